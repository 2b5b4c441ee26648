// What each pixel of a canvas shows of a picture whose lattice was painted: between texels a 256th
// apart, bilinear in 8 bits. Reference: tools::warp::Preview.

//#import lib/span
//#import lib/table
//#import lib/lattice

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: LatticeParams;
// Of each triangle its nodes, then their places in the picture: of the first, and from there.
@group(0) @binding(2) var triangles: texture_2d<u32>;
@group(0) @binding(3) var<storage, read> images: array<vec2f>;
@group(0) @binding(4) var<storage, read> owners: array<u32>;
// RGBA in a word, multiplied by alpha, with a border of one texel.
@group(0) @binding(5) var texels: texture_2d<u32>;
@group(0) @binding(6) var canvas: texture_storage_2d<rgba8unorm, write>;

// The area of a triangle, over the products it is the difference of, at which roundings may be all
// of it: tools::warp::gpu::lattice::THIN.
const THIN: f32 = 9.5367431640625e-7;

// Two channels of a texel in lanes of 16 bits; with others the other two.
const LANES: u32 = 0x00ff00ffu;

// The rounded mean of two texels in lanes, with the weight w, of 256, on the second.
fn between(a: vec2u, b: vec2u, w: u32) -> vec2u {
    return ((a * (256u - w) + b * w + vec2u(0x00800080u)) >> vec2u(8u)) & vec2u(LANES);
}

fn spread(x: u32, y: u32) -> vec2u {
    let t = textureLoad(texels, vec2u(x, y), 0).x;
    return vec2u(t & LANES, (t >> 8u) & LANES);
}

// Where pixel (x, y) lies in the picture, by the triangle it shows.
fn source(t: u32, x: f32, y: f32) -> vec2f {
    let q = corners(t);
    let head = texel_f32(triangles, 3u * t + 1u);
    let more = texel_f32(triangles, 3u * t + 2u);
    let e1 = q.b - q.a;
    let e2 = q.c - q.a;
    let d = vec2f(x, y) - q.a;
    let left = e1.x * e2.y;
    let right = e1.y * e2.x;
    let twice = left - right;
    var u = 1.0 / 3.0;
    var v = 1.0 / 3.0;
    if abs(twice) > THIN * (abs(left) + abs(right)) {
        u = clamp((d.x * e2.y - d.y * e2.x) / twice, 0.0, 1.0);
        v = clamp((e1.x * d.y - e1.y * d.x) / twice, 0.0, 1.0 - u);
    }
    return head.xy + u * head.zw + v * more.xy;
}

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let at = vec2u(id.x, span.first + id.y);
    if at.x >= span.row || at.y >= span.end {
        return;
    }
    let owner = owners[at.y * params.size.x + at.x];
    if owner == 0u {
        textureStore(canvas, at, vec4f());
        return;
    }
    let p = source(owner - 1u, f32(at.x), f32(at.y));
    // The centre of texel (0, 0) of the bordered picture is at (-1/2, -1/2).
    let fixed = vec2u(clamp(p + 0.5, vec2f(), params.picture + 1.0) * 256.0 + 0.5);
    let f = min(fixed, vec2u(params.picture) * 256u + 255u);
    let i = f >> vec2u(8u);
    let w = f & vec2u(255u);
    let top = between(spread(i.x, i.y), spread(i.x + 1u, i.y), w.x);
    let bottom = between(spread(i.x, i.y + 1u), spread(i.x + 1u, i.y + 1u), w.x);
    let m = between(top, bottom, w.y);
    var c = vec4f(f32(m.x & 255u), f32(m.y & 255u), f32(m.x >> 16u), f32(m.y >> 16u));
    if c.w > 0.0 && c.w < 255.0 {
        c = vec4f(min(floor(c.xyz * (255.0 / c.w) + 0.5), vec3f(255.0)), c.w);
    }
    textureStore(canvas, at, c / 255.0);
}
