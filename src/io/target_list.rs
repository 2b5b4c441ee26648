//! Lists of targets with their anchors, for work on many of them: a folder, or a list in JSON or
//! CSV.
//!
//! In a folder each mesh `NAME.obj` (or `.ply`, `.off`, `.gltf`, `.glb`) has its anchors beside it,
//! `NAME.json` or `NAME.txt`. A list in JSON is `[{"target": "a.obj", "anchors": "a.json", "name":
//! "a"}, ...]`, also under the key `items`; one in CSV (a [`Table`]) has columns `target`,
//! `anchors` and, if wanted, `name`. Paths are relative to the list. Without a name the target's
//! own is taken, less its extension.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::locate::is_allowed;
use super::table::Table;
use super::{by_extension, encoding};
use crate::{Error, Result};

/// One target of a list.
#[derive(Clone, Debug, PartialEq)]
pub struct TargetItem {
    /// The name that its results get, unique in the list; a file name.
    pub name: String,
    /// Its mesh and its anchors (a path, or two joined by a comma), or what is wrong with this
    /// item.
    pub files: std::result::Result<(PathBuf, String), String>,
}

/// Reads a list of targets, sorted by name; a mesh at `except` (the source, if it lies among them)
/// is passed over.
///
/// An item that cannot be used is in the list with what is wrong with it, so that the others keep
/// their places.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] if the list as a whole cannot be read or is empty.
pub fn read_targets(path: impl AsRef<Path>, except: Option<&Path>) -> Result<Vec<TargetItem>> {
    let path = path.as_ref();
    let mut items = if path.is_dir() { folder(path, except)? } else { list(path)? };
    if items.is_empty() {
        let remedy = "Name a folder with meshes and anchors beside them (a.obj, a.json), or a list in JSON or CSV";
        return Err(Error::format(path, None, "there is no target", remedy));
    }
    // A name that differs in case alone would be the same folder on some systems.
    let mut seen: HashMap<String, usize> = HashMap::new();
    for item in &items {
        *seen.entry(item.name.to_lowercase()).or_default() += 1;
    }
    for item in &mut items {
        let count = seen.get(&item.name.to_lowercase()).copied().unwrap_or(0);
        if item.files.is_ok() && count > 1 {
            item.files = Err(format!("{count} targets have the name {}: give each its own in a list", item.name));
        }
    }
    items.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(items)
}

fn folder(path: &Path, except: Option<&Path>) -> Result<Vec<TargetItem>> {
    let failed = |e| Error::io(path, e, "Check that the folder may be read");
    let except = except.and_then(|p| p.canonicalize().ok());
    let mut meshes = Vec::new();
    for entry in std::fs::read_dir(path).map_err(failed)? {
        let file = entry.map_err(failed)?.path();
        let hidden = file.file_name().is_some_and(|n| n.to_string_lossy().starts_with('.'));
        let is_source = except.is_some() && file.canonicalize().ok() == except;
        if !hidden && !is_source && by_extension(&file).is_some() && file.is_file() {
            meshes.push(file);
        }
    }
    // The order of a folder is the file system's.
    meshes.sort();
    let item = |mesh: PathBuf| {
        let beside = ["json", "txt"].map(|e| mesh.with_extension(e));
        let anchors = beside.iter().find(|a| a.is_file());
        let files = match anchors.map(|a| (a, a.to_str())) {
            Some((_, Some(anchors))) => Ok((mesh.clone(), anchors.to_owned())),
            Some((anchors, None)) => Err(format!("{}: the path is not Unicode", anchors.display())),
            None => Err(format!("{}: there are no anchors {} beside it", mesh.display(), beside[0].display())),
        };
        named(stem(&mesh), files)
    };
    Ok(meshes.into_iter().map(item).collect())
}

fn list(path: &Path) -> Result<Vec<TargetItem>> {
    let text = encoding::read_text(path)?.text;
    let base = path.parent().unwrap_or(Path::new(""));
    let rows = if text.trim_start().starts_with(['{', '[']) {
        json_rows(&text, path)?
    } else {
        table_rows(Table::parse_text(&text, path)?)?
    };
    let item = |(k, row): (usize, std::result::Result<Row, String>)| match row {
        Err(what) => named(format!("item_{k}"), Err(format!("{}, item {k}: {what}", path.display()))),
        Ok(row) => {
            let target = base.join(&row.target);
            let anchors = anchors_path(base, &row.anchors);
            let named_files = std::iter::once(target.as_path()).chain(anchors.split(',').map(Path::new));
            if let Some(out) = named_files.filter(|f| f.exists()).find(|f| !is_allowed(base, f)) {
                let what = format!("{}, item {k}: {} lies outside its folder", path.display(), out.display());
                return named(format!("item_{k}"), Err(what));
            }
            let name = row.name.unwrap_or_else(|| stem(&target));
            named(name, Ok((target, anchors)))
        }
    };
    Ok(rows.into_iter().enumerate().map(item).collect())
}

/// One path, or two joined by a comma, relative to `base`.
fn anchors_path(base: &Path, text: &str) -> String {
    let join = |p: &str| base.join(p.trim()).to_string_lossy().into_owned();
    match text.split_once(',') {
        Some((source, target)) if !base.join(text).is_file() => format!("{},{}", join(source), join(target)),
        _ => join(text),
    }
}

/// An item as a list names it.
struct Row {
    target: String,
    anchors: String,
    name: Option<String>,
}

fn json_rows(text: &str, path: &Path) -> Result<Vec<std::result::Result<Row, String>>> {
    let remedy = r#"Write [{"target": "a.obj", "anchors": "a.json"}, ...]"#;
    let value: Value = serde_json::from_str(text)
        .map_err(|e| Error::format(path, Some(e.line()), format!("this is not valid JSON: {e}"), remedy))?;
    let Some(items) = value.as_array().or_else(|| value.get("items").and_then(Value::as_array)) else {
        return Err(Error::format(path, None, "there is no list of items", remedy));
    };
    let row = |item: &Value| {
        let text = |key: &str| match item.get(key) {
            Some(Value::String(s)) if !s.trim().is_empty() => Ok(Some(s.trim().to_owned())),
            None | Some(Value::Null) => Ok(None),
            _ => Err(format!("{key:?} is not a text")),
        };
        let needed = |key: &str| text(key)?.ok_or_else(|| format!("{key:?} is missing"));
        Ok(Row { target: needed("target")?, anchors: needed("anchors")?, name: text("name")? })
    };
    Ok(items.iter().map(row).collect())
}

fn table_rows(mut table: Table) -> Result<Vec<std::result::Result<Row, String>>> {
    table.lift_header(|_, _| true);
    let (Some(target), Some(anchors)) = (table.column("target"), table.column("anchors")) else {
        let remedy = "Begin it with target,anchors or target,anchors,name (a list may also be JSON)";
        return Err(Error::format(table.path(), Some(1), "the header has no columns target and anchors", remedy));
    };
    let name = table.column("name");
    let row = |r: usize| {
        let (line, count, width) = (table.line(r), table.cells(r), table.width());
        if count != width {
            return Err(format!("line {line}: {count} cells of {width}"));
        }
        let cell = |column: usize| table.cell(r, column).to_owned();
        if cell(target).is_empty() || cell(anchors).is_empty() {
            return Err(format!("line {line}: an empty cell"));
        }
        Ok(Row { target: cell(target), anchors: cell(anchors), name: name.map(cell).filter(|n| !n.is_empty()) })
    };
    Ok((0..table.len()).map(row).collect())
}

fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// An item whose name can be that of a folder; one whose cannot is marked and gets a name that can.
fn named(name: String, files: std::result::Result<(PathBuf, String), String>) -> TargetItem {
    let good = !name.is_empty()
        && name.len() <= 200
        && !name.starts_with('.')
        && !name.contains(|c: char| c.is_control() || "/\\:*?\"<>|".contains(c));
    if good {
        return TargetItem { name, files };
    }
    let what = format!("{name:?} cannot be the name of a folder: give another name in a list");
    let harmless = |c: char| if c.is_alphanumeric() || c == '-' { c } else { '_' };
    let name: String = name.chars().take(100).map(harmless).collect();
    TargetItem { name: format!("item_{name}"), files: files.and(Err(what)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(name: &str, text: &str) -> (tempfile::TempDir, Result<Vec<TargetItem>>) {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join(name), text).unwrap();
        let items = read_targets(dir.path().join(name), None);
        (dir, items)
    }

    #[test]
    fn a_folder_is_sorted_and_the_source_is_not_in_it() {
        let dir = tempfile::tempdir().unwrap();
        for file in ["b.obj", "b.json", "a.PLY", "a.txt", "s.obj", "lonely.off", "notes.md", ".hidden.obj"] {
            std::fs::write(dir.path().join(file), "").unwrap();
        }
        let items = read_targets(dir.path(), Some(&dir.path().join("./s.obj"))).unwrap();
        let names: Vec<&str> = items.iter().map(|i| i.name.as_str()).collect();
        assert_eq!(names, ["a", "b", "lonely"]);
        assert!(items[0].files.as_ref().unwrap().1.ends_with("a.txt"));
        assert!(items[2].files.as_ref().unwrap_err().contains("lonely.json"));
    }

    #[test]
    fn lists_in_json_and_csv_say_the_same() {
        let (dir, json) = written(
            "l.json",
            r#"{"items": [{"target": "x/b.obj", "anchors": "b.json"}, {"target": "a.obj", "anchors": "s.vts,t.vts", "name": "z"}]}"#,
        );
        let (other, csv) = written("l.csv", "name,target,anchors\n\n,x/b.obj,b.json\n");
        let (json, csv) = (json.unwrap(), csv.unwrap());
        let (third, semicolons) = written("l.csv", "Anchors;Comment;Target\n\"s.vts,t.vts\";\"a; b\";x/ä.obj\n");
        let files = semicolons.unwrap().remove(0).files.unwrap();
        assert_eq!(files.0, third.path().join("x/ä.obj"));
        assert!(files.1.ends_with("t.vts") && files.1.contains(','), "{}", files.1);
        assert_eq!((json[0].name.as_str(), json[1].name.as_str()), ("b", "z"));
        assert_eq!(json[0].files.as_ref().unwrap().0, dir.path().join("x/b.obj"));
        assert_eq!(csv[0].files.as_ref().unwrap().0, other.path().join("x/b.obj"));
        let (s, t) = json[1].files.as_ref().unwrap().1.split_once(',').unwrap();
        assert!(Path::new(s).ends_with("s.vts") && Path::new(t) == dir.path().join("t.vts"));
    }

    #[test]
    fn a_bad_item_keeps_its_place() {
        let (_dir, items) = written(
            "l.json",
            r#"[{"target": "b.obj", "anchors": "b.json"}, {"target": 3}, {"target": "u/B.obj", "anchors": "c.json"},
                {"target": "c.obj", "anchors": "c.json", "name": "../c"}, {"target": "d.obj", "anchors": "d.json"}]"#,
        );
        let items = items.unwrap();
        let bad: Vec<&str> = items.iter().filter(|i| i.files.is_err()).map(|i| i.name.as_str()).collect();
        assert_eq!((items.len(), bad), (5, vec!["B", "b", "item_1", "item____c"]));
        assert!(items.iter().all(|i| !i.name.contains('/')));
        assert!(items.iter().find(|i| i.name == "d").unwrap().files.is_ok());
    }

    #[test]
    fn lists_that_are_none() {
        for (name, text, part) in [
            ("l.json", "[", "JSON"),
            ("l.json", "{}", "no list"),
            ("l.json", "[]", "no target"),
            ("l.csv", "a,b\n1,2\n", "header"),
            ("l.csv", "", "header"),
            ("l.csv", "target,anchors\n", "no target"),
        ] {
            let message = written(name, text).1.unwrap_err().to_string();
            assert!(message.contains(part), "{message}");
        }
        let (_dir, items) = written("l.csv", "target,anchors\na.obj\nb.obj,\nc.obj,c.json\n");
        assert_eq!(items.unwrap().iter().filter(|i| i.files.is_err()).count(), 2);
    }
}
