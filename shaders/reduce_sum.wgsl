// Sums runs of 1,024 values in a fixed order. Reference: engine::reduce::sum.

//#import lib/span

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<storage, read> values: array<f32>;
@group(0) @binding(2) var<storage, read_write> partial: array<f32>;

// Values a lane takes; reduce::ITEMS.
const ITEMS: u32 = 16u;

var<workgroup> lanes: array<f32, GROUP>;

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_index) lane: u32) {
    let run = invocation(span, id) / GROUP;
    let base = span.first + run * GROUP * ITEMS + lane;
    var sum = 0.0;
    for (var k = 0u; k < ITEMS; k++) {
        let i = base + k * GROUP;
        if i < span.end {
            sum += values[i];
        }
    }
    lanes[lane] = sum;
    workgroupBarrier();
    if lane == 0u && span.first + run * GROUP * ITEMS < span.end {
        var total = lanes[0];
        for (var l = 1u; l < GROUP; l++) {
            total += lanes[l];
        }
        partial[run] = total;
    }
}
