//! The machine: drivers, threads, interrupts, the cache.

use crate::support::Folder;

const TRANSFER: &str = "transfer --source s.obj --target t.obj --texture s.png --anchors a.json --size 64";

/// No Vulkan driver can be found.
const NO_DRIVER: [(&str, &str); 2] = [("VK_DRIVER_FILES", "/nonexistent"), ("VK_ICD_FILENAMES", "/nonexistent")];

#[test]
#[cfg(target_os = "linux")]
fn without_a_driver_the_cpu_does_the_work_and_says_so() {
    let f = Folder::spheres();
    let ran = f.run_with(&format!("{TRANSFER} -o auto.png --report r.json"), &NO_DRIVER).succeeds();
    let lines: Vec<&str> = ran.stderr.lines().filter(|l| l.contains("CPU") || l.contains("cpu")).collect();
    assert_eq!(lines.len(), 1, "one line says it: {}", ran.stderr);
    assert_eq!(f.json("r.json")["backend"]["kind"], "cpu");
    f.run(&format!("{TRANSFER} --backend cpu -o cpu.png")).succeeds();
    assert_eq!(f.bytes("auto.png"), f.bytes("cpu.png"));

    let ran = f.run_with(&format!("{TRANSFER} --backend gpu -o gpu.png"), &NO_DRIVER);
    ran.fails(1, &["adapter"]);
    assert!(!f.path("gpu.png").exists());
    let ran = f.run_with("devices", &NO_DRIVER).succeeds();
    assert!(ran.stdout.contains("no adapter") && ran.stdout.contains("in use"), "{}", ran.stdout);
    let ran = f.run(&format!("{TRANSFER} --adapter no-such-adapter --backend gpu -o gpu.png"));
    ran.fails(1, &["adapter"]);
}

#[test]
fn completions_and_manual_pages_name_every_command() {
    let f = Folder::empty();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let ran = f.run(&format!("completions {shell}")).succeeds();
        assert!(["transfer", "warp", "deform", "anchors"].iter().all(|w| ran.stdout.contains(w)), "{shell}");
    }
    assert_eq!(f.run("completions cmd.exe").code, Some(2));
    f.run("man --out pages").succeeds();
    let help = f.run("--help").succeeds().stdout;
    let commands: Vec<&str> = help
        .lines()
        .skip_while(|l| !l.starts_with("Commands:"))
        .skip(1)
        .take_while(|l| !l.is_empty())
        .filter(|l| l.starts_with("  ") && !l.starts_with("   "))
        .filter_map(|l| l.split_whitespace().next())
        .filter(|c| *c != "help")
        .collect();
    assert!(commands.len() > 20, "{help}");
    for command in commands {
        let page = f.read(&format!("pages/barymap-{command}.1"));
        assert!(page.contains("SYNOPSIS"), "{command}");
    }
    assert!(f.read("pages/barymap.1").contains("transfer"));
}

#[test]
fn the_same_input_gives_the_same_bytes_for_any_number_of_threads() {
    let f = Folder::spheres();
    let outputs = |run: &str, threads: &str| {
        f.run_with(
            &format!("{TRANSFER} --backend cpu --no-cache -o {run}.png --coverage {run}c.png --model {run}.glb"),
            &[("RAYON_NUM_THREADS", threads)],
        )
        .succeeds();
        f.run_with(&format!("embed t.obj --backend cpu --no-cache -o {run}.npy"), &[("RAYON_NUM_THREADS", threads)])
            .succeeds();
        [format!("{run}.png"), format!("{run}c.png"), format!("{run}.glb"), format!("{run}.npy")].map(|n| f.bytes(&n))
    };
    let one = outputs("one", "1");
    assert!(one == outputs("two", "2"), "two threads differ from one");
    assert!(one == outputs("again", "3"), "three threads differ from one");
}

#[test]
fn a_damaged_cache_is_rebuilt() {
    let f = Folder::spheres();
    let cache = f.path("cache");
    let environment = [("BARYMAP_CACHE", cache.to_str().unwrap())];
    f.run_with("embed s.obj --backend cpu -o a.npy", &environment).succeeds();
    let entries: Vec<_> = std::fs::read_dir(&cache).unwrap().map(|e| e.unwrap().path()).collect();
    assert_eq!(entries.len(), 1, "{entries:?}");
    let whole = std::fs::read(&entries[0]).unwrap();
    let mut flipped = whole.clone();
    flipped[whole.len() / 2] ^= 0x40;
    for damaged in [Vec::new(), whole[..whole.len() / 2].to_vec(), flipped] {
        std::fs::write(&entries[0], damaged).unwrap();
        f.run_with("embed s.obj --backend cpu -o b.npy", &environment).succeeds();
        assert_eq!(f.bytes("a.npy"), f.bytes("b.npy"));
        assert_eq!(std::fs::read(&entries[0]).unwrap(), whole, "the entry is whole again");
    }
    // A cache that cannot be written is no reason to fail.
    f.write("file", "");
    let unusable = [("BARYMAP_CACHE", "file")];
    f.run_with("embed s.obj --backend cpu -o c.npy", &unusable).succeeds();
    assert_eq!(f.bytes("a.npy"), f.bytes("c.npy"));
}

#[test]
fn quiet_says_nothing() {
    let f = Folder::spheres();
    let ran = f.run(&format!("{TRANSFER} --backend cpu --quiet -o o.png")).succeeds();
    assert_eq!((ran.stdout.as_str(), ran.stderr.as_str()), ("", ""));
}

#[test]
#[cfg(unix)]
fn an_interrupt_leaves_no_temporary_file() {
    use std::process::Command;
    use std::time::Duration;
    let f = Folder::spheres();
    let before = f.names();
    let mut interrupted = 0;
    // At several moments: during the work, and while something large is written.
    for (delay, signal, code) in [(60, "INT", 130), (150, "TERM", 143), (400, "INT", 130), (800, "QUIT", 131)] {
        let mut command = f.command();
        command.args(TRANSFER.split_whitespace().filter(|w| *w != "--size" && *w != "64"));
        command.args("--backend cpu --quiet --size 3000 -o o.png --coverage c.png --model m.glb".split_whitespace());
        let mut child = command.spawn().unwrap();
        std::thread::sleep(Duration::from_millis(delay));
        let sent = Command::new("kill").args([format!("-{signal}"), child.id().to_string()]).status().unwrap();
        let status = child.wait().unwrap();
        if sent.success() && status.code() == Some(code) {
            interrupted += 1;
        }
        let outputs = ["o.png", "c.png", "m.glb"];
        let left: Vec<_> =
            f.names().into_iter().filter(|n| !before.contains(n) && !outputs.contains(&n.as_str())).collect();
        assert!(left.is_empty(), "{left:?} after {delay} ms");
        for output in outputs.iter().filter(|o| f.path(o).exists()) {
            match output.ends_with("png") {
                true => drop(f.image(output)),
                false => drop(barymap::io::read_mesh(f.path(output)).unwrap()),
            }
            std::fs::remove_file(f.path(output)).unwrap();
        }
    }
    assert!(interrupted > 0, "every run was over before its interrupt");
}

#[test]
fn nobody_listening_ends_nothing() {
    let f = Folder::spheres();
    for (words, made) in
        [("devices --report d.json", "d.json"), ("embed s.obj --backend cpu --no-cache -o e.npy", "e.npy")]
    {
        assert_eq!(unheard(&f, words), Some(0), "{words}");
        assert!(f.path(made).exists(), "the work is done all the same");
    }
    // An error keeps its code, whoever reads it.
    assert_eq!(unheard(&f, "embed no.obj -o e.npy"), Some(1));
}

/// The exit code of a run whose output goes to a closed pipe.
fn unheard(f: &Folder, words: &str) -> Option<i32> {
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let mut command = f.command();
    command.args(words.split_whitespace()).stdout(writer.try_clone().unwrap()).stderr(writer);
    command.status().unwrap().code()
}

#[test]
#[cfg(target_os = "linux")]
fn little_room_gives_an_error_or_one_thread() {
    let f = Folder::spheres();
    // Addresses: whatever there is, no panic and no abort.
    for kilobytes in [400_000, 1_000_000, 1_500_000, 3_000_000] {
        let ran = f.shell(&format!("ulimit -v {kilobytes}; barymap {TRANSFER} -o v.png"));
        let room = kilobytes > 1_200_000;
        assert_eq!(ran.code, Some(if room { 0 } else { 1 }), "{kilobytes}: {}", ran.stderr);
        assert!(room || ran.message().contains("ulimit -v"), "{}", ran.stderr);
        assert!(!ran.stderr.contains("panicked"), "{}", ran.stderr);
    }
    f.shell("ulimit -v 400000; barymap --help && barymap transfer --help").succeeds();
}

/// What a shell runs as somebody for whom limits of processes hold, which is anybody but the
/// superuser: `barymap` in a folder that everybody may write to.
#[cfg(target_os = "linux")]
fn as_plain_user(f: &Folder, commands: &str) -> crate::support::Ran {
    use std::os::unix::fs::{MetadataExt, PermissionsExt};
    let open = |path: std::path::PathBuf| {
        std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o777)).unwrap();
    };
    let program = f.path("barymap");
    if !program.exists() {
        std::fs::copy(env!("CARGO_BIN_EXE_barymap"), &program).unwrap();
        open(program);
        open(f.path("."));
    }
    let superuser = std::fs::metadata("/proc/self").unwrap().uid() == 0;
    // A number that nobody has, so that no other process counts.
    let user = if superuser { "setpriv --reuid=64321 --regid=64321 --clear-groups " } else { "" };
    f.shell(&format!("{user}bash -c 'export BARYMAP_CACHE=$PWD/own; {commands}'"))
}

#[test]
#[cfg(target_os = "linux")]
fn without_further_threads_one_does_the_work() {
    let f = Folder::spheres();
    f.run(&format!("{TRANSFER} --backend cpu --no-cache -o many.png")).succeeds();
    let job = format!("./barymap {TRANSFER} --no-cache");
    let ran = as_plain_user(&f, &format!("ulimit -u 1; exec {job} -o one.png"));
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    assert!(!ran.stderr.contains("panicked"), "{}", ran.stderr);
    assert_eq!(f.bytes("one.png"), f.bytes("many.png"));
    // The limit held: a process more is refused.
    let ran = as_plain_user(&f, "ulimit -u 1; ./barymap --version; echo no");
    assert!(ran.code != Some(0) || !ran.stdout.contains("barymap"), "{ran:?}");
    // Few addresses at the same time.
    let ran = as_plain_user(&f, &format!("ulimit -u 1; ulimit -v 400000; exec {job} -o v.png"));
    ran.fails(1, &["ulimit -v"]);
    for command in ["warp s.png --cage cage.json -o w.png", "devices", "render s.obj -o r.png --size 64"] {
        f.write("cage.json", r#"{"source": [[0, 0], [9, 0], [9, 9]], "target": [[0, 0], [8, 0], [9, 9]]}"#);
        let ran = as_plain_user(&f, &format!("ulimit -u 1; exec ./barymap {command}"));
        assert!(matches!(ran.code, Some(0 | 1)) && !ran.stderr.contains("panicked"), "{command}: {ran:?}");
    }
}

#[test]
fn a_thousand_threads_are_bounded() {
    let f = Folder::spheres();
    f.run(&format!("{TRANSFER} --backend cpu --no-cache --threads 1 -o one.png")).succeeds();
    let ran = f.run(&format!("{TRANSFER} --backend cpu --no-cache --threads 1000 -o many.png")).succeeds();
    assert!(ran.stderr.contains("instead of 1000"), "{}", ran.stderr);
    assert_eq!(f.bytes("one.png"), f.bytes("many.png"));
    let ran = f.run_with(&format!("{TRANSFER} --backend cpu -o many.png"), &[("RAYON_NUM_THREADS", "1000")]).succeeds();
    assert!(ran.stderr.contains("instead of 1000"), "{}", ran.stderr);
}

#[test]
#[cfg(target_os = "linux")]
fn what_a_killed_run_left_goes_with_the_next() {
    let f = Folder::spheres();
    // No process has this number.
    f.write(".o.png.4194305-0.partial", "half of a picture");
    std::fs::create_dir(f.path(".frames.4194305-1.partial")).unwrap();
    f.write(".own.partial", "somebody's");
    f.run("render s.obj --size 32 -o o.png").succeeds();
    let left: Vec<String> = f.names().into_iter().filter(|n| n.ends_with(".partial")).collect();
    assert_eq!(left, [".own.partial"]);
}

#[test]
fn confined_commands_read_beside_and_below() {
    let f = Folder::empty();
    std::fs::create_dir_all(f.path("in/below")).unwrap();
    f.write("away.mtl", "newmtl a\nKd 1 0 0\n");
    f.write("in/below/near.mtl", "newmtl b\nKd 0 1 0\n");
    f.write("in/m.obj", "mtllib ../away.mtl\nmtllib below/near.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n");
    let ran = f.run("render in/m.obj --size 32 -o o.png").succeeds();
    assert!(!ran.stderr.contains("away.mtl"), "{}", ran.stderr);
    let ran = f.run("render in/m.obj --size 32 -o o.png --confine").succeeds();
    assert!(ran.stderr.contains("../away.mtl lies outside") && !ran.stderr.contains("near.mtl"), "{}", ran.stderr);
    f.write("in/g.gltf", r#"{"asset": {"version": "2.0"}, "buffers": [{"uri": "../away.mtl", "byteLength": 8}]}"#);
    f.run("render in/g.gltf -o o.png --confine").fails(1, &["away.mtl", "outside", "--confine"]);
}

#[test]
fn what_cannot_fit_is_refused_with_the_number() {
    let f = Folder::spheres();
    // A field through as many pairs is a dense system.
    f.anchors("many.json", 3000, |p| p);
    for method in ["field", "rbf"] {
        let ran = f.run(&format!(
            "map --source s.obj --target t.obj --anchors many.json --method {method} --memory 100M -o m.csv"
        ));
        ran.fails(1, &["3000 pairs", "bytes", "--memory"]);
    }
    f.write(
        "cage.json",
        r#"{"source": [[0, 0], [128, 0], [128, 128], [0, 128]], "target": [[0, 0], [100, 0], [128, 128], [0, 128]]}"#,
    );
    let ran = f.run("warp s.png --cage cage.json --partition uniform:1000000 -o w.png");
    ran.fails(2, &["--partition", "1000000 steps", "at most 10000"]);
    let circle = |radius: f64| -> Vec<[f64; 2]> {
        let corner = |k: usize| f64::sin_cos(k as f64 * std::f64::consts::TAU / 8000.0);
        (0..8000).map(corner).map(|(s, c)| [64.0 + radius * c, 64.0 + radius * s]).collect()
    };
    f.write("circle.json", &serde_json::json!({"source": circle(60.0), "target": circle(50.0)}).to_string());
    let ran = f.run("warp s.png --cage circle.json --partition uniform:2000 --memory 512M -o w.png");
    ran.fails(1, &["2000 steps of 8000 vertices", "bytes", "--memory"]);
    f.run("warp s.png --cage cage.json --partition uniform:10 -o w.png").succeeds();
    f.run("morph s.obj s.obj --frames 100000 -o frames").fails(2, &["--frames", "10000"]);
    f.run("morph s.obj s.obj --frames 10000 --memory 10M -o m.glb").fails(1, &["10000 frames", "bytes"]);
}

#[test]
fn a_primitive_that_is_repeated_is_counted_before_it_is_read() {
    let f = Folder::empty();
    // 1000 vertices, shown by 100,000 primitives.
    let positions: Vec<u8> = (0..3000).flat_map(|k| ((k * k % 97) as f32).to_le_bytes()).collect();
    std::fs::write(f.path("p.bin"), &positions).unwrap();
    let primitives = vec![r#"{"attributes": {"POSITION": 0}}"#; 100_000].join(",");
    f.write(
        "g.gltf",
        &format!(
            r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0]}}], "nodes": [{{"mesh": 0}}],
            "meshes": [{{"primitives": [{primitives}]}}], "buffers": [{{"uri": "p.bin", "byteLength": {}}}],
            "bufferViews": [{{"buffer": 0, "byteLength": {}}}],
            "accessors": [{{"bufferView": 0, "componentType": 5126, "count": 1000, "type": "VEC3", "min": [0, 0, 0], "max": [96, 96, 96]}}]}}"#,
            positions.len(),
            positions.len()
        ),
    );
    let ran = f.run("render g.gltf --memory 250M -o r.png").fails(1, &["g.gltf", "repeat", "bytes", "--memory"]);
    // The file, its text as a tree, and the program.
    assert!(ran.peak_memory.is_none_or(|bytes| bytes < 300 << 20), "{:?}", ran.peak_memory);
}
