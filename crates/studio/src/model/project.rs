//! Projects as files: JSON, versioned, paths relative to the file.

use std::path::{Component, Path, PathBuf};

use barymap::geometry::SurfacePoint;
use barymap::{Error, Result};
use glam::DVec2;
use serde::{Deserialize, Serialize};

use super::cage::{CageDocument, Loop};
use super::document::{Document, Options, TransferDocument};
use super::pairs::Pairs;

/// What the file says that it is.
const FORMAT: &str = "barymap-studio";
/// The version that is written; older ones are read.
const VERSION: u32 = 1;

#[derive(Serialize, Deserialize)]
struct File {
    format: String,
    version: u32,
    #[serde(default)]
    transfer: Transfer,
    #[serde(default)]
    warp: Warp,
}

#[derive(Default, Serialize, Deserialize)]
struct Transfer {
    source: Option<PathBuf>,
    target: Option<PathBuf>,
    texture: Option<PathBuf>,
    #[serde(default)]
    options: WrittenOptions,
    #[serde(default)]
    pairs: Vec<WrittenPair>,
}

#[derive(Serialize, Deserialize)]
#[serde(default)]
struct WrittenOptions {
    method: String,
    size: u32,
    margin: u32,
    fill: String,
    unwrap: bool,
}

impl Default for WrittenOptions {
    fn default() -> Self {
        Self::from(&Options::default())
    }
}

impl From<&Options> for WrittenOptions {
    fn from(o: &Options) -> Self {
        let (method, fill) = (o.method.word().to_owned(), o.fill.word().to_owned());
        Self { method, size: o.size, margin: o.margin, fill, unwrap: o.unwrap }
    }
}

#[derive(Serialize, Deserialize)]
struct WrittenPair {
    #[serde(skip_serializing_if = "Option::is_none")]
    source: Option<Place>,
    #[serde(skip_serializing_if = "Option::is_none")]
    target: Option<Place>,
    #[serde(default, skip_serializing_if = "String::is_empty")]
    label: String,
}

#[derive(Clone, Copy, Serialize, Deserialize)]
struct Place {
    face: u32,
    barycentric: [f64; 3],
}

#[derive(Default, Serialize, Deserialize)]
struct Warp {
    picture: Option<PathBuf>,
    #[serde(default)]
    loops: Vec<WrittenLoop>,
}

#[derive(Serialize, Deserialize)]
struct WrittenLoop {
    source: Vec<[f64; 2]>,
    target: Vec<[f64; 2]>,
}

impl From<SurfacePoint> for Place {
    fn from(p: SurfacePoint) -> Self {
        Self { face: p.face, barycentric: p.barycentric }
    }
}

/// A project that was read.
#[derive(Clone, Debug, PartialEq)]
pub struct Opened {
    /// What it holds; files that are missing are named in it all the same.
    pub document: Document,
    /// Files that it names and that are not there.
    pub missing: Vec<PathBuf>,
}

/// The text of a project file that is to be at `path`.
pub fn to_text(document: &Document, path: &Path) -> String {
    let folder = absolute(path).parent().map(Path::to_path_buf).unwrap_or_default();
    let relative = |p: &Option<PathBuf>| p.as_ref().map(|p| relative(&absolute(p), &folder));
    let transfer = &document.transfer;
    let pair = |p: &super::pairs::Pair| WrittenPair {
        source: p.points[0].map(Place::from),
        target: p.points[1].map(Place::from),
        label: p.label.clone(),
    };
    let points = |list: &[DVec2]| list.iter().map(|p| p.to_array()).collect();
    let file = File {
        format: FORMAT.to_owned(),
        version: VERSION,
        transfer: Transfer {
            source: relative(&transfer.files[0]),
            target: relative(&transfer.files[1]),
            texture: relative(&transfer.texture),
            options: WrittenOptions::from(&transfer.options),
            pairs: transfer.pairs.list().iter().map(pair).collect(),
        },
        warp: Warp {
            picture: relative(&document.warp.picture),
            loops: document
                .warp
                .loops
                .iter()
                .map(|l| WrittenLoop { source: points(&l.source), target: points(&l.target) })
                .collect(),
        },
    };
    // Numbers that are not finite cannot be written as JSON; there are none in a document.
    serde_json::to_string_pretty(&file).unwrap_or_default()
}

/// Writes a project, whole or not at all.
///
/// # Errors
/// [`Error::Io`].
pub fn save(document: &Document, path: &Path) -> Result<()> {
    let text = to_text(document, path);
    barymap::io::write_atomically(path, |file| {
        std::io::Write::write_all(file, text.as_bytes()).map_err(|e| Error::io(path, e, "Choose another place"))
    })
}

/// Reads a project.
///
/// # Errors
/// [`Error::Io`]; [`Error::Format`] if it is no project, of a newer version, or says what cannot be.
pub fn open(path: &Path) -> Result<Opened> {
    let bytes = std::fs::read(path).map_err(|e| Error::io(path, e, "Check that the file may be read"))?;
    let text = String::from_utf8_lossy(&bytes);
    let folder = absolute(path).parent().map(Path::to_path_buf).unwrap_or_default();
    parse(&text, path, &folder)
}

/// Whether a text begins as a project does.
pub fn is_project(text: &str) -> bool {
    text.trim_start().starts_with('{') && text.contains(&format!("\"{FORMAT}\""))
}

fn parse(text: &str, path: &Path, folder: &Path) -> Result<Opened> {
    let fail = |line, what: String, remedy: &str| Error::format(path, line, what, remedy);
    const REMEDY: &str = "Open a file that barymap-studio saved";
    let file: File = serde_json::from_str(text)
        .map_err(|e| fail(Some(e.line()).filter(|l| *l > 0), format!("this is no project: {e}"), REMEDY))?;
    if file.format != FORMAT {
        return Err(fail(None, format!("its format is {:?}", file.format), REMEDY));
    }
    if file.version > VERSION {
        let what = format!("its version is {}, this program reads up to {VERSION}", file.version);
        return Err(fail(None, what, "Use a newer barymap-studio"));
    }
    let resolved = |p: Option<PathBuf>| p.map(|p| shortest(&folder.join(p)));
    let written = file.transfer.options;
    let word = |e: Error| fail(None, e.to_string(), "Correct the word in the file");
    let options = Options {
        method: written.method.parse().map_err(word)?,
        size: written.size.clamp(16, 1 << 15),
        margin: written.margin.min(1024),
        fill: written.fill.parse().map_err(word)?,
        unwrap: written.unwrap,
    };
    let mut pairs = Pairs::default();
    let place = |k: usize, p: Option<Place>| -> Result<Option<SurfacePoint>> {
        let Some(p) = p else { return Ok(None) };
        let sum: f64 = p.barycentric.iter().sum();
        if !p.barycentric.iter().all(|b| *b >= 0.0) || !((sum - 1.0).abs() <= 1e-6) {
            let what = format!("pair {k} has the barycentric coordinates {:?}", p.barycentric);
            return Err(fail(None, what, "They are nonnegative and sum to one"));
        }
        Ok(Some(SurfacePoint::new(p.face, p.barycentric)))
    };
    let read = file.transfer.pairs.into_iter().enumerate().map(|(k, p)| {
        let points = [place(k, p.source)?, place(k, p.target)?];
        Ok((points, p.label))
    });
    pairs.replace(read.collect::<Result<Vec<_>>>()?);
    let mut loops = Vec::new();
    for (k, one) in file.warp.loops.into_iter().enumerate() {
        let finite = one.source.iter().chain(&one.target).flatten().all(|x| x.is_finite());
        if one.source.len() != one.target.len() || one.source.len() < 3 || !finite {
            let what = format!("loop {k} of the cage has {} and {} vertices", one.source.len(), one.target.len());
            return Err(fail(None, what, "Give as many on both, three or more, all finite"));
        }
        let points = |list: Vec<[f64; 2]>| list.into_iter().map(DVec2::from).collect();
        loops.push(Loop { source: points(one.source), target: points(one.target) });
    }
    let document = Document {
        transfer: TransferDocument {
            files: [resolved(file.transfer.source), resolved(file.transfer.target)],
            texture: resolved(file.transfer.texture),
            pairs,
            options,
        },
        warp: CageDocument { picture: resolved(file.warp.picture), loops },
    };
    let transfer = &document.transfer;
    let named = transfer.files.iter().chain([&transfer.texture, &document.warp.picture]).flatten();
    let missing = named.filter(|p| !p.exists()).cloned().collect();
    Ok(Opened { document, missing })
}

/// A path that does not depend on the working folder.
pub fn absolute(path: &Path) -> PathBuf {
    shortest(&std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf()))
}

/// Without `.` and `..`, as far as that needs no look at the disk.
fn shortest(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => (),
            Component::ParentDir if matches!(out.components().next_back(), Some(Component::Normal(_))) => _ = out.pop(),
            part => out.push(part),
        }
    }
    out
}

/// A path as seen from a folder; both absolute. As it is where they share no more than the root.
fn relative(path: &Path, folder: &Path) -> PathBuf {
    let common = path.components().zip(folder.components()).take_while(|(a, b)| a == b).count();
    if common < 2 {
        return path.to_path_buf();
    }
    let up = folder.components().count() - common;
    let down = path.components().skip(common);
    (0..up).map(|_| Component::ParentDir).chain(down).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Side;
    use barymap::surface::correspondence::Method;
    use barymap::tools::transfer::Fill;

    fn document(folder: &Path) -> Document {
        let mut d = Document::default();
        d.transfer.set_file(Side::Source, folder.join("meshes/a.obj"));
        d.transfer.set_file(Side::Target, folder.join("b.glb"));
        d.transfer.texture = Some(folder.join("meshes/skin.png"));
        let p = |x: f64| SurfacePoint::new(7, [x, 0.5, 0.5 - x]);
        d.transfer.pairs.add(p(0.1), p(1.0 / 3.0), "nose".into());
        d.transfer.pairs.click(Side::Target, p(0.2));
        d.transfer.options = Options { method: Method::Rbf, size: 512, margin: 4, fill: Fill::Smooth, unwrap: true };
        d.warp.picture = Some(folder.join("p.png"));
        d.warp.rectangle([64.0, 48.0], 1);
        d
    }

    #[test]
    fn a_project_comes_back_and_moves_with_its_folder() {
        let folder = tempfile::tempdir().unwrap();
        let (old, new) = (folder.path().join("old"), folder.path().join("new"));
        std::fs::create_dir_all(old.join("meshes")).unwrap();
        for name in ["meshes/a.obj", "b.glb", "meshes/skin.png"] {
            std::fs::write(old.join(name), "").unwrap();
        }
        let d = document(&old);
        save(&d, &old.join("p.json")).unwrap();
        let text = std::fs::read_to_string(old.join("p.json")).unwrap();
        assert!(is_project(&text) && !text.contains(folder.path().to_str().unwrap()), "{text}");
        let opened = open(&old.join("p.json")).unwrap();
        assert_eq!(opened.document, d);
        assert_eq!(opened.missing, [old.join("p.png")]);
        std::fs::rename(&old, &new).unwrap();
        let moved = open(&new.join("p.json")).unwrap();
        assert_eq!(moved.document.transfer.files, document(&new).transfer.files);
    }

    #[test]
    fn what_is_no_project_is_told_in_words() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.json");
        let good = to_text(&document(folder.path()), &path);
        let bad = [
            ("", "this is no project"),
            ("{\"source\": [1], \"target\": [2]}", "this is no project"),
            (&good.replace("barymap-studio", "other"), "its format is"),
            (&good.replace("\"version\": 1", "\"version\": 99"), "its version is 99"),
            (&good.replace("rbf", "magic"), "magic"),
            (&good.replace("0.1,", "-0.1,"), "barycentric"),
            (&good.replace("\"target\": [\n          [", "\"target\": [\n          [1, 2], ["), "loop 0"),
        ];
        for (text, says) in bad {
            assert_ne!(text, good);
            std::fs::write(&path, text).unwrap();
            let error = open(&path).unwrap_err().to_string();
            assert!(error.contains(says) && error.contains("x.json"), "{error}");
        }
        assert!(open(&folder.path().join("none.json")).is_err());
    }

    #[test]
    fn paths_are_relative_where_that_means_something() {
        let r = |a: &str, b: &str| relative(Path::new(a), Path::new(b));
        assert_eq!(r("/a/b/c.obj", "/a/b"), PathBuf::from("c.obj"));
        assert_eq!(r("/a/x/c.obj", "/a/b"), PathBuf::from("../x/c.obj"));
        assert_eq!(r("/q/c.obj", "/a/b"), PathBuf::from("/q/c.obj"));
        assert_eq!(shortest(Path::new("/a/./b/../c")), PathBuf::from("/a/c"));
    }
}
