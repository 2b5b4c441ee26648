// The covered texels as bits, 32 rows of a column to a word, the lowest bit first. Reference:
// tools::transfer::pad::column_bits.

//#import lib/span

// Twin: tools::transfer::gpu::coverage_bits::CoverParams.
struct CoverParams {
    width: u32,
    height: u32,
    unused0: u32,
    unused1: u32,
}

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: CoverParams;
// Four texels to a word; rows begin with a word of their own.
@group(0) @binding(2) var<storage, read> covers: array<u32>;
// Word (y / 32) * width + x.
@group(0) @binding(3) var<storage, read_write> bits: array<u32>;

// Coverage from this value on is covered; pad::COVERED.
const COVERED: u32 = 128u;

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= params.width {
        return;
    }
    let row = span.first + id.y;
    let stride = (params.width + 3u) / 4u;
    var word = 0u;
    for (var k = 0u; k < 32u && 32u * row + k < params.height; k++) {
        let four = covers[(32u * row + k) * stride + id.x / 4u];
        let cover = (four >> (8u * (id.x % 4u))) & 255u;
        word |= select(0u, 1u, cover >= COVERED) << k;
    }
    bits[row * params.width + id.x] = word;
}
