// (I - dF) x for every row, and what the transposed product takes from it. Reference:
// encoding::derivative::encoding_apply.

//#import lib/span
//#import lib/table
//#import lib/derivative

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var rows: texture_2d<u32>;
@group(0) @binding(2) var<storage, read> row_derivatives: array<RowDerivative>;
@group(0) @binding(3) var<storage, read> slot_derivatives: array<SlotDerivative>;
// x, a vertex each; zero where a vertex is held.
@group(0) @binding(4) var<storage, read> direction: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> products: array<RowProduct>;

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let index = span.first + invocation(span, id);
    if index >= span.end {
        return;
    }
    let row = row_of(texel(rows, index));
    var moved = vec3f();
    var turned = vec3f();
    var offset = 0.0;
    for (var k = row.first; k < row.first + row.count; k++) {
        let s = slot_derivatives[k];
        let x = direction[s.neighbour].xyz;
        moved += s.w * x;
        turned += cross(s.chord, x);
        offset += dot(s.z, x);
    }
    let d = row_derivatives[index];
    let normal = in_plane(d.normal, turned) * d.inverse_length;
    offset += dot(d.g, moved) - dot(d.h, normal);
    let change = moved + (d.offset * normal + offset * d.normal);
    products[index] = row_product(direction[row.vertex].xyz - change, d);
}
