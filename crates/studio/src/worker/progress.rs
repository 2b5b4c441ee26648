//! Progress, as reports that are few enough for a window.

use std::sync::Mutex;
use std::time::{Duration, Instant};

use barymap::progress::Progress;

use super::{Out, Report};

/// Between two reports at least.
const EVERY: Duration = Duration::from_millis(50);

/// Reports the progress of one piece of work.
pub(crate) struct Reporter<'a> {
    out: &'a Out,
    what: &'a str,
    state: Mutex<State>,
}

struct State {
    stage: String,
    done: u64,
    total: u64,
    told: Instant,
}

impl<'a> Reporter<'a> {
    /// Says that work begins, in words for the user: "embedding the source".
    pub(crate) fn new(out: &'a Out, what: &'a str) -> Self {
        out.send(Report::Busy(what.to_owned(), 0, 0));
        let state = State { stage: String::new(), done: 0, total: 0, told: Instant::now() };
        Self { out, what, state: Mutex::new(state) }
    }

    fn tell(&self, state: &mut State) {
        state.told = Instant::now();
        self.out.send(Report::Busy(format!("{}: {}", self.what, state.stage), state.done, state.total));
    }
}

impl Drop for Reporter<'_> {
    fn drop(&mut self) {
        self.out.send(Report::Idle);
    }
}

impl Progress for Reporter<'_> {
    fn stage(&self, name: &str, total: u64) {
        let Ok(mut state) = self.state.lock() else { return };
        (state.stage, state.done, state.total) = (name.to_owned(), 0, total);
        self.tell(&mut state);
    }

    fn advance(&self, count: u64) {
        let Ok(mut state) = self.state.lock() else { return };
        state.done += count;
        if state.told.elapsed() >= EVERY {
            self.tell(&mut state);
        }
    }
}
