//! Work that takes long tells how far it is, and ends when it is asked to.

use std::f64::consts::TAU;
use std::io::Read;
use std::process::{Command, Stdio};

use serde_json::json;

use crate::support::Folder;

/// A cage of `count` vertices: a circle that becomes a flower.
fn flower(f: &Folder, count: usize) {
    let ring = |radius: &dyn Fn(f64) -> f64| -> Vec<[f64; 2]> {
        let angle = |k: usize| TAU * k as f64 / count as f64;
        (0..count).map(angle).map(|a| [64.0 + radius(a) * a.cos(), 64.0 + radius(a) * a.sin()]).collect()
    };
    let (source, target) = (ring(&|_| 50.0), ring(&|a| 50.0 + 3.0 * (5.0 * a).sin()));
    f.write("flower.json", &json!({"source": source, "target": target}).to_string());
}

#[test]
#[cfg(unix)]
fn a_long_proof_tells_how_far_it_is_and_ends_at_once() {
    let f = Folder::spheres();
    flower(&f, 2000);
    let before = f.names();
    let mut command = f.command();
    command.args("warp s.png --cage flower.json --certify --boxes 100000000 -o o.png --backend cpu".split_whitespace());
    let mut child = command.stderr(Stdio::piped()).stdout(Stdio::null()).spawn().unwrap();
    // Lines come while the proof is at work; the first that is about it is waited for.
    let (mut told, mut byte) = (String::new(), [0]);
    let mut stderr = child.stderr.take().unwrap();
    while !told.lines().any(|l| l.starts_with("certificate, ") && l.ends_with("since the start")) {
        assert_eq!(stderr.read(&mut byte).unwrap(), 1, "it ended: {told}");
        told.push(char::from(byte[0]));
    }
    let line = told.lines().last().unwrap();
    assert!(line.contains(" % of the whole, "), "{line}");
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
    assert_eq!(child.wait().unwrap().code(), Some(130), "{told}");
    assert_eq!(f.names(), before, "nothing stays behind");
}
