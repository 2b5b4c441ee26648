//! What is said of an adapter.

use std::fmt;

/// One adapter of this machine, as `barymap devices` lists it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AdapterSummary {
    /// Name as the driver gives it.
    pub name: String,
    /// Driver and its version.
    pub driver: String,
    /// Interface it is reached through (vulkan, metal, dx12).
    pub interface: String,
    /// Discrete, integrated, virtual or software.
    pub kind: &'static str,
    /// Whether kernels run on the CPU behind the interface (Mesa lavapipe for one).
    pub software: bool,
    /// Largest storage binding in bytes.
    pub max_storage_binding: u64,
    /// Largest buffer in bytes.
    pub max_buffer: u64,
    /// Whether [`Backend::Auto`](super::Backend::Auto) takes this one.
    pub preferred: bool,
}

impl fmt::Display for AdapterSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} ({}, {}, {}), buffers up to {} MiB, bindings up to {} MiB{}",
            self.name,
            self.kind,
            self.interface,
            self.driver,
            self.max_buffer >> 20,
            self.max_storage_binding >> 20,
            if self.preferred { "; taken by --backend auto" } else { "" }
        )
    }
}
