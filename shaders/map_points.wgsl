// Points through one step of a composite map, and the derivative so far multiplied by that of the
// step. Reference: mapping::plane::Step.

//#import lib/span
//#import lib/table
//#import lib/corners
//#import lib/mean_value

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: PlaneParams;
@group(0) @binding(2) var<uniform> rings: array<vec4u, 1024>;
@group(0) @binding(3) var<uniform> corners0: array<vec4f, 1024>;
@group(0) @binding(4) var<uniform> corners1: array<vec4f, 1024>;
@group(0) @binding(5) var<uniform> corners2: array<vec4f, 1024>;
@group(0) @binding(6) var<uniform> corners3: array<vec4f, 1024>;
// Of each vertex its image, and the derivative along its bisector.
@group(0) @binding(7) var limits: texture_2d<u32>;
@group(0) @binding(8) var<storage, read> points: array<vec2f>;
@group(0) @binding(9) var<storage, read_write> images: array<vec2f>;
// Row by row.
@group(0) @binding(10) var<storage, read> derivatives: array<vec4f>;
@group(0) @binding(11) var<storage, read_write> products: array<vec4f>;

// Whether derivatives are wanted.
override DERIVATIVE: bool = true;

// Points an invocation works on: one for each component.
const ITEMS: u32 = 4u;

// a b, each row by row.
fn product(a: vec4f, b: vec4f) -> vec4f {
    return vec4f(a.x * b.xy + a.y * b.zw, a.z * b.xy + a.w * b.zw);
}

fn finish(i: u32, image: vec2f, derivative: vec4f, square: f32, nearest: u32) {
    if i >= span.end {
        return;
    }
    var q = image;
    var d = derivative;
    if square < AT_VERTEX {
        q = texel_f32(limits, 2u * nearest).xy;
        if DERIVATIVE {
            d = texel_f32(limits, 2u * nearest + 1u);
        }
    }
    images[i] = q;
    if DERIVATIVE {
        if params.chained != 0u {
            d = product(d, derivatives[i]);
        }
        products[i] = d;
    }
}

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let first = span.first + invocation(span, id) * ITEMS;
    if first >= span.end {
        return;
    }
    let last = span.end - 1u;
    let a = points[first];
    let b = points[min(first + 1u, last)];
    let c = points[min(first + 2u, last)];
    let d = points[min(first + 3u, last)];
    let px = vec4f(a.x, b.x, c.x, d.x);
    let py = vec4f(a.y, b.y, c.y, d.y);
    if !DERIVATIVE {
        let m = mean_value_map(px, py, params.loops, params.far);
        let x = px + m.x;
        let y = py + m.y;
        let none = vec4f();
        finish(first, vec2f(x.x, y.x), none, m.square.x, m.nearest.x);
        finish(first + 1u, vec2f(x.y, y.y), none, m.square.y, m.nearest.y);
        finish(first + 2u, vec2f(x.z, y.z), none, m.square.z, m.nearest.z);
        finish(first + 3u, vec2f(x.w, y.w), none, m.square.w, m.nearest.w);
        return;
    }
    let found = scan(px, py, params.loops);
    let sums = mean_value(found, px, py, params.loops, params.far);
    let x = px + sums.moved_x;
    let y = py + sums.moved_y;
    let xx = 1.0 + sums.xx;
    let yy = 1.0 + sums.yy;
    finish(first, vec2f(x.x, y.x), vec4f(xx.x, sums.xy.x, sums.yx.x, yy.x), found.square.x, found.nearest.x);
    finish(first + 1u, vec2f(x.y, y.y), vec4f(xx.y, sums.xy.y, sums.yx.y, yy.y), found.square.y, found.nearest.y);
    finish(first + 2u, vec2f(x.z, y.z), vec4f(xx.z, sums.xy.z, sums.yx.z, yy.z), found.square.z, found.nearest.z);
    finish(first + 3u, vec2f(x.w, y.w), vec4f(xx.w, sums.xy.w, sums.yx.w, yy.w), found.square.w, found.nearest.w);
}
