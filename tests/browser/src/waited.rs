//! The form for browsers that can suspend WebAssembly: the library waits as on a desktop.

use std::sync::{Mutex, OnceLock, PoisonError};

use barymap::conformance;
use barymap::engine::{Backend, Engine, EngineOptions};
use wasm_bindgen::prelude::wasm_bindgen;

// Neither may pass through the code that wasm-bindgen writes: a frame of JavaScript between an
// export that promises and an import that suspends cannot be suspended.
#[link(wasm_import_module = "./pause.js")]
unsafe extern "C" {
    /// Suspends until the browser has done what is due.
    safe fn pause();
}

static ENGINE: OnceLock<Result<Engine, String>> = OnceLock::new();
static SAID: Mutex<String> = Mutex::new(String::new());

/// The names of the checks.
#[wasm_bindgen]
pub fn names() -> Vec<String> {
    conformance::checks().iter().map(|c| c.name.to_owned()).collect()
}

/// Runs a check; `said` tells how it ended.
#[unsafe(no_mangle)]
pub extern "C" fn check(index: usize) {
    Engine::pause_with(|| pause());
    let start =
        || Engine::new(EngineOptions { backend: Backend::Gpu, ..EngineOptions::default() }).map_err(|e| e.to_string());
    let line = match (ENGINE.get_or_init(start), conformance::checks().get(index)) {
        (Err(e), _) => format!("FAILED to start: {e}"),
        (_, None) => "FAILED: there is no such check".to_owned(),
        (Ok(engine), Some(check)) => match check.run(engine) {
            Err(e) => format!("FAILED {}: {e}", check.name),
            Ok(found) => format!(
                "{} {}: error {:.1e} of {:.1e} {}, {:.0} ms",
                if check.passes(&found) { "passed" } else { "FAILED" },
                check.name,
                found.error,
                check.tolerance,
                check.unit,
                found.device.as_secs_f64() * 1e3
            ),
        },
    };
    *SAID.lock().unwrap_or_else(PoisonError::into_inner) = line;
}

/// How the last check ended.
#[wasm_bindgen]
pub fn said() -> String {
    SAID.lock().unwrap_or_else(PoisonError::into_inner).clone()
}
