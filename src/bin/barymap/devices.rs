//! `barymap devices`: adapters, limits and canaries.

use barymap::Result;
use barymap::engine::Engine;
use serde_json::json;

use crate::common::{Common, Session};

pub(crate) fn run(common: &Common) -> Result<()> {
    let adapters = Engine::adapters();
    if adapters.is_empty() {
        println!("no adapter: install a Vulkan driver (Debian and Ubuntu: apt-get install mesa-vulkan-drivers libvulkan1)");
    }
    for (i, a) in adapters.iter().enumerate() {
        println!("{i}: {a}");
    }
    let session = Session::start(common)?;
    let d = session.engine.description();
    println!("in use: {} ({}, {})", d.name, d.backend, d.driver);
    if let Some(gpu) = session.engine.gpu() {
        println!("{}", gpu.capabilities());
    }
    let mut report = session.report("devices");
    report["adapters"] = json!(adapters.iter().map(ToString::to_string).collect::<Vec<_>>());
    session.write_report(&report)
}
