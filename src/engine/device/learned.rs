//! What a device can do: its limits, and what the canary found.

use crate::engine::Capabilities;
use crate::error::{Error, Result};

/// Trip count of the canary's loop: above the 65,535 at which Mesa's software drivers end loops
/// without a word.
pub(super) const CANARY_LOOP: u32 = 70_000;

/// The loop budget assumed where the canary met no limit.
const AMPLE_LOOPS: u32 = 1 << 24;

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
