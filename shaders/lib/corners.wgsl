// How kernels of maps in the plane read a polygon. See mapping::plane::gpu.
//
// The kernel that imports this declares the blocks `corners0` .. `corners3`, of 1,024 vertices
// each, and `rings`.

// Whether there are more vertices than one block holds.
override MANY: bool = false;

struct PlaneParams {
    // Lower left corner of the raster and side of a pixel, in local units.
    origin: vec2f,
    pixel: f32,
    // Loops of the polygon.
    loops: u32,
    // Whether the derivatives read are to be multiplied, or are not there yet.
    chained: u32,
    // Squared distance from the origin beyond which a point is far away.
    far: f32,
    unused0: u32,
    unused1: u32,
}

// Position and displacement of vertex i. Every block has a vertex j, so all are read and no branch
// is taken: this is inlined often, and SwiftShader compiles for minutes where each has its
// branches.
fn corner(i: u32) -> vec4f {
    if MANY {
        let j = i & 1023u;
        let odd = (i & 1024u) != 0u;
        var block0 = corners0[j];
        var block1 = corners1[j];
        var block2 = corners2[j];
        var block3 = corners3[j];
        return select(select(block0, block1, odd), select(block2, block3, odd), i >= 2048u);
    }
    return corners0[i];
}

// First vertex of loop l, and one past its last.
fn ring(l: u32) -> vec2u {
    return rings[l].xy;
}
