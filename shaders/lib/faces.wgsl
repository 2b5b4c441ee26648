// How kernels of maps in space read a cage. See mapping::space::gpu.
//
// The kernel that imports this declares the blocks `faces0` .. `faces3`, each of 93 faces of 11
// vectors.

struct SpaceParams {
    // Faces of the cage.
    faces: u32,
    // Points there are.
    points: u32,
    unused0: u32,
    unused1: u32,
}

// Vectors of a face, and faces of a block.
const RECORD: u32 = 11u;
const PER_BLOCK: u32 = 93u;

struct Face {
    v0: vec3f,
    v1: vec3f,
    v2: vec3f,
    n: vec3f,
    // Directions of the edges, and their lengths.
    e0: vec4f,
    e1: vec4f,
    e2: vec4f,
    // Displacement of corner 0, and rows of its gradient.
    u: vec3f,
    g0: vec3f,
    g1: vec3f,
    g2: vec3f,
}

// Vector i of a block. Every block has one, so all are read and no branch is taken: a branch for
// each of the eleven vectors of a face keeps the compiler of SwiftShader busy for forty seconds.
fn vector(block: u32, i: u32) -> vec4f {
    let odd = (block & 1u) != 0u;
    var block0 = faces0[i];
    var block1 = faces1[i];
    var block2 = faces2[i];
    var block3 = faces3[i];
    return select(select(block0, block1, odd), select(block2, block3, odd), block >= 2u);
}

fn face(k: u32) -> Face {
    let b = k / PER_BLOCK;
    let i = (k % PER_BLOCK) * RECORD;
    return Face(
        vector(b, i).xyz,
        vector(b, i + 1u).xyz,
        vector(b, i + 2u).xyz,
        vector(b, i + 3u).xyz,
        vector(b, i + 4u),
        vector(b, i + 5u),
        vector(b, i + 6u),
        vector(b, i + 7u).xyz,
        vector(b, i + 8u).xyz,
        vector(b, i + 9u).xyz,
        vector(b, i + 10u).xyz,
    );
}
