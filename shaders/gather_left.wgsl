// Lists the points that kernels of the map left to the reference, in any order: the host sorts
// them.

//#import lib/span
//#import lib/image
//#import lib/none

@group(0) @binding(0) var<uniform> span: Span;
// A point and the place of its image; no triangle where there is none.
@group(0) @binding(1) var<storage, read> points: array<vec4u>;
@group(0) @binding(2) var<storage, read> images: array<PackedImage>;
// Their number and three words of nothing, then of each its place and the point. What has no room
// is counted.
@group(0) @binding(3) var<storage, read_write> left: array<atomic<u32>>;

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let index = span.first + invocation(span, id);
    if index >= span.end {
        return;
    }
    let point = points[index];
    if point.x != NONE && images[point.w].status == LEFT_TO_REFERENCE {
        let at = 4u + 4u * atomicAdd(&left[0], 1u);
        if at + 3u < arrayLength(&left) {
            atomicStore(&left[at], point.w);
            atomicStore(&left[at + 1u], point.x);
            atomicStore(&left[at + 2u], point.y);
            atomicStore(&left[at + 3u], point.z);
        }
    }
}
