// Triangles of an atlas and their entries in bins. Reference: tools::transfer::atlas.

//#import lib/none
//#import lib/table

// Texels along a side of a bin; atlas::BIN.
const BIN: u32 = 8u;
// atlas::SUBTEXEL.
const SUBTEXEL: i32 = 256;

// atlas::BinEntry, two texels.
struct Entry {
    triangle: u32,
    face: u32,
    quotient: vec3i,
    remainder: vec3i,
    barycentric: vec2f,
}

fn bin_entry(entries: texture_2d<u32>, index: u32) -> Entry {
    let head = texel(entries, 2u * index);
    let rest = texel(entries, 2u * index + 1u);
    let remainder = vec3i((vec3u(rest.y) >> vec3u(0u, 8u, 16u)) & vec3u(255u));
    let quotient = vec3i(bitcast<vec2i>(head.zw), bitcast<i32>(rest.x));
    return Entry(head.x, head.y, quotient, remainder, bitcast<vec2f>(rest.zw));
}

// atlas::AtlasTriangle without its gradients, two of its three texels.
struct Corners {
    swapped: bool,
    c0: vec2i,
    c1: vec2i,
    c2: vec2i,
}

fn atlas_corners(triangles: texture_2d<u32>, index: u32) -> Corners {
    let head = texel(triangles, 3u * index);
    let rest = bitcast<vec4i>(texel(triangles, 3u * index + 1u));
    return Corners(head.y != 0u, bitcast<vec2i>(head.zw), rest.xy, rest.zw);
}

// Coefficients of x and y of the three edge functions; atlas::edge.
fn edges_x(t: Corners) -> vec3i {
    return vec3i(t.c1.y - t.c2.y, t.c2.y - t.c0.y, t.c0.y - t.c1.y);
}

fn edges_y(t: Corners) -> vec3i {
    return vec3i(t.c2.x - t.c1.x, t.c0.x - t.c2.x, t.c1.x - t.c0.x);
}

// Whether the triangle holds the centre of texel (i, j) of its bin; atlas::holds_centre.
fn holds_centre(e: Entry, t: Corners, i: i32, j: i32) -> bool {
    let a = edges_x(t);
    let b = edges_y(t);
    let included = (a < vec3i(0)) | ((a == vec3i(0)) & (b > vec3i(0)));
    let borrow = select(vec3i(0), vec3i(1), (e.remainder == vec3i(0)) & !included);
    return all(e.quotient - borrow + a * i + b * j >= vec3i(0));
}

// Whether the closed triangle meets the open square of texel (i, j); atlas::touches_square.
fn touches_square(e: Entry, t: Corners, i: i32, j: i32, centre: vec2i) -> bool {
    let a = edges_x(t);
    let b = edges_y(t);
    let reach = abs(a) + abs(b);
    let rest = e.remainder + (reach & vec3i(1)) * 128 - 1;
    let met = e.quotient + (reach >> vec3u(1u)) + (rest >> vec3u(8u)) + a * i + b * j >= vec3i(0);
    let low = min(min(t.c0, t.c1), t.c2) < centre + SUBTEXEL / 2;
    let high = max(max(t.c0, t.c1), t.c2) > centre - SUBTEXEL / 2;
    return all(met) && all(low) && all(high);
}

// A point of a triangle's boundary: barycentric coordinates in the order of `Corners`, squared
// distance in sub-texels.
struct Nearest {
    barycentric: vec3f,
    distance: f32,
}

fn before(p: vec2i, q: vec2i) -> bool {
    return p.x < q.x || (p.x == q.x && p.y < q.y);
}

// The point of one edge nearest to `centre`: the shares of its first and second corner, and the
// squared distance.
fn nearest_on_edge(first: vec2i, second: vec2i, centre: vec2i) -> vec3f {
    // The same edge gives the same distance in both of its triangles only if walked in one
    // direction.
    let turned = before(second, first);
    let start = select(first, second, turned);
    let end = select(second, first, turned);
    let p = vec2f(start - centre);
    let d = vec2f(end - start);
    let along = -(p.x * d.x + p.y * d.y);
    let length = d.x * d.x + d.y * d.y;
    // A triangle has three different corners: the length is not zero.
    let t = select(select(along / length, 1.0, along >= length), 0.0, along <= 0.0);
    let q = p + t * d;
    return vec3f(select(vec2f(1.0 - t, t), vec2f(t, 1.0 - t), turned), q.x * q.x + q.y * q.y);
}

// atlas::closest_on_boundary.
fn closest_on_boundary(t: Corners, centre: vec2i) -> Nearest {
    let e0 = nearest_on_edge(t.c1, t.c2, centre);
    let e1 = nearest_on_edge(t.c2, t.c0, centre);
    let e2 = nearest_on_edge(t.c0, t.c1, centre);
    var best = Nearest(vec3f(0.0, e0.x, e0.y), e0.z);
    if e1.z < best.distance {
        best = Nearest(vec3f(e1.y, 0.0, e1.x), e1.z);
    }
    if e2.z < best.distance {
        best = Nearest(vec3f(e2.x, e2.y, 0.0), e2.z);
    }
    if t.swapped {
        best.barycentric = best.barycentric.xzy;
    }
    return best;
}
