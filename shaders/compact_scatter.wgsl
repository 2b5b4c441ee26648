// Writes the indices of the matching items of each run, in order, from the run's offset on. See
// engine::compact.

//#import lib/span
//#import lib/matching

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> matching: Matching;
@group(0) @binding(2) var<storage, read> words: array<u32>;
@group(0) @binding(3) var<storage, read> runs: array<u32>;
@group(0) @binding(4) var<storage, read_write> list: array<u32>;

// Items a lane takes, here one after the other so that the order is kept; compact::ITEMS.
const ITEMS: u32 = 16u;

var<workgroup> lanes: array<u32, GROUP>;

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_index) lane: u32) {
    let run = invocation(span, id) / GROUP;
    let base = run * GROUP * ITEMS + lane * ITEMS;
    var found = 0u;
    for (var k = 0u; k < ITEMS; k++) {
        let i = base + k;
        if i < span.end {
            if (words[i * matching.stride + matching.offset] & matching.mask) == matching.value {
                found |= 1u << k;
            }
        }
    }
    lanes[lane] = countOneBits(found);
    workgroupBarrier();
    if found == 0u {
        return;
    }
    var offset = runs[run];
    for (var l = 0u; l < lane; l++) {
        offset += lanes[l];
    }
    for (var k = 0u; k < ITEMS; k++) {
        if (found & (1u << k)) != 0u {
            list[offset + 1u] = base + k;
            offset += 1u;
        }
    }
}
