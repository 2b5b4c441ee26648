//! Every kernel passes Tint, the compiler of WGSL in Chromium, which is stricter than naga; and the
//! driver behind it compiles it in a time that a page can wait for.

use barymap::conformance;
use barymap::engine::{BindingKind, Composed, GROUP, Kernel, Span};
use serde_json::{Value, json};

use super::server::Files;
use super::visit;

const PAGE: &str = "<!doctype html><title>kernels</title><script type=module src=/kernels.js></script>";

/// A binding as WebGPU describes it.
fn entry((binding, kind): (usize, &BindingKind)) -> Value {
    let buffer = |kind: &str| json!({ "buffer": { "type": kind } });
    let mut entry = match kind {
        BindingKind::Uniform(bytes) => json!({ "buffer": { "type": "uniform", "minBindingSize": bytes } }),
        BindingKind::Read => buffer("read-only-storage"),
        BindingKind::Write => buffer("storage"),
        BindingKind::Table => json!({ "texture": { "sampleType": "uint" } }),
        BindingKind::Texture => json!({ "texture": { "sampleType": "float" } }),
        BindingKind::Sampler => json!({ "sampler": { "type": "filtering" } }),
        BindingKind::Canvas => json!({ "storageTexture": { "access": "write-only", "format": "rgba8unorm" } }),
    };
    entry["binding"] = binding.into();
    // GPUShaderStage.COMPUTE.
    entry["visibility"] = 4.into();
    entry
}

/// A kernel as the engine hands it to a device.
fn described(kernel: &Kernel, composed: &Composed) -> Value {
    let span = json!({
        "binding": 0, "visibility": 4,
        "buffer": { "type": "uniform", "hasDynamicOffset": true, "minBindingSize": size_of::<Span>() },
    });
    let entries: Vec<Value> = std::iter::once(span).chain((1..).zip(kernel.bindings).map(entry)).collect();
    let mut constants = json!({ "GROUP": GROUP });
    for (name, value) in kernel.constants {
        constants[*name] = json!(value);
    }
    json!({ "name": kernel.name, "code": composed.text, "constants": constants, "entries": entries })
}

/// A kernel's text with a fault that only a compiler sees.
fn misspelt(kernel: &Kernel, composed: &Composed) -> Value {
    let mut wrong = described(kernel, composed);
    wrong["code"] = format!("{}\nfn wrong() -> u32 {{ return 1.5; }}\n", composed.text).into();
    wrong
}

/// A kernel without the last of its bindings.
fn unbound(kernel: &Kernel, composed: &Composed) -> Value {
    let mut wrong = described(kernel, composed);
    wrong["entries"].as_array_mut().unwrap().pop();
    wrong
}

/// What was said of a kernel, with the places in our files.
fn faults(name: &str, composed: &Composed, found: &Value) -> Vec<String> {
    let sentence = |fault: &Value| {
        let line = fault["line"].as_u64().unwrap() as usize;
        format!("{name}, {}: {}", composed.origin(line), fault["text"].as_str().unwrap())
    };
    found["faults"].as_array().unwrap().iter().map(sentence).collect()
}

#[test]
fn every_kernel_passes_tint() {
    let kernels = conformance::kernels();
    let composed: Vec<Composed> = kernels.iter().map(|k| k.compose().unwrap()).collect();
    let mut sent: Vec<Value> = kernels.iter().zip(&composed).map(|(k, c)| described(k, c)).collect();
    sent.extend([misspelt(kernels[0], &composed[0]), unbound(kernels[0], &composed[0])]);
    let files = Files::from([
        ("/".into(), ("text/html", PAGE.into())),
        ("/kernels.js".into(), ("text/javascript", include_bytes!("kernels.js").to_vec())),
        ("/kernels".into(), ("application/json", serde_json::to_vec(&sent).unwrap())),
    ]);
    let Some(told) = visit(files) else { return };
    let Some(found) = told["found"].as_array() else { panic!("{told}") };
    let (found, wrong) = found.split_at(kernels.len());
    assert_eq!(wrong.len(), 2);
    assert!(wrong.iter().all(|w| !faults("", &composed[0], w).is_empty()), "a wrong kernel passes: {wrong:?}");

    let mut times: Vec<(u64, String)> = Vec::new();
    let mut all = Vec::new();
    for ((kernel, composed), found) in kernels.iter().zip(&composed).zip(found) {
        all.extend(faults(kernel.name, composed, found));
        let constants: Vec<String> = kernel.constants.iter().map(|(name, x)| format!("{name}={x}")).collect();
        let time = found["milliseconds"].as_f64().unwrap() as u64;
        times.push((time, format!("{} {}", kernel.name, constants.join(" "))));
    }
    times.sort();
    println!("{} kernels on {}, slowest:", kernels.len(), told["adapter"]);
    times.iter().rev().take(8).for_each(|(time, name)| println!("{time:6} ms  {name}"));
    assert!(all.is_empty(), "{}", all.join("\n"));
}
