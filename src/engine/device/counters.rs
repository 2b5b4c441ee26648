//! The counters of a device.

use std::sync::atomic::{AtomicU64, Ordering};

use crate::engine::Traffic;

/// The counters of a device, which only grow.
#[derive(Debug, Default)]
pub(super) struct Counters {
    bytes_up: AtomicU64,
    bytes_up_once: AtomicU64,
    bytes_down: AtomicU64,
    dispatches: AtomicU64,
    submissions: AtomicU64,
    waits: AtomicU64,
    allocations: AtomicU64,
}

impl Counters {
    pub(super) fn up(&self, bytes: u64) {
        self.bytes_up.fetch_add(bytes, Ordering::Relaxed);
    }

    pub(super) fn up_once(&self, bytes: u64) {
        self.bytes_up_once.fetch_add(bytes, Ordering::Relaxed);
    }

    pub(super) fn down(&self, bytes: u64) {
        self.bytes_down.fetch_add(bytes, Ordering::Relaxed);
    }

    pub(super) fn dispatch(&self) {
        self.dispatches.fetch_add(1, Ordering::Relaxed);
    }

    pub(super) fn submission(&self) {
        self.submissions.fetch_add(1, Ordering::Relaxed);
    }

    pub(super) fn wait(&self) {
        self.waits.fetch_add(1, Ordering::Relaxed);
    }

    pub(super) fn allocation(&self) {
        self.allocations.fetch_add(1, Ordering::Relaxed);
    }

    pub(super) fn read(&self) -> Traffic {
        let count = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        Traffic {
            bytes_up: count(&self.bytes_up),
            bytes_up_once: count(&self.bytes_up_once),
            bytes_down: count(&self.bytes_down),
            dispatches: count(&self.dispatches),
            submissions: count(&self.submissions),
            waits: count(&self.waits),
            allocations: count(&self.allocations),
        }
    }
}
