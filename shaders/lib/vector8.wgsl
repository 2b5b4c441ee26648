// Vectors of R^8 in two halves. Reference: surface::vector.

struct Vec8 {
    lo: vec4f,
    hi: vec4f,
}

fn sub8(a: Vec8, b: Vec8) -> Vec8 {
    return Vec8(a.lo - b.lo, a.hi - b.hi);
}

fn scaled8(s: f32, a: Vec8) -> Vec8 {
    return Vec8(s * a.lo, s * a.hi);
}

// Four chains, then pairwise: the order of surface::vector::dot.
fn dot8(a: Vec8, b: Vec8) -> f32 {
    let p = a.lo * b.lo + a.hi * b.hi;
    return (p.x + p.y) + (p.z + p.w);
}

fn combine8(x: vec3f, a: Vec8, b: Vec8, c: Vec8) -> Vec8 {
    return Vec8(x.x * a.lo + x.y * b.lo + x.z * c.lo, x.x * a.hi + x.y * b.hi + x.z * c.hi);
}
