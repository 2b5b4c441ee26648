//! How long-running work reports its progress.

/// Receives the progress of long work. Methods may be called from any thread.
pub trait Progress: Sync {
    /// A stage begins; `total` counts its items (0 where it is not known).
    fn stage(&self, name: &str, total: u64);
    /// `count` more items of the stage are done.
    fn advance(&self, count: u64);
}

/// Reports nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct Quiet;

impl Progress for Quiet {
    fn stage(&self, _name: &str, _total: u64) {}
    fn advance(&self, _count: u64) {}
}
