// Triangles of a lattice over a canvas. See tools::warp::gpu::lattice.
//
// The kernel that imports this declares `triangles`, `images` and `params`.

struct LatticeParams {
    // Where the origin of the images lies on the canvas, and pixels in one of their units.
    origin: vec2f,
    pixels: f32,
    // Triangles.
    count: u32,
    // Columns and rows of the canvas.
    size: vec2u,
    // Columns and rows of the picture.
    picture: vec2f,
}

// A coordinate of an image this large, in pixels, is taken for none:
// tools::warp::gpu::lattice::FAR.
const FAR: f32 = 16777216.0;

// Corners of a triangle on the canvas, from the centre of pixel (0, 0).
struct Corners {
    a: vec2f,
    b: vec2f,
    c: vec2f,
}

fn corners(t: u32) -> Corners {
    let nodes = texel(triangles, 3u * t).xyz;
    let shift = params.origin - vec2f(0.5);
    return Corners(
        images[nodes.x] * params.pixels + shift,
        images[nodes.y] * params.pixels + shift,
        images[nodes.z] * params.pixels + shift,
    );
}

// By bits, which order magnitudes; what is not a number is beyond all.
fn is_near(v: f32) -> bool {
    return (bitcast<u32>(v) & 0x7fffffffu) < bitcast<u32>(FAR);
}

// First and last column and row of the pixels that a triangle can have; no pixel for images that
// are no numbers.
struct Box {
    low: vec2u,
    high: vec2u,
    any: bool,
}

fn box(q: Corners) -> Box {
    let known = is_near(q.a.x) && is_near(q.a.y) && is_near(q.b.x) && is_near(q.b.y) && is_near(q.c.x)
        && is_near(q.c.y);
    let low = ceil(min(min(q.a, q.b), q.c));
    let high = floor(max(max(q.a, q.b), q.c));
    let last = vec2f(params.size) - 1.0;
    let any = known && all(low <= high) && all(low <= last) && all(high >= vec2f());
    if !any {
        return Box(vec2u(), vec2u(), false);
    }
    return Box(vec2u(max(low, vec2f())), vec2u(min(high, last)), true);
}

// Where an edge crosses row y: x from and to, empty where it does not. An edge gives the same
// numbers to both of its triangles, so that no pixel is lost between them.
fn crossing(s: vec2f, t: vec2f, y: f32) -> vec2f {
    let down = s.y < t.y || (s.y == t.y && s.x <= t.x);
    let a = select(t, s, down);
    let b = select(s, t, down);
    if y < a.y || y > b.y {
        return vec2f(FAR, -FAR);
    }
    let rise = b.y - a.y;
    if rise == 0.0 {
        return vec2f(a.x, b.x);
    }
    let x = a.x + (b.x - a.x) * ((y - a.y) / rise);
    let inside = clamp(x, min(a.x, b.x), max(a.x, b.x));
    return vec2f(inside, inside);
}

// First and last column of the pixels of row y within a triangle.
fn chord(q: Corners, y: f32) -> vec2f {
    let ab = crossing(q.a, q.b, y);
    let bc = crossing(q.b, q.c, y);
    let ca = crossing(q.c, q.a, y);
    return vec2f(ceil(min(min(ab.x, bc.x), ca.x)), floor(max(max(ab.y, bc.y), ca.y)));
}
