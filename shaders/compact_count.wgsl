// Counts the matching items of each run of 1,024. See engine::compact.

//#import lib/span
//#import lib/matching

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> matching: Matching;
@group(0) @binding(2) var<storage, read> words: array<u32>;
@group(0) @binding(3) var<storage, read_write> runs: array<u32>;

// Items a lane takes; compact::ITEMS.
const ITEMS: u32 = 16u;

var<workgroup> count: atomic<u32>;

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_index) lane: u32) {
    let run = invocation(span, id) / GROUP;
    let base = run * GROUP * ITEMS + lane;
    var mine = 0u;
    for (var k = 0u; k < ITEMS; k++) {
        let i = base + k * GROUP;
        if i < span.end {
            if (words[i * matching.stride + matching.offset] & matching.mask) == matching.value {
                mine += 1u;
            }
        }
    }
    atomicAdd(&count, mine);
    workgroupBarrier();
    if lane == 0u && run * GROUP * ITEMS < span.end {
        runs[run] = atomicLoad(&count);
    }
}
