// Turns the counts of all runs into the offsets they start at; one workgroup. See engine::compact.

//#import lib/span

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<storage, read_write> runs: array<u32>;
@group(0) @binding(2) var<storage, read_write> list: array<u32>;

var<workgroup> lanes: array<u32, GROUP>;

@compute @workgroup_size(GROUP)
fn main(@builtin(local_invocation_index) lane: u32) {
    let share = (span.end + GROUP - 1u) / GROUP;
    let first = min(lane * share, span.end);
    let end = min(first + share, span.end);
    var sum = 0u;
    for (var i = first; i < end; i++) {
        sum += runs[i];
    }
    lanes[lane] = sum;
    workgroupBarrier();
    var offset = 0u;
    for (var l = 0u; l < lane; l++) {
        offset += lanes[l];
    }
    for (var i = first; i < end; i++) {
        let count = runs[i];
        runs[i] = offset;
        offset += count;
    }
    if lane == GROUP - 1u {
        list[0] = offset;
    }
}
