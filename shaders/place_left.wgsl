// Where the few pixels look that no polynomial is bounded at: what the host found for them comes to
// its places. It only copies.

//#import lib/span
//#import lib/place

// Twin: tools::warp::gpu::place::LeftRecord.
struct LeftRecord {
    // The number of the pixel, and its share.
    pixel: u32,
    share: f32,
    place: PlaceRecord,
}

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<storage, read> left: array<LeftRecord>;
@group(0) @binding(2) var<storage, read_write> places: array<PlaceRecord>;
@group(0) @binding(3) var<storage, read_write> shares: array<vec2f>;

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let item = span.first + invocation(span, id);
    if item >= span.end {
        return;
    }
    let record = left[item];
    places[record.pixel] = record.place;
    shares[record.pixel].x = record.share;
}
