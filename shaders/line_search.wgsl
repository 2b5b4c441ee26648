// The shapes that a Gauss-Newton step leads to when it is taken whole, by half, by a quarter and so
// on. See encoding::gpu::gradients.

//#import lib/span
//#import lib/derivative
//#import lib/gradients

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: EncodingParams;
@group(0) @binding(2) var<storage, read> positions: array<vec4f>;
@group(0) @binding(3) var<storage, read> solve: array<SolveVertex>;
// Shape after shape.
@group(0) @binding(4) var<storage, read_write> candidates: array<vec4f>;

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let v = span.first + invocation(span, id);
    if v >= span.end {
        return;
    }
    let start = positions[v].xyz;
    let step = solve[v].solution;
    var part = 1.0;
    for (var frame = 0u; frame < params.frames; frame++) {
        candidates[frame * params.vertices + v] = vec4f(start - part * step, 0.0);
        part *= 0.5;
    }
}
