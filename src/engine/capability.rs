//! What a device can do, decided once when the engine starts. Nothing else asks a device for its
//! limits.

use std::fmt;

use crate::error::{Error, Result};

/// What a device can do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Capabilities {
    /// Largest storage binding in bytes.
    pub max_storage_binding: u64,
    /// Largest buffer in bytes.
    pub max_buffer: u64,
    /// Largest uniform binding in bytes.
    pub max_uniform_binding: u64,
    /// Storage buffers a kernel may bind.
    pub max_storage_buffers: u32,
    /// Largest workgroup count in one dimension.
    pub max_groups: u32,
    /// Most invocations of a workgroup.
    pub max_invocations: u32,
    /// Largest side of a sampled texture.
    pub max_texture_side: u32,
    /// Distance in bytes at which spans may start in a uniform buffer.
    pub uniform_alignment: u32,
    /// Iterations one invocation may spend in all its loops together; a driver that ends loops
    /// early has a small one.
    pub loop_budget: u32,
    /// Whether the driver ended the canary's loop early.
    pub truncates_loops: bool,
    /// Whether `x != x` tells a NaN.
    pub nan_by_comparison: bool,
    /// Whether the error term of a two-sum survives the shader compiler.
    pub compensated_sums: bool,
    /// Whether the kernels run on the CPU behind the interface.
    pub software: bool,
}

impl fmt::Display for Capabilities {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let yes = |b| if b { "yes" } else { "no" };
        writeln!(
            f,
            "limits: buffers {} MiB, storage bindings {} MiB, uniform blocks {} KiB, {} storage buffers per kernel, \
             {} workgroups per dimension, textures {} wide",
            self.max_buffer >> 20,
            self.max_storage_binding >> 20,
            self.max_uniform_binding >> 10,
            self.max_storage_buffers,
            self.max_groups,
            self.max_texture_side
        )?;
        write!(
            f,
            "canaries: atomics and workgroup memory passed, loops {}, NaN seen by comparison: {}, compensated sums kept: {}",
            if self.truncates_loops {
                format!("end after {} iterations (kernels are planned for it)", self.loop_budget)
            } else {
                "run to their end".into()
            },
            yes(self.nan_by_comparison),
            yes(self.compensated_sums)
        )
    }
}

impl Capabilities {
    /// Checks that a kernel whose loops run `iterations` times in all, at most over its lanes,
    /// stays within the budget.
    ///
    /// # Errors
    /// [`Error::Capability`] if it does not: the caller must split the loop over several
    /// dispatches.
    pub fn check_loops(&self, kernel: &str, iterations: u64) -> Result<()> {
        if iterations <= u64::from(self.loop_budget) {
            return Ok(());
        }
        Err(Error::Capability {
            limit: format!("loop iterations in kernel {kernel}"),
            required: iterations,
            actual: u64::from(self.loop_budget),
        })
    }

    /// Most elements of `T` that one storage binding can hold.
    pub fn max_elements<T>(&self) -> u64 {
        self.max_storage_binding.min(self.max_buffer) / (size_of::<T>().max(1) as u64)
    }
}
