//! What crosses between the host and a device, counted.
//!
//! Counts need no clock and no hardware device: they are the same on every machine, and they say
//! what a device that is faster than a software driver would wait for.

use std::ops::{AddAssign, Sub};

/// What was done on a device between two moments.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Bytes written from the host into buffers.
    pub bytes_up: u64,
    /// Bytes written from the host into tables and pictures, which are made once and then read.
    pub bytes_up_once: u64,
    /// Bytes read back to the host.
    pub bytes_down: u64,
    /// Dispatches of kernels.
    pub dispatches: u64,
    /// Submissions of recorded commands.
    pub submissions: u64,
    /// Times the host waited for a submission.
    pub waits: u64,
    /// Buffers and textures made.
    pub allocations: u64,
}

impl Sub for Traffic {
    type Output = Self;

    /// What came after `earlier`, for two readings of one device's counters.
    fn sub(self, earlier: Self) -> Self {
        Self {
            bytes_up: self.bytes_up - earlier.bytes_up,
            bytes_up_once: self.bytes_up_once - earlier.bytes_up_once,
            bytes_down: self.bytes_down - earlier.bytes_down,
            dispatches: self.dispatches - earlier.dispatches,
            submissions: self.submissions - earlier.submissions,
            waits: self.waits - earlier.waits,
            allocations: self.allocations - earlier.allocations,
        }
    }
}

impl AddAssign for Traffic {
    fn add_assign(&mut self, more: Self) {
        self.bytes_up += more.bytes_up;
        self.bytes_up_once += more.bytes_up_once;
        self.bytes_down += more.bytes_down;
        self.dispatches += more.dispatches;
        self.submissions += more.submissions;
        self.waits += more.waits;
        self.allocations += more.allocations;
    }
}
