//! The last resort of `--memory`: a process that takes more than it may, in a way that no estimate
//! foresaw, ends before the machine suffers.
//!
//! Pieces of work that are known to be large are refused before they begin
//! ([`control::require`](crate::control)). What the sum of all others takes is seen here only.

use std::thread;
use std::time::Duration;

use crate::cli::common::failed;
use crate::{Error, memory};

/// Time between two looks: at the gigabyte a second at which two threads touch new memory, 5 MB.
const EVERY: Duration = Duration::from_millis(5);

/// Ends the program, with an error that names the bytes, soon after its work has gone beyond
/// `allowed`. Does nothing where the system does not tell or gives no thread.
pub(crate) fn watch(allowed: u64) {
    if memory::resident().is_none() {
        return;
    }
    let work = move || {
        loop {
            let required = memory::in_use();
            // Estimates of pieces are rough: they may be wrong by a little.
            if required > allowed.saturating_add(allowed / 20) {
                crate::io::output::remove_all_temporary();
                let what = "the work so far".to_owned();
                std::process::exit(i32::from(failed(Error::Memory { what, required, allowed })));
            }
            thread::sleep(EVERY);
        }
    };
    // Without a thread the estimates alone hold.
    let _ = thread::Builder::new().name("memory".into()).spawn(work);
}
