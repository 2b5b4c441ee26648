//! The form for every browser: nothing waits, the page awaits.

use barymap::Error;
use barymap::conformance;
use barymap::engine::{Backend, BindingKind, Engine, EngineOptions, Gpu, Kernel, reduce};
use wasm_bindgen::prelude::{JsError, wasm_bindgen};

/// Ends a run of values that is no multiple of a group.
const COUNT: usize = 3 * reduce::RUN + 5;

/// A kernel that no compiler takes.
static WRONG: Kernel = Kernel {
    name: "wrong",
    source: "@group(0) @binding(1) var<storage, read_write> out: array<u32>;\n\
             @compute @workgroup_size(1) fn main() { out[0] = 1.5; }",
    bindings: &[BindingKind::Write],
    layouts: &[],
    items: 1,
    constants: &[],
};

/// The first values of `output` after the kernel read `input`.
async fn run(gpu: &Gpu, kernel: &'static Kernel, input: &[f32], count: usize) -> Result<Vec<f32>, Error> {
    let pipeline = gpu.pipeline(kernel)?;
    let (input, output) = (gpu.upload("input", input)?, gpu.buffer::<f32>("output", count)?);
    let bindings = [input.bind(), output.bind()];
    let group = gpu.bind(&pipeline, &bindings[2 - kernel.bindings.len()..])?;
    let mut batch = gpu.batch()?;
    batch.dispatch(&pipeline, &group, input.len())?;
    batch.submit()?;
    gpu.read_async(&output, 0..count).await
}

/// What the engine is; an error where a sum is not that of the processor, to the last bit, or a
/// wrong kernel is not told.
#[wasm_bindgen]
pub async fn awaited() -> Result<String, JsError> {
    let refused = Engine::new(EngineOptions { backend: Backend::Gpu, ..EngineOptions::default() });
    if !matches!(refused, Err(Error::NoAdapter { .. })) {
        return Err(JsError::new("a thread waited for a device"));
    }
    let engine = Engine::start(EngineOptions { backend: Backend::Gpu, ..EngineOptions::default() }).await?;
    let Some(gpu) = engine.gpu() else { return Err(JsError::new("an engine without a device")) };
    let Some(kernel) = conformance::kernels().into_iter().find(|k| k.name == "reduce_sum") else {
        return Err(JsError::new("there is no reduce_sum"));
    };
    let values: Vec<f32> = (0..COUNT as u32).map(|i| (i % 1000) as f32 * 0.37 - 100.0).collect();
    let partial = run(gpu, kernel, &values, COUNT.div_ceil(reduce::RUN)).await?;
    let (found, like) = (reduce::sum(&partial), reduce::sum(&values));
    if found.to_bits() != like.to_bits() {
        return Err(JsError::new(&format!("the device sums to {found}, the processor to {like}")));
    }
    match run(gpu, &WRONG, &[0.0], 1).await {
        Err(e) if e.to_string().contains("kernel wrong") => {}
        told => return Err(JsError::new(&format!("of a wrong kernel was told: {told:?}"))),
    }
    // The engine outlives its objections.
    run(gpu, kernel, &values, 1).await?;
    Ok(engine.description().to_string())
}
