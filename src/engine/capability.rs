//! What a device can do, decided once when the engine starts. Nothing else asks a device for its
//! limits.

use std::fmt;

use crate::error::{Error, Result};

/// Trip count of the canary's loop: above the 65,535 at which Mesa's software drivers end loops
/// without a word.
pub(super) const CANARY_LOOP: u32 = 70_000;

/// The loop budget assumed where the canary met no limit.
const AMPLE_LOOPS: u32 = 1 << 24;

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

/// What the canary kernel wrote.
#[derive(Clone, Copy, Debug)]
pub(super) struct Canary {
    pub(super) loop_count: u32,
    pub(super) added: u32,
    pub(super) largest: u32,
    pub(super) smallest: u32,
    pub(super) nan_differs: u32,
    pub(super) nan_by_bits: u32,
    pub(super) two_sum_bits: u32,
    pub(super) exchanged: u32,
}

impl Capabilities {
    /// The record of a device with these limits, before the canaries ran.
    pub(super) fn from_limits(limits: &wgpu::Limits, software: bool) -> Self {
        Self {
            max_storage_binding: limits.max_storage_buffer_binding_size,
            max_buffer: limits.max_buffer_size,
            max_uniform_binding: limits.max_uniform_buffer_binding_size,
            max_storage_buffers: limits.max_storage_buffers_per_shader_stage,
            max_groups: limits.max_compute_workgroups_per_dimension,
            max_invocations: limits.max_compute_invocations_per_workgroup,
            max_texture_side: limits.max_texture_dimension_2d,
            uniform_alignment: limits.min_uniform_buffer_offset_alignment,
            // Until the canary has run: what the most restrictive known driver allows.
            loop_budget: 65_535,
            truncates_loops: true,
            nan_by_comparison: false,
            compensated_sums: false,
            software,
        }
    }

    /// Takes over what the canaries found.
    ///
    /// # Errors
    /// [`Error::Device`] where the driver fails at what every kernel relies on: atomics, workgroup
    /// memory and bit tests.
    pub(super) fn learn(&mut self, canary: Canary, lanes: u32) -> Result<()> {
        let wrong = |what: &str| Error::Device {
            what: format!("the driver fails the start-up test of {what}"),
            remedy: "Update the driver, choose another adapter or use --backend cpu".into(),
        };
        if canary.added != lanes * (lanes + 1) / 2 || canary.largest != lanes || canary.smallest != 1 {
            return Err(wrong("atomic operations"));
        }
        if canary.exchanged != lanes {
            return Err(wrong("workgroup memory"));
        }
        if canary.nan_by_bits != 1 {
            return Err(wrong("bit patterns of floating-point numbers"));
        }
        self.truncates_loops = canary.loop_count < CANARY_LOOP;
        self.loop_budget = if self.truncates_loops { canary.loop_count } else { AMPLE_LOOPS };
        if self.loop_budget < 4096 {
            return Err(wrong("loops"));
        }
        self.nan_by_comparison = canary.nan_differs == 1;
        self.compensated_sums = f32::from_bits(canary.two_sum_bits) == TWO_SUM_ERROR;
        Ok(())
    }

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

/// Operands of the two-sum canary and the error term exact arithmetic leaves: 1 + 2^-25 rounds to
/// 1.
pub(super) const TWO_SUM: [f32; 2] = [1.0, 1.0 / 33_554_432.0];
const TWO_SUM_ERROR: f32 = TWO_SUM[1];

#[cfg(test)]
mod tests {
    use super::*;

    fn good() -> Canary {
        Canary {
            loop_count: 65_535,
            added: 64 * 65 / 2,
            largest: 64,
            smallest: 1,
            nan_differs: 0,
            nan_by_bits: 1,
            two_sum_bits: 0,
            exchanged: 64,
        }
    }

    fn record() -> Capabilities {
        Capabilities::from_limits(&wgpu::Limits::downlevel_defaults(), true)
    }

    #[test]
    fn a_truncating_driver_gets_the_budget_it_showed() {
        let mut c = record();
        c.learn(good(), 64).unwrap();
        assert!(c.truncates_loops && c.loop_budget == 65_535);
        assert!(c.check_loops("k", 65_535).is_ok());
        assert!(matches!(c.check_loops("k", 65_536), Err(Error::Capability { .. })));
        c.learn(Canary { loop_count: CANARY_LOOP, ..good() }, 64).unwrap();
        assert!(!c.truncates_loops && c.loop_budget > CANARY_LOOP);
    }

    #[test]
    fn a_driver_that_fails_what_kernels_rely_on_is_refused() {
        for bad in [
            Canary { added: 2079, ..good() },
            Canary { largest: 63, ..good() },
            Canary { smallest: 0, ..good() },
            Canary { exchanged: 63, ..good() },
            Canary { nan_by_bits: 0, ..good() },
            Canary { loop_count: 12, ..good() },
        ] {
            assert!(matches!(record().learn(bad, 64), Err(Error::Device { .. })), "{bad:?}");
        }
    }
}
