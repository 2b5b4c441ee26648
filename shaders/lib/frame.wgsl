// The plane that Psi spans at a point of a surface. Reference: surface::average::orthonormalise.

//#import lib/phong

// A point and an orthonormal basis of its plane.
struct Frame {
    y: Vec8,
    b0: Vec8,
    b1: Vec8,
}

// The coordinate axis along which `b` is smallest.
fn flattest_axis(b: Vec8) -> Vec8 {
    let lo = abs(b.lo);
    let hi = abs(b.hi);
    let least = min(min(min(lo.x, lo.y), min(lo.z, lo.w)), min(min(hi.x, hi.y), min(hi.z, hi.w)));
    if lo.x == least { return Vec8(vec4f(1.0, 0.0, 0.0, 0.0), vec4f()); }
    if lo.y == least { return Vec8(vec4f(0.0, 1.0, 0.0, 0.0), vec4f()); }
    if lo.z == least { return Vec8(vec4f(0.0, 0.0, 1.0, 0.0), vec4f()); }
    if lo.w == least { return Vec8(vec4f(0.0, 0.0, 0.0, 1.0), vec4f()); }
    if hi.x == least { return Vec8(vec4f(), vec4f(1.0, 0.0, 0.0, 0.0)); }
    if hi.y == least { return Vec8(vec4f(), vec4f(0.0, 1.0, 0.0, 0.0)); }
    if hi.z == least { return Vec8(vec4f(), vec4f(0.0, 0.0, 1.0, 0.0)); }
    return Vec8(vec4f(), vec4f(0.0, 0.0, 0.0, 1.0));
}

fn reject8(v: Vec8, b: Vec8) -> Vec8 {
    let along = dot8(v, b);
    return Vec8(v.lo - along * b.lo, v.hi - along * b.hi);
}

// Rows of Psi are means of unit vectors: either of order one, or their direction means nothing.
const LEAST_SQUARE: f32 = 1e-20;

fn orthonormal_frame(y: Vec8, first: Vec8, second: Vec8) -> Frame {
    var b0 = first;
    var n0 = dot8(b0, b0);
    if n0 <= LEAST_SQUARE {
        b0 = second;
        n0 = dot8(b0, b0);
    }
    if n0 <= LEAST_SQUARE {
        b0 = Vec8(vec4f(1.0, 0.0, 0.0, 0.0), vec4f());
        n0 = 1.0;
    }
    b0 = scaled8(1.0 / sqrt(n0), b0);
    var b1 = reject8(second, b0);
    var n1 = dot8(b1, b1);
    if n1 <= max(1e-6 * dot8(second, second), LEAST_SQUARE) {
        b1 = reject8(flattest_axis(b0), b0);
        n1 = dot8(b1, b1);
    }
    // Twice, so that the result is orthogonal to rounding at any angle.
    b1 = reject8(scaled8(1.0 / sqrt(n1), b1), b0);
    return Frame(y, b0, scaled8(1.0 / sqrt(dot8(b1, b1)), b1));
}

// Adds H T for one corner to the rows of Psi.
fn add_rows(psi: ptr<function, Frame>, h: mat2x2f, t: Corner) {
    (*psi).b0 = Vec8(
        (*psi).b0.lo + h[0].x * t.a.lo + h[1].x * t.b.lo,
        (*psi).b0.hi + h[0].x * t.a.hi + h[1].x * t.b.hi,
    );
    (*psi).b1 = Vec8(
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
    var y = scaled8(x.x, t.y);
    add_rows(&psi, c.a.x * g.g0 + c.b.z * g.g5, t);
    t = corner(vertices, head.y);
    y = Vec8(y.lo + x.y * t.y.lo, y.hi + x.y * t.y.hi);
    add_rows(&psi, c.a.y * g.g1 + c.a.z * g.g2, t);
    t = corner(vertices, head.z);
    y = Vec8(y.lo + x.z * t.y.lo, y.hi + x.z * t.y.hi);
    add_rows(&psi, c.b.x * g.g3 + c.b.y * g.g4, t);
    return orthonormal_frame(y, psi.b0, psi.b1);
}
