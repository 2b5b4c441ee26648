//! A kernel of your own on barymap's engine: a buffer up, one dispatch, a sum in a fixed order, a
//! buffer down, and the same on the CPU.
//!
//! `cargo run --release --example first_kernel`

#[path = "shared/device.rs"]
mod device;

use std::error::Error;

use barymap::engine::{BindingKind, Kernel, reduce, reflect};

/// Each invocation works on one item. Binding 0 is always the span of items; `lib/span` finds the
/// number of an invocation in it.
static SQUARE: Kernel = Kernel {
    name: "square",
    source: "
//#import lib/span

@group(0) @binding(0) var<uniform> span: Span;
@group(0) @binding(1) var<storage, read> values: array<f32>;
@group(0) @binding(2) var<storage, read_write> squares: array<f32>;

@compute @workgroup_size(GROUP)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let i = span.first + invocation(span, id);
    if i < span.end {
        squares[i] = values[i] * values[i];
    }
}
",
    bindings: &[BindingKind::Read, BindingKind::Write],
    layouts: &[],
    items: 1,
    constants: &[],
};

fn main() -> Result<(), Box<dyn Error>> {
    // naga reads the text and holds it against the description; no device is needed for that.
    let faults = reflect::faults(&SQUARE);
    assert!(faults.is_empty(), "{faults:?}");

    let engine = device::engine()?;
    let values: Vec<f32> = (0..100_000u32).map(|i| (i % 1000) as f32 / 1000.0).collect();
    let expected: Vec<f32> = values.iter().map(|x| x * x).collect();
    let Some(gpu) = engine.gpu() else {
        println!("no device: the sum is {}", reduce::sum(&expected));
        return Ok(());
    };

    let from = gpu.upload("values", &values)?;
    let to = gpu.buffer::<f32>("squares", values.len())?;
    let pipeline = gpu.pipeline(&SQUARE)?;
    let group = gpu.bind(&pipeline, &[from.bind(), to.bind()])?;
    let mut batch = gpu.batch()?;
    batch.dispatch(&pipeline, &group, values.len())?;
    batch.submit()?;

    assert_eq!(gpu.read(&to, 0..values.len())?, expected);
    // Sums have a fixed order: the same bits on every device and on the CPU.
    let sum = gpu.sum(&to, values.len())?;
    assert_eq!(sum.to_bits(), reduce::sum(&expected).to_bits());
    println!("{} squares, their sum is {sum}", values.len());
    println!("{:?}", gpu.traffic());
    Ok(())
}
