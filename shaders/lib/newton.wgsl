// Phong projection onto one triangle by Newton's method in two unknowns. Reference and explanation:
// surface::psi.

//#import lib/phong

// How far outside a triangle a root may lie; psi::slack.
const SLACK: f32 = 1e-4;
const NEWTON_STEPS: u32 = 12u;
const EPSILON: f32 = 1.1920928955078125e-7;
// psi::ROUNDING.
const ROUNDING: f32 = 6.0;

// Q_kj = G_k T_i(k) (v_j - ybar) as the columns j of one matrix for each k, and where the iteration
// starts.
struct System {
    q0: mat3x2f,
    q1: mat3x2f,
    q2: mat3x2f,
    q3: mat3x2f,
    q4: mat3x2f,
    q5: mat3x2f,
    start: vec3f,
    // Length that the rounding of coordinates leaves open.
    rounding: f32,
}

fn tangential(t: Corner, d0: Vector, d1: Vector, d2: Vector) -> mat3x2f {
    return mat3x2f(dot_vector(t.a, d0), dot_vector(t.b, d0), dot_vector(t.a, d1), dot_vector(t.b, d1), dot_vector(t.a, d2), dot_vector(t.b, d2));
}

// The projection onto the flat triangle, reflected into it where it lies outside; psi::start. `d`:
// v_2 - ybar.
fn flat_projection(e: Vector, f: Vector, d: Vector) -> vec3f {
    let ee = dot_vector(e, e);
    let ef = dot_vector(e, f);
    let ff = dot_vector(f, f);
    let determinant = ee * ff - ef * ef;
    if !(determinant > EPSILON * ee * ff) {
        return vec3f(1.0 / 3.0);
    }
    let de = dot_vector(e, d);
    let df = dot_vector(f, d);
    let x = (ef * df - ff * de) / determinant;
    let y = (ef * de - ee * df) / determinant;
    let inside = max(abs(vec3f(x, y, 1.0 - x - y)), vec3f(EPSILON));
    return inside / (inside.x + inside.y + inside.z);
}

fn phong_system(vertices: texture_2d<u32>, triangles: texture_2d<u32>, face: u32, head: vec4u, mean: Vector) -> System {
    let g = gauge(triangles, face, head.w);
    let t0 = corner(vertices, head.x);
    let t1 = corner(vertices, head.y);
    let t2 = corner(vertices, head.z);
    let d0 = sub_vector(t0.y, mean);
    let d1 = sub_vector(t1.y, mean);
    let d2 = sub_vector(t2.y, mean);
    let p0 = tangential(t0, d0, d1, d2);
    let p1 = tangential(t1, d0, d1, d2);
    let p2 = tangential(t2, d0, d1, d2);
    let start = flat_projection(sub_vector(t0.y, t2.y), sub_vector(t1.y, t2.y), d2);
    return System(g.g0 * p0, g.g1 * p1, g.g2 * p1, g.g3 * p2, g.g4 * p2, g.g5 * p0, start, ROUNDING * EPSILON * largest_component(mean));
}

struct Root {
    x: vec3f,
    inside: bool,
}

fn largest(v: vec2f) -> f32 {
    return max(abs(v.x), abs(v.y));
}

// Adds the part of basis k: f, and the columns of df.
fn add_basis(f: ptr<function, vec2f>, df: ptr<function, mat3x2f>, q: mat3x2f, x: vec3f, c: f32, dc: vec3f) {
    let u = q * x;
    *f += c * u;
    *df += mat3x2f(dc.x * u + c * q[0], dc.y * u + c * q[1], dc.z * u + c * q[2]);
}

struct Step {
    d: vec2f,
    sound: bool,
}

fn newton_step(system: System, x: vec3f) -> Step {
    let r = 1.0 / (x.x * x.y + x.y * x.z + x.z * x.x);
    let m = unscaled_coefficients(x);
    let ca = m.a * r;
    let cb = m.b * r;
    let ds = vec3f(x.y + x.z, x.z + x.x, x.x + x.y);
    let h = 0.5 * vec3f(x.y * x.z, x.z * x.x, x.x * x.y);
    let xx = x * x;
    let xy = 2.0 * x.x * x.y;
    let yz = 2.0 * x.y * x.z;
    let zx = 2.0 * x.z * x.x;
    var f = vec2f();
    var df = mat3x2f();
    add_basis(&f, &df, system.q0, x, ca.x, (vec3f(xy + h.x, xx.x + h.y, h.z) - ca.x * ds) * r);
    add_basis(&f, &df, system.q1, x, ca.y, (vec3f(xx.y + h.x, xy + h.y, h.z) - ca.y * ds) * r);
    add_basis(&f, &df, system.q2, x, ca.z, (vec3f(h.x, yz + h.y, xx.y + h.z) - ca.z * ds) * r);
    add_basis(&f, &df, system.q3, x, cb.x, (vec3f(h.x, xx.z + h.y, yz + h.z) - cb.x * ds) * r);
    add_basis(&f, &df, system.q4, x, cb.y, (vec3f(xx.z + h.x, h.y, zx + h.z) - cb.y * ds) * r);
    add_basis(&f, &df, system.q5, x, cb.z, (vec3f(zx + h.x, h.y, xx.x + h.z) - cb.z * ds) * r);
    let j0 = df[0] - df[2];
    let j1 = df[1] - df[2];
    let det = j0.x * j1.y - j1.x * j0.y;
    let diagonal = max(abs(j0.x), abs(j1.y));
    let across = max(abs(j1.x), abs(j0.y));
    if abs(det) <= EPSILON * (diagonal * diagonal + across * across) {
        return Step(vec2f(), false);
    }
    return Step(vec2f(j1.x * f.y - j1.y * f.x, j0.y * f.x - j0.x * f.y) / det, true);
}

// Accepts coordinates that lie outside by no more than the slack, or than a length that rounding
// leaves open; clamped to the triangle.
fn inside_or_not(system: System, x: vec3f) -> Root {
    let c = max(x, vec3f());
    let inside = c / (c.x + c.y + c.z);
    if min(x.x, min(x.y, x.z)) >= -SLACK {
        return Root(inside, true);
    }
    // How far that moves the point, as seen in the planes of the three corners; their turn by G_k
    // changes it by less than a half.
    let d = inside - x;
    let moved = max(largest(system.q0 * d), max(largest(system.q1 * d), largest(system.q3 * d)));
    if moved <= system.rounding {
        return Root(inside, true);
    }
    return Root(x, false);
}

// The vertex nearest to x, if it is a root. Lengths are those of Q in place of P:
// G_k is orthogonal.
fn vertex_root(system: System, x: vec3f) -> Root {
    var e = vec3f(1.0, 0.0, 0.0);
    var q = system.q0;
    if x.y > x.x && x.y >= x.z {
        e = vec3f(0.0, 1.0, 0.0);
        q = system.q1;
    } else if x.z > x.x {
        e = vec3f(0.0, 0.0, 1.0);
        q = system.q3;
    }
    let own = q * e;
    let scale = max(largest(q[0] - own), max(largest(q[1] - own), largest(q[2] - own)));
    if largest(own) <= max(SLACK * scale, system.rounding) {
        return Root(e, true);
    }
    return Root(x, false);
}

fn project_triangle(system: System, patience: f32) -> Root {
    var x = system.start;
    var last = 1e30;
    for (var i = 0u; i < NEWTON_STEPS; i++) {
        let step = newton_step(system, x);
        if !step.sound {
            return Root(x, false);
        }
        x += vec3f(step.d, -step.d.x - step.d.y);
        if min(x.x, min(x.y, x.z)) < -patience {
            return Root(x, false);
        }
        // Beyond a vertex s is negative and Psi as smooth as before it; only on the pole there is
        // no next step.
        let s = abs(x.x * x.y + x.y * x.z + x.z * x.x);
        if s <= AT_VERTEX {
            return vertex_root(system, x);
        }
        let size = largest(step.d);
        if size <= 8.0 * EPSILON || (size <= 1e-4 && size * size <= EPSILON * s && last < 1e30) {
            return inside_or_not(system, x);
        }
        last = size;
    }
    if last <= 1e-3 {
        return inside_or_not(system, x);
    }
    return Root(x, false);
}
