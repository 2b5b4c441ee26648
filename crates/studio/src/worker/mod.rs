//! The thread that owns meshes, textures and maps.

mod desk;
mod inbox;
pub mod live;
mod mapper;
mod message;
mod progress;
mod soup;
pub mod warp;

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

use barymap::Result;
use barymap::control::Control;

pub use message::{
    Confidence, Drawn, GuessFrom, LeftOut, OpenedShape, PairList, PlainPairs, Proposed, Report, Request, Rgba, Shown,
    Suggested,
};
pub use soup::{Corner, Part, Soup};

/// What a piece of work is worth when the window asks for something else.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Class {
    /// Makes things finer: ends at any request, and is begun again after it.
    Idle,
    /// Is needed for everything that follows: ends where another file is opened, or by hand.
    Base,
    /// Was asked for by hand: ends by hand.
    Asked,
}

/// The work that goes on.
type Current = Arc<Mutex<Option<(Control, Class)>>>;

/// The worker as the window sees it.
#[derive(Debug)]
pub struct Worker {
    sender: Sender<Request>,
    reports: Receiver<Report>,
    current: Current,
    sent: AtomicU64,
    rested: Arc<AtomicU64>,
    thread: Option<JoinHandle<()>>,
}

/// Where the worker's reports go.
#[derive(Clone)]
pub(crate) struct Out {
    sender: Sender<Report>,
    wake: Arc<dyn Fn() + Send + Sync>,
    current: Current,
    rested: Arc<AtomicU64>,
}

impl Out {
    /// Where the thread says how many requests it has done.
    pub(crate) fn rested(&self) -> Arc<AtomicU64> {
        self.rested.clone()
    }

    /// Sends a report, and wakes the window.
    pub(crate) fn send(&self, report: Report) {
        // A window that is gone needs no reports.
        _ = self.sender.send(report);
        (self.wake)();
    }

    /// Runs work under a control that the window can cancel. `still` is asked once the window can:
    /// whether nothing came in between.
    pub(crate) fn run<T>(
        &self,
        class: Class,
        still: impl FnOnce() -> bool,
        work: impl FnOnce() -> Result<T>,
    ) -> Result<T> {
        let control = Control::new();
        *self.current.lock().unwrap_or_else(PoisonError::into_inner) = Some((control.clone(), class));
        let result = if still() { control.run(work) } else { Err(barymap::Error::Cancelled) };
        *self.current.lock().unwrap_or_else(PoisonError::into_inner) = None;
        result
    }
}

impl Worker {
    /// Starts the thread. `wake` is called from it after every report.
    pub fn start(wake: impl Fn() + Send + Sync + 'static) -> Self {
        let (sender, requests) = channel();
        let (out, reports) = channel();
        let current = Current::default();
        let rested = Arc::new(AtomicU64::new(0));
        let out = Out { sender: out, wake: Arc::new(wake), current: current.clone(), rested: rested.clone() };
        let thread = std::thread::Builder::new().name("worker".into()).spawn(move || desk::run(requests, &out));
        Self { sender, reports, current, sent: AtomicU64::new(0), rested, thread: thread.ok() }
    }

    /// Whether all that was asked for is done, and nothing goes on.
    pub fn is_at_rest(&self) -> bool {
        self.rested.load(Ordering::Acquire) == self.sent.load(Ordering::Acquire)
    }

    /// Asks for something; returns at once.
    pub fn send(&self, request: Request) {
        self.sent.fetch_add(1, Ordering::AcqRel);
        let ends: fn(Class) -> bool = match request {
            Request::Stop | Request::Cancel => |_| true,
            Request::Open(..) | Request::Texture(_) | Request::Unwrap(_) => |class| class != Class::Asked,
            _ => |class| class == Class::Idle,
        };
        // First the request, so that work which begins afterwards sees it.
        _ = self.sender.send(request);
        let current = self.current.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((control, _)) = current.as_ref().filter(|(_, class)| ends(*class)) {
            control.cancel();
        }
    }

    /// What came since the last time.
    pub fn take(&self) -> Vec<Report> {
        self.reports.try_iter().collect()
    }

    /// Whether the thread ended by itself, which it never should.
    pub fn has_failed(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.send(Request::Stop);
        if let Some(thread) = self.thread.take() {
            // What it panicked with was printed already.
            _ = thread.join();
        }
    }
}
