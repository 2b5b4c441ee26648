// The colour of a texel, averaged over its footprint on the source's texture. Reference and
// explanation: tools::transfer::sample::sample_texture. Texels are loaded and weighed here:
// hardware filters have eight bits of fraction.

//#import lib/span
//#import lib/shown
//#import lib/decoded
//#import lib/footprint
//#import lib/lanczos
//#import lib/ellipse

// Twin: tools::transfer::gpu::sample_texture::TextureParams.
struct TextureParams {
    width: u32,
    height: u32,
    // Levels above the picture itself.
    levels: u32,
    channels: u32,
    filtering: u32,
    taps: u32,
    // 1 if colours are weighted by the last of 2 or 4 channels.
    opacity: u32,
    // Value of a sample of 1.
    scale: f32,
    // What the picture shows beyond its borders.
    wrap_u: u32,
    wrap_v: u32,
    // The number of the picture among those of its layer.
    texture: u32,
    unused: u32,
}

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: TextureParams;
// Centre and dx; dy, the triangle of the source, nothing.
@group(0) @binding(2) var<storage, read> footprints: array<vec4u>;
@group(0) @binding(3) var<storage, read_write> colors: array<vec4f>;
// The picture as stored, its levels as decoded floats, the light of samples.
@group(0) @binding(4) var base: texture_2d<u32>;
@group(0) @binding(5) var levels: texture_2d<u32>;
@group(0) @binding(6) var light: texture_2d<u32>;
// The picture of each triangle of the source, four to a texel.
@group(0) @binding(7) var textures: texture_2d<u32>;

// How texels are weighed: 0 boxes of the chain, 1 the nearest, 2 and 3 windowed sincs of three and
// four lobes, 4 ellipses. Reference of the latter: tools::transfer::windowed.
override WEIGHTS: u32 = 0u;

fn base_texel(at: vec2i) -> vec4f {
    return decoded(light, textureLoad(base, at, 0), params.channels, params.opacity, params.scale);
}

fn level_texel(at: vec2i, level: u32) -> vec4f {
    return bitcast<vec4f>(textureLoad(levels, at, level - 1u));
}

fn mixed(t00: vec4f, t01: vec4f, t10: vec4f, t11: vec4f, w: vec2f) -> vec4f {
    let top = t00 + w.x * (t01 - t00);
    let bottom = t10 + w.x * (t11 - t10);
    return top + w.y * (bottom - top);
}

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let index = span.first + invocation(span, id);
    if index >= span.end {
        return;
    }
    let head = footprints[2u * index];
    let rest = footprints[2u * index + 1u];
    let shown = shows_picture(textures, rest.z, params.texture);
    if shown {
        colors[index] = sampled(bitcast<vec4f>(head), bitcast<vec2f>(rest.xy));
    }
}

// The colour of the footprint with this centre and dx, and this dy.
fn sampled(head: vec4f, dy: vec2f) -> vec4f {
    let size = vec2i(i32(params.width), i32(params.height));
    let mode = vec2u(params.wrap_u, params.wrap_v);
    let centre = near_picture(head.xy, mode);
    if WEIGHTS == 1u {
        return base_texel(wrap(vec2i(floor(centre * vec2f(size))), size, mode));
    }
    if WEIGHTS == 2u {
        return windowed_6(centre * vec2f(size), size, mode);
    }
    if WEIGHTS == 3u {
        return windowed_8(centre * vec2f(size), size, mode);
    }
    if WEIGHTS == 4u {
        return elliptical(centre * vec2f(size), head.zw * vec2f(size), dy * vec2f(size), size, mode);
    }
    let taps = footprint_taps(centre, head.zw, dy, vec2f(size), params.filtering, f32(params.taps));
    let level = min(taps.level, f32(params.levels));
    let lower = u32(level);
    var fraction = level - f32(lower);
    // Half of the reads are saved where they would not show.
    fraction = select(0.0, fraction, fraction > SLACK);
    let count = taps.along * taps.across;
    var sum = vec4f();
    let passes = select(1u, 2u, fraction > 0.0);
    for (var pass_ = 0u; pass_ < passes; pass_++) {
        let l = lower + pass_;
        var part = vec4f();
        let of_base = select(count, 0u, l > 0u);
        for (var k = 0u; k < of_base; k++) {
            let p = tap_place(taps, k % taps.along, k / taps.along) - 0.5;
            let f = floor(p);
            let low = wrap(vec2i(f), size, mode);
            let high = wrap(vec2i(f) + 1, size, mode);
            part += mixed(
                base_texel(low),
                base_texel(vec2i(high.x, low.y)),
                base_texel(vec2i(low.x, high.y)),
                base_texel(high),
                p - f,
            );
        }
        let of_level = count - of_base;
        for (var k = 0u; k < of_level; k++) {
            let sides = max(size >> vec2u(l), vec2i(1));
            let p = tap_place(taps, k % taps.along, k / taps.along) * (vec2f(sides) / vec2f(size)) - 0.5;
            let f = floor(p);
            let low = wrap(vec2i(f), sides, mode);
            let high = wrap(vec2i(f) + 1, sides, mode);
            part += mixed(
                level_texel(low, l),
                level_texel(vec2i(high.x, low.y), l),
                level_texel(vec2i(low.x, high.y), l),
                level_texel(high, l),
                p - f,
            );
        }
        sum += select(1.0 - fraction, fraction, pass_ == 1u) * part;
    }
    return sum / f32(count);
}

// Texels `first` to six further on of a row, weighed.
fn row_6(first: vec2i, w: Weights, size: vec2i, mode: vec2u) -> vec4f {
    let at = vec2i(1, 0);
    return w.before.x * base_texel(wrap(first, size, mode))
        + w.before.y * base_texel(wrap(first + at, size, mode))
        + w.before.z * base_texel(wrap(first + 2 * at, size, mode))
        + w.after.x * base_texel(wrap(first + 3 * at, size, mode))
        + w.after.y * base_texel(wrap(first + 4 * at, size, mode))
        + w.after.z * base_texel(wrap(first + 5 * at, size, mode));
}

// The weighted mean of 6 x 6 texels about a point in texels.
fn windowed_6(p: vec2f, size: vec2i, mode: vec2u) -> vec4f {
    let low = floor(p - 0.5);
    let f = p - 0.5 - low;
    let x = lanczos_weights_6(f.x);
    let y = lanczos_weights_6(f.y);
    var down = array<f32, 6>(y.before.x, y.before.y, y.before.z, y.after.x, y.after.y, y.after.z);
    var sum = vec4f();
    for (var j = 0; j < 6; j++) {
        sum += down[j] * row_6(vec2i(low) + vec2i(-2, j - 2), x, size, mode);
    }
    return sum;
}

// Of 8 x 8.
fn windowed_8(p: vec2f, size: vec2i, mode: vec2u) -> vec4f {
    let low = floor(p - 0.5);
    let f = p - 0.5 - low;
    var across = lanczos_weights_8(f.x);
    var down = lanczos_weights_8(f.y);
    var sum = vec4f();
    for (var j = 0; j < 8; j++) {
        var row = vec4f();
        for (var i = 0; i < 8; i++) {
            row += across[i] * base_texel(wrap(vec2i(low) + vec2i(i - 3, j - 3), size, mode));
        }
        sum += down[j] * row;
    }
    return sum;
}

// The mean over the ellipse in the footprint; interpolated where that is no larger than a texel.
fn elliptical(p: vec2f, dx: vec2f, dy: vec2f, size: vec2i, mode: vec2u) -> vec4f {
    let e = ellipse(dx, dy, params.levels + 1u, f32(1u << min(params.levels + 1u, 31u)));
    var color = vec4f();
    if e.share < 1.0 {
        color = (1.0 - e.share) * windowed_6(p, size, mode);
    }
    if e.share > 0.0 {
        color += e.share * average(p, e, size, mode);
    }
    return color;
}

// The mean over an ellipse about a point. Rows and texels are bounded by its reach: no more than
// 150 of each.
fn average(p: vec2f, e: Ellipse, size: vec2i, mode: vec2u) -> vec4f {
    let sides = max(size >> vec2u(e.level), vec2i(1));
    let ratio = vec2f(sides) / vec2f(size);
    let stretch = select(ratio * f32(1u << e.level), vec2f(1.0), sides == vec2i(1));
    let q = p * ratio - 0.5;
    let a = e.form.x / (stretch.x * stretch.x);
    let b = e.form.y / (stretch.x * stretch.y);
    let c = e.form.z / (stretch.y * stretch.y);
    let reach = e.reach.y * stretch.y;
    let inverse = 0.5 / a;
    let determinant = b * b - 4.0 * a * c;
    var sum = vec4f();
    var weights = 0.0;
    let last = i32(floor(q.y + reach));
    for (var j = i32(floor(q.y - reach)); j <= last; j++) {
        let y = f32(j) - q.y;
        let discriminant = determinant * y * y + 4.0 * a;
        if discriminant > 0.0 {
            let middle = q.x - b * y * inverse;
            let half = sqrt(discriminant) * inverse;
            let end = i32(floor(middle + half));
            for (var i = i32(floor(middle - half)); i <= end; i++) {
                let x = f32(i) - q.x;
                let rest = max(1.0 - (a * x + b * y) * x - c * y * y, 0.0);
                let weight = rest * rest * rest;
                let at = wrap(vec2i(i, j), sides, mode);
                if e.level == 0u {
                    sum += weight * base_texel(at);
                } else {
                    sum += weight * level_texel(at, e.level);
                }
                weights += weight;
            }
        }
    }
    return sum / weights;
}
