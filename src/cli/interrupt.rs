//! Ending early: signals, and a parent that is gone. Nothing temporary stays behind.

/// Ends the program as signal `n` would: nothing half written stays, and the exit code is 128 + n.
fn end(n: i32) -> ! {
    crate::io::output::remove_all_temporary();
    std::process::exit(128 + n)
}

/// Handles the signals that end a program: interrupt, termination, quit and, unless it is ignored
/// as after `nohup`, hang-up.
///
/// # Errors
/// If the system refuses.
#[cfg(unix)]
pub(crate) fn handle_signals() -> std::io::Result<()> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGQUIT, SIGTERM};
    let mut signals = signal_hook::iterator::Signals::new([SIGINT, SIGTERM, SIGQUIT])?;
    if hang_up_counts() {
        signals.add_signal(SIGHUP)?;
    }
    std::thread::Builder::new().name("signals".into()).spawn(move || {
        if let Some(n) = signals.forever().next() {
            end(n);
        }
    })?;
    Ok(())
}

/// Handles Ctrl-C.
///
/// # Errors
/// If the system refuses.
#[cfg(not(unix))]
pub(crate) fn handle_signals() -> Result<(), ctrlc::Error> {
    ctrlc::set_handler(|| end(2))
}

/// Whether a hang-up ends this process. Where the system does not say, its own rule stays.
#[cfg(unix)]
fn hang_up_counts() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|l| l.strip_prefix("SigIgn:"));
    let mask = ignored.and_then(|l| u64::from_str_radix(l.trim(), 16).ok());
    mask.is_some_and(|mask| mask & (1 << (signal_hook::consts::SIGHUP - 1)) == 0)
}

/// Ends the program, as SIGTERM does, soon after the process that started it has ended: a worker
/// must not go on where nobody waits for it. After `nohup` it goes on, which is what that asks for.
#[cfg(unix)]
pub(crate) fn end_with_parent() {
    use std::os::unix::process::parent_id;
    let parent = parent_id();
    if parent <= 1 || !hang_up_counts() {
        return;
    }
    // Where no thread can be had, nothing is lost but this.
    let _ = std::thread::Builder::new().name("parent".into()).spawn(move || {
        while parent_id() == parent {
            std::thread::sleep(std::time::Duration::from_millis(200));
        }
        end(signal_hook::consts::SIGTERM)
    });
}

/// Elsewhere a process does not learn that its parent has ended.
#[cfg(not(unix))]
pub(crate) fn end_with_parent() {}
