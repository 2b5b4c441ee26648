// What the kernels of the forward problem share. Reference: surface::project.

//#import lib/newton
//#import lib/projected

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
