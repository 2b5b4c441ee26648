//! The library runs in a page, on a device of WebGPU: as a page awaits it, and with WebAssembly
//! that the browser suspends while the library waits.

use std::path::Path;

use super::server::Files;
use super::visit;

const PAGE: &str = "<!doctype html><title>library</title><script type=module src=/page.js></script>";

#[test]
fn the_library_runs_in_a_page() {
    let Some(folder) = std::env::var_os("BARYMAP_WEB") else {
        println!("SKIPPED: no Chromium (bash tests/browser.sh finds it, and builds the page)");
        return;
    };
    let mut files = Files::from([("/".into(), ("text/html", PAGE.into()))]);
    for (name, kind) in [
        ("barymap_browser.js", "text/javascript"),
        ("barymap_browser_bg.wasm", "application/wasm"),
        ("page.js", "text/javascript"),
        ("pause.js", "text/javascript"),
    ] {
        let path = Path::new(&folder).join(name);
        let content = std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        files.insert(format!("/{name}"), (kind, content));
    }
    let Some(told) = visit(files) else { return };
    let Some(checks) = told["checks"].as_array() else { panic!("{told}") };
    println!("{}", told["engine"]);
    let lines: Vec<&str> = checks.iter().map(|c| c.as_str().unwrap()).collect();
    println!("{}", lines.join("\n"));
    assert_eq!(lines.len(), barymap::conformance::checks().len());
    assert!(lines.iter().all(|line| line.starts_with("passed ")));
}
