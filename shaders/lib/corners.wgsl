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

// Position and displacement of vertex i.
fn corner(i: u32) -> vec4f {
    if MANY {
        let j = i & 1023u;
        switch i >> 10u {
            case 0u: { return corners0[j]; }
            case 1u: { return corners1[j]; }
            case 2u: { return corners2[j]; }
            default: { return corners3[j]; }
        }
    }
    return corners0[i];
}

// First vertex of loop l, and one past its last.
fn ring(l: u32) -> vec2u {
    return rings[l].xy;
}
