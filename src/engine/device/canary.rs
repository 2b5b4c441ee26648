//! The start-up test of a device: `shaders/canary.wgsl` tries what kernels rely on and what drivers
//! are known to break.

use super::gpu::Gpu;
use super::learned::{CANARY_LOOP, Canary, TWO_SUM};
use crate::engine::kernel::{BindingKind, GROUP, Kernel, Layout, layout};
use crate::error::Result;

/// What the canary is given; all of it comes from memory, so that nothing is worked out by the
/// shader compiler.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
struct CanaryParams {
    loop_count: u32,
    nan_bits: u32,
    two_sum_a: f32,
    two_sum_b: f32,
}

/// What the canary writes.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, bytemuck::Pod, bytemuck::Zeroable)]
struct CanaryResult {
    added: u32,
    largest: u32,
    smallest: u32,
    exchanged: u32,
    loop_count: u32,
    nan_differs: u32,
    nan_by_bits: u32,
    two_sum_bits: u32,
}

const LAYOUTS: &[Layout] = &[
    layout!(CanaryParams, { loop_count, nan_bits, two_sum_a, two_sum_b }),
    layout!(CanaryResult, {
        added, largest, smallest, exchanged, loop_count, nan_differs, nan_by_bits, two_sum_bits
    }),
];

pub(in crate::engine) static CANARY: Kernel = Kernel {
    name: "canary",
    source: include_str!("../../../shaders/canary.wgsl"),
    bindings: &[BindingKind::Uniform(size_of::<CanaryParams>() as u64), BindingKind::Write],
    layouts: LAYOUTS,
    items: 1,
    constants: &[],
};

/// Runs the canary on one workgroup and records what it found.
pub(super) async fn run(gpu: &mut Gpu) -> Result<()> {
    let params = CanaryParams {
        loop_count: CANARY_LOOP,
        nan_bits: f32::NAN.to_bits(),
        two_sum_a: TWO_SUM[0],
        two_sum_b: TWO_SUM[1],
    };
    let pipeline = gpu.pipeline(&CANARY)?;
    let params = gpu.uniform("canary", &params)?;
    let result = gpu.upload("canary", &[CanaryResult { smallest: u32::MAX, ..Default::default() }])?;
    let group = gpu.bind(&pipeline, &[params.bind(0), result.bind()])?;
    let mut batch = gpu.batch()?;
    batch.dispatch(&pipeline, &group, GROUP as usize)?;
    batch.submit()?;
    let Some(r) = gpu.read_async(&result, 0..1).await?.into_iter().next() else { return Ok(()) };
    let found = Canary {
        loop_count: r.loop_count,
        added: r.added,
        largest: r.largest,
        smallest: r.smallest,
        nan_differs: r.nan_differs,
        nan_by_bits: r.nan_by_bits,
        two_sum_bits: r.two_sum_bits,
        exchanged: r.exchanged,
    };
    gpu.capabilities.learn(found, GROUP)
}
