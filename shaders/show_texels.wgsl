// Rows of a picture of the result as a window shows them. Reference: none, it only converts.

//#import lib/span

// Twin: tools::transfer::gpu::shown::ShowParams.
struct ShowParams {
    // Texels of a row, and words and channels of a texel.
    width: u32,
    words: u32,
    channels: u32,
    // 0 of 8 bits, 1 of 16, 2 floats.
    depth: u32,
}

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: ShowParams;
@group(0) @binding(2) var<storage, read> picture: array<u32>;
@group(0) @binding(3) var canvas: texture_storage_2d<rgba8unorm, write>;

// Sample k of the texel that begins at word `at`.
fn sample_at(at: u32, k: u32) -> f32 {
    if params.depth == 0u {
        return f32((picture[at] >> (8u * k)) & 255u) / 255.0;
    }
    if params.depth == 1u {
        return f32((picture[at + k / 2u] >> (16u * (k % 2u))) & 65535u) / 65535.0;
    }
    return clamp(bitcast<f32>(picture[at + k]), 0.0, 1.0);
}

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let y = span.first + id.y;
    if id.x >= params.width || y >= span.end {
        return;
    }
    let at = (y * params.width + id.x) * params.words;
    let first = sample_at(at, 0u);
    var color = vec4f(first, first, first, 1.0);
    if params.channels > 2u {
        color.y = sample_at(at, 1u);
        color.z = sample_at(at, 2u);
    }
    if params.channels % 2u == 0u {
        color.w = sample_at(at, params.channels - 1u);
    }
    textureStore(canvas, vec2u(id.x, y), color);
}
