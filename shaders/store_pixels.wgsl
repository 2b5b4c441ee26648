// Colours as samples of the result, mixed with what lies outside the target polygon. Reference and
// explanation: tools::warp::store. span.place is the row of the result that the first item is in.

//#import lib/span
//#import lib/halvings
//#import lib/encoded

// Twin: tools::warp::gpu::pixels::StorePixelsParams.
struct StorePixelsParams {
    // Pixels of a row of the result.
    row: u32,
    // Channels of the result: those of the picture, or alpha more.
    wide: u32,
    // Words of a pixel.
    words: u32,
    // 1 if what the polygon does not cover is the original picture.
    keeps: u32,
    // 1 if the last of 2 or 4 channels is opacity.
    opacity: u32,
    unused0: u32,
    unused1: u32,
    unused2: u32,
}

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: StorePixelsParams;
@group(0) @binding(2) var<uniform> picture: HalvingParams;
@group(0) @binding(3) var<storage, read> shares: array<vec2f>;
@group(0) @binding(4) var<storage, read> colors: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> result: array<u32>;
@group(0) @binding(6) var base: texture_2d<u32>;
@group(0) @binding(7) var light: texture_2d<u32>;
// Light from which on a sample is larger, four to a texel.
@group(0) @binding(8) var steps: texture_2d<u32>;

// The samples of a colour, which is divided by alpha; what the picture has no alpha for has
// `opacity`.
fn encoded(color: vec4f, opacity: f32) -> vec4u {
    let own = picture.channels % 2u == 0u;
    let last = select(color.w, color.y, picture.channels == 2u);
    let alpha = select(opacity, clamp(last, 0.0, 1.0), own);
    let straight = select(params.wide > picture.channels, params.opacity == 1u, own);
    var factor = 1.0;
    if straight {
        factor = select(0.0, 1.0 / alpha, alpha > 0.0);
    }
    let c = color * factor;
    let shown = sample_of(select(last, alpha, straight));
    let x = sample_of_light(steps, c.x);
    if picture.channels < 3u {
        return vec4u(x, shown, 0u, 0u);
    }
    return vec4u(x, sample_of_light(steps, c.y), sample_of_light(steps, c.z), shown);
}

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let item = span.first + invocation(span, id);
    if item >= span.end {
        return;
    }
    let at = vec2u(item % params.row, span.place + item / params.row);
    let share = max(shares[item].x, 0.0);
    let inside = at.x < picture.width && at.y < picture.height;
    var keep = 0.0;
    if params.keeps == 1u {
        keep = 1.0 - shares[item].y;
    }
    let stored = textureLoad(base, min(at, vec2u(picture.width, picture.height) - 1u), 0);
    var samples: vec4u;
    if keep >= 1.0 {
        samples = stored;
        if params.wide == 2u && picture.channels == 1u {
            samples.y = sample_of_one();
        }
        if params.wide == 4u && picture.channels == 3u {
            samples.w = sample_of_one();
        }
        samples = select(vec4u(0u), samples, inside);
    } else {
        var color = vec4f();
        if share > 0.0 {
            color = colors[item];
        }
        var opacity = 1.0;
        if share < 1.0 {
            color *= share;
            opacity = share;
            if keep > 0.0 && inside {
                color += keep * decoded(light, stored, picture.channels, picture.opacity, picture.scale);
                opacity += keep;
            }
        }
        samples = encoded(color, opacity);
    }
    let words = packed_samples(samples, params.wide);
    for (var k = 0u; k < params.words; k++) {
        result[item * params.words + k] = words[k];
    }
}
