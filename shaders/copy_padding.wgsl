// Copies to each texel of the padding the colour of its nearest covered one, and marks it.
// Reference: tools::transfer::layer::copy_padding.

//#import lib/span
//#import lib/none

// Twin: tools::transfer::gpu::copy_padding::CopyParams.
struct CopyParams {
    width: u32,
    // Texels of a row of `nearest`, and the row that it begins with.
    stride: u32,
    first: u32,
    // Words of a texel of the picture.
    words: u32,
}

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: CopyParams;
// Indices of the nearest covered texels.
@group(0) @binding(2) var<storage, read> nearest: array<u32>;
// Four texels to a word; rows begin with a word of their own.
@group(0) @binding(3) var<storage, read_write> covers: array<u32>;
@group(0) @binding(4) var<storage, read_write> picture: array<u32>;

// tally::HOLE, and the value of coverage.
const HOLE: u32 = 1u;
const PADDING: u32 = 64u;

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let words = (params.width + 3u) / 4u;
    if id.x >= words {
        return;
    }
    let y = span.first + id.y;
    let place = y * words + id.x;
    var cover = covers[place];
    let most = min(4u, params.width - 4u * id.x);
    // Where all four are covered there is nothing to do.
    let free = (cover & 0x80808080u) != 0x80808080u;
    for (var j = select(4u, 0u, free); j < most; j++) {
        let x = 4u * id.x + j;
        let here = y * params.width + x;
        let source = nearest[(y - params.first) * params.stride + x];
        let own = (cover >> (8u * j)) & 255u;
        if source != NONE && source != here && own != HOLE {
            for (var k = 0u; k < params.words; k++) {
                picture[here * params.words + k] = picture[source * params.words + k];
            }
            cover |= PADDING << (8u * j);
        }
    }
    covers[place] = cover;
}
