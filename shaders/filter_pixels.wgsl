// The colours of pixels of the result, by a filter from a picture that is on the device with its
// halvings. The reference and all explanations stand at tools::warp::gather, interpolate and ewa.
// One invocation a pixel; `warp_image` is the same for pictures that come in windows.

//#import lib/span
//#import lib/halvings
//#import lib/ellipse
//#import lib/lanczos
//#import lib/place

// 0 bilinear, 1 Lanczos-3, 2 elliptical weighted averages.
override FILTER: u32 = 2u;

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: HalvingParams;
@group(0) @binding(2) var<storage, read> places: array<PlaceRecord>;
@group(0) @binding(3) var<storage, read> shares: array<vec2f>;
@group(0) @binding(4) var<storage, read> halvings: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> colors: array<vec4f>;
@group(0) @binding(6) var base: texture_2d<u32>;
@group(0) @binding(7) var light: texture_2d<u32>;

fn pixel_of(x: i32, y: i32) -> vec4f {
    return stored_texel(base, light, params, vec2i(x, y));
}

fn bilinear(whole: vec2i, part: vec2f) -> vec4f {
    let q = part - 0.5;
    let low = floor(q);
    let f = q - low;
    let at = whole + vec2i(low);
    let a = pixel_of(at.x, at.y);
    let b = pixel_of(at.x + 1, at.y);
    let c = pixel_of(at.x, at.y + 1);
    let d = pixel_of(at.x + 1, at.y + 1);
    let top = a + f.x * (b - a);
    let bottom = c + f.x * (d - c);
    return top + f.y * (bottom - top);
}

fn lanczos_row(x: i32, y: i32, w: Weights) -> vec4f {
    return pixel_of(x, y) * w.before.x + pixel_of(x + 1, y) * w.before.y + pixel_of(x + 2, y) * w.before.z
        + pixel_of(x + 3, y) * w.after.x + pixel_of(x + 4, y) * w.after.y + pixel_of(x + 5, y) * w.after.z;
}

fn lanczos(whole: vec2i, part: vec2f) -> vec4f {
    let q = part - 0.5;
    let low = floor(q);
    let f = q - low;
    let x = lanczos_weights_6(f.x);
    let y = lanczos_weights_6(f.y);
    var down = array<f32, 6>(y.before.x, y.before.y, y.before.z, y.after.x, y.after.y, y.after.z);
    let at = whole + vec2i(low) - 2;
    var sum = vec4f();
    for (var j = 0; j < 6; j++) {
        sum += down[j] * lanczos_row(at.x, at.y + j, x);
    }
    return sum;
}

// The mean over an ellipse. Rows and texels are bounded by its reach: no more than 150 of each.
fn average(whole: vec2i, part: vec2f, e: Ellipse) -> vec4f {
    let a = e.form.x;
    let b = e.form.y;
    let c = e.form.z;
    let place = params.places[e.level];
    let coarse = whole >> vec2u(e.level);
    let scale = 1.0 / f32(1u << e.level);
    let q = (vec2f(whole - (coarse << vec2u(e.level))) + part) * scale - 0.5;
    let first = i32(floor(q.y - e.reach.y));
    let last = i32(floor(q.y + e.reach.y));
    let inverse = 0.5 / a;
    let determinant = b * b - 4.0 * a * c;
    let most = vec2i(place.yz) - 1;
    var sum = vec4f(0.0);
    var weights = 0.0;
    for (var j = first; j <= last; j++) {
        let dy = f32(j) - q.y;
        let discriminant = determinant * dy * dy + 4.0 * a;
        if discriminant > 0.0 {
            let middle = q.x - b * dy * inverse;
            let half = sqrt(discriminant) * inverse;
            let to = i32(floor(middle + half));
            let y = clamp(coarse.y + j, 0, most.y);
            for (var i = i32(floor(middle - half)); i <= to; i++) {
                let dx = f32(i) - q.x;
                let rest = max(1.0 - (a * dx + b * dy) * dx - c * dy * dy, 0.0);
                let weight = rest * rest * rest;
                let x = clamp(coarse.x + i, 0, most.x);
                if e.level == 0u {
                    sum += weight * pixel_of(x, y);
                } else {
                    sum += weight * halvings[place.x + u32(y) * place.y + u32(x)];
                }
                weights += weight;
            }
        }
    }
    return sum / weights;
}

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let item = span.first + invocation(span, id);
    if item >= span.end {
        return;
    }
    if shares[item].x <= 0.0 {
        return;
    }
    let p = places[item];
    if FILTER == 0u {
        colors[item] = bilinear(p.whole, p.part);
        return;
    }
    if FILTER == 1u {
        colors[item] = lanczos(p.whole, p.part);
        return;
    }
    let e = ellipse(p.dx, p.dy, params.levels, params.most);
    var color = vec4f(0.0);
    if e.share < 1.0 {
        color = (1.0 - e.share) * lanczos(p.whole, p.part);
    }
    if e.share > 0.0 {
        color += e.share * average(p.whole, p.part, e);
    }
    colors[item] = color;
}
