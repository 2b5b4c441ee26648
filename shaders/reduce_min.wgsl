// The smallest of each run of 1,024 values and the lowest index it stands at. Reference:
// engine::reduce::min.

//#import lib/span

struct Candidate {
    value: f32,
    index: u32,
}

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<storage, read> values: array<f32>;
@group(0) @binding(2) var<storage, read_write> partial: array<Candidate>;

// Values a lane takes; reduce::ITEMS.
const ITEMS: u32 = 16u;

var<workgroup> lanes: array<Candidate, GROUP>;

fn least(a: Candidate, b: Candidate) -> Candidate {
    if b.value < a.value || (b.value == a.value && b.index < a.index) {
        return b;
    }
    return a;
}

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_index) lane: u32) {
    let run = invocation(span, id) / GROUP;
    let base = span.first + run * GROUP * ITEMS + lane;
    var best = Candidate(3.4028234e38, 0xffffffffu);
    for (var k = 0u; k < ITEMS; k++) {
        let i = base + k * GROUP;
        if i < span.end {
            best = least(best, Candidate(values[i], i));
        }
    }
    lanes[lane] = best;
    workgroupBarrier();
    if lane == 0u && span.first + run * GROUP * ITEMS < span.end {
        var first = lanes[0];
        for (var l = 1u; l < GROUP; l++) {
            first = least(first, lanes[l]);
        }
        partial[run] = first;
    }
}
