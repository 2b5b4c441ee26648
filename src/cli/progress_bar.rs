//! Progress: a bar on a terminal, a line now and then elsewhere.

use std::io::{IsTerminal, Write};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::cli::machine::Machine;
use crate::progress::Progress;

/// Time between two lines.
const EVERY: Duration = Duration::from_secs(5);

/// Shows on stderr how far each stage is, and for how long the command has worked: a bar on a
/// terminal, which leaves nothing behind; else a line every few seconds.
#[derive(Debug)]
pub(crate) struct Bars {
    shown: Mutex<Shown>,
    begun: Instant,
}

/// What is shown of the stage.
#[derive(Debug)]
enum Shown {
    Nothing,
    Bar(Option<ProgressBar>),
    Lines(Lines),
}

/// A stage told in lines.
#[derive(Debug)]
struct Lines {
    stage: String,
    done: u64,
    total: u64,
    last: Instant,
}

impl Lines {
    /// What there is to say at `now`, if it is time.
    fn due(&mut self, begun: Instant, now: Instant) -> Option<String> {
        if self.stage.is_empty() || now.duration_since(self.last) < EVERY {
            return None;
        }
        self.last = now;
        let share = match self.total {
            0 => String::new(),
            // Counts of several passes may go beyond it.
            total => format!(", {} %", 100 * self.done.min(total) / total),
        };
        Some(format!("{}{share}, {} s since the start", self.stage, now.duration_since(begun).as_secs()))
    }
}

impl Bars {
    /// Progress on stderr, unless `quiet`.
    pub(crate) fn new(quiet: bool) -> Self {
        let begun = Instant::now();
        // A bar draws itself from a thread of its own.
        let shown = match (quiet, std::io::stderr().is_terminal() && Machine::here().more_threads) {
            (true, _) => Shown::Nothing,
            (false, true) => Shown::Bar(None),
            (false, false) => Shown::Lines(Lines { stage: String::new(), done: 0, total: 0, last: begun }),
        };
        Self { shown: Mutex::new(shown), begun }
    }

    fn shown(&self) -> MutexGuard<'_, Shown> {
        self.shown.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn tell(&self, lines: &mut Lines) {
        if let Some(text) = lines.due(self.begun, Instant::now()) {
            // As common::note: a closed stream changes nothing.
            let _ = writeln!(std::io::stderr(), "{text}");
        }
    }

    /// Removes the last bar.
    pub(crate) fn finish(&self) {
        if let Shown::Bar(bar) = &mut *self.shown()
            && let Some(bar) = bar.take()
        {
            bar.finish_and_clear();
        }
    }
}

/// A bar for a stage of `total` items; 0 where that is not known.
fn bar(name: &str, total: u64) -> ProgressBar {
    let bar = ProgressBar::with_draw_target((total > 0).then_some(total), ProgressDrawTarget::stderr_with_hz(8));
    let template = match total {
        0 => "{msg:28} {spinner} {elapsed}",
        _ => "{msg:28} {bar:30} {percent:>3} %  {elapsed}, {eta} left of this stage",
    };
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    bar.set_message(name.to_owned());
    bar.enable_steady_tick(Duration::from_millis(500));
    bar
}

impl Progress for Bars {
    fn stage(&self, name: &str, total: u64) {
        match &mut *self.shown() {
            Shown::Nothing => {}
            Shown::Bar(current) => {
                if let Some(old) = current.replace(bar(name, total)) {
                    old.finish_and_clear();
                }
            }
            Shown::Lines(lines) => {
                (lines.stage, lines.done, lines.total) = (name.to_owned(), 0, total);
                self.tell(lines);
            }
        }
    }

    fn advance(&self, count: u64) {
        match &mut *self.shown() {
            Shown::Nothing => {}
            Shown::Bar(bar) => {
                if let Some(bar) = bar {
                    bar.inc(count);
                }
            }
            Shown::Lines(lines) => {
                lines.done = lines.done.saturating_add(count);
                self.tell(lines);
            }
        }
    }
}

impl Drop for Bars {
    fn drop(&mut self) {
        self.finish();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_comes_every_few_seconds_and_says_how_far() {
        let begun = Instant::now();
        let at = |seconds: u64| begun + Duration::from_secs(seconds);
        let mut lines = Lines { stage: String::new(), done: 0, total: 0, last: begun };
        assert_eq!(lines.due(begun, at(60)), None, "nothing has begun");
        (lines.stage, lines.done, lines.total) = ("transfer".into(), 30, 200);
        assert_eq!(lines.due(begun, at(4)), None);
        assert_eq!(lines.due(begun, at(7)).unwrap(), "transfer, 15 %, 7 s since the start");
        assert_eq!(lines.due(begun, at(11)), None);
        (lines.done, lines.total) = (300, 200);
        assert_eq!(lines.due(begun, at(12)).unwrap(), "transfer, 100 %, 12 s since the start");
        lines.total = 0;
        assert_eq!(lines.due(begun, at(30)).unwrap(), "transfer, 30 s since the start");
    }
}
