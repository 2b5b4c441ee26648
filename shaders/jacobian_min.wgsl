// The smallest Jacobian of a step over a few neighbouring pixels of the raster of its polygon. Each
// invocation takes the minimum of one piece, in pixel order; the host takes the minimum of the
// pieces. Reference: mapping::plane::jacobian_min.

//#import lib/span
//#import lib/corners
//#import lib/mean_value

struct PieceMinimum {
    value: f32,
    // Which pixel of the piece.
    pixel: u32,
}

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: PlaneParams;
@group(0) @binding(2) var<uniform> rings: array<vec4u, 1024>;
@group(0) @binding(3) var<uniform> corners0: array<vec4f, 1024>;
@group(0) @binding(4) var<uniform> corners1: array<vec4f, 1024>;
@group(0) @binding(5) var<uniform> corners2: array<vec4f, 1024>;
@group(0) @binding(6) var<uniform> corners3: array<vec4f, 1024>;
// Column of the first pixel (14 bits), row (14), number of pixels less one (4); samples::Run.
@group(0) @binding(7) var<storage, read> pieces: array<u32>;
@group(0) @binding(8) var<storage, read_write> minima: array<PieceMinimum>;

// Larger than any Jacobian that is looked for.
const HUGE: f32 = 3e38;

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let index = span.first + invocation(span, id);
    if index >= span.end {
        return;
    }
    let piece = pieces[index];
    let column = piece & 0x3fffu;
    let row = (piece >> 14u) & 0x3fffu;
    let last = piece >> 28u;
    let py = vec4f(params.origin.y + (f32(row) + 0.5) * params.pixel);
    var best = PieceMinimum(HUGE, 0u);
    for (var k = 0u; k <= last; k += 4u) {
        let pixel = min(vec4u(k, k + 1u, k + 2u, k + 3u), vec4u(last));
        let px = params.origin.x + (vec4f(vec4u(column) + pixel) + 0.5) * params.pixel;
        let found = scan(px, py, params.loops);
        let sums = mean_value(found, px, py, params.loops, params.far);
        let jacobian = (1.0 + sums.xx) * (1.0 + sums.yy) - sums.xy * sums.yx;
        // What is not finite counts as a fold, and the host looks again; vertices are the host's.
        let finite = (bitcast<vec4u>(jacobian) & vec4u(0x7f800000u)) != vec4u(0x7f800000u);
        let judged = select(select(vec4f(-HUGE), jacobian, finite), vec4f(HUGE), found.square < vec4f(AT_VERTEX));
        if judged.x < best.value { best = PieceMinimum(judged.x, pixel.x); }
        if judged.y < best.value { best = PieceMinimum(judged.y, pixel.y); }
        if judged.z < best.value { best = PieceMinimum(judged.z, pixel.z); }
        if judged.w < best.value { best = PieceMinimum(judged.w, pixel.w); }
    }
    minima[index] = best;
}
