// The transpose of I - dF times a vector over the rows, for every free vertex: a gather over the
// slots that name it. Reference: encoding::derivative::encoding_apply_transpose.

//#import lib/span
//#import lib/table
//#import lib/derivative

@group(0) @binding(0) var<uniform> span: Span;
// Of each vertex the first of the slots that name it, their number, and its row.
@group(0) @binding(1) var vertices: texture_2d<u32>;
// A slot and its row.
@group(0) @binding(2) var<storage, read> incoming: array<vec2u>;
@group(0) @binding(3) var<storage, read> slot_derivatives: array<SlotDerivative>;
@group(0) @binding(4) var<storage, read> products: array<RowProduct>;
@group(0) @binding(5) var<storage, read_write> result: array<vec4f>;

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let v = span.first + invocation(span, id);
    if v >= span.end {
        return;
    }
    let here = texel(vertices, v);
    var sum = vec3f();
    if here.z != NONE {
        sum = products[here.z].value;
    }
    for (var k = here.x; k < here.x + here.y; k++) {
        let at = incoming[k];
        let s = slot_derivatives[at.x];
        let along = products[at.y].along;
        let curl = products[at.y].curl;
        let mean = products[at.y].mean;
        sum -= s.w * mean + along * s.z + cross(curl, s.chord);
    }
    result[v] = vec4f(sum, 0.0);
}
