//! What people read: help, verdicts, summaries, and names of places in their files.

use crate::support::Folder;

/// The commands that `--help` lists.
fn commands(f: &Folder) -> Vec<String> {
    let help = f.run("--help").succeeds().stdout;
    let listed = help.lines().skip_while(|l| !l.starts_with("Commands:")).skip(1).take_while(|l| !l.is_empty());
    let names = listed.filter(|l| l.starts_with("  ") && !l.starts_with("   "));
    names.filter_map(|l| l.split_whitespace().next()).filter(|c| *c != "help").map(str::to_owned).collect()
}

#[test]
fn help_has_an_example_and_keeps_common_options_apart() {
    let f = Folder::empty();
    let commands = commands(&f);
    assert!(commands.len() > 20, "{commands:?}");
    for command in commands {
        let help = f.run(&format!("{command} --help")).succeeds().stdout;
        let (own, common) = help.split_once("Options of every command:").unwrap_or_else(|| panic!("{help}"));
        assert!(common.contains("--memory") && !own.contains("--memory"), "{command}");
        assert!(common.contains(&format!("Example:\n  barymap {command}")), "{help}");
    }
}

#[test]
fn results_end_with_a_verdict() {
    let f = Folder::spheres();
    let transfer = "transfer --source s.obj --target t.obj --texture s.png --anchors a.json --backend cpu --size 64";
    let ran = f.run(&format!("{transfer} -o o.png --report r.json --strict")).succeeds();
    let last = ran.stdout.lines().last().unwrap();
    let verdict = f.json("r.json")["verdict"].clone();
    assert!(last == "good" || last.starts_with("look at the result: "), "{}", ran.stdout);
    assert_eq!(verdict["word"] == "good", last == "good", "{verdict}");
    f.wrong_anchors("wrong.json", 40);
    let wrong = transfer.replace("a.json", "wrong.json");
    let ran = f.run(&format!("{wrong} -o w.png --report w.json")).succeeds();
    let unusable =
        |text: &str| text.contains("not usable, because ") && text.contains(" of the covered area cannot be trusted");
    assert!(unusable(&ran.stdout), "{}", ran.stdout);
    assert_eq!(f.json("w.json")["verdict"]["word"], "not usable");
    let ran = f.run(&format!("{wrong} -o w.png --strict"));
    assert!(ran.code == Some(3) && unusable(ran.message()), "{:?} {}", ran.code, ran.stderr);
}

#[test]
fn every_command_that_judges_its_result_says_so_last() {
    let f = Folder::spheres();
    let last = |command: &str| f.run(command).succeeds().stdout.lines().last().unwrap_or_default().to_owned();
    let is_verdict = |line: &str| {
        line == "good" || line.starts_with("look at the result: ") || line.starts_with("not usable, because ")
    };
    let line = last("anchors s.obj t.obj --anchors a.json -o more.json --strict");
    assert!(is_verdict(&line), "{line}");
    // Spheres have no limbs that would tell their sides apart.
    f.run("anchors s.obj t.obj -o none.json --strict").fails(3, &["--anchors"]);
}

#[test]
fn textures_of_materials_are_inputs_that_stay() {
    let f = Folder::spheres();
    std::fs::copy(f.path("s.png"), f.path("base_color.png")).unwrap();
    f.write("m.mtl", "newmtl a\nmap_Kd base_color.png\n");
    f.write("m.obj", &format!("mtllib m.mtl\nusemtl a\n{}", f.read("s.obj")));
    let before = f.bytes("base_color.png");
    let transfer = "transfer --source m.obj --target t.obj --anchors a.json --backend cpu --size 32";
    for command in [
        format!("{transfer} -o base_color.png"),
        format!("{transfer} -o <ROLE>.png"),
        "render m.obj --size 16 -o base_color.png".to_owned(),
    ] {
        f.run(&command).fails(2, &["is a file that is read", "--overwrite"]);
    }
    assert!(f.bytes("base_color.png") == before);
    // A library that cannot be read is passed over: here the mesh has no texture then.
    let library = f.read("m.mtl");
    let ran = f.run(&format!("{transfer} -o o.png --report m.mtl"));
    assert_eq!((ran.code, f.read("m.mtl"), f.path("o.png").exists()), (Some(2), library, false), "{}", ran.stderr);
    let ran = f.run(&format!("{transfer} -o <ROLE>.png --overwrite")).succeeds();
    assert!(ran.stdout.contains("base_color.png: 32 x 32") && f.bytes("base_color.png") != before, "{}", ran.stdout);
}

#[test]
#[cfg(unix)]
fn streams_are_called_as_they_were_given() {
    let f = Folder::spheres();
    let ran = f.shell("barymap render s.obj --size 16 -o - > p.png").succeeds();
    assert_eq!((ran.stderr.as_str(), f.image("p.png").width), ("-: 16 x 16\n", 16));
    let ran = f.shell("cat s.obj | barymap render -.obj --size 16 -o -.jpg > p.jpg").succeeds();
    assert_eq!((ran.stderr.as_str(), f.bytes("p.jpg")[..2].to_vec()), ("-.jpg: 16 x 16\n", vec![0xff, 0xd8]));
    let ran = f.shell("echo nothing | barymap render - -o p.png");
    assert!(ran.message().starts_with("barymap: -: ") && ran.code == Some(1), "{}", ran.stderr);
    f.run("deform s.obj --handles a.json -o -.obj").fails(2, &["option -o", "-.ply"]);
}

#[test]
fn sizes_that_cannot_be_are_refused_before_a_map_is_made() {
    let f = Folder::spheres();
    let transfer = "transfer --source s.obj --target t.obj --texture s.png --anchors a.json -o o.png --report r.json";
    f.run(&format!("{transfer} --size 0")).fails(2, &["--size"]);
    f.run(&format!("{transfer} --size 4000000")).fails(2, &["--size"]);
    let ran = f.run(&format!("{transfer} --size 16384 --memory 200M --no-cache"));
    ran.fails(1, &["16384 x 16384", "--memory"]);
}

#[test]
fn attributes_name_every_file() {
    let f = Folder::spheres();
    let row: String =
        (0..barymap::io::read_mesh(f.path("s.obj")).unwrap().mesh.vertex_count()).map(|v| format!("{v}\n")).collect();
    f.write("one.csv", &format!("a\n{row}"));
    f.write("two.csv", &format!("b\n{row}"));
    let ran =
        f.run("attributes --source s.obj --target t.obj --anchors a.json --attributes one.csv two.csv -o x.csv y.csv");
    let ran = ran.succeeds();
    assert!(ran.stdout.contains("x.csv, y.csv: "), "{}", ran.stdout);
}

#[test]
fn handles_and_regions_are_places() {
    let f = Folder::spheres();
    let mesh = barymap::io::read_mesh(f.path("s.obj")).unwrap().mesh;
    let handle = |v: usize, to: f64| {
        let p = mesh.positions[v];
        (p, [p.x + to, p.y, p.z])
    };
    let vertices = [0, 100, 150, 200, 250, 300];
    let entry = |place: String, to: [f64; 3]| format!(r#"{{{place}, "position": {to:?}}}"#);
    let all = |by: &dyn Fn(usize) -> String| -> String {
        let list: Vec<String> = vertices.iter().map(|&v| entry(by(v), handle(v, 0.1).1)).collect();
        format!(r#"{{"handles": [{}]}}"#, list.join(","))
    };
    f.write("v.json", &all(&|v| format!(r#""vertex": {v}"#)));
    f.write("p.json", &all(&|v| format!(r#""at": {:?}"#, handle(v, 0.0).0.to_array())));
    f.run("deform s.obj --handles v.json -o v.ply").succeeds();
    f.run("deform s.obj --handles p.json -o p.ply").succeeds();
    assert_eq!(f.bytes("v.ply"), f.bytes("p.ply"));
    f.write("far.json", r#"{"handles": [{"at": [1000, 0, 0], "position": [0, 0, 0]}]}"#);
    f.run("deform s.obj --handles far.json -o x.ply").fails(1, &["far.json", "handle 0"]);
}

#[test]
fn proposed_places_have_positions() {
    let f = Folder::spheres();
    f.write("one.json", r#"{"anchors": [0, 100, 200]}"#);
    let ran = f.run("check s.obj --anchors one.json --report r.json").succeeds();
    let report = f.json("r.json");
    let (vertex, at) = (&report["proposals"][0], &report["positions"][0]);
    let line = format!("  {vertex} at ({:.4}, ", at[0].as_f64().unwrap());
    assert!(ran.stdout.contains(&line), "{line}: {}", ran.stdout);
}

#[test]
fn pictures_show_polygons_and_either_side_of_pairs() {
    let f = Folder::spheres();
    f.write("quad.obj", "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3 4\n");
    f.write("two.obj", "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3\nf 1 3 4\n");
    let middle = |name: &str, options: &str| {
        f.run(&format!("render {name} --view 0,0 --size 65 {options} -o r.png")).succeeds();
        f.image("r.png").get(32, 32, 0)
    };
    // The diagonal passes through the middle.
    assert_eq!(middle("quad.obj", "--wireframe"), middle("quad.obj", ""));
    assert!(middle("two.obj", "--wireframe") < middle("two.obj", "") - 0.1);
    for (mesh, side) in [("s.obj", "source"), ("t.obj", "target")] {
        f.run(&format!("render {mesh} --anchors a.json --side {side} -o r.png")).succeeds();
    }
    f.run("render s.obj --anchors a.json -o r.png").succeeds();
}
