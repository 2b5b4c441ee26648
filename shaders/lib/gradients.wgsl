// The state of conjugate gradients. See encoding::gpu::gradients.

// A vertex: the solution so far, what is left of the right side, and one over the diagonal.
struct SolveVertex {
    solution: vec3f,
    unused0: f32,
    residual: vec3f,
    unused1: f32,
    inverse_diagonal: vec3f,
    unused2: f32,
}

// Where a step finds its scalars: `rho` and `next` are the products of residual and preconditioned
// residual before and after it.
struct GradientParams {
    rho: u32,
    next: u32,
    // Square of the part of the first residual at which the solution is good enough.
    tolerance: f32,
    unused: u32,
}

// Scalars whose place is fixed: the squared length of the product, the first `rho`, and the number
// of steps taken.
const CURVATURE: u32 = 2u;
const FIRST: u32 = 3u;
const STEPS: u32 = 4u;
