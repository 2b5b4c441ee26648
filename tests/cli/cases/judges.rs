//! What each case has to give: the values that its README expects.

use barymap::io::attribute_table::read_colors;
use barymap::io::read_mesh;
use barymap::models::shapes::{Diagonal, plane_grid};
use barymap::picture::Image;
use glam::{DMat4, DVec3};
use serde_json::Value;

use super::{BORDER, Case, named, unlike};

/// A judge.
type Judge = fn(&Case);

/// The judges by the names of the folders. Pictures named `expected.png` are compared besides.
pub(super) const JUDGES: &[(&str, Judge)] = &[
    ("bake-vertex-colours", bake_vertex_colours),
    ("bvh-latin1", bvh_latin1),
    ("cage-overflow", cage_overflow),
    ("concave-polygon", concave_polygon),
    ("csv-semicolon", csv_semicolon),
    ("exif-orientation-jpeg", exif_orientation_jpeg),
    ("exr-layer", |case| ramp_of_floats(case, 3)),
    ("exr-luminance", |case| ramp_of_floats(case, 1)),
    ("far-from-origin", far_from_origin),
    ("far-offset-map", far_offset_map),
    ("glb-far-coordinates", glb_far_coordinates),
    ("glb-model-hard-edges", glb_model_hard_edges),
    ("high-valence-fan", high_valence_fan),
    ("map-bump-normal", map_bump_normal),
    ("material-file-overwritten", named::material_file_overwritten),
    ("mtl-foreign-absolute-path", |case| assert!(case.ran.stderr.contains("note: "), "{}", case.ran.stderr)),
    ("npy-integer-labels", npy_integer_labels),
    ("pipes", named::pipes),
    ("ply-float-255", ply_colours),
    ("ply-rgb-names", ply_colours),
    ("points-with-names", points_with_names),
    ("report-onto-output", named::report_onto_output),
    ("rig-lost", rig_lost),
    ("tiff-gray-float", tiff_gray_float),
    ("tiff-palette", tiff_palette),
    ("unwelded-obj", unwelded_obj),
];

/// Texels that are compared, with their numbers from the left and the top.
fn inside(image: &Image) -> impl Iterator<Item = (u32, u32)> + use<> {
    let (width, height) = (image.width, image.height);
    (BORDER..height - BORDER).flat_map(move |y| (BORDER..width - BORDER).map(move |x| (x, y)))
}

fn succeeded(case: &Case) {
    assert_eq!(case.ran.code, Some(0), "{}", case.ran.stderr);
}

/// A cell of the table `out.csv` as a number, whatever its dialect.
fn cells(case: &Case, name: &str) -> Vec<Vec<String>> {
    let text = case.folder.read(name);
    let separator = if text.lines().next().unwrap().contains(';') { ';' } else { ',' };
    text.lines().map(|line| line.split(separator).map(str::to_owned).collect()).collect()
}

/// Red rises to the right and green upwards, as the colours of the vertices do; blue is what is
/// left of red's.
fn bake_vertex_colours(case: &Case) {
    succeeded(case);
    let out = case.folder.image("out.png");
    assert_eq!((out.width, out.height), (64, 64));
    let colours = read_colors(case.folder.path("source.ply")).unwrap();
    let mesh = read_mesh(case.folder.path("source.ply")).unwrap().mesh;
    for (p, c) in mesh.positions.iter().zip(colours.values.chunks(3)) {
        // The texel at a vertex in the plane of the sheet, inside the border.
        let (x, y) = ((p.x * 64.0) as u32, ((1.0 - p.y) * 64.0) as u32);
        if (BORDER..64 - BORDER).contains(&x) && (BORDER..64 - BORDER).contains(&y) {
            for (k, value) in c.iter().enumerate() {
                let found = f64::from(out.get(x, y, k as u32));
                assert!((found - value).abs() < 8.0 / 255.0, "texel {x}, {y}: {found} for {value}");
            }
        }
    }
    let (left, right, top) = (out.get(8, 32, 0), out.get(56, 32, 0), out.get(32, 8, 1));
    assert!(right - left > 0.7 && top > 0.8, "{left} {right} {top}");
}

/// The spine stands on the hips and turns by a quarter about z: its end goes from above to the side
/// of -x.
fn bvh_latin1(case: &Case) {
    succeeded(case);
    let mut frames: Vec<_> =
        case.folder.files("out").into_iter().filter(|p| p.extension().is_some_and(|e| e == "obj")).collect();
    frames.sort();
    assert_eq!(frames.len(), 3, "{frames:?}");
    let middle = |frame: usize, first: usize| {
        let mesh = read_mesh(&frames[frame]).unwrap().mesh;
        mesh.positions[first..first + 12].iter().sum::<DVec3>() / 12.0
    };
    for (frame, first, expected) in [
        (0, 0, DVec3::ZERO),
        (0, 144, DVec3::Y),
        (0, 288, 2.0 * DVec3::Y),
        (2, 0, DVec3::ZERO),
        (2, 144, DVec3::Y),
        (2, 288, DVec3::new(-1.0, 1.0, 0.0)),
        (1, 288, DVec3::new(-std::f64::consts::FRAC_1_SQRT_2, 1.0 + std::f64::consts::FRAC_1_SQRT_2, 0.0)),
    ] {
        let found = middle(frame, first);
        assert!(found.distance(expected) < 0.02, "frame {frame}, ring at {first}: {found} for {expected}");
    }
    assert!(case.ran.stderr.contains("not UTF-8"), "{}", case.ran.stderr);
}

/// An error that names the vertex, or finite numbers.
fn cage_overflow(case: &Case) {
    if case.ran.code == Some(0) {
        let text = case.folder.read("o.obj");
        assert!(!text.contains("NaN") && !text.contains("inf"), "{text}");
    } else {
        assert_eq!(case.ran.code, Some(1), "{}", case.ran.stderr);
        assert!(case.ran.message().contains("vertex"), "{}", case.ran.stderr);
        assert!(!case.folder.path("o.obj").exists());
    }
}

/// The L covers three quarters of the picture, as one island without folds; the fourth is empty.
fn concave_polygon(case: &Case) {
    succeeded(case);
    let out = case.folder.image("out.png");
    let alpha = |x: u32, y: u32| if out.channels.is_multiple_of(2) { out.get(x, y, out.channels - 1) } else { 1.0 };
    let mut covered = 0;
    for y in 0..64 {
        for x in 0..64 {
            let outside = x >= 32 && y < 32;
            covered += u32::from(alpha(x, y) > 0.5);
            assert_eq!(alpha(x, y) > 0.5, !outside, "texel {x}, {y}");
        }
    }
    assert_eq!(covered, 3072);
    for word in ["overlap", "mirrored", "flipped: ", "belong to several"] {
        assert!(!case.ran.stderr.contains(word), "{}", case.ran.stderr);
    }
    assert!(
        case.ran.stdout.contains("100.0 % of the covered area valid, 0.00 % of the target flipped"),
        "{}",
        case.ran.stdout
    );
}

/// Source and target are one mesh: its weights arrive as they are, in the table's own dialect.
fn csv_semicolon(case: &Case) {
    succeeded(case);
    let given: Vec<f64> = (0..=8).flat_map(|k| [f64::from(k) / 8.0, 1.0 - f64::from(k) / 8.0]).collect();
    let out = cells(case, "out.csv");
    assert_eq!(out[0], ["index", "hips", "spine", "status", "confidence"]);
    assert_eq!(out.len(), 82);
    for (v, row) in out[1..].iter().enumerate() {
        for k in 0..2 {
            let value: f64 = row[1 + k].replace(',', ".").parse().unwrap();
            let expected = given[2 * (v % 9) + k];
            assert!((value - expected).abs() < 1e-5, "vertex {v}: {row:?} for {expected}");
        }
    }
}

/// What viewers show is upright.
fn exif_orientation_jpeg(case: &Case) {
    let out = case.folder.image("out.png");
    assert_eq!((out.width, out.height), (96, 64));
}

/// Every row of the picture has the value y / 40 in each channel, beyond 1 as well.
fn ramp_of_floats(case: &Case, channels: u32) {
    succeeded(case);
    let out = case.folder.image("out.exr");
    assert_eq!((out.width, out.height), (64, 64));
    for (x, y) in inside(&out) {
        for c in 0..channels {
            let (value, expected) = (out.get(x, y, c), y as f32 / 40.0);
            assert!((value - expected).abs() < 0.02, "texel {x}, {y}, channel {c}: {value} for {expected}");
        }
    }
}

/// As near the origin: every vertex valid, and placed as there.
fn far_from_origin(case: &Case) {
    succeeded(case);
    let near = crate::support::Folder::empty();
    let welded = case.given.parent().unwrap().join("unwelded-obj");
    for file in ["source_welded.obj", "target_welded.obj", "pairs_welded.json"] {
        std::fs::copy(welded.join(file), near.path(file)).unwrap();
    }
    near.shell("barymap map --source source_welded.obj --target target_welded.obj --anchors pairs_welded.json -o m.csv --backend cpu --no-cache")
        .succeeds();
    let rows = |text: String| -> Vec<(String, DVec3)> {
        let row = |line: &str| {
            let cells: Vec<&str> = line.split(',').collect();
            let at = |k: usize| cells[k].parse::<f64>().unwrap();
            (cells[8].to_owned(), DVec3::new(at(5), at(6), at(7)))
        };
        text.lines().skip(1).map(row).collect()
    };
    let (here, there) = (rows(near.read("m.csv")), rows(case.folder.read("m.csv")));
    assert_eq!(here.len(), there.len());
    let shift = DVec3::new(500_000.0, 4_600_000.0, 100.0);
    for (v, (a, b)) in here.iter().zip(&there).enumerate() {
        assert_eq!(a.0, b.0, "vertex {v}");
        // The body is two units high; files hold nine digits behind the point of shifted positions.
        assert!((b.1 - shift).distance(a.1) < 2e-3, "vertex {v}: {} for {}", b.1 - shift, a.1);
    }
}

/// Vertex i of the target lies at vertex i of the source.
fn far_offset_map(case: &Case) {
    succeeded(case);
    let source = read_mesh(case.folder.path("source.obj")).unwrap().mesh;
    let rows = cells(case, "out.csv");
    assert_eq!(rows.len(), 1 + source.vertex_count());
    for (row, p) in rows[1..].iter().zip(&source.positions) {
        let at = |k: usize| row[k].parse::<f64>().unwrap();
        let found = DVec3::new(at(5), at(6), at(7));
        assert!(found.distance(*p) < 1e-5 && row[8] == "valid", "{row:?} for {p}");
    }
}

/// The JSON and the bytes of a GLB.
fn glb(case: &Case, name: &str) -> (Value, Vec<u8>) {
    let bytes = case.folder.bytes(name);
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    (serde_json::from_slice(&bytes[20..20 + length]).unwrap(), bytes[28 + length..].to_vec())
}

/// The vectors of an attribute of every primitive.
fn vectors(case: &Case, name: &str, semantic: &gltf::Semantic) -> Vec<DVec3> {
    let (document, buffers, _) = gltf::import(case.folder.path(name)).unwrap();
    let mut all = Vec::new();
    for primitive in document.meshes().flat_map(|m| m.primitives()) {
        let reader = primitive.reader(|b| buffers.get(b.index()).map(|d| d.0.as_slice()));
        let vector = |v: [f32; 3]| DVec3::from(v.map(f64::from));
        match semantic {
            gltf::Semantic::Normals => all.extend(reader.read_normals().unwrap().map(vector)),
            _ => all.extend(reader.read_positions().unwrap().map(vector)),
        }
    }
    all
}

/// The placement of the first node with a mesh, in double precision.
fn placement(json: &Value) -> DMat4 {
    let node = json["nodes"].as_array().unwrap().iter().find(|n| n.get("mesh").is_some()).unwrap();
    let list = |key: &str| {
        node.get(key).map(|v| v.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect::<Vec<f64>>())
    };
    if let Some(m) = list("matrix") {
        return DMat4::from_cols_slice(&m);
    }
    let translation = list("translation").map_or(DVec3::ZERO, |t| DVec3::from_slice(&t));
    let scale = list("scale").map_or(DVec3::ONE, |s| DVec3::from_slice(&s));
    let turn = list("rotation").map_or(glam::DQuat::IDENTITY, |r| glam::DQuat::from_slice(&r));
    DMat4::from_scale_rotation_translation(scale, turn, translation)
}

/// Every position is where it was to a millionth: there are nine northings.
fn glb_far_coordinates(case: &Case) {
    succeeded(case);
    let (json, _) = glb(case, "out.glb");
    let place = placement(&json);
    let positions: Vec<DVec3> =
        vectors(case, "out.glb", &gltf::Semantic::Positions).into_iter().map(|p| place.transform_point3(p)).collect();
    let mesh = read_mesh(case.folder.path("target.obj")).unwrap().mesh;
    let near = |a: DVec3, b: DVec3| a.distance(b) < 1e-6;
    for p in &mesh.positions {
        assert!(positions.iter().any(|q| near(*p, *q)), "{p} is nowhere");
    }
    assert!(positions.iter().all(|q| mesh.positions.iter().any(|p| near(*p, *q))));
    let mut northings: Vec<i64> = positions.iter().map(|p| (p.y * 1e4).round() as i64).collect();
    northings.sort_unstable();
    northings.dedup();
    assert_eq!(northings.len(), 9);
}

/// Every normal of the cube is that of a face.
fn glb_model_hard_edges(case: &Case) {
    succeeded(case);
    let normals = vectors(case, "out.glb", &gltf::Semantic::Normals);
    assert!(normals.len() >= 24, "{}", normals.len());
    for n in &normals {
        assert!(n.abs().max_element() > 0.9999 && (n.length() - 1.0).abs() < 1e-4, "{n}");
    }
    // All six of them.
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        assert!(normals.iter().any(|n| n.dot(axis) > 0.99) && normals.iter().any(|n| n.dot(axis) < -0.99));
    }
}

/// A cone of 2,000 sides is embedded: all places finite, those of the rim alike, the apex apart
/// from them.
fn high_valence_fan(case: &Case) {
    succeeded(case);
    let matrix = barymap::io::npy::read_npy(case.folder.path("e.npy")).unwrap();
    let mesh = read_mesh(case.folder.path("fan_2000.obj")).unwrap().mesh;
    assert_eq!(matrix.values.len(), matrix.columns * mesh.vertex_count());
    assert!(matrix.values.iter().all(|x| x.is_finite()));
    // As much memory as an even mesh of that size needs, but for half of it.
    let even = plane_grid(44, 44, 1.0, 1.0, Diagonal::Forward);
    barymap::io::write_obj(&even, case.folder.path("even.obj")).unwrap();
    let other = case.folder.shell("barymap embed even.obj -o even.npy --backend cpu --no-cache").succeeds();
    if let (Some(fan), Some(even)) = (case.ran.peak_memory, other.peak_memory) {
        assert!(2 * fan < 3 * even, "{fan} bytes for {even}");
    }
}

/// A normal map that is turned by a quarter with the layout.
fn map_bump_normal(case: &Case) {
    succeeded(case);
    let out = case.folder.image("out_normal.png");
    for (x, y) in inside(&out) {
        for (c, expected) in [128.0, 210.0, 225.0].into_iter().enumerate() {
            let value = 255.0 * out.get(x, y, c as u32);
            // The tolerance of the cases: 6 of 255.
            assert!((value - expected).abs() < 6.0, "texel {x}, {y}, channel {c}: {value}");
        }
    }
}

/// Source and target are one mesh: vertex i has the label i, a whole number.
fn npy_integer_labels(case: &Case) {
    succeeded(case);
    let rows = cells(case, "out.csv");
    assert_eq!((rows.len(), rows[0].len()), (82, 4));
    let given = barymap::io::npy::read_npy(case.folder.path("l.npy")).unwrap();
    for (v, row) in rows[1..].iter().enumerate() {
        assert_eq!(row[1], given.values[v].to_string(), "vertex {v}");
    }
    assert_eq!(given.values[..6], [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
}

/// Vertex 20 keeps its colour.
fn ply_colours(case: &Case) {
    succeeded(case);
    let table = read_colors(case.folder.path("out.ply")).unwrap();
    let row: Vec<f64> = table.values[20 * table.columns.len()..][..3].iter().map(|c| (255.0 * c).round()).collect();
    for (found, expected) in row.iter().zip([64.0, 64.0, 191.0]) {
        assert!((found - expected).abs() <= 1.0, "{row:?}");
    }
}

/// The point is moved by what the cage is, and everything else stays.
fn points_with_names(case: &Case) {
    succeeded(case);
    let rows = cells(case, "out.csv");
    assert_eq!(rows[0], ["id", "x", "y", "name", "status"]);
    let [id, x, y, name, status] = &rows[1][..] else { panic!("{rows:?}") };
    assert_eq!((rows.len(), id.as_str(), name.as_str(), status.as_str()), (2, "7", "a", "ok"));
    for (found, expected) in [(x, 20.0), (y, 15.0)] {
        assert!((found.parse::<f64>().unwrap() - expected).abs() < 1e-9, "{rows:?}");
    }
}

/// The textured model has the rig of the target.
fn rig_lost(case: &Case) {
    succeeded(case);
    let ((before, _), (after, _)) = (glb(case, "target.glb"), glb(case, "out.glb"));
    for key in ["skins", "animations", "nodes"] {
        let count = |json: &Value| json[key].as_array().map_or(0, Vec::len);
        assert!(count(&after) >= count(&before), "{key}: {} of {}", count(&after), count(&before));
    }
    let names = |json: &Value| -> Vec<String> {
        json["nodes"].as_array().unwrap().iter().filter_map(|n| Some(n["name"].as_str()?.to_owned())).collect()
    };
    assert!(names(&before).iter().all(|n| names(&after).contains(n)), "{:?}", names(&after));
    let mesh = &after["meshes"][0];
    assert_eq!(mesh["extras"]["targetNames"], before["meshes"][0]["extras"]["targetNames"]);
    let primitive = &mesh["primitives"][0];
    for attribute in ["JOINTS_0", "WEIGHTS_0", "TEXCOORD_0", "POSITION"] {
        assert!(primitive["attributes"][attribute].is_u64(), "{attribute}: {primitive}");
    }
    assert_eq!(primitive["targets"].as_array().map(Vec::len), Some(1));
    // The morph target moves every vertex by 1 along z, before and after.
    let (document, buffers, _) = gltf::import(case.folder.path("out.glb")).unwrap();
    let primitive = document.meshes().next().unwrap().primitives().next().unwrap();
    let reader = primitive.reader(|b| buffers.get(b.index()).map(|d| d.0.as_slice()));
    let targets: Vec<_> = reader.read_morph_targets().collect();
    assert!(targets[0].0.clone().unwrap().all(|d| d == [0.0, 0.0, 1.0]));
    assert!(reader.read_weights(0).unwrap().into_f32().all(|w| (w.iter().sum::<f32>() - 1.0).abs() < 1e-3));
    assert!(primitive.material().pbr_metallic_roughness().base_color_texture().is_some());
}

/// Grey of y / 40, up to white, and a note on what is brighter.
fn tiff_gray_float(case: &Case) {
    succeeded(case);
    let out = case.folder.image("out.png");
    for (x, y) in inside(&out) {
        let (value, expected) = (out.get(x, y, 0), (y as f32 / 40.0).min(1.0));
        assert!((value - expected).abs() < 6.0 / 255.0, "texel {x}, {y}: {value} for {expected}");
    }
    assert!(case.ran.stderr.contains("note: "), "{}", case.ran.stderr);
}

/// Colours of the palette, at three corners by hand.
fn tiff_palette(case: &Case) {
    succeeded(case);
    let (out, given) = (case.folder.image("out.png"), case.folder.image("t.tif"));
    for (x, y, expected) in
        [(0, 0, [28, 28, 120]), (63, 0, [222, 28, 120]), (16, 16, [91, 91, 120]), (32, 32, [155, 155, 120])]
    {
        let found = [0, 1, 2].map(|c| (255.0 * given.get(x, y, c)).round() as i32);
        assert_eq!(found, expected, "texel {x}, {y}");
    }
    if let Some(what) = unlike(&out, &given) {
        panic!("{what}");
    }
}

/// As welded: the same picture, all of it valid.
fn unwelded_obj(case: &Case) {
    succeeded(case);
    let unwelded = case.folder.image("o.png");
    assert!(
        case.ran.stdout.contains("100.0 % of the covered area valid, 0.00 % of the target flipped"),
        "{}",
        case.ran.stdout
    );
    case.folder
        .shell("barymap transfer --source source_welded.obj --target target_welded.obj --texture texture.png --anchors pairs_welded.json --size 256 -o w.png --backend cpu --no-cache")
        .succeeds();
    let welded = case.folder.image("w.png");
    assert_eq!((unwelded.width, unwelded.height, unwelded.channels), (welded.width, welded.height, welded.channels));
    let mut sum = 0.0;
    for (x, y) in inside(&welded) {
        sum += (0..welded.channels).map(|c| (welded.get(x, y, c) - unwelded.get(x, y, c)).abs()).sum::<f32>();
    }
    let mean = sum / (252.0 * 252.0 * welded.channels as f32);
    assert!(mean < 1.0 / 255.0, "{mean}");
}
