//! What the library shows: few public items that no command, example or front page uses.
//!
//! Items are counted by name, as a reader of the documentation meets them: those of public modules,
//! and those that public modules re-export. What only tests and benches use is `doc(hidden)`.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Public items that nobody uses by name: mostly types of results and options.
const MOST: usize = 60;

const KINDS: [&str; 8] = ["fn", "struct", "enum", "trait", "type", "const", "static", "union"];

/// The file of a module that `folder` holds.
fn module_file(folder: &Path, name: &str) -> Option<PathBuf> {
    [folder.join(format!("{name}.rs")), folder.join(name).join("mod.rs")].into_iter().find(|p| p.is_file())
}

/// The names that a line makes public, and the module that it declares with its visibility.
fn read_line(line: &str) -> (Vec<String>, Option<(String, bool)>) {
    let (public, rest) = match line.strip_prefix("pub ") {
        Some(rest) => (true, rest),
        None => (false, line.strip_prefix("pub(crate) ").unwrap_or(line)),
    };
    if let Some(name) = rest.strip_prefix("mod ").and_then(|r| r.strip_suffix(';')) {
        return (Vec::new(), Some((name.to_owned(), public)));
    }
    if !public {
        return (Vec::new(), None);
    }
    let words: Vec<&str> = rest.split(|c: char| !(c.is_alphanumeric() || c == '_')).filter(|w| !w.is_empty()).collect();
    if words.first() == Some(&"use") {
        // The last part of every path.
        let names = rest[4..].split([',', '{', '}', ';']).filter_map(|path| path.trim().rsplit("::").next());
        return (names.filter(|n| !n.is_empty()).map(str::to_owned).collect(), None);
    }
    let skipped = words.iter().skip_while(|w| ["unsafe", "async"].contains(w));
    let mut words = skipped.copied().peekable();
    let mut kind = words.next();
    if kind == Some("const") && words.peek() == Some(&"fn") {
        kind = words.next();
    }
    let name = kind.filter(|k| KINDS.contains(k)).and_then(|_| words.next());
    (name.map(str::to_owned).into_iter().collect(), None)
}

/// The public items of a text, and the modules that it declares.
fn read_text(text: &str) -> (Vec<String>, Vec<(String, bool)>) {
    let (mut items, mut modules) = (Vec::new(), Vec::new());
    let (mut hidden, mut test) = (false, false);
    let mut joined = String::new();
    for line in text.lines() {
        if line.starts_with("#[") || line.starts_with("///") {
            hidden |= line.contains("doc(hidden)");
            test |= line.contains("cfg(test)");
            continue;
        }
        // A list of names may take several lines.
        joined.push_str(line);
        if joined.starts_with("pub use ") && !joined.ends_with(';') {
            continue;
        }
        let (names, module) = read_line(&joined);
        if !hidden {
            items.extend(names);
        }
        modules.extend(module.filter(|_| !test).map(|(name, public)| (name, public && !hidden)));
        (hidden, test) = (false, false);
        joined.clear();
    }
    (items, modules)
}

fn collect(file: &Path, folder: &Path, items: &mut BTreeSet<String>) {
    let (own, modules) = read_text(&std::fs::read_to_string(file).unwrap());
    items.extend(own);
    for (name, _) in modules.into_iter().filter(|m| m.1) {
        if let Some(file) = module_file(folder, &name) {
            collect(&file, &folder.join(&name), items);
        }
    }
}

/// All words of the Rust files of a folder.
fn words_of(folder: &Path, words: &mut BTreeSet<String>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            words_of(&path, words);
        } else if path.extension().is_some_and(|e| e == "rs") {
            add_words(&path, words);
        }
    }
}

fn add_words(file: &Path, words: &mut BTreeSet<String>) {
    let text = std::fs::read_to_string(file).unwrap();
    words.extend(text.split(|c: char| !(c.is_alphanumeric() || c == '_')).map(str::to_owned));
}

#[test]
fn items_and_modules_are_read() {
    let text = "/// A.\npub struct A;\n#[doc(hidden)]\npub fn b() {}\npub const fn c() {}\npub use x::{D,\n    y::E};\n\
                pub(crate) fn f() {}\n    pub fn method() {}\npub mod g;\n#[doc(hidden)]\npub mod h;\nmod i;\n\
                #[cfg(test)]\nmod j;\npub const K: u32 = 1;\n#[doc(hidden)]\npub use z::L;\n";
    let (items, modules) = read_text(text);
    assert_eq!(items, ["A", "c", "D", "E", "K"]);
    assert_eq!(modules, [("g".into(), true), ("h".into(), false), ("i".into(), false)]);
}

#[test]
fn few_public_items_are_without_a_user() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut items = BTreeSet::new();
    collect(&root.join("src/lib.rs"), &root.join("src"), &mut items);
    let mut words = BTreeSet::new();
    words_of(&root.join("src/cli"), &mut words);
    words_of(&root.join("src/bin"), &mut words);
    words_of(&root.join("examples"), &mut words);
    add_words(&root.join("src/lib.rs"), &mut words);
    // The desk is what a window and a script begin with.
    add_words(&root.join("src/desk/mod.rs"), &mut words);
    let without: Vec<&String> = items.difference(&words).collect();
    println!("{} public items, {} without a user: {without:?}", items.len(), without.len());
    assert!(items.len() > 300, "{}", items.len());
    assert!(without.len() <= MOST, "{}: {without:?}", without.len());
}
