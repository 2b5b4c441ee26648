// What is known of the projection of a point. Twin: surface::gpu::project_phong::Projected.

struct Projected {
    // The triangle, or NONE.
    face: u32,
    b0: f32,
    b1: f32,
    // From the reference to the projection.
    distance_squared: f32,
    // How it was found, in the bits of HOW; where it is LEFT, also whether the walk found a root
    // all the same (ASTRAY), and the vertex that the walk over vertices ended at, times VERTEX.
    found: u32,
}

// project::Found, and what is left to the next pass; project_phong::Projected.
const NOTHING: u32 = 0u;
const BY_WALK: u32 = 1u;
const BY_SEARCH: u32 = 2u;
const LEFT: u32 = 3u;
const HOW: u32 = 3u;
