//! Tests that run kernels. One device serves them all, because every process pays device and
//! compilation anew.
//!
//! Without an adapter each test is skipped and says so; the count is printed, and
//! `BARYMAP_REQUIRE_GPU=1` makes a skipped test a failure.

#[path = "../common/mod.rs"]
mod common;
mod conformance;
mod decode;
mod device;
mod encoding;
mod encoding_bounds;
mod field;
mod live;
mod patterns;
mod plane;
#[path = "../common/plane.rs"]
mod plane_cases;
mod remesh;
mod resident;
#[path = "../common/similar.rs"]
mod similar;
mod similarity;
mod space;
mod surface;
mod transfer;
mod transfer_sample;
#[path = "../common/tube.rs"]
mod tube;
mod warp;
mod warp_preview;
mod warp_resident;

use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

use barymap::engine::{Backend, DeviceLimits, Engine, EngineOptions, Gpu};

static SKIPPED: AtomicUsize = AtomicUsize::new(0);

fn shared(limits: DeviceLimits, cell: &'static OnceLock<Option<Engine>>) -> Option<&'static Engine> {
    let engine = cell.get_or_init(|| {
        match Engine::new(EngineOptions { backend: Backend::Gpu, limits, ..EngineOptions::default() }) {
            Ok(e) => {
                eprintln!("{limits:?} limits on {}", e.description());
                eprintln!("{:?}", e.gpu().map(Gpu::capabilities));
                Some(e)
            }
            Err(e) => {
                eprintln!("{e}");
                None
            }
        }
    });
    if engine.is_none() {
        let n = SKIPPED.fetch_add(1, Ordering::Relaxed) + 1;
        eprintln!("SKIPPED: no adapter ({n} so far)");
        assert!(
            std::env::var_os("BARYMAP_REQUIRE_GPU").is_none(),
            "BARYMAP_REQUIRE_GPU is set and there is no adapter"
        );
    }
    engine.as_ref()
}

/// The device of all tests, with all the adapter has.
pub fn engine() -> Option<&'static Engine> {
    static CELL: OnceLock<Option<Engine>> = OnceLock::new();
    shared(DeviceLimits::Adapter, &CELL)
}

/// A device that can do no more than the smallest ones.
pub fn downlevel() -> Option<&'static Engine> {
    static CELL: OnceLock<Option<Engine>> = OnceLock::new();
    shared(DeviceLimits::Downlevel, &CELL)
}

/// The devices a test runs on; none, counted aloud, without an adapter.
pub fn devices() -> Vec<&'static Gpu> {
    [engine(), downlevel()].into_iter().flatten().filter_map(Engine::gpu).collect()
}
