// As paint_lattice, of triangles over many pixels: a workgroup has a tile of the canvas, and looks
// for the triangles that reach it.

//#import lib/span
//#import lib/table
//#import lib/lattice

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: LatticeParams;
@group(0) @binding(2) var triangles: texture_2d<u32>;
@group(0) @binding(3) var<storage, read> images: array<vec2f>;
@group(0) @binding(4) var<storage, read_write> owners: array<u32>;
@group(0) @binding(5) var<storage, read> wide: array<u32>;

// Rows of a tile, whose columns are as many as a workgroup's invocations:
// tools::warp::gpu::lattice::TILE_ROWS.
const TILE_ROWS: u32 = 16u;

var<workgroup> count: u32;
// Of the triangles looked at those that reach the tile, as one plus their number; 0 for others.
var<workgroup> reaching: array<u32, GROUP>;

@compute @workgroup_size(GROUP)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    // Workgroups go over the tiles; the span has the part of the list that is looked at.
    let across = (params.size.x + GROUP - 1u) / GROUP;
    let low = vec2u(group.x % across * GROUP, group.x / across * TILE_ROWS);
    let end_of_tile = min(low + vec2u(GROUP, TILE_ROWS), params.size);
    if lane == 0u {
        count = wide[0];
    }
    let end = min(span.end, workgroupUniformLoad(&count));
    let x = low.x + lane;
    for (var first = span.first; first < end; first += GROUP) {
        var found = 0u;
        if first + lane < end {
            let t = wide[first + lane + 1u];
            let b = box(corners(t));
            if b.any && all(b.low < end_of_tile) && all(b.high >= low) {
                found = t + 1u;
            }
        }
        reaching[lane] = found;
        workgroupBarrier();
        let many = min(GROUP, end - first);
        for (var k = 0u; k < many; k++) {
            let t = reaching[k];
            if t == 0u || x >= params.size.x {
                continue;
            }
            let q = corners(t - 1u);
            for (var y = low.y; y < end_of_tile.y; y++) {
                let ends = chord(q, f32(y));
                if f32(x) >= ends.x && f32(x) <= ends.y {
                    let at = y * params.size.x + x;
                    owners[at] = max(owners[at], t);
                }
            }
        }
        workgroupBarrier();
    }
}
