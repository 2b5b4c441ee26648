//! What users with a new device run: every kernel beside its reference, on generated data.

use std::collections::BTreeSet;

use barymap::conformance::{checks, faults, kernels};
use barymap::engine::{Backend, DeviceLimits, Engine, EngineOptions};

use crate::{devices, engine};

#[test]
fn every_kernel_is_valid_and_compiles() {
    for gpu in devices() {
        for kernel in kernels() {
            assert_eq!(faults(kernel, gpu), Vec::<String>::new(), "{}", kernel.name);
        }
    }
}

#[test]
fn every_check_passes_and_together_they_run_every_kernel() {
    if engine().is_none() {
        return;
    }
    for limits in [DeviceLimits::Adapter, DeviceLimits::Downlevel] {
        let own = Engine::new(EngineOptions { backend: Backend::Gpu, limits, ..EngineOptions::default() }).unwrap();
        for check in checks() {
            let outcome = check.run(&own).unwrap();
            println!("{}: {outcome:?}", check.name);
            assert!(check.passes(&outcome), "{}: {outcome:?} of {:e}", check.name, check.tolerance);
        }
        let ran: BTreeSet<&str> = own.gpu().unwrap().compiled().into_iter().collect();
        let all: BTreeSet<&str> = kernels().iter().map(|k| k.name).collect();
        assert_eq!(ran, all, "{limits:?}");
    }
}
