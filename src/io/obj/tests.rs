//! Tests of the OBJ reader.

use super::*;

fn parse(text: &str) -> Result<LoadedMesh> {
    parse_obj(text.as_bytes(), Path::new("test.obj"))
}

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

fn message(text: &str) -> String {
    parse(text).unwrap_err().to_string()
}

#[test]
fn vertex_index_is_the_line_and_faces_are_fans() {
    let text = "v 9 9 9\r\nv 0 0 0 1 0 0\r\nv 1 0 0\r\nf 2 3 4 5 # quad\r\nv 1 1 0\r\nv 0 1 0\r\nf -1 -3 \\\r\n -4\r\n";
    let loaded = parse(text).unwrap();
    assert_eq!(loaded.mesh.triangles(), [[1, 2, 3], [1, 3, 4], [4, 2, 1]]);
    assert_eq!((loaded.mesh.vertex_count(), loaded.mesh.polygon_count()), (5, 2));
    assert_eq!(loaded.mesh.positions[1], DVec3::ZERO);
    assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
}

#[test]
fn corners_hold_all_four_forms() {
    let text = format!("{TRIANGLE}vt 0.25 0.5\nvn 0 0 1\nf 1/1 2//1 3/1/1\nf 1/1/ 2// 3\n");
    let mesh = parse(&text).unwrap().mesh;
    let [a, b, c] = mesh.triangle_corners(0);
    assert_eq!([a.texcoord, a.normal, b.texcoord, b.normal, c.texcoord, c.normal], [0, NONE, NONE, 0, 0, 0]);
    assert_eq!(mesh.triangle_texcoords(0), None);
    let [a, b, _] = mesh.triangle_corners(1);
    assert_eq!([a.texcoord, a.normal, b.texcoord, b.normal], [0, NONE, NONE, NONE]);
}

#[test]
fn groups_and_materials_interleave() {
    let text = format!("{TRIANGLE}f 1 2 3\ng a\nusemtl m\nf 1 2 3\no b c\nf 1 2 3\ng a\nusemtl\nf 1 2 3\ng\nf 1 2 3");
    let mesh = parse(&text).unwrap().mesh;
    assert_eq!(mesh.groups, ["a", "b c"]);
    let groups: Vec<u32> = (0..5).map(|p| mesh.polygon_group(p)).collect();
    let materials: Vec<u32> = (0..5).map(|p| mesh.polygon_material(p)).collect();
    assert_eq!((groups, materials), (vec![NONE, 0, 1, 0, NONE], vec![NONE, 0, 0, NONE, NONE]));
}

#[test]
fn colours_stand_behind_positions_or_in_comments() {
    let text = "v 0 0 0 255 0 51\nv 1 0 0 0 0 0\nv 0 1 0 0 255 0\nf 1 2 3\n";
    let loaded = parse(text).unwrap();
    assert_eq!(loaded.mesh.colors[0], [1.0, 0.0, 0.2, 1.0]);
    assert!(loaded.warnings[0].contains("parts of 255"), "{:?}", loaded.warnings);
    let painted = format!("{TRIANGLE}#MRGB ffff0033ff000000\n#MRGB ff00ff00\nf 1 2 3\n");
    assert_eq!(parse(&painted).unwrap().mesh.colors, loaded.mesh.colors);
    // What does not fit the vertices is a comment.
    let short = format!("{TRIANGLE}#MRGB ffff0033\nf 1 2 3\n");
    assert!(parse(&short).unwrap().mesh.colors.is_empty());
    assert!(parse(&format!("{TRIANGLE}f 1 2 3\n")).unwrap().mesh.colors.is_empty());
}

#[test]
fn errors_name_the_line() {
    let cases = [
        (format!("{TRIANGLE}f 1 2 4\n"), "line 4: a face refers to vertex 4, the file has 3"),
        (format!("{TRIANGLE}f 0 1 2\n"), "vertex index 0"),
        (format!("{TRIANGLE}f 1 2 -4\n"), "line 4: a face refers to vertex -4, 3 lie before it"),
        (format!("{TRIANGLE}f 1/1 2/1 3/1\n"), "texture coordinate 1, the file has 0"),
        (format!("{TRIANGLE}f 1 2 x\n"), "no integer"),
        (format!("{TRIANGLE}f 1 2 /3\n"), "not a face corner"),
        (format!("{TRIANGLE}f 1 2 99999999999999999999\n"), "no integer"),
        (format!("{TRIANGLE}f 1 2 9999999999\n"), "vertex 9999999999"),
        ("v 0 0\n".to_owned(), "line 1: a vertex with 2 of 3 numbers"),
        ("v 0 0,5 0\n".to_owned(), "not a number"),
        ("v nan 0 0\nv 1 0 0\nv 0 1 0\n\nf 3 2 1\n".to_owned(), "line 5: the position of vertex 0 (line 1)"),
        ("v 1.#IND 0 0\nv 1 0 0\nv 0 1 0\nf 3 2 1\n".to_owned(), "not finite"),
        (String::new(), "no face"),
        (format!("{TRIANGLE}l 1 2\n"), "no face"),
        ("\u{0}v\u{0} \u{0}0\u{0} \u{0}0".to_owned(), "UTF-16"),
    ];
    for (text, expected) in cases {
        let message = message(&text);
        assert!(message.contains(expected), "{message:?} lacks {expected:?}");
    }
}

#[test]
fn harmless_faults_become_warnings() {
    let text =
        format!("{TRIANGLE}v inf 0 0\nvt nan 0\nf 1 2\nf\nf 1/1 2/1 3/1\nf 1//7 2//7 3//7\nl 1 2\nmtllib gone.mtl\n");
    let loaded = parse(&text).unwrap();
    assert_eq!(loaded.mesh.triangle_count(), 2);
    assert!(!loaded.mesh.has_texcoords());
    let all = loaded.warnings.join("\n");
    for expected in [
        "three corners were left out: 2, first on line 6",
        "positions that",
        "texture coordinates that",
        "normals",
        "lines and points",
        "gone.mtl",
    ] {
        assert!(all.contains(expected), "{all:?} lacks {expected:?}");
    }
}
