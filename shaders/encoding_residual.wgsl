// V - F of every row, for several shapes; and, for one, the derivative of F. References:
// encoding::decode::encoding_residual, encoding::derivative::Linearisation.

//#import lib/span
//#import lib/table
//#import lib/encoding

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: EncodingParams;
@group(0) @binding(2) var rows: texture_2d<u32>;
@group(0) @binding(3) var slots: texture_2d<u32>;
// Shape after shape, as the residuals.
@group(0) @binding(4) var<storage, read> positions: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> products: array<RowProduct>;
@group(0) @binding(6) var<storage, read_write> row_derivatives: array<RowDerivative>;
@group(0) @binding(7) var<storage, read_write> slot_derivatives: array<SlotDerivative>;

// Whether the derivative is wanted.
override DERIVATIVE: bool = false;

fn position(v: u32) -> vec3f {
    return positions[v].xyz;
}

fn slot(k: u32) -> Slot {
    return slot_of(texel(slots, k));
}

// V - F and the derivative of F.
fn linearise(index: u32, row: Row) {
    let f = ring_frame(row, 0u);
    let end = row.first + row.count;
    var d = RowDerivative(f.normal, f.inverse_length, vec3f(), 0.0, vec3f(), 0.0);
    var kappa = 0.0;
    var before = position(slot(end - 1u).neighbour);
    var here = slot(row.first);
    var p = f.origin;
    for (var k = row.first; k < end; k++) {
        var next = k + 1u;
        if next == end {
            next = row.first;
        }
        let after = slot(next);
        let p_after = position(after.neighbour);
        let o = ring_offset(f, p - f.origin);
        let wb = here.w * here.b;
        // All neighbours at one place: no direction.
        var over = 0.0;
        if o.length > 0.0 {
            over = 1.0 / o.length;
        }
        let u = over * o.plane;
        d.offset += wb * o.length;
        d.g += wb * u;
        d.h += wb * o.along * u;
        kappa += wb * over;
        slot_derivatives[k] = SlotDerivative(-wb * u, here.w, p_after - before, here.neighbour);
        before = p;
        p = p_after;
        here = after;
    }
    kappa *= REGULAR / f32(row.count);
    for (var k = row.first; k < end; k++) {
        let s = slot_derivatives[k];
        slot_derivatives[k].z = s.z + kappa * (position(s.neighbour) - f.origin - f.mean);
    }
    row_derivatives[index] = d;
    let value = f.origin + (f.centre + d.offset * f.normal);
    products[index] = row_product(position(row.vertex) - value, d);
}

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let item = span.first + invocation(span, id);
    if item >= span.end {
        return;
    }
    let index = item / params.frames;
    let row = row_of(texel(rows, index));
    if DERIVATIVE {
        linearise(index, row);
    } else {
        let frame = item % params.frames;
        let at = frame * params.vertices;
        products[frame * params.rows + index].value = position(at + row.vertex) - ring_value(row, at);
    }
}
