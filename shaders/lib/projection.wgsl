// What the kernels of the forward problem share. Reference: surface::project.

//#import lib/newton

// Twin: surface::gpu::project_phong::ProjectParams.
struct ProjectParams {
    // Parts of vectors an entry of `averages` has, and where the point and what its distance is
    // measured from begin.
    stride: u32,
    point: u32,
    reference: u32,
    // Bounds of the walks; project::SearchLimits::FIRST, less where vertices have very many
    // neighbours.
    vertex_steps: u32,
    triangle_steps: u32,
    unused0: u32,
    unused1: u32,
    unused2: u32,
}

// Twin: surface::gpu::project_phong::Projected.
struct Projected {
    // The triangle, or NONE.
    face: u32,
    b0: f32,
    b1: f32,
    // From the reference to the projection.
    distance_squared: f32,
    // How it was found; where it is LEFT, also whether the walk found a root all the same (ASTRAY),
    // and the vertex that the walk over vertices ended at, times VERTEX.
    found: u32,
}

// project::Found, and what is left to the next pass; project_phong::Projected.
const NOTHING: u32 = 0u;
const BY_WALK: u32 = 1u;
const BY_SEARCH: u32 = 2u;
const LEFT: u32 = 3u;

// What the next pass reads of a point that is LEFT; no host code does.
const ASTRAY: u32 = 4u;
const VERTEX: u32 = 8u;

fn unprojected(found: u32) -> Projected {
    return Projected(NONE, 0.0, 0.0, 0.0, found);
}

// The root `x` in triangle `face`.
fn projected(vertices: texture_2d<u32>, face: u32, head: vec4u, x: vec3f, reference: Vector, found: u32) -> Projected {
    let a = vertex_point(vertices, head.x);
    let b = vertex_point(vertices, head.y);
    let c = vertex_point(vertices, head.z);
    let d = sub_vector(combine_vectors(x, a, b, c), reference);
    return Projected(face, x.x, x.y, dot_vector(d, d), found);
}
