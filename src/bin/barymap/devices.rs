//! `barymap devices`: adapters, limits and canaries.

use barymap::Result;
use barymap::engine::Engine;
use serde_json::json;

use crate::common::{Common, Session, line};

pub(crate) fn run(common: &Common) -> Result<()> {
    let adapters = Engine::adapters();
    if adapters.is_empty() {
        line("no adapter: install a Vulkan driver (Debian and Ubuntu: apt-get install mesa-vulkan-drivers libvulkan1)");
    }
    for (i, a) in adapters.iter().enumerate() {
        let preferred = if a.preferred { ", taken by auto" } else { "" };
        line(&format!("{i}: {} ({}, {}, {}{preferred})", a.name, a.kind, a.interface, a.driver));
    }
    let session = Session::start(common)?;
    let d = session.engine.description();
    line(&format!("in use: {} ({}, {})", d.name, d.backend, d.driver));
    if let Some(gpu) = session.engine.gpu() {
        let c = gpu.capabilities();
        line(&format!(
            "limits: storage binding {} MiB, uniform binding {} KiB, {} storage buffers a kernel, {} groups a dimension",
            c.max_storage_binding >> 20,
            c.max_uniform_binding >> 10,
            c.max_storage_buffers,
            c.max_groups
        ));
        line(&format!(
            "canaries: loops {} (budget {}), NaN by comparison {}, compensated sums {}",
            if c.truncates_loops { "are cut short by the driver" } else { "run in full" },
            c.loop_budget,
            if c.nan_by_comparison { "seen" } else { "not seen" },
            if c.compensated_sums { "survive" } else { "do not survive" }
        ));
    }
    let mut report = session.report("devices");
    report["adapters"] = json!(
        adapters
            .iter()
            .map(|a| json!({"name": a.name, "driver": a.driver, "kind": a.kind, "interface": a.interface, "preferred": a.preferred}))
            .collect::<Vec<_>>()
    );
    session.write_report(&report)
}
