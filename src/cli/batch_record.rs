//! What is kept beside each result of a batch: what it was made of, so that it is not made twice.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::{Value, json};

use crate::desk::Textures;
use crate::geometry::Mesh;
use crate::io::CacheKey;
use crate::picture::{Image, Pixels};
use crate::{Error, Result};

/// The record's file in the folder of a result.
pub(crate) const FILE: &str = "item.json";

/// Changes whenever the same inputs and options may give another result, or the record another
/// form.
const VERSION: u32 = 2;

/// The record of a result. The same inputs and options give the same bytes: it holds no times.
#[derive(Debug)]
pub(crate) struct Record {
    name: String,
    /// Names everything that the result depends on.
    pub(crate) key: String,
    /// The report of the transfer, without what differs from run to run.
    pub(crate) report: Value,
    /// The files of the result with the hashes of their content.
    files: BTreeMap<String, String>,
}

impl Record {
    /// The record of the files in `folder`.
    pub(crate) fn new(name: &str, key: String, mut report: Value, folder: &Path) -> Result<Self> {
        if let Some(report) = report.as_object_mut() {
            for varies in ["seconds", "cpu_seconds", "traffic", "nanoseconds_per_texel", "files"] {
                report.remove(varies);
            }
            let kind = report["backend"]["kind"].clone();
            report.insert("backend".into(), kind);
        }
        let failed = |e| Error::io(folder, e, "Check the folder and run the command again");
        let mut files = BTreeMap::new();
        for entry in std::fs::read_dir(folder).map_err(failed)? {
            let entry = entry.map_err(failed)?;
            let name = entry.file_name().to_string_lossy().into_owned();
            files.insert(name, hash(&entry.path()).map_err(failed)?);
        }
        Ok(Self { name: name.to_owned(), key, report, files })
    }

    /// Writes it into `folder`.
    pub(crate) fn write(&self, folder: &Path) -> Result<()> {
        let record = json!({"name": self.name, "key": self.key, "files": self.files, "report": self.report});
        crate::io::report::write_report(folder.join(FILE), &record)
    }

    /// Whether its files are in `folder` as they were written.
    pub(crate) fn is_whole(&self, folder: &Path) -> bool {
        self.files.iter().all(|(name, content)| hash(&folder.join(name)).is_ok_and(|h| h == *content))
    }
}

/// The record in `folder`, if there is one.
pub(crate) fn read(folder: &Path) -> Option<Record> {
    let text = std::fs::read_to_string(folder.join(FILE)).ok()?;
    let mut record: Value = serde_json::from_str(&text).ok()?;
    let files = record["files"].as_object()?;
    let files = files.iter().map(|(k, v)| Some((k.clone(), v.as_str()?.to_owned()))).collect::<Option<_>>()?;
    Some(Record {
        name: record["name"].as_str()?.to_owned(),
        key: record["key"].as_str()?.to_owned(),
        report: record["report"].take(),
        files,
    })
}

fn hash(path: &Path) -> std::io::Result<String> {
    Ok(CacheKey::new("file", VERSION).bytes(&std::fs::read(path)?).finish())
}

/// What all results of a batch depend on: the program's version, the source and its textures.
pub(crate) fn source_key(source: &Mesh, layers: &[Textures]) -> CacheKey {
    let key = CacheKey::new("batch", VERSION).bytes(env!("CARGO_PKG_VERSION").as_bytes());
    let mut key = mesh_key(key, source).number(layers.len() as u64);
    for layer in layers {
        key = key.bytes(layer.role.as_bytes()).values(&layer.material_texture).number(u64::from(layer.default_texture));
        key = key.values(layer.face_texture.as_deref().unwrap_or_default());
        for placement in &layer.placements {
            let place = placement.transform.to_cols_array().map(f64::to_bits);
            let wrap = placement.wrap.map(|w| w as u64);
            key = place.into_iter().chain(wrap).fold(key, CacheKey::number);
        }
        let colors: Vec<f32> = layer.vertices.iter().flatten().flatten().copied().collect();
        key = key.values(&colors);
        key = layer.images.iter().fold(key, image_key);
    }
    key
}

/// The key of one target's result.
///
/// # Errors
/// If the anchors cannot be read.
pub(crate) fn target_key(key: CacheKey, target: &Mesh, anchors: &str) -> Result<String> {
    let mut key = mesh_key(key, target);
    let files: Vec<&str> = if Path::new(anchors).is_file() { vec![anchors] } else { anchors.split(',').collect() };
    for file in files {
        let bytes = std::fs::read(file.trim())
            .map_err(|e| Error::io(file.trim(), e, "Check the path of the anchors and that they may be read"))?;
        key = key.bytes(&bytes);
    }
    Ok(key.finish())
}

fn mesh_key(key: CacheKey, mesh: &Mesh) -> CacheKey {
    let positions: Vec<[f64; 3]> = mesh.positions.iter().map(|p| p.to_array()).collect();
    let texcoords: Vec<[f64; 2]> = mesh.texcoords.iter().map(|p| p.to_array()).collect();
    let normals: Vec<[f64; 3]> = mesh.normals.iter().map(|p| p.to_array()).collect();
    let mut key = key.values(&positions).values(&texcoords).values(&normals);
    let mut corners = Vec::new();
    for p in 0..mesh.polygon_count() {
        corners.extend([u32::MAX, mesh.polygon_material(p), mesh.polygon_group(p)]);
        corners.extend(mesh.polygon(p).iter().flat_map(|c| [c.vertex, c.texcoord, c.normal]));
    }
    key = key.values(&corners);
    mesh.materials.iter().fold(key, |key, m| key.bytes(m.name.as_bytes()))
}

fn image_key(key: CacheKey, image: &Image) -> CacheKey {
    let key = key.values(&[image.width, image.height, image.channels]);
    match &image.pixels {
        Pixels::U8(v) => key.values(v),
        Pixels::U16(v) => key.values(v),
        Pixels::F32(v) => key.values(v),
    }
}
