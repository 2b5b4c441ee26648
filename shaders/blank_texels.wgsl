// Texels that show nothing get the background, whatever they held: of a picture that is coloured
// anew in parts. Reference: none, it only writes.

//#import lib/span

// Twin: tools::transfer::gpu::shown::BlankParams.
struct BlankParams {
    // The words of a texel.
    background: vec4u,
    words: u32,
    // Texels of a row.
    width: u32,
    unused0: u32,
    unused1: u32,
}

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: BlankParams;
// Four texels to a word; rows begin with a word of their own.
@group(0) @binding(2) var<storage, read> covers: array<u32>;
@group(0) @binding(3) var<storage, read_write> picture: array<u32>;

// Coverage from this value on is covered; pad::COVERED.
const COVERED: u32 = 128u;

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let y = span.first + id.y;
    if id.x >= params.width || y >= span.end {
        return;
    }
    let four = covers[y * ((params.width + 3u) / 4u) + id.x / 4u];
    if ((four >> (8u * (id.x % 4u))) & 255u) >= COVERED {
        return;
    }
    let at = (y * params.width + id.x) * params.words;
    for (var k = 0u; k < params.words; k++) {
        picture[at + k] = params.background[k];
    }
}
