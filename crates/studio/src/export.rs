//! Exports: the command line in a process of its own.

use std::io::Read;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex, PoisonError};

/// The first argument that makes the studio's program the command line.
pub const AS_COMMAND_LINE: &str = "--as-command-line";

/// How an export ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Ended {
    /// All is written; what the command line said.
    Done(String),
    /// Nothing is written, and why.
    Failed(String),
    /// It was ended by hand.
    Cancelled,
}

/// An export that goes on.
#[derive(Debug)]
pub struct Export {
    child: Arc<Mutex<Child>>,
    cancelled: bool,
    ended: Receiver<Ended>,
}

impl Export {
    /// Starts the program at `program` as the command line with these arguments; `wake` is called
    /// when it ends.
    ///
    /// # Errors
    /// In words, if it cannot be started.
    pub fn start(program: &PathBuf, words: &[String], wake: impl FnOnce() + Send + 'static) -> Result<Self, String> {
        let mut command = Command::new(program);
        command.arg(AS_COMMAND_LINE).args(words);
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command
            .spawn()
            .map_err(|e| format!("{}: {e}. Copy the command line and run it in a terminal", program.display()))?;
        let (mut out, mut err) = (child.stdout.take(), child.stderr.take());
        let child = Arc::new(Mutex::new(child));
        let (sender, ended) = channel();
        let process = child.clone();
        std::thread::spawn(move || {
            let mut text = String::new();
            // What cannot be read is not shown.
            _ = err.as_mut().map(|s| s.read_to_string(&mut text));
            _ = out.as_mut().map(|s| s.read_to_string(&mut text));
            let status = process.lock().unwrap_or_else(PoisonError::into_inner).wait();
            let text = text.trim().to_owned();
            let done = status.is_ok_and(|s| s.success());
            // A window that is gone does not listen.
            _ = sender.send(if done { Ended::Done(text) } else { Ended::Failed(text) });
            wake();
        });
        Ok(Self { child, cancelled: false, ended })
    }

    /// Ends it; files that were to be written are as they were.
    pub fn cancel(&mut self) {
        self.cancelled = true;
        // One that has ended needs no end.
        _ = self.child.lock().unwrap_or_else(PoisonError::into_inner).kill();
    }

    /// How it ended, once it has.
    pub fn ended(&mut self) -> Option<Ended> {
        let ended = self.ended.try_recv().ok()?;
        Some(if self.cancelled { Ended::Cancelled } else { ended })
    }
}

impl Drop for Export {
    fn drop(&mut self) {
        self.cancel();
    }
}
