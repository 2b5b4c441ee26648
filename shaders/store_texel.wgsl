// Colours as samples of the result, and texels of the source at their own size as they are.
// Reference and explanation: tools::transfer::layer::store, tools::transfer::exact.

//#import lib/span
//#import lib/shown
//#import lib/encoded
//#import lib/wrap
//#import lib/runs

// Twin: tools::transfer::gpu::store_texel::StoreParams.
struct StoreParams {
    // The number of the picture among those of its layer.
    texture: u32,
    // Sides of the picture, and what it shows beyond its borders.
    width: u32,
    height: u32,
    wrap_u: u32,
    wrap_v: u32,
    // Channels of the picture and of the result.
    channels: u32,
    wide: u32,
    // 1 if colours are divided by alpha.
    opacity: u32,
    // 1 if texels at their own size are copied.
    exact: u32,
    // Words of a texel of the result.
    words: u32,
    // Texels of a row of the result.
    row: u32,
    unused: u32,
}

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: StoreParams;
// Of each texel of the dispatch: centre and dx; dy, triangle of the source, nothing; its colour.
@group(0) @binding(2) var<storage, read> footprints: array<vec4u>;
@group(0) @binding(3) var<storage, read> colors: array<vec4f>;
// The rows from span.place on.
@group(0) @binding(4) var<storage, read_write> picture: array<u32>;
@group(0) @binding(5) var<storage, read> runs: array<u32>;
// The picture of the source as stored, and that of each of its triangles, four to a texel.
@group(0) @binding(6) var base: texture_2d<u32>;
@group(0) @binding(7) var textures: texture_2d<u32>;
// Light from which on a sample is larger, four to a texel.
@group(0) @binding(8) var steps: texture_2d<u32>;

// exact::NEAR.
const NEAR: f32 = 0.00390625;
// exact::ALIKE.
const ALIKE: f32 = 0.015625;

// The samples of a colour, decoded and premultiplied, in the channels of the result.
fn encoded(color: vec4f) -> vec4u {
    let rgb = select(color.xyz, color.xxx, params.channels < 3u);
    let own = select(color.w, color.y, params.channels == 2u);
    let alpha = select(own, 1.0, params.channels % 2u == 1u);
    var scale = 1.0;
    if params.wide % 2u == 0u && params.opacity == 1u {
        scale = select(0.0, 1.0 / alpha, alpha > 0.0);
    }
    let c = rgb * scale;
    let r = sample_of_light(steps, c.x);
    if params.wide < 3u {
        return vec4u(r, sample_of(alpha), 0u, 0u);
    }
    return vec4u(r, sample_of_light(steps, c.y), sample_of_light(steps, c.z), sample_of(alpha));
}

// The samples of a stored texel in the channels of the result; sample::widen_samples.
fn widened(stored: vec4u) -> vec4u {
    let rgb = select(stored.xyz, stored.xxx, params.channels < 3u);
    let most = sample_of_one();
    let own = select(stored.w, stored.y, params.channels == 2u);
    let alpha = select(own, most, params.channels % 2u == 1u);
    return select(vec4u(rgb, alpha), vec4u(rgb.x, alpha, 0u, 0u), params.wide < 3u);
}

fn alike(v: vec2f, w: vec2f) -> bool {
    let off = abs(abs(v) - w);
    return off.x <= ALIKE && off.y <= ALIKE;
}

// Whether a footprint is a texel of the picture, and which.
struct Coinciding {
    at: vec2i,
    is: bool,
}

fn coinciding(head: vec4f, dy_uv: vec2f) -> Coinciding {
    let sides = vec2i(i32(params.width), i32(params.height));
    let size = vec2f(sides);
    let dx = head.zw * size;
    let dy = dy_uv * size;
    let right = vec2f(1.0, 0.0);
    let whole = (alike(dx, right) && alike(dy, right.yx)) || (alike(dx, right.yx) && alike(dy, right));
    let p = head.xy * size;
    let index = floor(p);
    let off = abs(p - index - 0.5);
    let centred = off.x <= NEAR && off.y <= NEAR;
    let i = vec2i(clamp(index, vec2f(-1e9), vec2f(1e9)));
    let mode = vec2u(params.wrap_u, params.wrap_v);
    let within = (mode != vec2u(CLAMP)) | ((i >= vec2i(0)) & (i < sides));
    return Coinciding(wrap(i, sides, mode), whole && centred && all(within));
}

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let number = invocation(span, id);
    let index = span.first + number;
    if index >= span.end {
        return;
    }
    let head = footprints[2u * number];
    let rest = footprints[2u * number + 1u];
    let shown = shows_picture(textures, rest.z, params.texture);
    if shown {
        var samples = encoded(colors[number]);
        if params.exact == 1u {
            let c = coinciding(bitcast<vec4f>(head), bitcast<vec2f>(rest.xy));
            if c.is {
                samples = widened(textureLoad(base, c.at, 0));
            }
        }
        let packed = packed_samples(samples, params.wide);
        let at = run_texel(runs[index >> RUN_BITS], index);
        let out = (at.y - span.place) * params.row + at.x;
        for (var k = 0u; k < params.words; k++) {
            picture[out * params.words + k] = packed[k];
        }
    }
}
