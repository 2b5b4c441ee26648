//! Judges of the cases about the files that a command line names.

use super::Case;
use crate::support::Folder;

/// The library of a mesh is referred to; what has the name of a new one stays.
pub(super) fn material_file_overwritten(case: &Case) {
    let f = &case.folder;
    let (library, mesh) = (std::fs::read(case.given.join("hero.mtl")).unwrap(), case.given.join("hero.obj"));
    // The input is the output: only if that is asked for.
    case.ran.fails_like(2, &["--output", "hero.obj", "--overwrite"]);
    assert!(f.bytes("hero.obj") == std::fs::read(mesh).unwrap() && f.bytes("hero.mtl") == library);

    let ran = f.run("deform hero.obj --handles handles.json -o hero.obj --overwrite").succeeds();
    assert!(ran.stdout.contains("hero.mtl: unchanged"), "{}", ran.stdout);
    assert_eq!(f.bytes("hero.mtl"), library);
    assert!(f.read("hero.obj").starts_with("mtllib hero.mtl\n"));

    std::fs::create_dir(f.path("out")).unwrap();
    f.write("out/x.mtl", "# something else\n");
    f.run("deform hero.obj --handles handles.json -o out/x.obj").succeeds();
    assert_eq!((f.read("out/x.mtl").as_str(), f.bytes("hero.mtl")), ("# something else\n", library));
    assert!(f.read("out/x.obj").starts_with("mtllib ../hero.mtl\n"));
    let material = |name: &str| barymap::io::read_mesh(f.path(name)).unwrap().mesh.materials[0].clone();
    let (before, after) = (material("hero.obj"), material("out/x.obj"));
    assert_eq!((before.statements, before.base_color_placement), (after.statements, after.base_color_placement));
}

/// No file is written twice, whatever the two options are.
pub(super) fn report_onto_output(case: &Case) {
    case.ran.fails_like(2, &["written twice", "--report", "--output"]);
    let f = Folder::spheres();
    let pair = "--source s.obj --target t.obj --anchors a.json";
    for (line, output) in [
        (format!("map {pair} -o m.csv --report ./m.csv"), "m.csv"),
        (format!("transfer {pair} --texture s.png --size 64 -o x.png --report x.png"), "x.png"),
        (format!("transfer {pair} --texture s.png --size 64 -o x.png --coverage x.png"), "x.png"),
        ("anchors s.obj t.obj --anchors a.json -o p.json --report p.json".to_owned(), "p.json"),
        ("warp s.png --cage a.json -o w.png --heatmap w.png --grid w.png".to_owned(), "w.png"),
    ] {
        f.run(&line).fails(2, &["written twice"]);
        assert!(!f.path(output).exists(), "{line}");
    }
}

/// Pipes are read and written where a shell made them, and refused at once where they would wait.
pub(super) fn pipes(_: &Case) {
    let f = Folder::spheres();
    let bash = |line: &str| f.shell(&format!("bash -c '{line}'"));
    let map = "barymap map --source s.obj --target t.obj --anchors a.json";
    bash(&format!("{map} -o file.csv")).succeeds();
    bash("barymap map --source s.obj --target t.obj --anchors <(cat a.json) -o m.csv").succeeds();
    assert_eq!(f.read("m.csv"), f.read("file.csv"));
    bash("cat s.obj | barymap map --source - --target t.obj --anchors a.json -o n.csv").succeeds();
    assert_eq!(f.read("n.csv"), f.read("file.csv"));
    let ran = bash(&format!("{map} -o -")).succeeds();
    assert_eq!(ran.stdout, f.read("file.csv"));
    assert!(ran.stderr.contains("vertices") || ran.stderr.contains("points"), "the summary: {}", ran.stderr);
    bash(&format!("{map} -o /dev/stdout --quiet | cat > piped.csv")).succeeds();
    assert_eq!(f.read("piped.csv"), f.read("file.csv"));
    bash(&format!("{map} -o >(cat > sent.csv); sleep 0.3")).succeeds();
    assert_eq!(f.read("sent.csv"), f.read("file.csv"));

    // A named pipe whose other end nobody holds.
    f.shell("mkfifo p f");
    bash(&format!("{map} -o p")).fails(1, &["p: ", "named pipe"]);
    bash(&format!("{map} -o m.csv --report p --overwrite")).fails(1, &["p: ", "named pipe"]);
    f.run("render f -o r.png").fails(1, &["f: ", "pipe"]);
    f.write("m.obj", "mtllib f\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let ran = f.run("render m.obj -o r.png").succeeds();
    assert!(ran.stderr.contains("pipe"), "{}", ran.stderr);
    f.write("n.mtl", "newmtl a\nmap_Kd f\n");
    f.write("n.obj", "mtllib n.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\n");
    assert!(f.run("render n.obj -o r.png").code.is_some_and(|code| code < 2));
    f.write("b.gltf", r#"{"asset": {"version": "2.0"}, "buffers": [{"uri": "f", "byteLength": 12}]}"#);
    assert_eq!(f.run("render b.gltf -o r.png").code, Some(1));
}
