// Inverse problem on the target fused with the weighted averages, one pass over the anchors (paper, section 3.4 and
// eq. 13). Reference and explanation: surface::average::fused; what differs is said below.
//
// The anchor that is eliminated is the nearest one in R^8, found by a first, short pass, so that the sums are those of
// K = p - p_k from the start and nothing has to be held back. The answer does not depend on which of the near
// anchors is eliminated; only its digits would, with one that is far.

//#import lib/span
//#import lib/frame

struct AverageParams {
    // Anchors in the block.
    anchors: u32,
    // Whether `transport` is added.
    transported: u32,
    // Squared length that keeps the sums in range; correspondence::AVERAGE_SCALE.
    scale: f32,
    // Whether `corrections` are added.
    corrected: u32,
    // Rows of Q, each in two halves.
    transport: array<vec4f, 16>,
}

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: AverageParams;
// Of each anchor the point on the target and what is averaged for it, each in two halves.
@group(0) @binding(2) var<uniform> anchors: array<vec4f, 1024>;
@group(0) @binding(3) var<storage, read> points: array<u32>;
// Of each point ybar on the source, the average of the target's anchors themselves, and y; each in two halves.
@group(0) @binding(4) var<storage, read_write> averages: array<vec4f>;
@group(0) @binding(5) var vertices: texture_2d<u32>;
@group(0) @binding(6) var triangles: texture_2d<u32>;
// Of each vertex of the target what is added to averages near it, and the length it belongs to;
// correspondence::Correction.
@group(0) @binding(7) var corrections: texture_2d<u32>;

// Smallest D of an anchor that is not eliminated, in units of the scale; average::fused::FLOOR.
const FLOOR: f32 = 1e-12;
// average::GAMMA.
const GAMMA: f32 = 10.0;
// average::solve::rank_limit.
const RANK_LIMIT: f32 = 3.814697265625e-6;
// Texels an invocation works on: they share the reads of the anchors.
const ITEMS: u32 = 2u;
const OUT: u32 = 6u;
// Whether the target's own anchors are averaged too, for corrections and for the round trip.
override OWN: bool = true;
const CORRECTION_TEXELS: u32 = 3u;

struct Sums {
    k: u32,
    pk: vec2f,
    dk: f32,
    s0: f32,
    s1: vec2f,
    s2: vec3f,
    z0: Vec8,
    zx: Vec8,
    zy: Vec8,
    o0: Vec8,
    ox: Vec8,
    oy: Vec8,
}

fn own(i: u32) -> Vec8 {
    return Vec8(anchors[4u * i], anchors[4u * i + 1u]);
}

fn image(i: u32) -> Vec8 {
    return Vec8(anchors[4u * i + 2u], anchors[4u * i + 3u]);
}

// An offset in the plane and its D.
fn offset(f: Frame, anchor: Vec8) -> vec3f {
    let v = sub8(anchor, f.y);
    let p = vec2f(dot8(f.b0, v), dot8(f.b1, v));
    let within = p.x * p.x + p.y * p.y;
    return vec3f(p, within + GAMMA * max(dot8(v, v) - within, 0.0));
}

fn begin(f: Frame, k: u32) -> Sums {
    var s = Sums();
    s.k = k;
    let o = offset(f, own(k));
    s.pk = o.xy;
    s.dk = o.z;
    return s;
}

fn add8(sum: Vec8, q: f32, v: Vec8) -> Vec8 {
    return Vec8(sum.lo + q * v.lo, sum.hi + q * v.hi);
}

fn push(s: ptr<function, Sums>, f: Frame, j: u32, a: Vec8, b: Vec8) {
    let o = offset(f, a);
    let ratio = params.scale / max(o.z, params.scale * FLOOR);
    let q = select(ratio * ratio, 0.0, j == (*s).k);
    let p = o.xy - (*s).pk;
    let qp = q * p;
    (*s).s0 += q;
    (*s).s1 += qp;
    (*s).s2 += vec3f(qp.x * p.x, qp.x * p.y, qp.y * p.y);
    (*s).z0 = add8((*s).z0, q, b);
    (*s).zx = add8((*s).zx, qp.x, b);
    (*s).zy = add8((*s).zy, qp.y, b);
    if OWN {
        (*s).o0 = add8((*s).o0, q, a);
        (*s).ox = add8((*s).ox, qp.x, a);
        (*s).oy = add8((*s).oy, qp.y, a);
    }
}

// mu and t; average::solve::Multipliers.
fn multipliers(s: Sums) -> vec3f {
    let ratio = s.dk / params.scale;
    let a = ratio * ratio;
    let rho = a / (1.0 + a * s.s0);
    let rs = rho * s.s1;
    let rhs = -s.pk - rs;
    let m = s.s2 - vec3f(rs.x * s.s1.x, rs.x * s.s1.y, rs.y * s.s1.y);
    let trace = m.x + m.z;
    let noise = RANK_LIMIT * max(s.s2.x + s.s2.z, trace);
    if trace <= max(noise, 1e-30) {
        return vec3f(0.0, 0.0, rho);
    }
    let scale = 1.0 / trace;
    let n = m * scale;
    let determinant = n.x * n.z - n.y * n.y;
    var mu = vec2f(n.x * rhs.x + n.y * rhs.y, n.y * rhs.x + n.z * rhs.y) * scale;
    if determinant > noise * scale {
        mu = vec2f(n.z * rhs.x - n.y * rhs.y, n.x * rhs.y - n.y * rhs.x) * (scale / determinant);
    }
    return vec3f(mu, rho * (1.0 - s.s1.x * mu.x - s.s1.y * mu.y));
}

fn transported(y: Vec8) -> Vec8 {
    var r = Vec8();
    if params.transported != 0u {
        for (var i = 0u; i < 4u; i++) {
            r.lo[i] = dot8(Vec8(params.transport[2u * i], params.transport[2u * i + 1u]), y);
            r.hi[i] = dot8(Vec8(params.transport[2u * i + 8u], params.transport[2u * i + 9u]), y);
        }
    }
    return r;
}

struct Correction {
    d: Vec8,
    residual: f32,
}

fn correction(x: vec3f, face: u32) -> Correction {
    let v = texel(triangles, face * TRIANGLE_TEXELS).xyz * CORRECTION_TEXELS;
    let a = Vec8(texel_f32(corrections, v.x), texel_f32(corrections, v.x + 1u));
    let b = Vec8(texel_f32(corrections, v.y), texel_f32(corrections, v.y + 1u));
    let c = Vec8(texel_f32(corrections, v.z), texel_f32(corrections, v.z + 1u));
    let r = vec3f(
        texel_f32(corrections, v.x + 2u).x,
        texel_f32(corrections, v.y + 2u).x,
        texel_f32(corrections, v.z + 2u).x,
    );
    return Correction(combine8(x, a, b, c), x.x * r.x + x.y * r.y + x.z * r.z);
}

fn finish(i: u32, f: Frame, s: Sums) {
    let m = multipliers(s);
    let rest = 1.0 - (m.x * s.s1.x + m.y * s.s1.y + m.z * s.s0);
    let b = image(s.k);
    let q = transported(f.y);
    let o = i * OUT;
    var mean = Vec8(
        q.lo + (rest * b.lo + (m.x * s.zx.lo + m.y * s.zy.lo + m.z * s.z0.lo)),
        q.hi + (rest * b.hi + (m.x * s.zx.hi + m.y * s.zy.hi + m.z * s.z0.hi)),
    );
    if OWN {
        let a = own(s.k);
        let average = Vec8(
            rest * a.lo + (m.x * s.ox.lo + m.y * s.oy.lo + m.z * s.o0.lo),
            rest * a.hi + (m.x * s.ox.hi + m.y * s.oy.hi + m.z * s.o0.hi),
        );
        averages[o + 2u] = average.lo;
        averages[o + 3u] = average.hi;
        averages[o + 4u] = f.y.lo;
        averages[o + 5u] = f.y.hi;
        if params.corrected != 0u {
            let r = sub8(f.y, average);
            let c = correction(coordinates(i), points[3u * i]);
            if c.residual > 0.0 {
                mean = add8(mean, min(sqrt(dot8(r, r)) / c.residual, 1.0), c.d);
            }
        }
    }
    averages[o] = mean.lo;
    averages[o + 1u] = mean.hi;
}

fn coordinates(i: u32) -> vec3f {
    let x = bitcast<f32>(points[3u * i + 1u]);
    let y = bitcast<f32>(points[3u * i + 2u]);
    return vec3f(x, y, 1.0 - x - y);
}

fn point_frame(i: u32) -> Frame {
    return frame(vertices, triangles, points[3u * i], coordinates(i));
}

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let first = span.first + invocation(span, id) * ITEMS;
    if first >= span.end {
        return;
    }
    // The last invocation of an odd count works on its one point twice.
    let second = min(first + 1u, span.end - 1u);
    let f = point_frame(first);
    let g = point_frame(second);
    var least_f = 3e38;
    var least_g = 3e38;
    var k_f = 0u;
    var k_g = 0u;
    for (var j = 0u; j < params.anchors; j++) {
        let a = own(j);
        let v = sub8(a, f.y);
        let w = sub8(a, g.y);
        let e = dot8(v, v);
        let h = dot8(w, w);
        k_f = select(k_f, j, e < least_f);
        k_g = select(k_g, j, h < least_g);
        least_f = min(least_f, e);
        least_g = min(least_g, h);
    }
    var s = begin(f, k_f);
    var t = begin(g, k_g);
    for (var j = 0u; j < params.anchors; j++) {
        let a = own(j);
        let b = image(j);
        push(&s, f, j, a, b);
        push(&t, g, j, a, b);
    }
    finish(first, f, s);
    finish(second, g, t);
}
