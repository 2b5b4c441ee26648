// A step of conjugate gradients: along the direction, by a length that the device found. Reference:
// encoding::gradients.

//#import lib/span
//#import lib/gradients

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: GradientParams;
@group(0) @binding(2) var<storage, read_write> scalars: array<vec4f>;
@group(0) @binding(3) var<storage, read_write> solve: array<SolveVertex>;
@group(0) @binding(4) var<storage, read> direction: array<vec4f>;
// The matrix times the direction; becomes the preconditioned residual.
@group(0) @binding(5) var<storage, read_write> product: array<vec4f>;

// Whether this is the beginning: the product is the right side and the solution zero.
override START: bool = false;

// How far to go; zero once the solution is good enough, so that steps after that change nothing.
fn step_length() -> f32 {
    let rho = scalars[params.rho].x;
    let curvature = scalars[CURVATURE].x;
    if rho > params.tolerance * scalars[FIRST].x && curvature > 0.0 && curvature < 1e30 {
        return rho / curvature;
    }
    return 0.0;
}

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let v = span.first + invocation(span, id);
    if v >= span.end {
        return;
    }
    var solution = vec3f();
    var residual = product[v].xyz;
    if !START {
        let alpha = step_length();
        solution = solve[v].solution + alpha * direction[v].xyz;
        residual = solve[v].residual - alpha * residual;
        if v == span.first && alpha > 0.0 {
            scalars[STEPS].x += 1.0;
        }
    }
    solve[v].solution = solution;
    solve[v].residual = residual;
    product[v] = vec4f(solve[v].inverse_diagonal * residual, 0.0);
}
