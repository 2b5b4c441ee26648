//! What a caller chooses about where kernels run.

use std::time::Duration;

use crate::words::words;

/// Where the work is done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Backend {
    /// The best hardware adapter; the CPU, with a note, where there is none.
    #[default]
    Auto,
    /// An adapter (a software one counts); an error where there is none.
    Gpu,
    /// The CPU references in single precision, in parallel.
    Cpu,
    /// The CPU references in double precision.
    Reference,
}

words! { Backend, "backend", "a back end":
    Auto => "auto",
    Gpu => "gpu",
    Cpu => "cpu",
    Reference => "reference",
}

/// Which limits an owned device is created with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DeviceLimits {
    /// All the adapter has.
    #[default]
    Adapter,
    /// No more than the smallest devices offer (four storage buffers per kernel, uniform blocks of
    /// 16 KiB).
    Downlevel,
}

/// Options of [`Engine::new`](super::Engine::new).
///
/// | field | default | meaning |
/// |---|---|---|
/// | `backend` | `Auto` | where kernels run |
/// | `adapter` | none | part of an adapter's name, upper or lower case alike; `WGPU_ADAPTER_NAME` is used where it is not given |
/// | `memory` | none | bytes of device memory that may be held at once |
/// | `limits` | `Adapter` | limits of the device |
/// | `timeout` | 60 s | longest wait for one submission |
/// | `cpu_stages` | empty | names of kernels that stay on the CPU, to bisect a fault of a driver |
#[derive(Clone, Debug)]
pub struct EngineOptions {
    /// Where kernels run.
    pub backend: Backend,
    /// Part of an adapter's name.
    pub adapter: Option<String>,
    /// Bytes of device memory that may be held at once.
    pub memory: Option<u64>,
    /// Limits of the device.
    pub limits: DeviceLimits,
    /// Longest wait for one submission.
    pub timeout: Duration,
    /// Names of kernels that stay on the CPU.
    pub cpu_stages: Vec<String>,
}

impl Default for EngineOptions {
    fn default() -> Self {
        Self {
            backend: Backend::Auto,
            adapter: None,
            memory: None,
            limits: DeviceLimits::Adapter,
            // A software adapter on a busy machine needs many times what a time slice is planned
            // for.
            timeout: Duration::from_secs(60),
            cpu_stages: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_read_back_and_others_refused() {
        for b in [Backend::Auto, Backend::Gpu, Backend::Cpu, Backend::Reference] {
            assert_eq!(b.to_string().parse::<Backend>().unwrap(), b);
        }
        let refused = "cuda".parse::<Backend>().unwrap_err().to_string();
        assert!(refused.contains("cuda") && refused.contains("reference"), "{refused}");
    }
}
