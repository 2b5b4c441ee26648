//! Joints and weights of a scene, read and written.

use super::*;

#[test]
fn weights_are_a_column_for_each_joint() {
    let table = read(&samples::rigged().glb()).scene.unwrap().skin_weights().unwrap().unwrap();
    assert_eq!((table.names, table.joints), (vec!["hip".to_owned(), "chest".to_owned()], vec![2, 3]));
    assert_eq!(table.weights.len(), 50);
    assert_eq!(table.weights[..2], [1.0, 0.0]);
    assert_eq!(table.weights[10..12], [0.75, 0.25]);
    let table = read(&samples::posed().glb()).scene.unwrap().skin_weights().unwrap().unwrap();
    assert!(table.weights.chunks(2).all(|w| (w[0] + w[1] - 1.0).abs() < 1e-12));
    assert!((table.weights[1] - 0.2 / 1.2).abs() < 1e-12, "{:?}", &table.weights[..2]);
    assert_eq!(read(&samples::several().glb()).scene.unwrap().skin_weights().unwrap(), None);
}

#[test]
fn a_new_skin_leaves_the_shape_as_it_is_shown() {
    let rig = read(&samples::posed().glb()).scene.unwrap();
    let joints = rig.skin_weights().unwrap().unwrap().joints;
    let mut written = Vec::new();
    for (name, sample) in samples::all().into_iter().filter(|(name, _)| *name != "quantized") {
        let before = sample.glb();
        let LoadedMesh { mesh, scene, .. } = read(&before);
        let scene = scene.unwrap();
        // Its own rig, where it has one, else that of another file.
        let own = if name == "posed" { &scene } else { &rig };
        let row_of: Vec<u32> = (0..mesh.vertex_count() as u32).collect();
        let weights: Vec<f64> = row_of.iter().flat_map(|&v| [f64::from(v % 5), 2.0]).collect();
        let mut edit = scene.edit();
        edit.skin(&SkinWeights { rig: own, joints: &joints, row_of: &row_of, weights: &weights, sets: 1 }).unwrap();
        let (after, notes) = edit.finish().unwrap();
        if name == "far" {
            assert!(notes[0].contains("single precision of skins"), "{notes:?}");
            continue;
        }
        assert!(notes.is_empty(), "{name}: {notes:?}");
        let back = read(&after);
        assert!(close(&back.mesh.positions, &mesh.positions, 2e-6), "{name}");
        assert_eq!(back.mesh.triangles(), mesh.triangles(), "{name}");
        let normals = back.mesh.normals.iter().zip(&mesh.normals).all(|(a, b)| a.distance(*b) < 1e-5);
        assert!(normals && back.mesh.normals.len() == mesh.normals.len(), "{name}");
        assert!(close(&independent(&after), &mesh.positions, 2e-6), "{name}");
        let table = back.scene.unwrap().skin_weights().unwrap().unwrap();
        assert_eq!(table.names, ["hip", "chest"], "{name}");
        for (v, w) in table.weights.chunks(2).enumerate() {
            let k = (v % 5) as f64;
            assert!((w[0] - k / (k + 2.0)).abs() < 1e-6, "{name}, vertex {v}: {w:?}");
        }
        let lost: Vec<String> = changed(&before, &after)
            .into_iter()
            .filter(|p| !["/primitives/", "/skin", "/nodes", "/scenes"].iter().any(|k| p.contains(k)))
            .collect();
        assert!(lost.is_empty(), "{name}: {lost:?}");
        written.push((name.to_owned(), after));
    }
    samples::check_valid(&written);
}

#[test]
fn only_the_largest_weights_are_written_and_what_is_lost_is_told() {
    let LoadedMesh { mesh, scene, .. } = read(&samples::rigged().glb());
    let scene = scene.unwrap();
    let row_of = vec![0; mesh.vertex_count()];
    let joints = [2, 3, 2, 3, 2, 3];
    let weights = [0.3, 0.25, 0.2, 0.15, 0.06, 0.04];
    let skin = SkinWeights { rig: &scene, joints: &joints, row_of: &row_of, weights: &weights, sets: 1 };
    let mut edit = scene.edit();
    edit.skin(&skin).unwrap();
    let (_, notes) = edit.finish().unwrap();
    assert!(notes[0].contains("25 vertices follow more than 4 joints") && notes[0].contains("10.0 %"), "{notes:?}");
    let mut edit = scene.edit();
    edit.skin(&SkinWeights { sets: 2, ..skin }).unwrap();
    let (bytes, notes) = edit.finish().unwrap();
    assert!(notes.is_empty());
    let attributes = &expanded(&bytes)["meshes"][0]["primitives"][0]["attributes"];
    assert_eq!(attributes["WEIGHTS_1"].as_array().unwrap().len(), 100);
    let none = SkinWeights { weights: &[0.0; 6], ..skin };
    let mut edit = scene.edit();
    edit.skin(&none).unwrap();
    assert!(edit.finish().unwrap().1[0].contains("no weights"));
    assert!(scene.edit().skin(&SkinWeights { row_of: &row_of[1..], ..skin }).is_err());
    assert!(scene.edit().skin(&SkinWeights { joints: &[99], weights: &[1.0], ..skin }).is_err());
}
