//! The end of a copy to the host: told by a callback of the device, awaited by whoever reads.

use std::future::Future;
use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll, Waker};

/// How a copy ended.
pub(super) type Outcome = std::result::Result<(), String>;

#[derive(Debug, Default)]
struct State {
    outcome: Option<Outcome>,
    waker: Option<Waker>,
}

/// Resolves to how the copy ended.
#[derive(Debug)]
pub(super) struct Arrival(Arc<Mutex<State>>);

/// Says how the copy ended; dropped without a word, that it never will.
#[derive(Debug)]
pub(super) struct Herald(Arc<Mutex<State>>);

/// Both ends of a copy that is under way.
pub(super) fn arrival() -> (Herald, Arrival) {
    let state = Arc::new(Mutex::new(State::default()));
    (Herald(Arc::clone(&state)), Arrival(state))
}

impl Herald {
    /// Says how the copy ended.
    pub(super) fn tell(self, outcome: Outcome) {
        self.set(outcome);
    }

    fn set(&self, outcome: Outcome) {
        let waker = {
            let mut state = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            state.outcome.get_or_insert(outcome);
            state.waker.take()
        };
        waker.into_iter().for_each(Waker::wake);
    }
}

impl Drop for Herald {
    fn drop(&mut self) {
        // Nothing changes where the outcome was told.
        self.set(Err("the device gave the copy up".into()));
    }
}

impl Arrival {
    /// Whether the copy has ended; returns at once.
    pub(super) fn is_there(&self) -> bool {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).outcome.is_some()
    }
}

impl Future for Arrival {
    type Output = Outcome;

    fn poll(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Outcome> {
        let mut state = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        match &state.outcome {
            Some(outcome) => Poll::Ready(outcome.clone()),
            None => {
                state.waker = Some(context.waker().clone());
                Poll::Pending
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_told_on_another_thread_arrives() {
        let (herald, arrival) = arrival();
        let teller = std::thread::spawn(move || herald.tell(Ok(())));
        assert_eq!(pollster::block_on(arrival), Ok(()));
        teller.join().unwrap();
    }

    #[test]
    fn a_herald_that_says_nothing_ends_the_wait() {
        let (herald, arrival) = arrival();
        drop(herald);
        assert!(pollster::block_on(arrival).is_err());
    }
}
