// The plane that Psi spans at a point of a surface. Reference: surface::average::orthonormalise.

//#import lib/vector8
//#import lib/phong

// A point and an orthonormal basis of its plane.
struct Frame {
    y: Vector,
    b0: Vector,
    b1: Vector,
}

// The coordinate axis along which `b` is smallest.
fn flattest_axis(b: Vector) -> Vector {
    let lo = abs(b.lo);
    let hi = abs(b.hi);
    let least = min(min(min(lo.x, lo.y), min(lo.z, lo.w)), min(min(hi.x, hi.y), min(hi.z, hi.w)));
    if lo.x == least { return Vector(vec4f(1.0, 0.0, 0.0, 0.0), vec4f()); }
    if lo.y == least { return Vector(vec4f(0.0, 1.0, 0.0, 0.0), vec4f()); }
    if lo.z == least { return Vector(vec4f(0.0, 0.0, 1.0, 0.0), vec4f()); }
    if lo.w == least { return Vector(vec4f(0.0, 0.0, 0.0, 1.0), vec4f()); }
    if hi.x == least { return Vector(vec4f(), vec4f(1.0, 0.0, 0.0, 0.0)); }
    if hi.y == least { return Vector(vec4f(), vec4f(0.0, 1.0, 0.0, 0.0)); }
    if hi.z == least { return Vector(vec4f(), vec4f(0.0, 0.0, 1.0, 0.0)); }
    return Vector(vec4f(), vec4f(0.0, 0.0, 0.0, 1.0));
}

fn reject(v: Vector, b: Vector) -> Vector {
    let along = dot_vector(v, b);
    return Vector(v.lo - along * b.lo, v.hi - along * b.hi);
}

// Rows of Psi are means of unit vectors: either of order one, or their direction means nothing.
const LEAST_SQUARE: f32 = 1e-20;

fn orthonormal_frame(y: Vector, first: Vector, second: Vector) -> Frame {
    var b0 = first;
    var n0 = dot_vector(b0, b0);
    if n0 <= LEAST_SQUARE {
        b0 = second;
        n0 = dot_vector(b0, b0);
    }
    if n0 <= LEAST_SQUARE {
        b0 = Vector(vec4f(1.0, 0.0, 0.0, 0.0), vec4f());
        n0 = 1.0;
    }
    b0 = scaled_vector(1.0 / sqrt(n0), b0);
    var b1 = reject(second, b0);
    var n1 = dot_vector(b1, b1);
    if n1 <= max(1e-6 * dot_vector(second, second), LEAST_SQUARE) {
        b1 = reject(flattest_axis(b0), b0);
        n1 = dot_vector(b1, b1);
    }
    // Twice, so that the result is orthogonal to rounding at any angle.
    b1 = reject(scaled_vector(1.0 / sqrt(n1), b1), b0);
    return Frame(y, b0, scaled_vector(1.0 / sqrt(dot_vector(b1, b1)), b1));
}

// Adds H T for one corner to the rows of Psi.
fn add_rows(psi: ptr<function, Frame>, h: mat2x2f, t: Corner) {
    (*psi).b0 = Vector(
        (*psi).b0.lo + h[0].x * t.a.lo + h[1].x * t.b.lo,
        (*psi).b0.hi + h[0].x * t.a.hi + h[1].x * t.b.hi,
    );
    (*psi).b1 = Vector(
        (*psi).b1.lo + h[0].y * t.a.lo + h[1].y * t.b.lo,
        (*psi).b1.hi + h[0].y * t.a.hi + h[1].y * t.b.hi,
    );
}

fn frame(vertices: texture_2d<u32>, triangles: texture_2d<u32>, face: u32, x: vec3f) -> Frame {
    let head = texel(triangles, face * TRIANGLE_TEXELS);
    let g = gauge(triangles, face, head.w);
    let c = coefficients(x);
    var psi = Frame();
    var t = corner(vertices, head.x);
    var y = scaled_vector(x.x, t.y);
    add_rows(&psi, c.a.x * g.g0 + c.b.z * g.g5, t);
    t = corner(vertices, head.y);
    y = Vector(y.lo + x.y * t.y.lo, y.hi + x.y * t.y.hi);
    add_rows(&psi, c.a.y * g.g1 + c.a.z * g.g2, t);
    t = corner(vertices, head.z);
    y = Vector(y.lo + x.z * t.y.lo, y.hi + x.z * t.y.hi);
    add_rows(&psi, c.b.x * g.g3 + c.b.y * g.g4, t);
    return orthonormal_frame(y, psi.b0, psi.b1);
}
