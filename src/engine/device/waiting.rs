//! Waiting on a thread for what a driver does by itself.

use std::future::Future;
#[cfg(target_arch = "wasm32")]
use std::{
    pin::pin,
    sync::OnceLock,
    task::{Context, Poll, Waker},
};

use crate::engine::Engine;
use crate::error::Result;

/// Whether a thread can wait. In a browser nothing comes to an end before the thread has returned.
pub(super) const CAN_WAIT: bool = cfg!(not(target_arch = "wasm32"));

/// The value of a future, on this thread.
///
/// # Errors
/// Those of the future; [`Error::NoAdapter`](crate::Error::NoAdapter) in a browser, if the value is
/// not there at once and [`Engine::pause_with`] was not called.
#[cfg(not(target_arch = "wasm32"))]
pub(super) fn block_on<T>(future: impl Future<Output = Result<T>>) -> Result<T> {
    pollster::block_on(future)
}

#[cfg(target_arch = "wasm32")]
pub(super) fn block_on<T>(future: impl Future<Output = Result<T>>) -> Result<T> {
    let mut future = pin!(future);
    loop {
        if let Poll::Ready(value) = future.as_mut().poll(&mut Context::from_waker(Waker::noop())) {
            return value;
        }
        match PAUSE.get() {
            Some(pause) => pause(),
            None => {
                return Err(crate::Error::NoAdapter {
                    what: "a thread of a browser cannot wait for a device".into(),
                    remedy: "Await Engine::start and Gpu::read_async there, or use the CPU back end".into(),
                });
            }
        }
    }
}

#[cfg(target_arch = "wasm32")]
static PAUSE: OnceLock<fn()> = OnceLock::new();

impl Engine {
    /// Lets calls that wait for a device work in a browser: they call `pause`, again and again,
    /// which has to let the browser work on and then to return. WebAssembly can do so by its
    /// promise integration (`WebAssembly.Suspending`); `tests/browser` shows how. The first call
    /// counts; outside of a browser threads wait by themselves.
    pub fn pause_with(pause: fn()) {
        #[cfg(target_arch = "wasm32")]
        PAUSE.get_or_init(|| pause);
        #[cfg(not(target_arch = "wasm32"))]
        let _ = pause;
    }
}
