// The colours of output pixels, gathered from windows of a picture's pyramid at their pre-images.
// The CPU reference and all explanations stand at tools::warp::gather, interpolate and ewa.
// One invocation a pixel.

//#import lib/span
//#import lib/ellipse
//#import lib/lanczos

// 0 bilinear, 1 Lanczos-3, 2 elliptical weighted averages.
override FILTER: u32 = 2u;

const MOST_LEVELS: u32 = 32u;
// tools::warp::footprint
const FARTHEST: f32 = 4194304.0;

struct WarpParams {
    // Levels of the pyramid.
    levels: u32,
    // 2 ^ levels
    most: f32,
    unused_0: u32,
    unused_1: u32,
    windows: array<WindowPlace, MOST_LEVELS>,
}

// Where the window of a level is: its first texel in the level, its place in the buffer and the
// length of its rows.
struct WindowPlace {
    origin: vec2i,
    start: u32,
    stride: u32,
}

struct Preimage {
    at: vec2f,
    dx: vec2f,
    dy: vec2f,
    cover: f32,
    block: u32,
}

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: WarpParams;
@group(0) @binding(2) var<storage, read> preimages: array<Preimage>;
@group(0) @binding(3) var<storage, read> bases: array<vec2i>;
@group(0) @binding(4) var<storage, read> texels: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> colors: array<vec4f>;

// Where a point of a level, counted from the base, lies in the window of the level.
fn in_window(level: u32, at: vec2f, base: vec2i) -> vec2f {
    let coarse = base >> vec2u(level);
    let scale = 1.0 / f32(1u << level);
    let rest = vec2f(base - (coarse << vec2u(level))) * scale;
    return at * scale + (rest + vec2f(coarse - params.windows[level].origin));
}

fn bilinear(p: vec2f) -> vec4f {
    let q = p - vec2f(0.5);
    let i = vec2u(q);
    let f = q - vec2f(i);
    let w = params.windows[0];
    let at = w.start + i.y * w.stride + i.x;
    let a = texels[at];
    let b = texels[at + 1u];
    let c = texels[at + w.stride];
    let d = texels[at + w.stride + 1u];
    let top = a + f.x * (b - a);
    let bottom = c + f.x * (d - c);
    return top + f.y * (bottom - top);
}

fn lanczos_row(at: u32, w: Weights) -> vec4f {
    return texels[at] * w.before.x + texels[at + 1u] * w.before.y + texels[at + 2u] * w.before.z
        + texels[at + 3u] * w.after.x + texels[at + 4u] * w.after.y + texels[at + 5u] * w.after.z;
}

fn lanczos(p: vec2f) -> vec4f {
    let q = p - vec2f(0.5);
    let i = vec2u(q);
    let f = q - vec2f(i);
    let x = lanczos_weights_6(f.x);
    let y = lanczos_weights_6(f.y);
    let w = params.windows[0];
    let at = w.start + (i.y - 2u) * w.stride + i.x - 2u;
    return lanczos_row(at, x) * y.before.x + lanczos_row(at + w.stride, x) * y.before.y
        + lanczos_row(at + 2u * w.stride, x) * y.before.z + lanczos_row(at + 3u * w.stride, x) * y.after.x
        + lanczos_row(at + 4u * w.stride, x) * y.after.y + lanczos_row(at + 5u * w.stride, x) * y.after.z;
}

// The mean over an ellipse. Rows and texels are bounded by its reach: no more than 150 of each.
fn average(p: vec2f, e: Ellipse) -> vec4f {
    let a = e.form.x;
    let b = e.form.y;
    let c = e.form.z;
    let w = params.windows[e.level];
    let q = p - vec2f(0.5);
    let first = u32(max(q.y - e.reach.y, 0.0));
    let last = u32(q.y + e.reach.y);
    let inverse = 0.5 / a;
    let determinant = b * b - 4.0 * a * c;
    var sum = vec4f(0.0);
    var weights = 0.0;
    for (var j = first; j <= last; j++) {
        let dy = f32(j) - q.y;
        let discriminant = determinant * dy * dy + 4.0 * a;
        if discriminant > 0.0 {
            let middle = q.x - b * dy * inverse;
            let half = sqrt(discriminant) * inverse;
            let to = u32(middle + half);
            for (var i = u32(max(middle - half, 0.0)); i <= to; i++) {
                let dx = f32(i) - q.x;
                let rest = max(1.0 - (a * dx + b * dy) * dx - c * dy * dy, 0.0);
                let weight = rest * rest * rest;
                sum += weight * texels[w.start + j * w.stride + i];
                weights += weight;
            }
        }
    }
    return sum / weights;
}

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let item = span.first + invocation(span, id);
    if item >= span.end {
        return;
    }
    let p = preimages[item];
    if p.cover <= 0.0 {
        return;
    }
    let base = bases[p.block];
    let at = clamp(p.at, vec2f(-FARTHEST), vec2f(FARTHEST));
    if FILTER == 0u {
        colors[item] = bilinear(in_window(0u, at, base));
        return;
    }
    if FILTER == 1u {
        colors[item] = lanczos(in_window(0u, at, base));
        return;
    }
    let e = ellipse(p.dx, p.dy, params.levels, params.most);
    var color = vec4f(0.0);
    if e.share < 1.0 {
        color = (1.0 - e.share) * lanczos(in_window(0u, at, base));
    }
    if e.share > 0.0 {
        color += e.share * average(in_window(e.level, at, base), e);
    }
    colors[item] = color;
}
