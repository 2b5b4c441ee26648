//! What Chromium says of the library: behind a switch, for it is large and not everywhere.
//!
//! `BARYMAP_CHROMIUM` names the program; `bash tests/browser.sh` finds it and runs these tests. A
//! page is served from memory on this machine, and sends back what it found.

mod kernels;
mod library;
mod server;

use std::process::{Child, Command, Stdio};
use std::sync::mpsc::channel;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use serde_json::Value;
use server::{Files, Told, serve};

/// Longest silence of a page. A kernel that compiles for longer is a fault: a page would seem dead.
const PATIENCE: Duration = Duration::from_secs(60);

/// WebGPU on the processor, by the driver that Chromium brings along.
const FLAGS: [&str; 6] = [
    "--headless=new",
    "--no-sandbox",
    "--no-first-run",
    "--disable-dev-shm-usage",
    "--enable-unsafe-webgpu",
    "--use-webgpu-adapter=swiftshader",
];

/// One browser at a time.
static TURN: Mutex<()> = Mutex::new(());

/// A browser that ends with the test.
struct Browser(Child);

impl Drop for Browser {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// What the page `/` of `files` finds; `None` without a browser.
fn visit(files: Files) -> Option<Value> {
    let Some(program) = std::env::var_os("BARYMAP_CHROMIUM") else {
        println!("SKIPPED: no Chromium (bash tests/browser.sh finds it)");
        return None;
    };
    let _turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
    let (tell, told) = channel();
    let address = serve(files, tell);
    let profile = tempfile::tempdir().unwrap();
    let child = Command::new(&program)
        .args(FLAGS)
        .arg(format!("--user-data-dir={}", profile.path().display()))
        .arg(format!("http://{address}/"))
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap_or_else(|e| panic!("BARYMAP_CHROMIUM={}: {e}", program.display()));
    let _browser = Browser(child);
    let mut step = "its start".to_owned();
    loop {
        match told.recv_timeout(PATIENCE) {
            Ok(Told::Step(next)) => step = next,
            Ok(Told::End(found)) => return Some(found),
            Err(_) => panic!("the page is silent for {} s after: {step}", PATIENCE.as_secs()),
        }
    }
}
