// A picture of nothing but background.

//#import lib/span

// Twin: tools::transfer::gpu::store_texel::BackgroundParams.
struct BackgroundParams {
    // The words of a texel.
    background: vec4u,
    words: u32,
    unused0: u32,
    unused1: u32,
    unused2: u32,
}

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: BackgroundParams;
@group(0) @binding(2) var<storage, read_write> picture: array<u32>;

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let index = span.first + invocation(span, id);
    if index >= span.end {
        return;
    }
    for (var k = 0u; k < params.words; k++) {
        picture[index * params.words + k] = params.background[k];
    }
}
