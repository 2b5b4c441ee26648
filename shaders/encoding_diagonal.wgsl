// One over the diagonal of (I - dF)T (I - dF): Jacobi's preconditioner. Reference:
// encoding::gradients::encoding_diagonal.

//#import lib/span
//#import lib/table
//#import lib/derivative
//#import lib/gradients

@group(0) @binding(0) var<uniform> span: Span;
// As in encoding_apply_transpose.
@group(0) @binding(1) var vertices: texture_2d<u32>;
@group(0) @binding(2) var<storage, read> incoming: array<vec2u>;
@group(0) @binding(3) var<storage, read> row_derivatives: array<RowDerivative>;
@group(0) @binding(4) var<storage, read> slot_derivatives: array<SlotDerivative>;
@group(0) @binding(5) var<storage, read_write> solve: array<SolveVertex>;

// Squared length of column `axis` of a slot's block.
fn column(d: RowDerivative, s: SlotDerivative, axis: vec3f) -> f32 {
    let normal = in_plane(d.normal, cross(s.chord, axis)) * d.inverse_length;
    let offset = dot(s.z + s.w * d.g, axis) - dot(d.h, normal);
    let block = s.w * axis + offset * d.normal + d.offset * normal;
    return dot(block, block);
}

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let v = span.first + invocation(span, id);
    if v >= span.end {
        return;
    }
    let here = texel(vertices, v);
    var sum = vec3f();
    if here.z != NONE {
        sum = vec3f(1.0);
    }
    for (var k = here.x; k < here.x + here.y; k++) {
        let at = incoming[k];
        let s = slot_derivatives[at.x];
        let d = row_derivatives[at.y];
        sum += vec3f(
            column(d, s, vec3f(1.0, 0.0, 0.0)),
            column(d, s, vec3f(0.0, 1.0, 0.0)),
            column(d, s, vec3f(0.0, 0.0, 1.0)),
        );
    }
    // A vertex in no row stays where it is.
    let one = vec3f(1.0);
    solve[v].inverse_diagonal = one / select(one, sum, sum > vec3f());
}
