//! Files: every reader against the real data, the bad data, and random bytes.

use std::path::{Path, PathBuf};

use barymap::geometry::{Diagnosis, Mesh, Topology};
use barymap::io::gltf_write::glb_bytes;
use barymap::io::image_file::{decode_image, encode_png};
use barymap::io::{anchors, gltf_read, npy, obj, off, ply, read_image, read_mesh, write_obj, write_ply};
use barymap::picture::{Depth, Image};
use glam::DVec3;
use proptest::prelude::*;

fn data() -> PathBuf {
    std::env::var_os("BARYMAP_DATA").expect("BARYMAP_DATA names the folder of test data").into()
}

/// Vertices and a part of the warnings of a file that can be read, or a part of the message of one
/// that cannot.
type Expected = Result<(usize, &'static str), &'static str>;

/// The manifest's rows of meshes outside `bad`: file, then V, F, C, L, G, M, UV as written.
fn manifest() -> Vec<(PathBuf, Vec<String>)> {
    let text = std::fs::read_to_string(data().join("MANIFEST.md")).unwrap();
    let rows =
        text.lines().filter(|l| l.split('|').nth(1).is_some_and(|c| c.ends_with(".obj ") && !c.starts_with(" bad/")));
    rows.map(|l| {
        let cells: Vec<&str> = l.split('|').map(str::trim).collect();
        (data().join(cells[1]), cells[3..10].iter().map(|c| (*c).to_owned()).collect())
    })
    .collect()
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn meshes_load_as_the_manifest_says() {
    let rows = manifest();
    assert!(rows.len() > 40, "only {} meshes", rows.len());
    for (path, expected) in rows {
        let loaded = read_mesh(&path).unwrap();
        let (mesh, name) = (&loaded.mesh, path.display());
        assert!(loaded.warnings.is_empty(), "{name}: {:?}", loaded.warnings);
        let d = Diagnosis::new(mesh, &Topology::new(mesh));
        d.is_usable().unwrap();
        let first = |cell: &str| cell.split_whitespace().next().unwrap_or_default().to_owned();
        let found = [
            mesh.vertex_count().to_string(),
            mesh.polygon_count().to_string(),
            d.components.len().to_string(),
            d.boundary_loops().to_string(),
            d.genus().map_or("-".to_owned(), |g| g.to_string()),
            if d.is_manifold() { "yes" } else { "no" }.to_owned(),
            if mesh.has_texcoords() { "yes" } else { "no" }.to_owned(),
        ];
        let expected: Vec<String> = expected.iter().map(|c| first(c)).collect();
        assert_eq!(found.to_vec(), expected, "{name}: V F C L G M UV\n{d}");
    }
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn real_meshes_survive_every_writer() {
    let dir = tempfile::tempdir().unwrap();
    for name in ["textured/spot/spot_quads.obj", "textured/knight/knight.obj", "cage/beast_cage.obj"] {
        let mesh = read_mesh(data().join(name)).unwrap().mesh;
        let path = dir.path().join("out.obj");
        write_obj(&mesh, &path).unwrap();
        let back = read_mesh(&path).unwrap();
        assert!(back.warnings.is_empty(), "{name}: {:?}", back.warnings);
        assert_eq!(same_mesh(&mesh, &back.mesh), Ok(()), "{name}");
        let texture = |m: &Mesh| {
            m.materials.iter().map(|m| m.base_color_texture.as_ref()?.canonicalize().ok()).collect::<Vec<_>>()
        };
        assert_eq!(texture(&mesh), texture(&back.mesh), "{name}");

        write_ply(&mesh, None, dir.path().join("out.ply")).unwrap();
        let back = read_mesh(dir.path().join("out.ply")).unwrap().mesh;
        assert_eq!((&back.positions, back.triangles()), (&mesh.positions, mesh.triangles()), "{name}");

        let glb = glb_bytes(&mesh, &[]).unwrap();
        let back = gltf_read::parse_gltf(&glb, Path::new("out.glb")).unwrap().mesh;
        assert_eq!(back.triangle_count(), mesh.triangle_count(), "{name}");
        for t in 0..mesh.triangle_count() {
            let (a, b) = (mesh.triangle_positions(t), back.triangle_positions(t));
            assert!(
                a.iter().zip(&b).all(|(a, b)| a.distance(*b) <= 1e-6 * a.length().max(1.0)),
                "{name}: triangle {t}"
            );
        }
    }
}

fn same_mesh(a: &Mesh, b: &Mesh) -> Result<(), String> {
    if a.positions != b.positions || a.texcoords != b.texcoords || a.normals != b.normals {
        return Err("positions, texture coordinates or normals".into());
    }
    if a.polygon_count() != b.polygon_count() {
        return Err("polygon counts".into());
    }
    for p in 0..a.polygon_count() {
        let name = |m: &Mesh| m.materials.get(m.polygon_material(p) as usize).map(|m| m.name.clone());
        let group = |m: &Mesh| m.groups.get(m.polygon_group(p) as usize).cloned();
        if a.polygon(p) != b.polygon(p) || name(a) != name(b) || group(a) != group(b) {
            return Err(format!("polygon {p}"));
        }
    }
    Ok(())
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn bad_meshes_give_a_clear_error_or_the_right_mesh() {
    // Either a part of the message, or polygons and a part of the warnings.
    let cases: [(&str, Expected); 15] = [
        ("box_UTF16BE.obj", Err("UTF-16")),
        ("camel_nonmanifold.obj", Ok((10000, ""))),
        ("fuzz_crash.ply", Err("line 7")),
        ("invalid-face-definition.obj", Err("no face with three")),
        ("invalid-relative-vertex-index.obj", Err("line 1: a face refers to vertex -4")),
        ("issue-140-zero-face-idx.obj", Err("line 16: face corner \"0/0/0\" has vertex index 0")),
        ("issue-295-trianguation-failure.obj", Ok((14, ""))),
        ("jacked.obj", Ok((12, "nonexistent.mtl"))),
        ("malformed.obj", Err("line 28: face corner \"0\" has vertex index 0")),
        ("malformed2.obj", Ok((5, "first on line 23"))),
        ("notenoughindices.obj", Ok((1, "fewer than three corners were left out: 1"))),
        ("obj_wireframe.obj", Err("no face with three")),
        ("payload_JVN42386607.ply", Err("declared twice")),
        ("test-nan.obj", Err("line 27: the position of vertex 0 (line 12) is not finite")),
        ("tobj_invalid_index.obj", Err("line 12: a face refers to vertex 7, the file has 6")),
    ];
    for (name, expected) in cases {
        match (read_mesh(data().join("bad").join(name)), expected) {
            (Ok(loaded), Ok((polygons, warning))) => {
                assert_eq!(loaded.mesh.polygon_count(), polygons, "{name}");
                assert!(loaded.warnings.join("\n").contains(warning), "{name}: {:?}", loaded.warnings);
                Diagnosis::new(&loaded.mesh, &Topology::new(&loaded.mesh)).is_usable().unwrap();
            }
            (Err(error), Err(part)) => {
                let message = error.to_string();
                assert!(message.contains(part) && message.contains(name), "{message:?} lacks {part:?}");
            }
            (got, _) => panic!("{name}: {got:?}"),
        }
    }
    let listed: Vec<_> = cases.iter().map(|c| c.0.to_owned()).collect();
    for entry in std::fs::read_dir(data().join("bad")).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        assert!(name.ends_with(".png") || listed.contains(&name), "{name} is not tested");
    }
    let camel = read_mesh(data().join("bad/camel_nonmanifold.obj")).unwrap().mesh;
    let d = Diagnosis::new(&camel, &Topology::new(&camel));
    assert_eq!((d.nonmanifold_edges, d.genus()), (5, None));
    assert!(d.to_string().contains("5 edges of more than two triangles: the surface is cut there"), "{d}");
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn pictures_load_and_bad_ones_give_errors() {
    for (name, width, height, channels) in [
        ("image/brick.png", 512, 512, 1),
        ("image/horse.png", 400, 328, 4),
        ("image/kodim23.png", 768, 512, 3),
        ("textured/knight/knight_texture.png", 1024, 1024, 4),
    ] {
        let image = read_image(data().join(name)).unwrap();
        assert_eq!((image.width, image.height, image.channels), (width, height, channels), "{name}");
    }
    let mut tried = 0;
    for entry in std::fs::read_dir(data().join("bad")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|e| e == "png") {
            let message = read_image(&path).map(|i| (i.width, i.height)).unwrap_err().to_string();
            assert!(message.contains(&*path.to_string_lossy()), "{message}");
            tried += 1;
        }
    }
    assert_eq!(tried, 9);
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn anchors_of_the_real_pairs_resolve() {
    let gt = data().join("gt");
    let file = |name: &str| gt.join(name).to_str().unwrap().to_owned();
    let shrec = format!("{},{}", file("shrec_quadrupeds/381.vts"), file("shrec_quadrupeds/384.vts"));
    for (pairs, source, target, count) in [
        (file("cat_lion/landmarks.txt"), "cat_lion/cat-00.obj", "cat_lion/lion-00.obj", 0),
        (file("fox_same/anchors_80.txt"), "fox_same/fox_rest.obj", "fox_same/fox_run.obj", 80),
        (file("smpl_cross/anchors.json"), "smpl_cross/man.obj", "smpl_cross/woman_9k.obj", 80),
        (shrec, "shrec_quadrupeds/381.obj", "shrec_quadrupeds/384.obj", 21),
    ] {
        let pairs = anchors::read_pairs(&pairs).unwrap();
        assert!(pairs.source.anchors.len() == count || count == 0);
        for (list, mesh) in [(&pairs.source, source), (&pairs.target, target)] {
            let mesh = read_mesh(gt.join(mesh)).unwrap().mesh;
            let topology = Topology::new(&mesh);
            let found = list.resolve(&mesh, &topology, &|_| unreachable!("no anchor is given by position")).unwrap();
            assert!(found.iter().all(|a| a.point.is_valid(&mesh, 0.0)));
        }
    }
    let single = anchors::read_single(gt.join("smpl_cross/anchors_80.txt")).unwrap();
    assert_eq!(single.anchors.len(), 80);
}

/// A valid file of each kind that mutations start from.
fn seeds() -> Vec<(&'static str, Vec<u8>)> {
    let dir = tempfile::tempdir().unwrap();
    let positions = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    let mesh = Mesh::from_triangles("seed", positions, &[[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]).unwrap();
    write_ply(&mesh, Some(&[[1, 2, 3]; 4]), dir.path().join("a.ply")).unwrap();
    npy::write_npy(dir.path().join("a.npy"), 2, &[1.0, 2.0, 3.0, 4.0], |_| false).unwrap();
    let png = encode_png(&Image::zeros(5, 3, 3, Depth::U8).unwrap()).unwrap();
    let material = barymap::io::GlbMaterial {
        name: "m".into(),
        base_color: [1.0; 4],
        texture: Some(png.clone().into()),
        ..Default::default()
    };
    let glb = glb_bytes(&mesh, &[material]).unwrap();
    vec![
        ("obj", b"mtllib x\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 1\nvn 0 0 1\ng a\nusemtl b\nf 1/1/1 2//1 3/1 -1\nf -1 -2 \\\n -3\n".to_vec()),
        ("off", b"STOFF\n3 1 0\n0 0 0 1 1\n1 0 0 0 0\n0 1 0 .5 .5\n3 0 1 2\n".to_vec()),
        ("ply", b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 6 0 0 1 0 0 1\n".to_vec()),
        ("ply", std::fs::read(dir.path().join("a.ply")).unwrap()),
        ("glb", glb),
        ("png", png),
        ("npy", std::fs::read(dir.path().join("a.npy")).unwrap()),
        ("json", br#"{"source": [1, {"face": 2, "barycentric": [1, 0, 0]}], "target": [{"position": [1, 2, 3]}, 4]}"#.to_vec()),
        ("txt", b"1 2\n3 4 # x\n".to_vec()),
    ]
}

/// Gives `bytes` to the reader of `kind`, which must return; what it accepts must be consistent.
fn feed(kind: &str, bytes: &[u8]) {
    let path = Path::new("/nowhere/fuzz");
    let mesh = match kind {
        "obj" => obj::parse_obj(bytes, path),
        "off" => off::parse_off(bytes, path),
        "ply" => ply::parse_ply(bytes, path),
        "glb" => gltf_read::parse_gltf(bytes, path),
        "png" => {
            let _ = decode_image(bytes, path);
            return;
        }
        _ => {
            let dir = tempfile::tempdir().unwrap();
            let file = dir.path().join("fuzz");
            std::fs::write(&file, bytes).unwrap();
            let _ = npy::read_npy(&file);
            let _ = anchors::read_pairs(file.to_str().unwrap());
            let _ = anchors::read_single(&file);
            return;
        }
    };
    if let Ok(loaded) = mesh {
        let mesh = loaded.mesh;
        assert!(mesh.triangle_count() > 0);
        assert!(mesh.triangles().iter().flatten().all(|v| mesh.positions[*v as usize].is_finite()));
        let _ = Diagnosis::new(&mesh, &Topology::new(&mesh)).to_string();
    }
}

#[test]
fn seeds_are_valid_and_no_truncation_panics() {
    for (kind, bytes) in seeds() {
        for length in 0..=bytes.len() {
            feed(kind, &bytes[..length]);
        }
    }
    let path = Path::new("seed");
    for (kind, bytes) in seeds() {
        match kind {
            "obj" => drop(obj::parse_obj(&bytes[..], path).unwrap()),
            "off" => drop(off::parse_off(&bytes, path).unwrap()),
            "ply" => drop(ply::parse_ply(&bytes, path).unwrap()),
            "glb" => drop(gltf_read::parse_gltf(&bytes, path).unwrap()),
            "png" => drop(decode_image(&bytes, path).unwrap()),
            _ => {}
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        for kind in ["obj", "off", "ply", "glb", "png", "json"] {
            feed(kind, &bytes);
        }
        // Behind a valid beginning more of each reader is reached.
        feed("ply", &[b"ply\nformat binary_big_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 3\nproperty list uint uint vertex_index\nend_header\n", &bytes[..]].concat());
        feed("off", &[b"OFF\n3 3 0\n0 0 0\n1 0 0\n0 1 0\n", &bytes[..]].concat());
        feed("obj", &[b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf ", &bytes[..]].concat());
    }

    #[test]
    fn mutated_files_never_panic(
        which in 0usize..9,
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0u8..4), 1..6),
    ) {
        let (kind, mut bytes) = seeds().swap_remove(which);
        for (index, value, action) in edits {
            if bytes.is_empty() {
                break;
            }
            let at = index.index(bytes.len());
            match action {
                0 => bytes[at] = value,
                // A digit more or less changes counts and indices.
                1 => bytes[at] = b'0' + value % 10,
                2 => bytes.insert(at, value),
                _ => drop(bytes.remove(at)),
            }
        }
        feed(kind, &bytes);
    }

    #[test]
    fn random_statements_never_panic(words in prop::collection::vec("(v|vt|vn|f|g|usemtl|o|l|\n|\\\\\n|[-0-9./e]{1,6}|nan|inf|#)", 0..200)) {
        feed("obj", words.join(" ").as_bytes());
        feed("off", format!("OFF\n{}", words.join(" ")).as_bytes());
    }
}
