//! Ending long work before its end, and keeping it from taking too much memory.
//!
//! Work that runs inside [`Control::run`] ends with [`Error::Cancelled`] soon after
//! [`Control::cancel`] was called, from any thread. The loops of this library look at the control
//! of their thread between bands, sweeps, stages and slices of a device's work; what is not
//! finished is dropped. A control is not handed from function to function: everything below `run`
//! on its thread is under it, and parallel parts take it along.
//!
//! ```
//! use barymap::control::Control;
//!
//! let control = Control::new();
//! control.cancel();
//! let result = control.run(|| Ok(1));
//! assert!(matches!(result, Err(barymap::Error::Cancelled)));
//! ```

use std::cell::RefCell;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use crate::error::{Error, Result};
use crate::memory;

/// A handle by which work is cancelled. Clones are handles of the same work.
#[derive(Clone, Debug, Default)]
pub struct Control {
    state: Arc<State>,
}

#[derive(Debug, Default)]
struct State {
    /// Bytes that one piece of work may ask for; no limit if not given.
    memory: Option<u64>,
    /// Whether the limit is that of the whole process.
    whole: bool,
    cancelled: AtomicBool,
    /// How often the work has looked here.
    checks: AtomicU64,
    /// The check from which on work is cancelled; 0 for none.
    end: AtomicU64,
}

thread_local! {
    /// The control of the work on this thread.
    static HERE: RefCell<Option<Control>> = const { RefCell::new(None) };
}

impl Control {
    /// Of work that was not cancelled.
    pub fn new() -> Self {
        Self::default()
    }

    /// Of work whose pieces are refused, before they begin, if one of them would take more than
    /// `bytes`: a dense system of equations, the polygons of a partition, the meshes of a file. The
    /// error is [`Error::Memory`] with the number that was asked for.
    pub fn with_memory(bytes: u64) -> Self {
        Self { state: Arc::new(State { memory: Some(bytes), ..State::default() }) }
    }

    /// As [`Control::with_memory`], for the process as a whole: what it has already counts, too.
    #[cfg_attr(not(feature = "cli"), expect(dead_code, reason = "for the command line"))]
    pub(crate) fn of_process(bytes: u64) -> Self {
        Self { state: Arc::new(State { memory: Some(bytes), whole: true, ..State::default() }) }
    }

    /// Ends the work that runs under this control, and all that will.
    pub fn cancel(&self) {
        self.state.cancelled.store(true, Ordering::Relaxed);
    }

    /// Whether the work is to end.
    pub fn is_cancelled(&self) -> bool {
        self.state.cancelled.load(Ordering::Relaxed)
    }

    /// Runs `work` under this control instead of any other that the thread has.
    ///
    /// # Errors
    /// [`Error::Cancelled`] if the work was cancelled; else those of `work`.
    pub fn run<T>(&self, work: impl FnOnce() -> Result<T>) -> Result<T> {
        Current(Some(self.clone())).within(|| {
            check()?;
            work()
        })
    }

    /// Cancels work at the check with number `end`, from 1 on. For tests: where work ends does not
    /// depend on time then.
    #[doc(hidden)]
    pub fn cancel_at(&self, end: u64) {
        self.state.end.store(end, Ordering::Relaxed);
    }

    /// How often work has looked whether it is to end.
    #[doc(hidden)]
    pub fn checks(&self) -> u64 {
        self.state.checks.load(Ordering::Relaxed)
    }

    fn check(&self) -> Result<()> {
        let number = 1 + self.state.checks.fetch_add(1, Ordering::Relaxed);
        let end = self.state.end.load(Ordering::Relaxed);
        if end != 0 && number >= end {
            self.cancel();
        }
        if self.is_cancelled() { Err(Error::Cancelled) } else { Ok(()) }
    }
}

/// What a thread works under, for the parts of its work that other threads do.
#[derive(Clone, Debug)]
pub(crate) struct Current(Option<Control>);

impl Current {
    /// As [`check`], from any thread.
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    pub(crate) fn check(&self) -> Result<()> {
        self.0.as_ref().map_or(Ok(()), Control::check)
    }

    /// Runs `work` under it on this thread.
    pub(crate) fn within<T>(&self, work: impl FnOnce() -> T) -> T {
        let _before = Restore(HERE.with(|here| here.replace(self.0.clone())));
        work()
    }
}

/// Puts a thread's control back, even where its work panics.
struct Restore(Option<Control>);

impl Drop for Restore {
    fn drop(&mut self) {
        HERE.with(|here| *here.borrow_mut() = self.0.take());
    }
}

/// The control of this thread.
pub(crate) fn current() -> Current {
    Current(HERE.with(|here| here.borrow().clone()))
}

/// Fails if `what`, which is to take `required` bytes, takes more than the control of this thread
/// allows.
///
/// # Errors
/// [`Error::Memory`].
pub(crate) fn require(required: u64, what: impl FnOnce() -> String) -> Result<()> {
    let Some((allowed, used)) = budget() else { return Ok(()) };
    let required = required.saturating_add(used);
    if required > allowed { Err(Error::Memory { what: what(), required, allowed }) } else { Ok(()) }
}

/// The bytes that the control of this thread allows, and those of them that are in use.
fn budget() -> Option<(u64, u64)> {
    HERE.with(|here| {
        let here = here.borrow();
        let state = &here.as_ref()?.state;
        let used = if state.whole { memory::in_use() } else { 0 };
        Some((state.memory?, used))
    })
}

/// The bytes that a piece of work may take; no limit without one.
pub(crate) fn left() -> u64 {
    budget().map_or(u64::MAX, |(allowed, used)| allowed.saturating_sub(used))
}

/// Ends work that was cancelled: loops whose passes take long call this in each.
///
/// # Errors
/// [`Error::Cancelled`].
pub(crate) fn check() -> Result<()> {
    HERE.with(|here| here.borrow().as_ref().map_or(Ok(()), Control::check))
}

/// How often a wait for [`apart`] looks whether the work was cancelled.
const LOOK: Duration = Duration::from_millis(20);

/// Does `work` that cannot be stopped, such as a factorisation of another library, on a thread of
/// its own, so that this one can end when it is cancelled; what was begun is then left to end by
/// itself, and dropped. Without a control, and in a browser, this thread does it.
///
/// Waits are not counted by [`Control::checks`]: their number depends on time.
///
/// # Errors
/// [`Error::Cancelled`].
pub(crate) fn apart<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Result<T> {
    let Some(control) = current().0.filter(|_| !cfg!(target_family = "wasm")) else { return Ok(work()) };
    let (done, result) = mpsc::channel();
    let job = Arc::new(Mutex::new(Some(work)));
    let theirs = Arc::clone(&job);
    let begin = move || {
        let work = theirs.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(work) = work {
            // Nobody hears it where the work was cancelled.
            let _ = done.send(work());
        }
    };
    let Ok(worker) = std::thread::Builder::new().spawn(begin) else {
        // There is no thread to be had.
        return job.lock().unwrap_or_else(PoisonError::into_inner).take().map(|work| work()).ok_or(Error::Cancelled);
    };
    loop {
        match result.recv_timeout(LOOK) {
            Ok(value) => return Ok(value),
            Err(RecvTimeoutError::Timeout) if control.is_cancelled() => return Err(Error::Cancelled),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => match worker.join() {
                Ok(()) => return Err(Error::Cancelled),
                Err(panic) => std::panic::resume_unwind(panic),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_that_cannot_be_stopped_is_left_alone() {
        let (go_on, wait) = mpsc::channel::<()>();
        let control = Control::new();
        let begun = control.clone();
        let result = control.run(|| {
            apart(move || {
                begun.cancel();
                // Ends when the test does.
                let _ = wait.recv();
                1
            })
        });
        assert!(matches!(result, Err(Error::Cancelled)));
        drop(go_on);
        let other = Control::new();
        assert!(matches!(other.run(|| apart(|| 2)), Ok(2)));
        assert_eq!(other.checks(), 1, "that of run alone");
        assert!(matches!(apart(|| 3), Ok(3)));
        let panics = std::panic::catch_unwind(|| Control::new().run(|| apart::<()>(|| panic!("as it should"))));
        assert!(panics.is_err(), "a panic is that of the caller");
    }

    #[test]
    fn work_ends_where_it_looks_next() {
        let control = Control::new();
        let count = |control: &Control| {
            let mut done = 0;
            let result = control.run(|| {
                for _ in 0..10 {
                    check()?;
                    done += 1;
                }
                Ok(())
            });
            (done, result.is_ok())
        };
        assert_eq!(count(&control), (10, true));
        assert_eq!(control.checks(), 11);
        control.cancel_at(11 + 4);
        assert_eq!(count(&control), (2, false), "the fourth check is the third of the loop");
        assert_eq!(count(&control), (0, false));
        assert!(control.is_cancelled() && control.clone().is_cancelled());
        assert!(check().is_ok(), "nothing stays behind on the thread");
    }

    #[test]
    fn what_takes_too_much_is_refused_where_there_is_a_limit() {
        let ask = |bytes: u64| require(bytes, || "a system".into());
        assert!(ask(u64::MAX).is_ok());
        assert!(Control::new().run(|| ask(u64::MAX)).is_ok());
        let control = Control::with_memory(1000);
        assert!(control.run(|| ask(1000)).is_ok());
        let refused = control.run(|| ask(1001)).unwrap_err();
        assert!(matches!(refused, Error::Memory { required: 1001, allowed: 1000, .. }), "{refused}");
        assert!(ask(1001).is_ok());
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn what_the_process_has_counts_where_the_limit_is_the_processes() {
        let block = std::hint::black_box(vec![1u8; 300 << 20]);
        let control = Control::of_process(256 << 20);
        let ask = || control.run(|| require(64 << 20, || "a system".into()));
        let Err(Error::Memory { required, .. }) = ask() else { panic!("not refused") };
        assert!(required >= (300 + 64 - 80) << 20, "{required}");
        assert!(Control::with_memory(256 << 20).run(|| require(64 << 20, || "a system".into())).is_ok());
        let all = Control::of_process(64 << 30).run(|| Ok(left())).unwrap();
        assert!(all < 64 << 30, "{all}");
        assert_eq!(left(), u64::MAX);
        drop(block);
    }

    #[test]
    fn other_threads_work_under_it_and_no_other_work_does() {
        let (outer, inner) = (Control::new(), Control::new());
        inner.cancel();
        let result = outer.run(|| {
            let here = current();
            std::thread::scope(|scope| {
                scope.spawn(|| {
                    assert!(check().is_ok());
                    outer.cancel();
                    assert!(check().is_ok(), "this thread has no control");
                    assert!(here.check().is_err() && here.within(check).is_err());
                    assert!(check().is_ok());
                });
            });
            assert!(inner.run(|| Ok(())).is_err());
            check()
        });
        assert!(matches!(result, Err(Error::Cancelled)));
        let kept = std::panic::catch_unwind(|| inner.clone().run(|| -> Result<()> { Ok(()) }).is_err());
        assert!(kept.unwrap_or(false) && check().is_ok());
    }
}
