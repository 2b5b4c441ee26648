//! What the machine lets this process have: threads and addresses. Both are looked at before work
//! begins, because libraries end the process where the system refuses them later.

use std::num::NonZero;
use std::sync::OnceLock;
use std::thread;

use rayon::ThreadPoolBuilder;

use crate::{Error, Result};

/// Addresses without which nothing is begun: the program, its libraries, and room for small work.
const LEAST_ADDRESSES: u64 = 1 << 30;
/// Addresses that a thread takes: its stack, and what allocators reserve for each.
const ADDRESSES_PER_THREAD: u64 = 80 << 20;
/// Most threads for each core: more only get in each other's way.
const THREADS_PER_CORE: usize = 4;

/// What work may use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Machine {
    /// Threads that work in parallel.
    pub(crate) threads: usize,
    /// Whether further threads can be had, for drivers and progress.
    pub(crate) more_threads: bool,
    /// Bytes that may be allocated, if the system says.
    pub(crate) addresses: Option<u64>,
}

/// What was found when the process first looked.
static FOUND: OnceLock<Machine> = OnceLock::new();

impl Machine {
    /// What this process may use: threads without limit where nobody has looked.
    pub(crate) fn here() -> Self {
        let unseen = Self { threads: rayon::current_num_threads(), more_threads: true, addresses: None };
        FOUND.get().copied().unwrap_or(unseen)
    }

    /// Whether drivers of devices get the threads and addresses that they take without asking.
    pub(crate) fn is_roomy(self) -> bool {
        self.more_threads && self.addresses.is_none()
    }

    /// Looks at the limits and starts the threads: `wanted` of them, or as many as there are cores.
    /// Returns what is to be told, too.
    ///
    /// # Errors
    /// [`Error::Input`] where the address space is too small for any work.
    pub(crate) fn prepare(wanted: Option<usize>) -> Result<(Self, Vec<String>)> {
        let mut notes = Vec::new();
        let addresses = free_addresses();
        if let Some(free) = addresses.filter(|&free| free < LEAST_ADDRESSES) {
            let what = format!(
                "the memory of this process is limited (ulimit -v or -d): {} MB are free, {} MB are needed",
                free >> 20,
                LEAST_ADDRESSES >> 20
            );
            return Err(Error::input(what, "Raise the limit: ulimit -v unlimited -d unlimited"));
        }
        let cores = thread::available_parallelism().map_or(1, NonZero::get);
        let environment = std::env::var("RAYON_NUM_THREADS").ok().and_then(|n| n.trim().parse().ok());
        let asked = wanted.or(environment).filter(|&n| n > 0);
        let (count, note) = bounded(asked, cores, addresses);
        notes.extend(note);
        let had = spawnable(count);
        if had < count {
            notes.push(format!("the system gives no more than {had} of {count} threads (ulimit -u)"));
        }
        // A pool that is there already, as in a process of another program, is used as it is.
        let builder = ThreadPoolBuilder::new().num_threads(had);
        let _ = if had == 1 { builder.use_current_thread().build_global() } else { builder.build_global() };
        let more_threads = thread::Builder::new().spawn(|| ()).is_ok_and(|t| t.join().is_ok());
        Ok((*FOUND.get_or_init(|| Self { threads: had, more_threads, addresses }), notes))
    }
}

/// How many threads are tried for, and why not those that were asked for.
fn bounded(asked: Option<usize>, cores: usize, addresses: Option<u64>) -> (usize, Option<String>) {
    let most = cores * THREADS_PER_CORE;
    let room = addresses.map_or(usize::MAX, |free| {
        usize::try_from(free.saturating_sub(LEAST_ADDRESSES / 2) / ADDRESSES_PER_THREAD).unwrap_or(usize::MAX).max(1)
    });
    let wanted = asked.unwrap_or(cores);
    let count = wanted.min(most).min(room);
    let why =
        if count == most { format!("there are {cores} cores") } else { "addresses are limited (ulimit -v)".into() };
    let note = (asked.is_some() && count < wanted).then(|| format!("{count} threads instead of {wanted}: {why}"));
    (count, note)
}

/// How many of `count` threads the system gives; 1 where it gives none beside this one.
fn spawnable(count: usize) -> usize {
    let mut tried = count;
    while tried > 1 {
        if ThreadPoolBuilder::new().num_threads(tried).build().is_ok() {
            return tried;
        }
        tried /= 2;
    }
    1
}

/// Bytes that are left below the limits of addresses and of data; none without a limit.
fn free_addresses() -> Option<u64> {
    let limits = std::fs::read_to_string("/proc/self/limits").ok()?;
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let used = |key: &str| {
        let line = status.lines().find_map(|l| l.strip_prefix(key));
        line.and_then(|l| l.trim().strip_suffix(" kB")?.parse::<u64>().ok()).unwrap_or(0) << 10
    };
    let left = |limit: &str, key: &str| Some(limit_of(&limits, limit)?.saturating_sub(used(key)));
    let (addresses, data) = (left("Max address space", "VmSize:"), left("Max data size", "VmData:"));
    addresses.into_iter().chain(data).min()
}

/// A soft limit in the words of `/proc/self/limits`.
fn limit_of(limits: &str, name: &str) -> Option<u64> {
    let line = limits.lines().find_map(|l| l.strip_prefix(name))?;
    line.split_whitespace().next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn threads_are_bounded_by_cores_and_addresses() {
        assert_eq!(bounded(None, 2, None), (2, None));
        assert_eq!(bounded(Some(3), 2, None), (3, None));
        let (count, note) = bounded(Some(1000), 2, None);
        assert!(count == 8 && note.unwrap().contains("2 cores"));
        // A default that does not fit is no news.
        assert_eq!(bounded(None, 64, Some(LEAST_ADDRESSES)), (6, None));
        let (count, note) = bounded(Some(64), 64, Some(LEAST_ADDRESSES));
        assert!(count == 6 && note.unwrap().contains("ulimit -v"));
        assert_eq!(bounded(None, 8, Some(0)).0, 1);
    }

    #[test]
    fn limits_are_read_as_the_system_writes_them() {
        let text = |value: &str| {
            format!(
                "Limit  Soft Limit  Hard Limit  Units\nMax address space         {value}            unlimited            bytes\n"
            )
        };
        assert_eq!(limit_of(&text("409600000"), "Max address space"), Some(409_600_000));
        assert_eq!(limit_of(&text("409600000"), "Max data size"), None);
        assert_eq!(limit_of(&text("unlimited"), "Max address space"), None);
        assert_eq!(limit_of("", "Max address space"), None);
    }
}
