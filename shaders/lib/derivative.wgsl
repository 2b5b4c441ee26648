// Rows of the encoding, the derivative of F and products with it. Explained at the reference,
// encoding::derivative.

// No row.
const NONE: u32 = 0xffffffffu;

// Which vertices a dispatch works on: `frames` shapes of `vertices` vertices each, whose residuals
// have `rows` rows; row r of the splits sets vertex `base + r`.
struct EncodingParams {
    frames: u32,
    vertices: u32,
    rows: u32,
    base: u32,
}

// An encoded vertex: its slots and its number.
struct Row {
    first: u32,
    count: u32,
    vertex: u32,
}

// What the derivative of a row needs; derivative::RowDerivative.
struct RowDerivative {
    normal: vec3f,
    inverse_length: f32,
    g: vec3f,
    offset: f32,
    h: vec3f,
    unused: f32,
}

// What the derivative of a row needs of a slot: z, w, and the chord between the neighbours before
// and after.
struct SlotDerivative {
    z: vec3f,
    w: f32,
    chord: vec3f,
    neighbour: u32,
}

// A row's entry y of a vector, and what the transposed product takes from it;
// derivative::RowTranspose.
struct RowProduct {
    value: vec3f,
    along: f32,
    curl: vec3f,
    unused0: f32,
    mean: vec3f,
    unused1: f32,
}

fn row_of(texel: vec4u) -> Row {
    return Row(texel.x, texel.y, texel.z);
}

// The part of `v` in the plane of the unit vector `n`.
fn in_plane(n: vec3f, v: vec3f) -> vec3f {
    return v - dot(n, v) * n;
}

// The entry `y` of a row and what the transposed product takes from it.
fn row_product(y: vec3f, d: RowDerivative) -> RowProduct {
    let along = dot(d.normal, y);
    let curl = in_plane(d.normal, d.offset * y - along * d.h) * d.inverse_length;
    return RowProduct(y, along, curl, 0.0, y + along * d.g, 0.0);
}
