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

fn vector(block: u32, i: u32) -> vec4f {
    switch block {
        case 0u: { return faces0[i]; }
        case 1u: { return faces1[i]; }
        case 2u: { return faces2[i]; }
        default: { return faces3[i]; }
    }
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
