// A picture of our own onto the window, texel by texel.

@group(0) @binding(0) var picture: texture_2d<f32>;
override linear: bool = false;

struct Shown {
    @builtin(position) clip: vec4f,
    @location(0) uv: vec2f,
}

@vertex
fn corner(@builtin(vertex_index) i: u32) -> Shown {
    let uv = vec2f(f32((i << 1u) & 2u), f32(i & 2u));
    return Shown(vec4f(uv * vec2f(2.0, -2.0) + vec2f(-1.0, 1.0), 0.0, 1.0), uv);
}

@fragment
fn texel(s: Shown) -> @location(0) vec4f {
    let size = vec2i(textureDimensions(picture));
    let at = clamp(vec2i(s.uv * vec2f(size)), vec2i(0), size - 1);
    let c = textureLoad(picture, at, 0);
    if linear {
        // The target stores light: undo the curve that it will apply.
        let low = c.rgb / 12.92;
        let high = pow((c.rgb + 0.055) / 1.055, vec3f(2.4));
        return vec4f(select(high, low, c.rgb <= vec3f(0.04045)), 1.0);
    }
    return vec4f(c.rgb, 1.0);
}
