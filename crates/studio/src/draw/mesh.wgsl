// A shape, lit from where the eye is, with a picture, colours of vertices, a checker or grey.

struct Frame {
    matrix: mat4x4f,
    // Towards the light; w pulls lines towards the eye.
    light: vec4f,
    // x: what is shown (0 grey, 1 picture, 2 colours, 3 checker); y: whether a second picture is laid over it.
    kind: vec4u,
    // Of lines.
    color: vec4f,
}

@group(0) @binding(0) var<uniform> frame: Frame;
@group(1) @binding(0) var picture: texture_2d<f32>;
@group(1) @binding(1) var sampling: sampler;
@group(1) @binding(2) var over: texture_2d<f32>;

struct Corner {
    @location(0) position: vec3f,
    @location(1) normal: vec3f,
    @location(2) uv: vec2f,
    @location(3) color: vec4f,
}

struct Shown {
    @builtin(position) clip: vec4f,
    @location(0) normal: vec3f,
    @location(1) uv: vec2f,
    @location(2) color: vec4f,
}

@vertex
fn corner(c: Corner) -> Shown {
    return Shown(frame.matrix * vec4f(c.position, 1.0), c.normal, c.uv, c.color);
}

const GREY = vec3f(0.62, 0.62, 0.64);

@fragment
fn surface(s: Shown) -> @location(0) vec4f {
    // Sampled in every case: a derivative needs all pixels of a square.
    let texel = textureSample(picture, sampling, s.uv);
    let laid = textureSample(over, sampling, s.uv);
    var base = GREY;
    if frame.kind.x == 1u {
        base = mix(GREY, texel.rgb, texel.a);
    } else if frame.kind.x == 2u {
        base = s.color.rgb;
    } else if frame.kind.x == 3u {
        let cell = vec2i(floor(s.uv * 32.0));
        base = select(vec3f(0.45, 0.5, 0.55), vec3f(0.8, 0.82, 0.84), ((cell.x + cell.y) & 1) == 0);
    }
    if frame.kind.y == 1u {
        base = mix(base, laid.rgb, laid.a);
    }
    // Faces are lit from both sides.
    let facing = abs(dot(normalize(s.normal), frame.light.xyz));
    return vec4f(base * (0.4 + 0.6 * facing), 1.0);
}

@vertex
fn line(c: Corner) -> @builtin(position) vec4f {
    var clip = frame.matrix * vec4f(c.position, 1.0);
    clip.z -= frame.light.w * clip.w;
    return clip;
}

@fragment
fn ink() -> @location(0) vec4f {
    return frame.color;
}
