// A picture that is on the device as it is stored, with its halvings. Reference:
// tools::warp::pyramid::Pyramid.

//#import lib/decoded

// tools::warp::gpu::picture::MOST_LEVELS
const MOST_HALVINGS: u32 = 32u;

// Twin: tools::warp::gpu::picture::HalvingParams.
struct HalvingParams {
    // Sides of the picture.
    width: u32,
    height: u32,
    // Levels, the picture included.
    levels: u32,
    channels: u32,
    // 1 if colours are weighted by the last of 2 or 4 channels.
    opacity: u32,
    // Value of a sample of 1.
    scale: f32,
    // 2 ^ levels
    most: f32,
    unused: u32,
    // Of each level where its first texel is in the buffer, and its sides.
    places: array<vec4u, MOST_HALVINGS>,
}

// Texel of level 0, which is continued by its border.
fn stored_texel(base: texture_2d<u32>, light: texture_2d<u32>, p: HalvingParams, at: vec2i) -> vec4f {
    let inside = clamp(at, vec2i(0), vec2i(i32(p.width), i32(p.height)) - 1);
    return decoded(light, textureLoad(base, inside, 0), p.channels, p.opacity, p.scale);
}
