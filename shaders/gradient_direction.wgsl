// The next direction of conjugate gradients. Reference: encoding::gradients.

//#import lib/span
//#import lib/gradients

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: GradientParams;
@group(0) @binding(2) var<storage, read> scalars: array<vec4f>;
// The preconditioned residual.
@group(0) @binding(3) var<storage, read> product: array<vec4f>;
@group(0) @binding(4) var<storage, read_write> direction: array<vec4f>;

// Whether this is the first direction.
override START: bool = false;

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let v = span.first + invocation(span, id);
    if v >= span.end {
        return;
    }
    var beta = 0.0;
    let rho = scalars[params.rho].x;
    if !START && rho > 0.0 {
        beta = scalars[params.next].x / rho;
    }
    direction[v] = vec4f(product[v].xyz + beta * direction[v].xyz, 0.0);
}
