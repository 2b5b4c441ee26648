// Puts images that the host found where those of the kernels lie.

//#import lib/span
//#import lib/image

// An image and its place. Twin: tools::transfer::gpu::exchange::Found.
struct Found {
    place: u32,
    image: PackedImage,
}

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<storage, read> found: array<Found>;
@group(0) @binding(2) var<storage, read_write> images: array<PackedImage>;

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let index = span.first + invocation(span, id);
    if index >= span.end {
        return;
    }
    images[found[index].place] = found[index].image;
}
