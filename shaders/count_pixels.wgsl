// What became of pixels, by runs: how many have a pre-image, how many of those that are to be
// coloured see nothing, and how many of these have no pre-image; 8 bits each, from the lowest on.
// Reference: tools::warp::gpu::pixels::count_pixels. span.place is the number of pixels.

//#import lib/span

// Twin: tools::warp::gpu::pixels::CountParams.
struct CountParams {
    // Where the counts are in the result.
    first: u32,
    unused0: u32,
    unused1: u32,
    unused2: u32,
}

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: CountParams;
@group(0) @binding(2) var<storage, read> shares: array<vec2f>;
@group(0) @binding(3) var<storage, read_write> result: array<u32>;

// tools::warp::gpu::pixels::RUN
const RUN: u32 = 64u;

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let item = span.first + invocation(span, id);
    if item >= span.end {
        return;
    }
    var sum = 0u;
    let end = min((item + 1u) * RUN, span.place);
    for (var i = item * RUN; i < end; i++) {
        let s = shares[i];
        let shown = s.y > 0.0;
        sum += select(0u, 1u, s.x >= 0.0);
        sum += select(0u, 1u << 8u, s.x <= 0.0 && shown);
        sum += select(0u, 1u << 16u, s.x < 0.0 && shown);
    }
    result[params.first + item] = sum;
}
