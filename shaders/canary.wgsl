// Tries what kernels rely on and what drivers are known to break (engine::device::canary,
// engine::device::learned).

//#import lib/span

struct CanaryParams {
    loop_count: u32,
    nan_bits: u32,
    two_sum_a: f32,
    two_sum_b: f32,
}

struct CanaryResult {
    added: atomic<u32>,
    largest: atomic<u32>,
    smallest: atomic<u32>,
    exchanged: u32,
    loop_count: u32,
    nan_differs: u32,
    nan_by_bits: u32,
    two_sum_bits: u32,
}

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<uniform> params: CanaryParams;
@group(0) @binding(2) var<storage, read_write> result: CanaryResult;

var<workgroup> shared_value: u32;

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let lane = invocation(span, id);
    atomicAdd(&result.added, lane + 1u);
    atomicMax(&result.largest, lane + 1u);
    atomicMin(&result.smallest, lane + 1u);
    if lane == GROUP - 1u {
        shared_value = lane + 1u;
    }
    workgroupBarrier();
    if lane == 0u {
        result.exchanged = shared_value;
        let x = bitcast<f32>(params.nan_bits);
        result.nan_differs = select(0u, 1u, x != x);
        let bits = bitcast<u32>(x);
        result.nan_by_bits = select(0u, 1u, (bits & 0x7fffffffu) > 0x7f800000u);
        let sum = params.two_sum_a + params.two_sum_b;
        let b = sum - params.two_sum_a;
        result.two_sum_bits = bitcast<u32>((params.two_sum_a - (sum - b)) + (params.two_sum_b - b));
    }
    // Last, because a driver that ends loops early counts all loops of a kernel together.
    var count = 0u;
    for (var i = 0u; i < params.loop_count; i++) {
        // Without a store the compiler could replace the loop by its result.
        count = count ^ (i + (count << 1u));
        if lane == 0u {
            result.loop_count = i + 1u;
        }
    }
    if lane == GROUP {
        result.loop_count = count;
    }
}
