// Mean value coordinates of closed triangle meshes that stay exact on faces, edges and corners. The
// formulas stand at mapping::space::mean_value; names are those of the functions there.

// Four roundings; a plane nearer than this is taken to be so far off.
const ON_FACE: f32 = 4.76837158e-7;
const OVER_CORNER: f32 = 1e-15;
// Square of the distance at which a point is at a vertex.
const AT_VERTEX_3D: f32 = 1e-30;
const HUGE: f32 = 1e30;
// Fourth root of a rounding.
const BEYOND: f32 = 0.018581361;

// A face as a point sees it.
struct View {
    h: f32,
    a0: vec3f,
    a1: vec3f,
    a2: vec3f,
    b: vec3f,
    // The normals of the edges in the plane.
    m0: vec3f,
    m1: vec3f,
    m2: vec3f,
    // Squared distances to the corners.
    squares: vec3f,
}

// From the foot to a corner, in the plane; towards the middle where the foot is at the corner.
fn in_plane(p: vec3f, h: f32, n: vec3f, v: vec3f, middle: vec3f) -> vec3f {
    let a = p - h * n;
    let toward = middle - v;
    let aside = -OVER_CORNER * inverseSqrt(max(dot(toward, toward), LEAST)) * toward;
    return select(a, aside, dot(a, a) < OVER_CORNER * OVER_CORNER);
}

fn view(f: Face, x: vec3f) -> View {
    let p0 = f.v0 - x;
    let p1 = f.v1 - x;
    let p2 = f.v2 - x;
    let h0 = dot(f.n, p0);
    let h1 = dot(f.n, p1);
    let h2 = dot(f.n, p2);
    let middle = (f.v0 + f.v1 + f.v2) * (1.0 / 3.0);
    let a0 = in_plane(p0, h0, f.n, f.v0, middle);
    let a1 = in_plane(p1, h1, f.n, f.v1, middle);
    let a2 = in_plane(p2, h2, f.n, f.v2, middle);
    let s0 = dot(a0, a0);
    let s1 = dot(a1, a1);
    let s2 = dot(a2, a2);
    var h = select(h0, h1, s1 < s0);
    h = select(h, h2, s2 < min(s0, s1));
    h = select(h, ON_FACE, abs(h) < ON_FACE);
    let m0 = cross(f.n, f.e0.xyz);
    let m1 = cross(f.n, f.e1.xyz);
    let m2 = cross(f.n, f.e2.xyz);
    let b = vec3f(
        -dot(m0, select(a1, a2, s2 < s1)),
        -dot(m1, select(a2, a0, s0 < s2)),
        -dot(m2, select(a0, a1, s1 < s0)),
    );
    return View(h, a0, a1, a2, b, m0, m1, m2, vec3f(dot(p0, p0), dot(p1, p1), dot(p2, p2)));
}

// The linear displacement of a face at the foot.
fn displacement(f: Face, a0: vec3f) -> vec3f {
    return f.u - vec3f(dot(f.g0, a0), dot(f.g1, a0), dot(f.g2, a0));
}

// The derivative of the displacement along m.
fn slope(f: Face, m: vec3f) -> vec3f {
    return vec3f(dot(f.g0, m), dot(f.g1, m), dot(f.g2, m));
}

// Takes the displacement of each corner that is nearer than `least`.
fn take_nearest(f: Face, seen: View, least: ptr<function, f32>, place: ptr<function, vec3f>) {
    if seen.squares.x < *least {
        *least = seen.squares.x;
        *place = f.u;
    }
    if seen.squares.y < *least {
        *least = seen.squares.y;
        *place = f.u + slope(f, f.v1 - f.v0);
    }
    if seen.squares.z < *least {
        *least = seen.squares.z;
        *place = f.u + slope(f, f.v2 - f.v0);
    }
}

// What an edge contributes: sign(b) K, E, and with derivatives the integrals of r^-4 and t r^-4.
struct Edge {
    k: f32,
    e: f32,
    fourth: f32,
    tilt: f32,
}

fn edge_part(length: f32, b: f32, h2: f32, t1: f32, t2: f32) -> Edge {
    let across = abs(b);
    let b2 = b * b;
    let tau = t1 * t2;
    let beta = sqrt(b2 + h2);
    let inverse = 1.0 / beta;
    let near = b2 + tau;
    let far = b2 + h2 + tau;
    let phi = angle(across * length, near);
    let theta = angle(beta * length, far);
    let sum = beta + across;
    let product = across * beta;
    let s = h2 * (length * (product - tau) / sum);
    let c = near * far + product * (length * length);
    let shift = angle(abs(s), c) / h2;
    let k = inverse * (phi / sum + across * select(shift, -shift, s < 0.0));
    return Edge(select(k, -k, b < 0.0), theta * inverse, 0.0, 0.0);
}

fn edge_with_derivative(length: f32, b: f32, h2: f32, t1: f32, t2: f32) -> Edge {
    var part = edge_part(length, b, h2, t1, t2);
    let b2 = b * b;
    let beta2 = b2 + h2;
    let tau = t1 * t2;
    let both = length / ((t1 * t1 + beta2) * (t2 * t2 + beta2));
    part.fourth = 0.5 * (both * (beta2 - tau) + part.e) / beta2;
    part.tilt = 0.5 * both * (t1 + t2);
    let nearest = min(abs(t1), abs(t2));
    if beta2 < BEYOND * nearest * nearest && tau > 0.0 {
        let p = 1.0 / t1;
        let q = 1.0 / t2;
        let p2 = p * p;
        let q2 = q * q;
        let pq = p * q;
        let scale = length * pq;
        let middle = p2 + pq + q2;
        let cubes = scale * middle * (1.0 / 3.0);
        let fifths = scale * (p2 * p2 + pq * middle + q2 * q2) * 0.2;
        let sevenths = scale * (p2 * p2 * p2 + q2 * q2 * q2 + pq * (p2 * p2 + q2 * q2 + pq * middle)) * (1.0 / 7.0);
        part.fourth = cubes + beta2 * (3.0 * beta2 * sevenths - 2.0 * fifths);
        part.k = b * (cubes - (b2 + beta2) * fifths + (b2 * b2 + beta2 * (b2 + beta2)) * sevenths);
    }
    return part;
}
