//! The device that an example runs its kernels on.

use barymap::Result;
use barymap::engine::{Backend, Engine, EngineOptions};

/// The best adapter, a software one too; the CPU where there is none. Prints which.
pub(crate) fn engine() -> Result<Engine> {
    let engine = match Engine::new(EngineOptions { backend: Backend::Gpu, ..EngineOptions::default() }) {
        Ok(engine) => engine,
        Err(error) => {
            println!("{error}");
            Engine::cpu()
        }
    };
    println!("runs on {}", engine.description());
    Ok(engine)
}
