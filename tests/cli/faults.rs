//! Files and folders that cannot be used: a clear message, no panic, nothing half-written.

use std::path::PathBuf;

use crate::support::Folder;

const TRANSFER: &str =
    "transfer --backend cpu --source s.obj --target t.obj --texture s.png --anchors a.json --size 32";

#[test]
fn wrong_use_is_told_apart_from_wrong_data() {
    let f = Folder::spheres();
    for wrong in
        ["", "no-such-command", "transfer", "embed s.obj", "embed s.obj -o e.npy --backend fast", "map --source"]
    {
        let ran = f.run(wrong);
        assert_eq!(ran.code, Some(2), "{wrong:?}: {ran:?}");
    }
    assert_eq!(f.run("--help").code, Some(0));
    assert!(f.run("--version").succeeds().stdout.contains(env!("CARGO_PKG_VERSION")));
    f.run("embed missing.obj --backend cpu -o e.npy").fails(1, &["missing.obj"]);
    f.run("embed . --backend cpu -o e.npy").fails(1, &["."]);
    f.write("mesh.xyz", "1 2 3\n");
    f.run("embed mesh.xyz --backend cpu -o e.npy").fails(1, &["mesh.xyz"]);
}

#[test]
fn outputs_that_cannot_be_written_are_noticed_before_the_work() {
    let f = Folder::spheres();
    let before = f.names();
    std::fs::create_dir(f.path("folder.png")).unwrap();
    for output in [
        "-o s.obj/o.png",
        "-o folder.png",
        "-o o.png --coverage s.obj/c.png",
        "-o o.png --model s.obj/m.glb",
        "-o o.png --report s.obj/r.json",
        "-o o.gif",
        "-o o",
    ] {
        let ran = f.run(&format!("{TRANSFER} {output}"));
        assert!(matches!(ran.code, Some(1 | 2)), "{output}: {ran:?}");
        let last = output.split_whitespace().last().unwrap();
        assert!(ran.message().contains(last), "{output}: {}", ran.message());
        std::fs::remove_dir(f.path("folder.png")).unwrap();
        assert_eq!(f.names(), before, "{output}");
        std::fs::create_dir(f.path("folder.png")).unwrap();
    }
    f.write("file", "");
    f.run("demo --backend cpu --size 16 --out file").fails(1, &["file"]);
}

#[test]
fn textures_that_are_no_pictures() {
    let f = Folder::spheres();
    let whole = f.bytes("s.png");
    let before = f.names();
    for (what, bytes) in [
        ("empty", Vec::new()),
        ("half", whole[..whole.len() / 2].to_vec()),
        ("header only", whole[..33].to_vec()),
        ("text", b"not a picture".to_vec()),
        ("zero by zero", zero_by_zero(&whole)),
    ] {
        std::fs::write(f.path("s.png"), bytes).unwrap();
        let ran = f.run(&format!("{TRANSFER} -o o.png"));
        assert_eq!(ran.code, Some(1), "{what}: {ran:?}");
        assert!(ran.message().contains("s.png"), "{what}: {}", ran.message());
        assert_eq!(f.names(), before, "{what}");
    }
}

/// A PNG whose header claims no pixels; its checksum is wrong as well.
fn zero_by_zero(png: &[u8]) -> Vec<u8> {
    let mut png = png.to_vec();
    png[16..24].fill(0);
    png
}

#[test]
fn meshes_that_cannot_carry_a_texture() {
    let f = Folder::spheres();
    let bare: String = f.read("t.obj").lines().filter(|l| !l.starts_with("vt ")).map(without_texcoords).collect();
    f.write("bare.obj", &bare);
    let from = TRANSFER.replace("s.obj", "bare.obj");
    f.run(&format!("{from} -o o.png")).fails(1, &["bare.obj", "texture coordinates"]);
    let to = TRANSFER.replace("t.obj", "bare.obj");
    f.run(&format!("{to} -o o.png")).fails(1, &["bare.obj", "texture coordinates"]);
    for (what, text) in [
        ("nothing", ""),
        ("no faces", "v 0 0 0\nv 1 0 0\nv 0 1 0\n"),
        ("no area", "v 0 0 0\nv 0 0 0\nv 0 0 0\nvt 0 0\nf 1/1 2/1 3/1\n"),
        ("one line", "v 0 0 0\nv 1 0 0\nv 2 0 0\nvt 0 0\nf 1/1 2/1 3/1\n"),
        ("no numbers", "v 0 0 nan\nv 1 0 0\nv 2 1 0\nvt 0 0\nf 1/1 2/1 3/1\n"),
    ] {
        f.write("t.obj", text);
        let ran = f.run(&format!("{TRANSFER} -o o.png"));
        assert_eq!(ran.code, Some(1), "{what}: {ran:?}");
        ran.message();
    }
    assert!(!f.path("o.png").exists());
}

fn without_texcoords(line: &str) -> String {
    let words = line.split_whitespace().map(|w| if line.starts_with("f ") { w.split('/').next().unwrap() } else { w });
    words.collect::<Vec<_>>().join(" ") + "\n"
}

#[test]
fn huge_and_tiny_coordinates() {
    let f = Folder::spheres();
    let scaled = |factor: f64| -> String {
        let line = |l: &str| match l.strip_prefix("v ") {
            Some(p) => {
                let p: Vec<String> =
                    p.split_whitespace().map(|x| format!("{:e}", x.parse::<f64>().unwrap() * factor)).collect();
                format!("v {}\n", p.join(" "))
            }
            None => format!("{l}\n"),
        };
        f.read("t.obj").lines().map(line).collect()
    };
    f.write("x.json", r#"{"source": [0, 40, 150, 200, 361], "target": [0, 60, 200, 280, 511]}"#);
    for factor in [1e-6, 1e6, 1e-150, 1e200] {
        f.write("scaled.obj", &scaled(factor));
        let command = TRANSFER.replace("t.obj", "scaled.obj").replace("a.json", "x.json");
        let ran = f.run(&format!("{command} -o o.png"));
        let ordinary = (1e-10..1e10).contains(&factor);
        assert!(ran.code == Some(0) || (!ordinary && ran.code == Some(1)), "{factor:e}: {ran:?}");
        if ran.code == Some(1) {
            ran.message();
        }
    }
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn every_bad_file_gives_a_result_or_a_clear_message() {
    let f = Folder::spheres();
    let folder = PathBuf::from(std::env::var("BARYMAP_DATA").unwrap()).join("bad");
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    files.sort();
    assert!(files.len() >= 20, "{} bad files", files.len());
    f.write("x.json", r#"{"source": [0, 1, 2], "target": [0, 1, 2]}"#);
    let before = f.names();
    for file in files {
        let name = file.file_name().unwrap().to_str().unwrap().to_owned();
        let (commands, picture) = match name.ends_with(".png") {
            true => (vec![TRANSFER.replace("s.png", file.to_str().unwrap()) + " -o o.png"], true),
            false => {
                let transfer = TRANSFER.replace("a.json", "x.json");
                let as_source = transfer.replace("s.obj", file.to_str().unwrap()) + " -o o.png --method closest";
                let as_target = transfer.replace("t.obj", file.to_str().unwrap()) + " -o o.png";
                let embed = format!("embed {} --backend cpu --landmarks 100 -o o.npy", file.display());
                (vec![as_source, as_target, embed], false)
            }
        };
        for command in commands {
            let ran = f.run(&command);
            match ran.code {
                Some(0) => assert!(!picture, "{name} is no picture: {ran:?}"),
                Some(1) => {
                    assert!(ran.message().contains(&name) || !picture, "{name}: {}", ran.message());
                    assert_eq!(f.names(), before, "{name}: something is left behind");
                }
                _ => panic!("{command}: {ran:?}"),
            }
            for output in ["o.png", "o.npy"] {
                let _ = std::fs::remove_file(f.path(output));
            }
            assert_eq!(f.names(), before, "{name}: something is left behind");
        }
    }
}
