//! Serves files from memory to a browser on this machine, and hears what its page tells.

use std::collections::HashMap;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::mpsc::Sender;
use std::thread;

use serde_json::Value;

/// Type and content by path.
pub(super) type Files = HashMap<String, (&'static str, Vec<u8>)>;

/// What a page tells.
pub(super) enum Told {
    /// What it begins with.
    Step(String),
    /// All it found.
    End(Value),
}

/// Serves until the program ends.
pub(super) fn serve(files: Files, tell: Sender<Told>) -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let files = Arc::new(files);
    thread::spawn(move || {
        for stream in listener.incoming().flatten() {
            let (files, tell) = (Arc::clone(&files), tell.clone());
            // Browsers open connections that they do not use.
            thread::spawn(move || answer(stream, &files, &tell));
        }
    });
    address
}

/// Answers one request; a connection that breaks is the browser's to open again.
fn answer(mut stream: TcpStream, files: &Files, tell: &Sender<Told>) -> Option<()> {
    let mut reader = BufReader::new(stream.try_clone().ok()?);
    let mut line = String::new();
    reader.read_line(&mut line).ok()?;
    let path = line.split(' ').nth(1)?.to_owned();
    let mut length = 0;
    loop {
        line.clear();
        reader.read_line(&mut line).ok()?;
        if line.trim().is_empty() {
            break;
        }
        let (name, value) = line.split_once(':')?;
        if name.eq_ignore_ascii_case("content-length") {
            length = value.trim().parse().ok()?;
        }
    }
    let mut body = vec![0; length];
    reader.read_exact(&mut body).ok()?;
    let empty = ("text/plain", Vec::new());
    let (status, (kind, content)) = match path.as_str() {
        "/step" | "/end" => {
            let value: Value = serde_json::from_slice(&body).ok()?;
            let said = if path == "/end" { Told::End(value) } else { Told::Step(value.to_string()) };
            // The test may have ended.
            let _ = tell.send(said);
            ("200 OK", &empty)
        }
        path => files.get(path).map_or(("404 Not Found", &empty), |file| ("200 OK", file)),
    };
    let head = format!("HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {}\r\n", content.len());
    stream.write_all(format!("{head}Connection: close\r\n\r\n").as_bytes()).ok()?;
    stream.write_all(content).ok()
}
