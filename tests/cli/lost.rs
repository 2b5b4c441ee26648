//! Nothing is lost: two outputs never share a file, and what somebody else made stays.

use std::fs;

use crate::support::Folder;

const TRANSFER: &str =
    "transfer --backend cpu --source s.obj --target t.obj --texture s.png --anchors a.json --size 32";
const WARP: &str = "warp s.png --backend cpu --cage cage.json";

fn with_cage() -> Folder {
    let f = Folder::spheres();
    f.write("cage.json", r#"{"source": [[0, 0], [9, 0], [9, 9]], "target": [[0, 0], [8, 0], [9, 9]]}"#);
    f
}

#[test]
fn a_demo_keeps_what_it_did_not_write() {
    let f = Folder::spheres();
    fs::create_dir(f.path("out")).unwrap();
    f.write("out/source.obj", "mine\n");
    let demo = "demo --backend cpu --size 64 --anchors 20";
    f.run(demo).fails(2, &["source.obj", "no demo wrote it", "--overwrite"]);
    assert_eq!(f.bytes("out/source.obj"), b"mine\n");
    f.run(&format!("{demo} --overwrite")).succeeds();
    // Its own is written again.
    f.run(demo).succeeds();
}

#[test]
fn outputs_of_one_name_are_refused_however_they_come_by_it() {
    let f = with_cage();
    f.run(&format!("{WARP} -o new/w.png --heatmap new/../new/w.png")).fails(2, &["written twice", "--heatmap"]);
    f.run(&format!("{WARP} -o w.png --frames 3 --heatmap w_0001.png")).fails(2, &["w_0001.png", "frame"]);
    f.run(&format!("{WARP} -o w.png --frames 3 --report w_0000.png")).fails(2, &["w_0000.png", "JSON"]);
    f.run(&format!("{WARP} -o - --frames 2")).fails(2, &["--frames", "stdout"]);
    // A library beside a mesh.
    f.write("m.mtl", "newmtl skin\nKd 1 0 0\n");
    f.write("m.obj", &format!("mtllib m.mtl\nusemtl skin\n{}", String::from_utf8(f.bytes("s.obj")).unwrap()));
    f.run("unwrap m.obj -o y.glb").succeeds();
    f.run("unwrap y.glb -o z.obj --report z.mtl").fails(2, &["--report", "written twice"]);
    assert!(String::from_utf8(f.bytes("z.mtl")).unwrap().contains("newmtl"));
    // A library that is read is named by the option at fault, before anything is written.
    f.run("unwrap m.obj -o x.obj --report m.mtl").fails(2, &["--report", "m.mtl", "is read"]);
    assert!(!f.path("x.obj").exists() && f.bytes("m.mtl").starts_with(b"newmtl"));
}

#[cfg(unix)]
#[test]
fn links_lead_where_they_lead_and_protected_files_stay() {
    let f = with_cage();
    std::os::unix::fs::symlink("w.png", f.path("link.png")).unwrap();
    f.run(&format!("{WARP} -o w.png --heatmap link.png")).fails(2, &["written twice"]);
    f.run(&format!("{WARP} -o link.png")).succeeds();
    assert!(f.path("link.png").is_symlink() && f.path("w.png").is_file());
    let mut permissions = fs::metadata(f.path("w.png")).unwrap().permissions();
    permissions.set_readonly(true);
    fs::set_permissions(f.path("w.png"), permissions).unwrap();
    let before = f.bytes("w.png");
    f.run(&format!("{WARP} -o w.png")).fails(1, &["w.png", "write-protected"]);
    assert_eq!(f.bytes("w.png"), before);
}

#[test]
fn names_say_what_files_are() {
    let f = Folder::spheres();
    f.run(&format!("{TRANSFER} --model x.obj")).fails(2, &["--model", "GLB"]);
    f.run(&format!("{TRANSFER} -o x.png --report r.png")).fails(2, &["--report", "r.png", "JSON"]);
    f.run("embed s.obj -o e.glb").fails(2, &["e.glb", "NPY", ".npy"]);
    // A folder of a name with a sign that stands for nothing is made as any other.
    f.run("unwrap s.obj -o 100%/u.obj").succeeds();
    assert!(f.path("100%/u.obj").is_file());
}

#[test]
fn pairs_at_random_are_at_odds_and_few_say_nothing() {
    let f = Folder::spheres();
    let whole: serde_json::Value = serde_json::from_slice(&f.bytes("a.json")).unwrap();
    // Anchors in their order, or in one that no turn of the ball makes.
    let check = |count: usize, step: usize| {
        let side = |key: &str, step: usize| -> Vec<serde_json::Value> {
            (0..count).map(|i| whole[key][i * step % count].clone()).collect()
        };
        let (source, target) = (side("source", step), side("target", 1));
        f.write("odd.json", &serde_json::json!({"source": source, "target": target}).to_string());
        f.run("anchors s.obj t.obj --anchors odd.json --check --strict")
    };
    let few = check(2, 1).succeeds();
    assert!(few.stdout.contains("too few") && !few.stdout.contains("none contradicts"), "{}", few.stdout);
    check(40, 1).succeeds();
    check(40, 17).fails(3, &["contradict one another"]);
}
