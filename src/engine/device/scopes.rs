//! What a device objects to, and whose work it was.
//!
//! Where a thread can wait, an objection is the error of the call that it is about. A browser tells
//! later: there objections are kept until results are read, which is when they matter.

use std::future::Future;
use std::pin::Pin;
use std::sync::{Mutex, PoisonError};
use std::task::{Context, Poll, Waker};

use crate::error::{Error, Result};

/// Verdicts that are kept before those which have come in are looked through.
const MANY: usize = 1024;

/// What a device says of some work.
type Verdict = Pin<Box<dyn Future<Output = Result<()>> + Send>>;

/// What catches the objections to the work that this thread does.
pub(super) struct Scopes {
    memory: wgpu::ErrorScopeGuard,
    internal: wgpu::ErrorScopeGuard,
    validation: wgpu::ErrorScopeGuard,
}

impl Scopes {
    pub(super) fn open(device: &wgpu::Device) -> Self {
        Self {
            memory: device.push_error_scope(wgpu::ErrorFilter::OutOfMemory),
            internal: device.push_error_scope(wgpu::ErrorFilter::Internal),
            validation: device.push_error_scope(wgpu::ErrorFilter::Validation),
        }
    }

    /// Ends the work, called `what` in messages. The future is what the device says of it.
    pub(super) fn close(self, what: &str) -> impl Future<Output = Result<()>> + Send + use<> {
        let (validation, internal) = (self.validation.pop(), self.internal.pop());
        let memory = self.memory.pop();
        let what = what.to_owned();
        async move {
            let faults = [validation.await, internal.await];
            let (fault, remedy) = match (memory.await, faults.into_iter().flatten().next()) {
                (Some(e), _) => {
                    (e, "Set a smaller --memory, close other programs that use the device, or use --backend cpu")
                }
                (None, Some(e)) => (e, "Please report it; --backend cpu does the same work without the device"),
                (None, None) => return Ok(()),
            };
            Err(Error::Device { what: format!("{what}: {}", describe(&fault)), remedy: remedy.into() })
        }
    }
}

/// One line out of a device's complaint.
pub(super) fn describe(e: &wgpu::Error) -> String {
    let text = match e {
        wgpu::Error::OutOfMemory { .. } => "out of memory".to_string(),
        wgpu::Error::Validation { description, .. } | wgpu::Error::Internal { description, .. } => description.clone(),
    };
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Verdicts that are still to come, in the order of the work.
#[derive(Default)]
pub(super) struct Verdicts(Mutex<Vec<Verdict>>);

impl Verdicts {
    /// Keeps a verdict for [`Verdicts::all`].
    pub(super) fn keep(&self, verdict: impl Future<Output = Result<()>> + Send + 'static) {
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if kept.len() >= MANY {
            for verdict in std::mem::take(&mut *kept) {
                kept.extend(unless_good(verdict));
            }
        }
        kept.push(Box::pin(verdict));
    }

    /// Waits for all verdicts on the work so far.
    ///
    /// # Errors
    /// The first objection.
    pub(super) async fn all(&self) -> Result<()> {
        let kept = std::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner));
        for verdict in kept {
            verdict.await?;
        }
        Ok(())
    }
}

/// A verdict that has not come in or is an objection.
fn unless_good(mut verdict: Verdict) -> Option<Verdict> {
    match verdict.as_mut().poll(&mut Context::from_waker(Waker::noop())) {
        Poll::Pending => Some(verdict),
        Poll::Ready(Ok(())) => None,
        Poll::Ready(Err(e)) => Some(Box::pin(std::future::ready(Err(e)))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn objection(what: &str) -> Result<()> {
        Err(Error::Device { what: what.into(), remedy: String::new() })
    }

    #[test]
    fn the_first_objection_is_told_once() {
        let verdicts = Verdicts::default();
        verdicts.keep(async { Ok(()) });
        verdicts.keep(async { objection("first") });
        verdicts.keep(async { objection("second") });
        let told = pollster::block_on(verdicts.all()).unwrap_err();
        assert!(told.to_string().contains("first"), "{told}");
        assert!(pollster::block_on(verdicts.all()).is_ok());
    }

    #[test]
    fn objections_outlast_many_good_verdicts() {
        let verdicts = Verdicts::default();
        verdicts.keep(async { objection("early") });
        (0..3 * MANY).for_each(|_| verdicts.keep(async { Ok(()) }));
        assert!(verdicts.0.lock().unwrap().len() <= MANY + 1);
        assert!(pollster::block_on(verdicts.all()).is_err());
    }
}
