// Vertices of the levels of splits from their rings. Reference: encoding::decode::split_level. An
// invocation sets a vertex of one shape; or, for levels too narrow to fill a dispatch, one
// workgroup takes a shape through all of them.

//#import lib/span
//#import lib/table
//#import lib/encoding

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: EncodingParams;
@group(0) @binding(2) var rows: texture_2d<u32>;
@group(0) @binding(3) var slots: texture_2d<u32>;
// First row of each level, and one past the last.
@group(0) @binding(4) var<storage, read> levels: array<u32>;
// Shape after shape.
@group(0) @binding(5) var<storage, read_write> positions: array<vec4f>;

// Whether the items are levels, one workgroup a shape; else rows, each for all shapes in turn.
override NARROW: bool = false;

fn position(v: u32) -> vec3f {
    return positions[v].xyz;
}

fn slot(k: u32) -> Slot {
    return slot_of(texel(slots, k));
}

fn place(row: u32, frame: u32) {
    let at = frame * params.vertices;
    positions[at + params.base + row] = vec4f(ring_value(row_of(texel(rows, row)), at), 0.0);
}

@compute @workgroup_size(GROUP)
fn main(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    if NARROW {
        for (var level = span.first; level < span.end; level++) {
            let end = levels[level + 1u];
            for (var row = levels[level] + lane; row < end; row += GROUP) {
                place(row, group.x);
            }
            storageBarrier();
        }
    } else {
        let item = span.first + invocation(span, id);
        if item < span.end {
            place(item / params.frames, item % params.frames);
        }
    }
}
