//! Work without the interpreter's lock, that signals and callbacks end.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use barymap::control::Control;
use barymap::progress::Progress;
use pyo3::prelude::*;

use crate::failure::{exception, raised};

/// How often the interpreter is looked at: signals, and the callback, get their turn.
const LOOK: Duration = Duration::from_millis(33);
/// The note of an exception that came when there was nothing left to stop.
const ENDED: &str = "barymap: the work had ended by itself";
/// The stack of the thread that works: that of a main thread.
const STACK: usize = 8 << 20;

/// Runs `work` on a thread of its own, without the interpreter's lock.
///
/// `progress(stage, done, total)` is called from the thread that called, at most thirty times a
/// second for the stage at work and once for each that ended. What it raises, and what a signal
/// raises (Ctrl-C), cancels the work and is raised here.
pub(crate) fn run<T: Send>(
    py: Python<'_>,
    progress: Option<&Py<PyAny>>,
    memory: u64,
    work: impl FnOnce(&dyn Progress) -> barymap::Result<T> + Send,
) -> PyResult<T> {
    let (control, told) = (Control::with_memory(memory), Told::default());
    let (result, stopped) = py.detach(|| {
        thread::scope(|scope| {
            let (done, wait) = mpsc::channel::<()>();
            let (control, told) = (&control, &told);
            let job = move || {
                let result = control.run(|| work(told));
                drop(done);
                result
            };
            let worker = match named().spawn_scoped(scope, job) {
                Ok(worker) => worker,
                Err(error) => return (None, Some(PyErr::from(error))),
            };
            let mut seen = Seen::default();
            let mut stopped = attend(&wait, progress, told, &mut seen).err();
            if stopped.is_some() {
                control.cancel();
            }
            let result = worker.join();
            if stopped.is_none() {
                stopped = Python::attach(|py| look(py, progress, told, &mut seen)).err();
            }
            (Some(result.ok()), stopped)
        })
    });
    match (result, stopped) {
        (Some(Some(Ok(_))), Some(stopped)) => {
            // Whoever is interested learns that it came too late to spare anything.
            let _ = stopped.value(py).setattr("__notes__", [ENDED]);
            Err(stopped)
        }
        (_, Some(stopped)) => Err(stopped),
        (Some(Some(result)), None) => result.map_err(|error| exception(py, &error)),
        (_, None) => Err(mistake(py)),
    }
}

/// As [`run`], for work of another library that cannot be stopped: what was begun when a signal
/// came is left to end by itself, and dropped.
pub(crate) fn run_apart<T: Send + 'static>(
    py: Python<'_>,
    memory: u64,
    work: impl FnOnce() -> barymap::Result<T> + Send + 'static,
) -> PyResult<T> {
    let control = Control::with_memory(memory);
    let result = py.detach(|| {
        let (done, wait) = mpsc::channel::<()>();
        let job = move || {
            let result = control.run(work);
            drop(done);
            result
        };
        let worker = named().spawn(job)?;
        attend(&wait, None, &Told::default(), &mut Seen::default())?;
        Ok::<_, PyErr>(worker.join().ok())
    })?;
    result.ok_or_else(|| mistake(py))?.map_err(|error| exception(py, &error))
}

fn named() -> thread::Builder {
    thread::Builder::new().name("barymap".into()).stack_size(STACK)
}

/// Waits for the work to end; ends before it with what a signal or the callback raises.
fn attend(wait: &mpsc::Receiver<()>, progress: Option<&Py<PyAny>>, told: &Told, seen: &mut Seen) -> PyResult<()> {
    while let Err(RecvTimeoutError::Timeout) = wait.recv_timeout(LOOK) {
        Python::attach(|py| look(py, progress, told, seen))?;
    }
    Ok(())
}

/// A mistake of the library is an exception like others, not one that `except Exception` passes
/// over.
fn mistake(py: Python<'_>) -> PyErr {
    let remedy = "This is a mistake of barymap: please report it with the input";
    raised(py, "InternalError", "the work ended early", None, remedy)
}

/// Lets signals and the callback have their turn.
fn look(py: Python<'_>, progress: Option<&Py<PyAny>>, told: &Told, seen: &mut Seen) -> PyResult<()> {
    py.check_signals()?;
    let Some(callback) = progress else { return Ok(()) };
    for (stage, done, total) in told.since(seen) {
        callback.call1(py, (stage, done, total))?;
    }
    Ok(())
}

/// What the work has told so far.
#[derive(Debug, Default)]
struct Told {
    stages: Mutex<Vec<Stage>>,
    /// Of the last stage.
    done: AtomicU64,
}

#[derive(Debug)]
struct Stage {
    name: String,
    total: u64,
    done: u64,
}

/// What the callback has been told.
#[derive(Debug, Default)]
struct Seen {
    ended: usize,
    last: Option<(usize, u64)>,
}

impl Progress for Told {
    fn stage(&self, name: &str, total: u64) {
        let mut stages = self.stages.lock().unwrap_or_else(PoisonError::into_inner);
        let done = self.done.swap(0, Ordering::Relaxed);
        if let Some(last) = stages.last_mut() {
            last.done = done;
        }
        stages.push(Stage { name: name.to_owned(), total, done: 0 });
    }

    fn advance(&self, count: u64) {
        self.done.fetch_add(count, Ordering::Relaxed);
    }
}

impl Told {
    /// Stages that ended since, and the one at work where it went on.
    fn since(&self, seen: &mut Seen) -> Vec<(String, u64, u64)> {
        let stages = self.stages.lock().unwrap_or_else(PoisonError::into_inner);
        let mut news = Vec::new();
        let last = stages.len().saturating_sub(1);
        for stage in stages.iter().take(last).skip(seen.ended) {
            news.push((stage.name.clone(), stage.done, stage.total));
        }
        seen.ended = last;
        if let Some(stage) = stages.last() {
            let here = (last, self.done.load(Ordering::Relaxed));
            if seen.last != Some(here) {
                news.push((stage.name.clone(), here.1, stage.total));
                seen.last = Some(here);
            }
        }
        news
    }
}
