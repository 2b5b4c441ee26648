//! `barymap devices`: adapters, limits and canaries; with `--check` every kernel beside its
//! reference.

use clap::Args;
use serde_json::{Value, json};

use crate::cli::common::{Common, Session, line};
use crate::conformance::{checks, faults, kernels};
use crate::engine::Backend;
use crate::engine::{Engine, Gpu};
use crate::{Error, Result};

#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// Run every kernel beside its reference on generated data, in a minute or two: errors, times,
    /// and `N passed, N failed`. Takes any adapter, a software one too; exit 3 where one failed
    #[arg(long)]
    check: bool,
}

pub(crate) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    if arguments.check && common.backend == Backend::Auto {
        // A check is for the device, whatever `auto` would take.
        let common = Common { backend: Backend::Gpu, ..common.clone() };
        return show(&common, true);
    }
    show(common, arguments.check)
}

fn show(common: &Common, check: bool) -> Result<()> {
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
    if !check {
        return session.write_report(&report);
    }
    let Some(gpu) = session.engine.gpu() else {
        return Err(Error::option(
            "--backend",
            "no device to check",
            "Leave it out, or give gpu: --check runs kernels",
        ));
    };
    let (rows, failed) = compare(&session.engine, gpu);
    report["checks"] = json!(rows);
    session.write_report(&report)?;
    if failed == 0 {
        return Ok(());
    }
    Err(Error::unusable(
        format!("{failed} checks of {} failed", session.engine.description().name),
        "Update its driver, take another with --adapter, or use --backend cpu",
    ))
}

/// A line for every kernel that cannot run and for every comparison; how many failed.
fn compare(engine: &Engine, gpu: &Gpu) -> (Vec<Value>, usize) {
    let (mut rows, mut passed, mut failed) = (Vec::new(), 0, 0);
    let mut count = |good: bool| if good { passed += 1 } else { failed += 1 };
    for kernel in kernels() {
        let faults = faults(kernel, gpu);
        count(faults.is_empty());
        for fault in &faults {
            line(&format!("FAILED {}: {fault}", kernel.name));
        }
        rows.push(json!({"kernel": kernel.name, "faults": faults}));
    }
    line(&format!("{} kernels are valid and compiled", rows.iter().filter(|r| r["faults"] == json!([])).count()));
    for check in checks() {
        let run = check.run(engine);
        let good = run.as_ref().is_ok_and(|o| check.passes(o));
        count(good);
        let verdict = if good { "passed" } else { "FAILED" };
        match run {
            Ok(o) => {
                let (device, cpu) = (o.device.as_secs_f64(), o.cpu.as_secs_f64());
                let again = if o.repeats { "" } else { "; not the same bytes on every run" };
                line(&format!(
                    "{verdict} {:28} error {:8.1e} of {:.1e} {}; {:.1} ms, CPU {:.1} ms, {:.2} x{again}",
                    check.name,
                    o.error,
                    check.tolerance,
                    check.unit,
                    1e3 * device,
                    1e3 * cpu,
                    device / cpu
                ));
                rows.push(json!({"check": check.name, "kernels": check.kernels, "passed": good, "error": o.error,
                    "tolerance": check.tolerance, "unit": check.unit, "repeats": o.repeats, "seconds": device,
                    "cpu_seconds": cpu}));
            }
            Err(e) => {
                line(&format!("{verdict} {:28} {e}", check.name));
                rows.push(
                    json!({"check": check.name, "kernels": check.kernels, "passed": false, "fault": e.to_string()}),
                );
            }
        }
    }
    line(&format!("{passed} passed, {failed} failed"));
    (rows, failed)
}
