//! Progress over the whole job: a bar on a terminal, a line now and then elsewhere.

use std::io::{IsTerminal, Write};
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::cli::machine::Machine;
use crate::cli::plan::{Plan, Stages};
use crate::progress::Progress;

/// Time between two lines.
const EVERY: Duration = Duration::from_secs(5);
/// Parts of a whole bar.
const PARTS: u64 = 1000;

/// Shows on stderr what a command does, how far the whole job is, and for how long it has worked: a
/// bar on a terminal, which leaves nothing behind; else a line every few seconds. How long the rest
/// takes is not told: stages are too different to know.
#[derive(Debug)]
pub(crate) struct Bars {
    state: Arc<Mutex<State>>,
    /// Tells lines in time, however long a stage says nothing. It ends when the sender is gone.
    teller: Option<(Sender<()>, JoinHandle<()>)>,
}

/// What is known and how it is shown.
#[derive(Debug)]
struct State {
    shown: Shown,
    begun: Instant,
    stage: String,
    plan: Plan,
}

/// How it is shown.
#[derive(Debug)]
enum Shown {
    Nothing,
    Bar(Option<ProgressBar>),
    /// The time of the last line.
    Lines(Instant),
}

impl State {
    /// What there is to say at `now`, if it is time.
    fn due(&mut self, now: Instant) -> Option<String> {
        let Shown::Lines(last) = &mut self.shown else { return None };
        if self.stage.is_empty() || now.duration_since(*last) < EVERY {
            return None;
        }
        *last = now;
        let share = self.plan.share().map_or_else(String::new, |s| format!(", {:.0} % of the whole", 100.0 * s));
        Some(format!("{}{share}, {} s since the start", self.stage, now.duration_since(self.begun).as_secs()))
    }

    /// Brings what is shown up to date.
    fn show(&mut self) {
        if let Some(text) = self.due(Instant::now()) {
            // As common::note: a closed stream changes nothing.
            let _ = writeln!(std::io::stderr(), "{text}");
        }
        let share = self.plan.share();
        if let Shown::Bar(Some(bar)) = &self.shown {
            bar.set_position((share.unwrap_or(0.0) * PARTS as f64) as u64);
        }
    }
}

impl Bars {
    /// Progress on stderr of a job with these stages, unless `quiet`.
    pub(crate) fn new(quiet: bool, stages: Stages) -> Self {
        let (begun, more_threads) = (Instant::now(), Machine::here().more_threads);
        // A bar draws itself from a thread of its own.
        let shown = match (quiet, std::io::stderr().is_terminal() && more_threads) {
            (true, _) => Shown::Nothing,
            (false, true) => Shown::Bar(None),
            (false, false) => Shown::Lines(begun),
        };
        let lines = matches!(shown, Shown::Lines(_)) && more_threads;
        let state = State { shown, begun, stage: String::new(), plan: Plan::new(stages) };
        let state = Arc::new(Mutex::new(state));
        let teller = lines.then(|| teller(Arc::clone(&state))).flatten();
        Self { state, teller }
    }

    /// Item `k` of `count` equal ones begins.
    pub(crate) fn item(&self, k: usize, count: usize) {
        let mut state = lock(&self.state);
        state.plan.item(k, count);
        state.show();
    }

    /// Removes the bar, until the next stage begins.
    pub(crate) fn finish(&self) {
        if let Shown::Bar(bar) = &mut lock(&self.state).shown
            && let Some(bar) = bar.take()
        {
            bar.finish_and_clear();
        }
    }
}

fn lock(state: &Mutex<State>) -> MutexGuard<'_, State> {
    state.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Starts the thread that tells lines; none where the system gives none.
fn teller(state: Arc<Mutex<State>>) -> Option<(Sender<()>, JoinHandle<()>)> {
    let (sender, receiver) = mpsc::channel::<()>();
    let work = move || {
        while receiver.recv_timeout(Duration::from_secs(1)) == Err(RecvTimeoutError::Timeout) {
            lock(&state).show();
        }
    };
    let thread = thread::Builder::new().name("progress".into()).spawn(work).ok()?;
    Some((sender, thread))
}

/// A bar for a job that began at `begun`; without a bar where its `share` is not known.
fn bar(name: &str, begun: Instant, share: Option<f64>) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(PARTS), ProgressDrawTarget::stderr_with_hz(8));
    let template = match share {
        None => "{msg:28} {spinner} {elapsed}",
        Some(_) => "{msg:28} {bar:30} {percent:>3} %  {elapsed}",
    };
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    let bar = bar.with_elapsed(begun.elapsed()).with_message(name.to_owned());
    bar.enable_steady_tick(Duration::from_millis(500));
    bar
}

impl Progress for Bars {
    fn stage(&self, name: &str, total: u64) {
        let mut state = lock(&self.state);
        state.plan.stage(name, total);
        name.clone_into(&mut state.stage);
        let (begun, share) = (state.begun, state.plan.share());
        if let Shown::Bar(current) = &mut state.shown
            && let Some(old) = current.replace(bar(name, begun, share))
        {
            old.finish_and_clear();
        }
        state.show();
    }

    fn advance(&self, count: u64) {
        let mut state = lock(&self.state);
        state.plan.advance(count);
        state.show();
    }
}

impl Drop for Bars {
    fn drop(&mut self) {
        self.finish();
        if let Some((sender, thread)) = self.teller.take() {
            drop(sender);
            // A line that is being written is finished; a panic there has been told.
            let _ = thread.join();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_comes_every_few_seconds_and_says_how_far() {
        let begun = Instant::now();
        let at = |seconds: u64| begun + Duration::from_secs(seconds);
        let plan = Plan::new(&[&[("map", 30.0), ("transfer", 70.0)]]);
        let mut state = State { shown: Shown::Lines(begun), begun, stage: String::new(), plan };
        assert_eq!(state.due(at(60)), None, "nothing has begun");
        state.stage = "map".into();
        state.plan.stage("map", 200);
        state.plan.advance(100);
        assert_eq!(state.due(at(4)), None);
        assert_eq!(state.due(at(7)).unwrap(), "map, 15 % of the whole, 7 s since the start");
        assert_eq!(state.due(at(11)), None);
        state.stage = "transfer".into();
        state.plan.stage("transfer", 200);
        assert_eq!(state.due(at(12)).unwrap(), "transfer, 30 % of the whole, 12 s since the start");
        // Counts of several passes may go beyond the total.
        state.plan.advance(300);
        assert_eq!(state.due(at(30)).unwrap(), "transfer, 100 % of the whole, 30 s since the start");
        let mut unknown = State { plan: Plan::new(&[]), ..state };
        unknown.plan.stage("transfer", 0);
        assert_eq!(unknown.due(at(40)).unwrap(), "transfer, 40 s since the start");
    }
}
