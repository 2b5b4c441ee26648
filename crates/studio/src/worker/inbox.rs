//! What the window wants, as the sum of its requests.

use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvError, TryRecvError};
use std::time::Instant;

use barymap::surface::correspondence::Method;

use super::message::{GuessFrom, PairList, Request};
use crate::model::Side;

/// Something that was asked for once.
#[derive(Clone, Debug)]
pub(crate) enum Task {
    Guess(GuessFrom),
    Propose(usize),
    Suggest(usize),
    ReadPairs(PathBuf),
}

/// Requests, summed up.
#[derive(Debug)]
pub(crate) struct Inbox {
    requests: Receiver<Request>,
    /// How many came so far; and how many of them were done when there was nothing left to do.
    received: u64,
    rested: Arc<AtomicU64>,
    /// Files that are to be opened.
    pub(crate) opens: [Option<PathBuf>; 2],
    /// Another texture.
    pub(crate) texture: Option<Option<PathBuf>>,
    /// Whether the target is to be unwrapped, if that was said anew.
    pub(crate) unwrap: Option<bool>,
    /// The pairs.
    pub(crate) pairs: PairList,
    /// When they changed last.
    pub(crate) asked: Instant,
    /// Whether one of them is dragged.
    pub(crate) dragging: bool,
    /// The method.
    pub(crate) method: Method,
    /// The size at rest.
    pub(crate) size: u32,
    /// What was asked for once.
    pub(crate) tasks: VecDeque<Task>,
    /// Whether the user ended what was going on: nothing big begins by itself until something is
    /// asked for.
    pub(crate) paused: bool,
    /// Whether the thread is to end.
    pub(crate) stop: bool,
}

impl Inbox {
    pub(crate) fn new(requests: Receiver<Request>, rested: Arc<AtomicU64>) -> Self {
        Self {
            requests,
            received: 0,
            rested,
            opens: [None, None],
            texture: None,
            unwrap: None,
            pairs: Vec::new(),
            asked: Instant::now(),
            dragging: false,
            method: Method::Field,
            size: 1024,
            tasks: VecDeque::new(),
            paused: false,
            stop: false,
        }
    }

    /// Takes all requests; waits for one if so asked. Whether there was any.
    pub(crate) fn receive(&mut self, wait: bool) -> bool {
        let mut any = false;
        if wait && !self.stop {
            self.rested.store(self.received, Ordering::Release);
            match self.requests.recv() {
                Ok(request) => self.take(request),
                // The window is gone.
                Err(RecvError) => self.stop = true,
            }
            any = true;
        }
        loop {
            match self.requests.try_recv() {
                Ok(request) => self.take(request),
                Err(TryRecvError::Empty) => return any,
                Err(TryRecvError::Disconnected) => {
                    self.stop = true;
                    return true;
                }
            }
            any = true;
        }
    }

    fn take(&mut self, request: Request) {
        self.received += 1;
        match request {
            Request::Open(side, path) => {
                self.opens[side.index()] = Some(path);
                if side == Side::Source {
                    self.texture = Some(None);
                }
                self.tasks.clear();
            }
            Request::Texture(path) => self.texture = Some(path),
            Request::Unwrap(unwrap) => self.unwrap = Some(unwrap),
            Request::Pairs(pairs, dragging) => {
                if pairs != self.pairs {
                    self.asked = Instant::now();
                }
                (self.pairs, self.dragging) = (pairs, dragging);
            }
            Request::Method(method) => self.method = method,
            Request::Size(size) => self.size = size,
            Request::Guess(from) => {
                self.tasks.retain(|t| !matches!(t, Task::Guess(_)));
                self.tasks.push_front(Task::Guess(from));
            }
            Request::Propose(count) => self.tasks.push_back(Task::Propose(count)),
            Request::Suggest(count) => self.tasks.push_back(Task::Suggest(count)),
            Request::ReadPairs(path) => self.tasks.push_back(Task::ReadPairs(path)),
            Request::Cancel => {
                self.paused = true;
                self.tasks.clear();
                return;
            }
            Request::Stop => self.stop = true,
        }
        self.paused = false;
    }

    /// Whether something is wanted that changes what sessions borrow.
    pub(crate) fn needs_desk(&self) -> bool {
        self.stop || self.opens.iter().any(Option::is_some) || self.texture.is_some() || self.unwrap.is_some()
    }
}
