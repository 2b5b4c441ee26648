//! The OBJ reader against the crate `tobj`, which reads the same corners by another program.
//!
//! `tobj` reads single precision, renumbers nothing where it is told to keep separate indices, and
//! knows UTF-8 alone; files that it refuses are counted.

use std::path::{Path, PathBuf};

use barymap::geometry::{Mesh, NONE};
use barymap::io::read_mesh;
use glam::{DVec2, DVec3};

/// A corner: its place, and its texture coordinate if it has one.
type Corner = ([f32; 3], Option<[f32; 2]>);

/// A face: its corners, and the name of its material where the library has it.
#[derive(Clone, Debug, PartialEq)]
struct Face {
    corners: Vec<Corner>,
    material: Option<String>,
}

/// The faces of a file as `tobj` reads them; `None` where it refuses the file.
fn oracle(path: &Path) -> Option<Vec<Face>> {
    let options = tobj::LoadOptions { ignore_lines: true, ignore_points: true, ..tobj::LoadOptions::default() };
    let (models, materials) = tobj::load_obj(path, &options).ok()?;
    let materials = materials.unwrap_or_default();
    let mut faces = Vec::new();
    for model in &models {
        let mesh = &model.mesh;
        let material = mesh.material_id.and_then(|m| materials.get(m)).map(|m| m.name.clone());
        let triangles = vec![3; mesh.indices.len() / 3];
        let mut next = 0;
        for &n in if mesh.face_arities.is_empty() { &triangles } else { &mesh.face_arities } {
            let corner = |c: usize| {
                let v = 3 * mesh.indices[c] as usize;
                let place = [mesh.positions[v], mesh.positions[v + 1], mesh.positions[v + 2]];
                let texcoord = mesh.texcoord_indices.get(c).map(|&t| 2 * t as usize);
                (place, texcoord.map(|t| [mesh.texcoords[t], mesh.texcoords[t + 1]]))
            };
            faces.push(Face { corners: (next..next + n as usize).map(corner).collect(), material: material.clone() });
            next += n as usize;
        }
    }
    Some(faces)
}

/// The faces of a mesh as the file has them.
fn ours(mesh: &Mesh) -> Vec<Face> {
    let single = |p: DVec3| p.to_array().map(|x| x as f32);
    let texcoord = |t: DVec2| t.to_array().map(|x| x as f32);
    (0..mesh.polygon_count())
        .map(|p| {
            let corners = mesh
                .file_polygon(p)
                .map(|c| {
                    let uv = (c.texcoord != NONE).then(|| texcoord(mesh.texcoords[c.texcoord as usize]));
                    (single(mesh.positions[c.vertex as usize]), uv)
                })
                .collect();
            let material = mesh.materials.get(mesh.polygon_material(p) as usize).map(|m| m.name.clone());
            Face { corners, material }
        })
        .collect()
}

/// The first difference, in words. A number read in single precision and one read in double and
/// then rounded differ by a unit in the last place at most; `tobj` has materials of a library
/// alone.
fn difference(ours: &[Face], theirs: &[Face]) -> Option<String> {
    let near = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= f32::EPSILON * a.abs());
    if ours.len() != theirs.len() {
        return Some(format!("{} faces and {}", ours.len(), theirs.len()));
    }
    ours.iter().zip(theirs).enumerate().find_map(|(k, (a, b))| {
        let corners = a.corners.len() == b.corners.len()
            && a.corners.iter().zip(&b.corners).all(|(a, b)| {
                near(&a.0, &b.0)
                    && match (a.1, b.1) {
                        (Some(a), Some(b)) => near(&a, &b),
                        (a, b) => a == b,
                    }
            });
        let materials = b.material.is_none() || a.material == b.material;
        (!(corners && materials)).then(|| format!("face {k}: {a:?} and {b:?}"))
    })
}

fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            files(&path, found);
        } else if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("obj")) {
            found.push(path);
        }
    }
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn faces_of_every_readable_file_are_those_of_tobj() {
    let folder = PathBuf::from(std::env::var_os("BARYMAP_DATA").unwrap());
    let mut found = Vec::new();
    files(&folder, &mut found);
    let (mut same, mut refused) = (0, Vec::new());
    for path in &found {
        // What a file has beside the format is passed over with a warning here, and guessed there.
        let Some(loaded) = read_mesh(path).ok().filter(|loaded| loaded.warnings.is_empty()) else { continue };
        let Some(theirs) = oracle(path) else {
            refused.push(path.strip_prefix(&folder).unwrap().display().to_string());
            continue;
        };
        if let Some(what) = difference(&ours(&loaded.mesh), &theirs) {
            panic!("{}: {what}", path.display());
        }
        same += 1;
    }
    println!("{same} files are the same; tobj refuses {refused:?}");
    assert!(same > 40, "only {same} of {} files were compared", found.len());
}

#[test]
fn the_comparison_notices_a_corner_a_texture_coordinate_and_a_material() {
    let face = Face { corners: vec![([1.0, 2.0, 3.0], Some([0.5, 0.25])); 3], material: Some("skin".into()) };
    let faces = vec![face.clone(), face];
    assert_eq!(difference(&faces, &faces), None);
    let changed = |change: &dyn Fn(&mut Face)| {
        let mut other = faces.clone();
        change(&mut other[1]);
        difference(&faces, &other)
    };
    assert_eq!(changed(&|f| f.material = None), None);
    assert!(changed(&|f| f.corners[2].0[1] = 2.000_001).is_some_and(|d| d.starts_with("face 1")));
    assert!(changed(&|f| f.corners[0].1 = Some([0.5, 0.2501])).is_some());
    assert!(changed(&|f| f.corners[0].1 = None).is_some());
    assert!(changed(&|f| f.material = Some("cloth".into())).is_some());
    assert!(changed(&|f| f.corners.truncate(2)).is_some());
    assert!(difference(&faces, &faces[..1]).is_some());
}
