// Vectors of R^12 in three parts; lib/vector8 is the other. Reference: surface::vector.

//#import lib/table

struct Vector {
    a: vec4f,
    b: vec4f,
    c: vec4f,
}

const VECTOR_TEXELS: u32 = 3u;

fn vector_of(a: vec4f, b: vec4f, last: vec4f) -> Vector {
    return Vector(a, b, last);
}

fn texel_vector(table: texture_2d<u32>, i: u32) -> Vector {
    return Vector(texel_f32(table, i), texel_f32(table, i + 1u), texel_f32(table, i + 2u));
}

fn sub_vector(p: Vector, q: Vector) -> Vector {
    return Vector(p.a - q.a, p.b - q.b, p.c - q.c);
}

// The largest absolute value of a component.
fn largest_component(p: Vector) -> f32 {
    let m = max(max(abs(p.a), abs(p.b)), abs(p.c));
    return max(max(m.x, m.y), max(m.z, m.w));
}

fn dot_vector(p: Vector, q: Vector) -> f32 {
    let s = p.a * q.a + p.b * q.b + p.c * q.c;
    return (s.x + s.y) + (s.z + s.w);
}

fn combine_vectors(x: vec3f, p: Vector, q: Vector, r: Vector) -> Vector {
    return Vector(
        x.x * p.a + x.y * q.a + x.z * r.a,
        x.x * p.b + x.y * q.b + x.z * r.b,
        x.x * p.c + x.y * q.c + x.z * r.c,
    );
}
