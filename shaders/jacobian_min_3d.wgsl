// The smallest Jacobian of a step among those of a piece of points that lie inside. Reference:
// mapping::space::piece_minima_on_cpu; the pieces are compared by the host, which judges the
// smallest again.

//#import lib/span
//#import lib/angle
//#import lib/faces
//#import lib/mean_value_3d

struct PieceMinimum3d {
    value: f32,
    // Which point of the piece.
    index: u32,
}

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: SpaceParams;
@group(0) @binding(2) var<uniform> faces0: array<vec4f, 1024>;
@group(0) @binding(3) var<uniform> faces1: array<vec4f, 1024>;
@group(0) @binding(4) var<uniform> faces2: array<vec4f, 1024>;
@group(0) @binding(5) var<uniform> faces3: array<vec4f, 1024>;
@group(0) @binding(6) var<storage, read> points: array<vec4f>;
@group(0) @binding(7) var<storage, read_write> minima: array<PieceMinimum3d>;

// Points of a piece.
const PIECE: u32 = 16u;

// Displacement of the closest of all vertices and of the faces in which the foot lies.
fn closest(x: vec3f) -> vec3f {
    var least = HUGE;
    var base = vec3f();
    for (var k = 0u; k < params.faces; k++) {
        let f = face(k);
        let seen = view(f, x);
        take_nearest(f, seen, &least, &base);
        let flat = seen.h * seen.h;
        if min(min(seen.b.x, seen.b.y), seen.b.z) >= 0.0 && flat < least {
            least = flat;
            base = displacement(f, seen.a0);
        }
    }
    return base;
}

// Sums over the faces: weight and its gradient, displacement and the rows of its gradient.
struct Sums3d {
    weight: f32,
    moved: vec3f,
    slope: vec3f,
    row0: vec3f,
    row1: vec3f,
    row2: vec3f,
}

// Adds the part of an edge to the gradient of the tangential moment.
fn add_edge(sums: ptr<function, Sums3d>, f: Face, part: Edge, h: f32, b: f32, m: vec3f, e: vec3f) {
    let y = (h * h * part.fourth - 0.5 * part.e) * f.n - (h * b * part.fourth) * m + (h * part.tilt) * e;
    let s = slope(f, m);
    (*sums).row0 += s.x * y;
    (*sums).row1 += s.y * y;
    (*sums).row2 += s.z * y;
}

fn sums_at(x: vec3f, base: vec3f) -> Sums3d {
    var sums = Sums3d();
    for (var k = 0u; k < params.faces; k++) {
        let f = face(k);
        let seen = view(f, x);
        let h = seen.h;
        let h2 = h * h;
        let p0 = edge_with_derivative(f.e0.w, seen.b.x, h2, dot(f.e0.xyz, seen.a1), dot(f.e0.xyz, seen.a2));
        let p1 = edge_with_derivative(f.e1.w, seen.b.y, h2, dot(f.e1.xyz, seen.a2), dot(f.e1.xyz, seen.a0));
        let p2 = edge_with_derivative(f.e2.w, seen.b.z, h2, dot(f.e2.xyz, seen.a0), dot(f.e2.xyz, seen.a1));
        add_edge(&sums, f, p0, h, seen.b.x, seen.m0, f.e0.xyz);
        add_edge(&sums, f, p1, h, seen.b.y, seen.m1, f.e1.xyz);
        add_edge(&sums, f, p2, h, seen.b.z, seen.m2, f.e2.xyz);
        let inside = select(PI, 0.0, min(min(seen.b.x, seen.b.y), seen.b.z) < 0.0);
        let fourth = inside / h2 - 0.5 * (p0.k + p1.k + p2.k);
        let w = h * fourth;
        let outward = seen.b.x * p0.fourth + seen.b.y * p1.fourth + seen.b.z * p2.fourth;
        let along = p0.fourth * seen.m0 + p1.fourth * seen.m1 + p2.fourth * seen.m2;
        let gradient = (fourth + outward) * f.n + h * along;
        let tangent = slope(f, p0.e * seen.m0 + p1.e * seen.m1 + p2.e * seen.m2);
        let d = displacement(f, seen.a0) - base;
        sums.weight += w;
        sums.moved += w * d + 0.5 * h * tangent;
        sums.slope += gradient;
        sums.row0 += d.x * gradient + w * f.g0;
        sums.row1 += d.y * gradient + w * f.g1;
        sums.row2 += d.z * gradient + w * f.g2;
    }
    return sums;
}

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let piece = span.first + invocation(span, id);
    if piece >= span.end {
        return;
    }
    var best = PieceMinimum3d(HUGE, 0u);
    let first = piece * PIECE;
    let count = min(PIECE, params.points - first);
    for (var i = 0u; i < count; i++) {
        let x = points[first + i].xyz;
        let sums = sums_at(x, closest(x));
        let inverse = 1.0 / sums.weight;
        let mean = sums.moved * inverse;
        let r0 = (sums.row0 - mean.x * sums.slope) * inverse + vec3f(1.0, 0.0, 0.0);
        let r1 = (sums.row1 - mean.y * sums.slope) * inverse + vec3f(0.0, 1.0, 0.0);
        let r2 = (sums.row2 - mean.z * sums.slope) * inverse + vec3f(0.0, 0.0, 1.0);
        let jacobian = dot(r0, cross(r1, r2));
        // What is not finite, or beyond all measure, counts as a fold, and the host looks again.
        let finite = (bitcast<u32>(jacobian) & 0x7f800000u) != 0x7f800000u && abs(jacobian) < HUGE;
        let judged = select(-HUGE, jacobian, finite);
        if sums.weight > 0.0 && judged < best.value {
            best = PieceMinimum3d(judged, i);
        }
    }
    minima[piece] = best;
}
