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
