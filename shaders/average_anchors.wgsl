// Inverse problem on the target and weighted averages (paper, section 3.4 and eq. 13), with two
// passes over the anchors and nothing stored per anchor. Reference and explanation:
// surface::average::fused.
//
// One uniform block holds 256 anchors. With more, the passes are cut into one dispatch per block,
// between which the sums and then the averages of each point wait where its results will be.

//#import lib/span
//#import lib/points
//#import lib/frame

struct AverageParams {
    // Anchors in the block, and before it.
    anchors: u32,
    first: u32,
    // Whether no block follows.
    last: u32,
    // Whether `transport` is added.
    transported: u32,
    // Squared length that keeps the sums in range; correspondence::AVERAGE_SCALE.
    scale: f32,
    // Whether `corrections` are added.
    corrected: u32,
    unused0: u32,
    unused1: u32,
    // Rows of Q, each in two halves.
    transport: array<vec4f, 16>,
}

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: AverageParams;
// Of each anchor the point on the target and what is averaged for it, each in two halves.
@group(0) @binding(2) var<uniform> anchors: array<vec4f, 1024>;
@group(0) @binding(3) var<storage, read> points: array<u32>;
// Of each point ybar on the source, the average of the target's anchors themselves, and y; each in
// two halves.
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
// Which part of the work a dispatch does.
const WHOLE: u32 = 0u;
const SUMS: u32 = 1u;
const AVERAGES: u32 = 2u;
override PART: u32 = WHOLE;
const CORRECTION_TEXELS: u32 = 3u;

// The anchor with the smallest D so far, and the sums over the others of q times powers of K = p -
// p_k.
struct Sums {
    k: u32,
    dk: f32,
    pk: vec2f,
    s0: f32,
    s1: vec2f,
    s2: vec3f,
    // What shifts took away from s2.
    shifted: f32,
}

fn own(i: u32) -> Vector {
    return Vector(anchors[4u * i], anchors[4u * i + 1u]);
}

fn image(i: u32) -> Vector {
    return Vector(anchors[4u * i + 2u], anchors[4u * i + 3u]);
}

// An offset in the plane and its D.
fn offset(f: Frame, anchor: Vector) -> vec3f {
    let v = sub_vector(anchor, f.y);
    let p = vec2f(dot_vector(f.b0, v), dot_vector(f.b1, v));
    let within = p.x * p.x + p.y * p.y;
    return vec3f(p, within + GAMMA * max(dot_vector(v, v) - within, 0.0));
}

fn add_vector(sum: Vector, q: f32, v: Vector) -> Vector {
    return Vector(sum.lo + q * v.lo, sum.hi + q * v.hi);
}

fn weight_factor(d: f32) -> f32 {
    let ratio = params.scale / max(d, params.scale * FLOOR);
    return ratio * ratio;
}

fn push(s: ptr<function, Sums>, f: Frame, j: u32, a: Vector) {
    let o = offset(f, a);
    let p = o.xy - (*s).pk;
    let nearer = o.z < (*s).dk;
    // Where the newcomer is nearer it becomes the origin of K, and the one before is pushed.
    let by = select(vec2f(), p, nearer);
    let q = weight_factor(max(o.z, (*s).dk));
    let k = select(p, -p, nearer);
    let s1 = (*s).s1 - (*s).s0 * by;
    let sum = (*s).s1 + s1;
    (*s).shifted += (*s).s0 * dot(by, by);
    (*s).k = select((*s).k, j, nearer);
    (*s).dk = min((*s).dk, o.z);
    (*s).pk += by;
    let qk = q * k;
    (*s).s0 += q;
    (*s).s2 += vec3f(
        qk.x * k.x - by.x * sum.x,
        qk.x * k.y - (by.y * (*s).s1.x + by.x * s1.y),
        qk.y * k.y - by.y * sum.y,
    );
    (*s).s1 = s1 + qk;
}

// w_j = q_j (K_j . mu + t), but w_k = rest; and the averages.
struct Means {
    k: u32,
    rest: f32,
    t: f32,
    pk: vec2f,
    mu: vec2f,
    image: Vector,
    own: Vector,
}

fn gather(r: ptr<function, Means>, f: Frame, j: u32, a: Vector, b: Vector) {
    let o = offset(f, a);
    let w = select(weight_factor(o.z) * (dot(o.xy - (*r).pk, (*r).mu) + (*r).t), (*r).rest, j == (*r).k);
    (*r).image = add_vector((*r).image, w, b);
    if OWN {
        (*r).own = add_vector((*r).own, w, a);
    }
}

// average::solve::Multipliers.
fn weigh(s: Sums) -> Means {
    var r = Means();
    r.k = s.k;
    r.pk = s.pk;
    let ratio = s.dk / params.scale;
    let a = ratio * ratio;
    let rho = a / (1.0 + a * s.s0);
    let rs = rho * s.s1;
    let rhs = -s.pk - rs;
    let m = s.s2 - vec3f(rs.x * s.s1.x, rs.x * s.s1.y, rs.y * s.s1.y);
    let trace = m.x + m.z;
    let noise = RANK_LIMIT * max(s.s2.x + s.s2.z + s.shifted, trace);
    r.t = rho;
    if trace > max(noise, 1e-30) {
        let scale = 1.0 / trace;
        let n = m * scale;
        let determinant = n.x * n.z - n.y * n.y;
        r.mu = vec2f(n.x * rhs.x + n.y * rhs.y, n.y * rhs.x + n.z * rhs.y) * scale;
        if determinant > noise * scale {
            r.mu = vec2f(n.z * rhs.x - n.y * rhs.y, n.x * rhs.y - n.y * rhs.x) * (scale / determinant);
        }
        r.t = rho * (1.0 - dot(s.s1, r.mu));
    }
    r.rest = 1.0 - (dot(r.mu, s.s1) + r.t * s.s0);
    return r;
}

fn transported(y: Vector) -> Vector {
    var r = Vector();
    if params.transported != 0u {
        for (var i = 0u; i < 4u; i++) {
            r.lo[i] = dot_vector(Vector(params.transport[2u * i], params.transport[2u * i + 1u]), y);
            r.hi[i] = dot_vector(Vector(params.transport[2u * i + 8u], params.transport[2u * i + 9u]), y);
        }
    }
    return r;
}

struct Correction {
    d: Vector,
    residual: f32,
}

fn correction(x: vec3f, face: u32) -> Correction {
    let v = texel(triangles, face * TRIANGLE_TEXELS).xyz * CORRECTION_TEXELS;
    let a = Vector(texel_f32(corrections, v.x), texel_f32(corrections, v.x + 1u));
    let b = Vector(texel_f32(corrections, v.y), texel_f32(corrections, v.y + 1u));
    let c = Vector(texel_f32(corrections, v.z), texel_f32(corrections, v.z + 1u));
    let r = vec3f(
        texel_f32(corrections, v.x + 2u).x,
        texel_f32(corrections, v.y + 2u).x,
        texel_f32(corrections, v.z + 2u).x,
    );
    return Correction(combine_vectors(x, a, b, c), x.x * r.x + x.y * r.y + x.z * r.z);
}

fn finish(i: u32, f: Frame, r: Means) {
    let q = transported(f.y);
    let o = place(i);
    var mean = Vector(q.lo + r.image.lo, q.hi + r.image.hi);
    if OWN {
        let average = r.own;
        averages[o + 2u] = average.lo;
        averages[o + 3u] = average.hi;
        averages[o + 4u] = f.y.lo;
        averages[o + 5u] = f.y.hi;
        if params.corrected != 0u {
            let left = sub_vector(f.y, average);
            let c = correction(coordinates(i), points[point_word(i)]);
            if c.residual > 0.0 {
                mean = add_vector(mean, min(sqrt(dot_vector(left, left)) / c.residual, 1.0), c.d);
            }
        }
    }
    averages[o] = mean.lo;
    averages[o + 1u] = mean.hi;
}

// The first vector of point `i`.
fn place(i: u32) -> u32 {
    return i * OUT;
}

fn coordinates(i: u32) -> vec3f {
    let x = bitcast<f32>(points[point_word(i) + 1u]);
    let y = bitcast<f32>(points[point_word(i) + 2u]);
    return vec3f(x, y, 1.0 - x - y);
}

fn point_frame(i: u32) -> Frame {
    return frame(vertices, triangles, points[point_word(i)], coordinates(i));
}

// Nothing but finite numbers is kept between dispatches: bit patterns of others may change on the
// way.
fn keep_sums(i: u32, s: Sums) {
    averages[place(i)] = vec4f(s.dk, s.pk, f32(s.k));
    averages[place(i) + 1u] = vec4f(s.s0, s.s1, s.s2.x);
    averages[place(i) + 2u] = vec4f(s.s2.yz, s.shifted, 0.0);
}

fn sums(i: u32) -> Sums {
    // The first comparison has no loser: with this D it has no weight.
    var s = Sums();
    s.dk = 3e38;
    if PART == AVERAGES || (PART == SUMS && params.first != 0u) {
        let a = averages[place(i)];
        let b = averages[place(i) + 1u];
        let c = averages[place(i) + 2u];
        s = Sums(u32(a.w), a.x, a.yz, b.x, b.yz, vec3f(b.w, c.xy), c.z);
    }
    return s;
}

fn keep_means(i: u32, r: Means) {
    averages[place(i)] = r.image.lo;
    averages[place(i) + 1u] = r.image.hi;
    averages[place(i) + 2u] = r.own.lo;
    averages[place(i) + 3u] = r.own.hi;
    averages[place(i) + 4u] = vec4f(f32(r.k), r.rest, r.t, 0.0);
    averages[place(i) + 5u] = vec4f(r.pk, r.mu);
}

fn means(i: u32, s: Sums) -> Means {
    if PART == AVERAGES && params.first != 0u {
        let at = place(i);
        let m = averages[at + 4u];
        let n = averages[at + 5u];
        return Means(
            u32(m.x),
            m.y,
            m.z,
            n.xy,
            n.zw,
            Vector(averages[at], averages[at + 1u]),
            Vector(averages[at + 2u], averages[at + 3u]),
        );
    }
    return weigh(s);
}

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let first = span.first + invocation(span, id) * ITEMS;
    if first >= span.end {
        return;
    }
    // The last invocation of an odd count works on its one point twice.
    let second = min(first + 1u, span.end - 1u);
    // A record without point takes part in no pass.
    let shown = points[point_word(first)] != NONE || points[point_word(second)] != NONE;
    let anchor_count = select(0u, params.anchors, shown);
    let f = point_frame(first);
    let g = point_frame(second);
    var s = sums(first);
    var t = sums(second);
    if PART != AVERAGES {
        for (var j = 0u; j < anchor_count; j++) {
            let a = own(j);
            push(&s, f, params.first + j, a);
            push(&t, g, params.first + j, a);
        }
    }
    if PART == SUMS {
        keep_sums(first, s);
        keep_sums(second, t);
        return;
    }
    var m = means(first, s);
    var n = means(second, t);
    for (var j = 0u; j < anchor_count; j++) {
        let a = own(j);
        let b = image(j);
        gather(&m, f, params.first + j, a, b);
        gather(&n, g, params.first + j, a, b);
    }
    if PART == AVERAGES && params.last == 0u {
        keep_means(first, m);
        keep_means(second, n);
        return;
    }
    finish(first, f, m);
    finish(second, g, n);
}
