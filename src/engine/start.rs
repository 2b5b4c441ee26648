//! The engine: which back end does the work, and how it says so.

use std::fmt;
use std::sync::Arc;

use super::adapter::AdapterSummary;
use super::device::{self, Gpu};
use super::options::{Backend, EngineOptions};
use crate::error::Result;

/// Where kernels run. Cheap to clone; clones share the device.
#[derive(Clone, Debug)]
pub struct Engine {
    pub(super) backend: Backend,
    pub(super) gpu: Option<Arc<Gpu>>,
    pub(super) description: Description,
    pub(super) note: Option<String>,
    pub(super) cpu_stages: Vec<String>,
}

/// Who computed a result, as reports give it.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Description {
    /// `gpu`, `cpu` or `reference`.
    pub backend: String,
    /// Name of the adapter or processor.
    pub name: String,
    /// Driver and version, or the threads used.
    pub driver: String,
}

impl fmt::Display for Description {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {} ({})", self.backend, self.name, self.driver)
    }
}

impl Engine {
    /// An engine as the options ask for.
    ///
    /// `Auto` takes the best hardware adapter; where there is none, or it cannot be started, the
    /// CPU does the work and [`Engine::note`] says so. A software adapter is taken by `Gpu` or by
    /// its name. An adapter asked for by name must exist.
    ///
    /// # Errors
    /// [`Error::NoAdapter`](crate::Error::NoAdapter) if a named adapter, or for `Gpu` any adapter,
    /// is missing; [`Error::Device`](crate::Error::Device) if it cannot be started.
    ///
    /// # Examples
    /// ```
    /// use barymap::engine::{Backend, Engine, EngineOptions};
    /// let engine = Engine::new(EngineOptions { backend: Backend::Cpu, ..EngineOptions::default() })?;
    /// assert!(engine.gpu().is_none());
    /// # Ok::<(), barymap::Error>(())
    /// ```
    pub fn new(options: EngineOptions) -> Result<Self> {
        match options.backend {
            Backend::Cpu | Backend::Reference => Ok(Self::on_cpu(options.backend)),
            wanted => {
                let started = Self::on_adapter(&options, wanted == Backend::Gpu);
                Self::or_cpu(&options, started)
            }
        }
    }

    /// [`Engine::new`] for a browser, where a thread cannot wait for a device. Elsewhere the thread
    /// is kept, as by [`Engine::new`].
    ///
    /// On such an engine await [`Gpu::read_async`]; what reads results otherwise, as the jobs in
    /// [`tools`](crate::tools) do, fails in a browser.
    ///
    /// # Errors
    /// As [`Engine::new`].
    pub async fn start(options: EngineOptions) -> Result<Self> {
        match options.backend {
            Backend::Cpu | Backend::Reference => Ok(Self::on_cpu(options.backend)),
            wanted => {
                let started = Self::start_adapter(&options, wanted == Backend::Gpu).await;
                Self::or_cpu(&options, started)
            }
        }
    }

    /// What was started; or the CPU, where the options leave the choice.
    fn or_cpu(options: &EngineOptions, started: Result<Self>) -> Result<Self> {
        match started {
            Err(e) if options.backend == Backend::Auto && options.adapter.is_none() => {
                Ok(Self { note: Some(format!("working on the CPU: {e}")), ..Self::on_cpu(Backend::Cpu) })
            }
            started => started,
        }
    }

    /// The CPU references in single precision.
    pub fn cpu() -> Self {
        Self::on_cpu(Backend::Cpu)
    }

    /// The CPU references in double precision.
    pub fn reference() -> Self {
        Self::on_cpu(Backend::Reference)
    }

    /// All adapters of this machine, best first; empty where no driver is installed.
    pub fn adapters() -> Vec<AdapterSummary> {
        device::adapters()
    }

    /// The back end at work: never `Auto`.
    pub fn backend(&self) -> Backend {
        self.backend
    }

    /// The device, if kernels run on one.
    pub fn gpu(&self) -> Option<&Gpu> {
        self.gpu.as_deref()
    }

    /// The device that runs the stage called `stage`; `None` if it runs on the CPU, because the
    /// whole engine does or because the options keep this stage there.
    pub fn gpu_for(&self, stage: &str) -> Option<&Gpu> {
        if self.cpu_stages.iter().any(|s| s == stage) { None } else { self.gpu() }
    }

    /// Who computes, for reports.
    pub fn description(&self) -> &Description {
        &self.description
    }

    /// One line to show the user, if `Auto` fell back to the CPU.
    pub fn note(&self) -> Option<&str> {
        self.note.as_deref()
    }

    fn on_cpu(backend: Backend) -> Self {
        let threads = rayon::current_num_threads();
        let description = Description {
            backend: backend.word().into(),
            name: format!("{} processor", std::env::consts::ARCH),
            driver: format!("{threads} thread{}", if threads == 1 { "" } else { "s" }),
        };
        Self { backend, gpu: None, description, note: None, cpu_stages: Vec::new() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_processor_needs_no_adapter() {
        for b in [Backend::Cpu, Backend::Reference] {
            let e = Engine::new(EngineOptions { backend: b, ..EngineOptions::default() }).unwrap();
            assert_eq!((e.backend(), e.description().backend.as_str()), (b, b.word()));
            assert!(e.gpu().is_none() && e.note().is_none() && e.gpu_for("average_anchors").is_none());
        }
    }
}
