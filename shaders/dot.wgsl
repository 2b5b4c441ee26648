// Sums of products of vectors in a fixed order: runs of 1,024 entries, each by one workgroup; and
// the runs' sums again, until one is left. Reference: encoding::gradients::dot_product.

//#import lib/span

// Where the vectors lie. Entry i of segment s stands at `first + (s * count + i) * stride`; each
// segment has `runs` runs, and the sum of run r of segment s goes to `to + s * runs + r`.
struct DotParams {
    first_a: u32,
    stride_a: u32,
    first_b: u32,
    stride_b: u32,
    count: u32,
    runs: u32,
    to: u32,
    // Whether the entries of a are sums of an earlier level, in their first component, and b is not
    // looked at.
    again: u32,
}

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: DotParams;
@group(0) @binding(2) var<storage, read> a: array<vec4f>;
@group(0) @binding(3) var<storage, read> b: array<vec4f>;
@group(0) @binding(4) var<storage, read_write> sums: array<vec4f>;

// Entries a lane takes; dot::ITEMS.
const ITEMS: u32 = 16u;

var<workgroup> lanes: array<f32, GROUP>;

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_index) lane: u32) {
    let run = invocation(span, id) / GROUP;
    let segment = run / params.runs;
    let base = (run % params.runs) * GROUP * ITEMS + lane;
    let in_range = run * GROUP * ITEMS < span.end;
    var sum = 0.0;
    for (var k = 0u; k < ITEMS; k++) {
        let i = base + k * GROUP;
        if in_range && i < params.count {
            let at = segment * params.count + i;
            let x = a[params.first_a + at * params.stride_a].xyz;
            if params.again != 0u {
                sum += x.x;
            } else {
                sum += dot(x, b[params.first_b + at * params.stride_b].xyz);
            }
        }
    }
    lanes[lane] = sum;
    workgroupBarrier();
    if lane == 0u && in_range {
        var total = lanes[0];
        for (var l = 1u; l < GROUP; l++) {
            total += lanes[l];
        }
        sums[params.to + run] = vec4f(total, 0.0, 0.0, 0.0);
    }
}
