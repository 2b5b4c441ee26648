// Which triangle of a lattice each pixel shows: the last of those that cover it, as one plus its
// number. Triangles over many pixels are left to paint_wide. Reference: mapping::plane::Preimages.

//#import lib/span
//#import lib/table
//#import lib/lattice

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: LatticeParams;
// Of each triangle its nodes, then what show_lattice reads.
@group(0) @binding(2) var triangles: texture_2d<u32>;
@group(0) @binding(3) var<storage, read> images: array<vec2f>;
@group(0) @binding(4) var<storage, read_write> owners: array<atomic<u32>>;
// Their count, then the triangles over many pixels, in any order.
@group(0) @binding(5) var<storage, read_write> wide: array<atomic<u32>>;

// Most columns, and rows, of a triangle that is painted here: tools::warp::gpu::lattice::NARROW.
const NARROW: u32 = 64u;

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let t = span.first + invocation(span, id);
    if t >= span.end {
        return;
    }
    let q = corners(t);
    let b = box(q);
    if !b.any {
        return;
    }
    if any(b.high - b.low >= vec2u(NARROW)) {
        let slot = atomicAdd(&wide[0], 1u);
        atomicStore(&wide[slot + 1u], t);
        return;
    }
    for (var y = b.low.y; y <= b.high.y; y++) {
        let ends = chord(q, f32(y));
        let first = u32(max(ends.x, 0.0));
        let end = u32(max(min(ends.y, f32(params.size.x) - 1.0) + 1.0, 0.0));
        let row = y * params.size.x;
        for (var x = first; x < end; x++) {
            atomicMax(&owners[row + x], t + 1u);
        }
    }
}
