//! How much memory this process has, as the system sees it: a library without `unsafe` code cannot
//! count its allocations.

use std::sync::atomic::{AtomicU64, Ordering};

/// What the program takes by itself, with its threads and tables.
const PROGRAM: u64 = 80 << 20;
/// What a software driver takes for its compiler and threads.
const DRIVER: u64 = 300 << 20;

/// What is not counted as the work's.
static PROGRAM_AND_DRIVER: AtomicU64 = AtomicU64::new(PROGRAM);

/// A device is used: its driver's memory is not the work's.
#[cfg_attr(not(feature = "cli"), expect(dead_code, reason = "for the command line"))]
pub(crate) fn allow_driver() {
    PROGRAM_AND_DRIVER.store(PROGRAM + DRIVER, Ordering::Relaxed);
}

/// Bytes that the work of this process has at present, beside what the program takes itself; 0
/// where the system does not tell.
pub(crate) fn in_use() -> u64 {
    resident().unwrap_or(0).saturating_sub(PROGRAM_AND_DRIVER.load(Ordering::Relaxed))
}

/// Bytes of memory that this process has at present; none where the system does not tell.
pub(crate) fn resident() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    bytes(&status)
}

/// The resident memory in the words of `/proc/self/status`.
fn bytes(status: &str) -> Option<u64> {
    let line = status.lines().find_map(|l| l.strip_prefix("VmRSS:"))?;
    line.trim().strip_suffix(" kB")?.trim().parse::<u64>().ok().map(|k| k << 10)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn resident_memory_is_read_as_the_system_writes_it() {
        assert_eq!(bytes("VmHWM:\t  9000 kB\nVmRSS:\t    2048 kB\n"), Some(2 << 20));
        assert_eq!(bytes("Name: x\n"), None);
        if cfg!(target_os = "linux") {
            let block = std::hint::black_box(vec![1u8; 200 << 20]);
            let with = resident().unwrap();
            assert!(with >= 200 << 20, "{with}");
            drop(block);
        }
    }
}
