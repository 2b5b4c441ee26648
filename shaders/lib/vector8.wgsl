// Vectors of R^8, called Vector wherever the number of dimensions does not matter; lib/vector12 is
// the other. Reference: surface::vector.

//#import lib/table

struct Vector {
    lo: vec4f,
    hi: vec4f,
}

// Texels of a table, or entries of a buffer of vec4f, that hold one.
const VECTOR_TEXELS: u32 = 2u;

// From the parts a buffer holds: the first, the second, the last.
fn vector_of(a: vec4f, b: vec4f, last: vec4f) -> Vector {
    return Vector(a, b);
}

fn texel_vector(table: texture_2d<u32>, i: u32) -> Vector {
    return Vector(texel_f32(table, i), texel_f32(table, i + 1u));
}

fn sub_vector(a: Vector, b: Vector) -> Vector {
    return Vector(a.lo - b.lo, a.hi - b.hi);
}

// The largest absolute value of a component.
fn largest_component(a: Vector) -> f32 {
    let m = max(abs(a.lo), abs(a.hi));
    return max(max(m.x, m.y), max(m.z, m.w));
}

fn scaled_vector(s: f32, a: Vector) -> Vector {
    return Vector(s * a.lo, s * a.hi);
}

// Four chains, then pairwise: the order of surface::vector::dot.
fn dot_vector(a: Vector, b: Vector) -> f32 {
    let p = a.lo * b.lo + a.hi * b.hi;
    return (p.x + p.y) + (p.z + p.w);
}

fn combine_vectors(x: vec3f, a: Vector, b: Vector, c: Vector) -> Vector {
    return Vector(x.x * a.lo + x.y * b.lo + x.z * c.lo, x.x * a.hi + x.y * b.hi + x.z * c.hi);
}
