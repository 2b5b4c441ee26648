//! `barymap batch`.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use barymap::io::write_image;
use serde_json::Value;

use crate::support::{Folder, stretched, waves};

const BATCH: &str = "batch --backend cpu --source s.obj --texture s.png --targets in --method rbf --size 48 --margin 2";

/// A folder with a source and, in `in`, spheres of different connectivity with their anchors.
fn targets(names: &[&str]) -> Folder {
    let f = Folder::spheres();
    fs::create_dir(f.path("in")).unwrap();
    for (k, name) in names.iter().enumerate() {
        barymap::io::write_obj(&stretched(12 + 2 * k, 10 + k), f.path(&format!("in/{name}.obj"))).unwrap();
        f.anchors(&format!("in/{name}.json"), 12, |p| p);
    }
    f
}

/// Every file below a folder with its content.
fn tree(path: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut all = BTreeMap::new();
    let mut open = vec![path.to_path_buf()];
    while let Some(folder) = open.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let file = entry.unwrap().path();
            if file.is_dir() {
                open.push(file);
            } else {
                let name = file.strip_prefix(path).unwrap().to_string_lossy().into_owned();
                all.insert(name, fs::read(file).unwrap());
            }
        }
    }
    all
}

/// The status of each item in a report.
fn statuses(report: &Value) -> Vec<(String, String)> {
    let text = |v: &Value| v.as_str().unwrap().to_owned();
    report["items"].as_array().unwrap().iter().map(|i| (text(&i["name"]), text(&i["status"]))).collect()
}

fn status(report: &Value, name: &str) -> String {
    statuses(report).into_iter().find(|s| s.0 == name).unwrap_or_else(|| panic!("{name} is not in {report}")).1
}

#[test]
fn each_target_gets_what_a_transfer_gives() {
    let f = targets(&["a", "b"]);
    let ran = f.run(&format!("{BATCH} -o out --coverage c.png --model m.glb --report r.json")).succeeds();
    assert!(ran.stdout.contains("2 done, 0 skipped, 0 failed"), "{}", ran.stdout);
    let names: Vec<String> = tree(&f.path("out")).into_keys().collect();
    let files = ["c.png", "item.json", "m.glb", "s.png"];
    let wanted: Vec<String> = ["a", "b"].iter().flat_map(|n| files.map(|f| format!("{n}/{f}"))).collect();
    assert_eq!(names, wanted);
    let one = BATCH.replace("batch", "transfer").replace("--targets in", "--target in/b.obj --anchors in/b.json");
    f.run(&format!("{one} -o o.png --coverage c.png")).succeeds();
    assert_eq!(f.bytes("out/b/s.png"), f.bytes("o.png"));
    assert_eq!(f.bytes("out/b/c.png"), f.bytes("c.png"));
    let report = f.json("r.json");
    assert_eq!(report["done"], 2);
    assert!(report["items"][1]["report"]["valid_fraction"].as_f64().unwrap() > 0.9, "{report}");
    assert_eq!(f.json("out/a/item.json")["report"]["method"], "rbf");
    // The last line says in plain words what the results are worth, as a transfer does of its own.
    let words: Vec<&Value> =
        report["items"].as_array().unwrap().iter().map(|i| &i["report"]["verdict"]["word"]).collect();
    let count = |word: &str| words.iter().filter(|w| **w == word).count();
    let told = format!("{} good, {} to look at, {} not usable", count("good"), count("look"), count("not usable"));
    assert_eq!(ran.stdout.lines().last(), Some(told.as_str()), "{}", ran.stdout);
    assert_eq!((count("good") + count("look") + count("not usable"), &report["verdict"]), (2, &Value::from(told)));
}

#[test]
fn what_is_not_usable_is_named_with_its_reason() {
    let f = targets(&["a", "b"]);
    f.wrong_anchors("in/b.json", 40);
    let ran = f.run(&format!("{BATCH} -o out --report r.json")).succeeds();
    let verdict = f.json("r.json")["items"][1]["report"]["verdict"].clone();
    assert_eq!(verdict["word"], "not usable", "{verdict}");
    let line = ran.stdout.lines().find(|l| l.starts_with("b: ")).unwrap_or_else(|| panic!("{}", ran.stdout));
    assert!(line.contains(verdict["because"][0].as_str().unwrap()), "{line}");
    // What is there already is judged as when it was made.
    let again = f.run(&format!("{BATCH} -o out")).succeeds();
    assert!(again.stdout.contains("2 skipped") && again.stdout.contains(line), "{}", again.stdout);
    f.run(&format!("{BATCH} -o out --strict")).fails(4, &["1 of 2 results are not usable: b", "Add pairs"]);
    f.wrong_anchors("in/a.json", 40);
    f.run(&format!("{BATCH} -o out --strict")).fails(3, &["2 of 2 results are not usable: a, b"]);
    f.write("in/a.obj", "v 0 0 0\n");
    let ran = f.run(&format!("{BATCH} -o out --strict"));
    ran.fails_like(3, &["1 of 2 targets failed: a; 1 of 2 results are not usable: b"]);
}

#[test]
fn shards_together_are_the_whole() {
    let f = targets(&["a", "b", "c", "d", "e"]);
    f.run(&format!("{BATCH} -o whole")).succeeds();
    for i in 1..=3 {
        f.run(&format!("{BATCH} -o parts --shard {i}/3 --report r{i}.json")).succeeds();
    }
    assert_eq!(tree(&f.path("whole")), tree(&f.path("parts")));
    let shares: Vec<usize> = (1..=3).map(|i| statuses(&f.json(&format!("r{i}.json"))).len()).collect();
    assert_eq!(shares, [2, 2, 1]);
    // The comparison sees a single changed byte.
    let mut bytes = f.bytes("parts/c/s.png");
    *bytes.last_mut().unwrap() ^= 1;
    fs::write(f.path("parts/c/s.png"), bytes).unwrap();
    assert_ne!(tree(&f.path("whole")), tree(&f.path("parts")));
    // More shards than targets: some have nothing to do.
    f.run(&format!("{BATCH} -o parts --shard 9/9")).succeeds();
    for wrong in ["0/3", "4/3", "x"] {
        let ran = f.run(&format!("{BATCH} -o parts --shard {wrong}"));
        assert!(ran.code == Some(2) && ran.stderr.contains("--shard"), "{ran:?}");
    }
}

#[test]
fn what_is_done_is_not_made_again_and_what_changed_is() {
    let f = targets(&["a", "b", "c", "d"]);
    let command = format!("{BATCH} -o out --report r.json");
    f.run(&command).succeeds();
    let first = tree(&f.path("out"));
    f.run(&command).succeeds();
    assert!(statuses(&f.json("r.json")).iter().all(|s| s.1 == "skipped"));

    // A damaged picture, one that is gone, other anchors: these are made anew, and only these.
    fs::write(f.path("out/a/s.png"), "cut off").unwrap();
    fs::remove_file(f.path("out/b/s.png")).unwrap();
    f.anchors("in/c.json", 14, |p| p);
    f.run(&command).succeeds();
    let report = f.json("r.json");
    let all: Vec<String> = ["a", "b", "c", "d"].iter().map(|n| status(&report, n)).collect();
    assert_eq!(all, ["done", "done", "done", "skipped"]);
    let second = tree(&f.path("out"));
    for (name, bytes) in &first {
        assert_eq!(second[name] == *bytes, !name.starts_with("c/"), "{name}");
    }

    // Other options or another texture: everything.
    f.run(&command.replace("--margin 2", "--margin 3")).succeeds();
    assert_eq!(f.json("r.json")["done"], 4);
    barymap::io::write_image(&waves(64), f.path("s.png")).unwrap();
    f.run(&command.replace("--margin 2", "--margin 3")).succeeds();
    assert_eq!(f.json("r.json")["done"], 4);
}

#[test]
fn one_bad_item_does_not_stop_the_others() {
    let f = targets(&["a", "b", "c", "d", "e", "f"]);
    f.write("in/a.obj", "v 0 0 0\nv 1 0 0\n");
    f.write("in/b.json", "{\"source\": [0], \"target\": [99999999]}");
    fs::remove_file(f.path("in/c.json")).unwrap();
    let plain: String = f.read("in/d.obj").lines().filter(|l| !l.starts_with("vt")).map(no_texcoords).collect();
    f.write("in/d.obj", &plain);
    fs::create_dir_all(f.path("out/e")).unwrap();
    f.write("out/e/mine.txt", "not a result");
    let ran = f.run(&format!("{BATCH} -o out --report r.json")).fails(4, &["5 of 6 targets failed", "a, b, c, d, e"]);
    let report = f.json("r.json");
    assert_eq!((report["failed"].as_u64(), report["done"].as_u64()), (Some(5), Some(1)));
    for (name, part) in
        [("a", "a.obj"), ("b", "99999999"), ("c", "c.json"), ("d", "texture coordinates"), ("e", "something else")]
    {
        let item = report["items"].as_array().unwrap().iter().find(|i| i["name"] == name).unwrap();
        assert_eq!(item["status"], "failed");
        assert!(item["error"].as_str().unwrap().contains(part), "{item}");
        assert!(ran.stderr.contains(part), "{}", ran.stderr);
    }
    let left: Vec<String> = tree(&f.path("out")).into_keys().collect();
    assert_eq!(left, ["e/mine.txt", "f/item.json", "f/s.png"], "nothing half-made is left");
    assert_eq!(f.read("out/e/mine.txt"), "not a result");
    // The table tells of all of them.
    assert!(ran.stdout.contains("1 done, 0 skipped, 5 failed"), "{}", ran.stdout);
}

fn no_texcoords(line: &str) -> String {
    let words = line.split(' ').map(|w| w.split('/').next().unwrap());
    words.collect::<Vec<_>>().join(" ") + "\n"
}

#[test]
fn lists_name_their_items() {
    let f = targets(&["a", "b"]);
    f.write("in/l.csv", "name,target,anchors\nfirst,a.obj,a.json\nsecond,b.obj,b.json\n");
    f.run(&format!("{} -o out", BATCH.replace("--targets in", "--targets in/l.csv"))).succeeds();
    assert!(f.path("out/first/s.png").is_file() && f.path("out/second/s.png").is_file());
    for (targets, part) in [("nowhere", "nowhere"), ("s.png", "s.png"), ("empty", "no target")] {
        fs::create_dir_all(f.path("empty")).unwrap();
        f.run(&format!("{} -o other", BATCH.replace("--targets in", &format!("--targets {targets}"))))
            .fails(1, &[part]);
    }
    assert!(!f.path("other").exists());
    for names in ["--coverage item.json", "--coverage s.png", "--model x/m.glb", "--coverage c.png --model c.png"] {
        f.run(&format!("{BATCH} -o other {names}")).fails(2, &["folder of each result"]);
    }
}

#[test]
fn files_may_be_named_in_several_ways() {
    let f = targets(&["a"]);
    f.run(&format!("{BATCH} -o out --report r.json")).succeeds();
    let folder = f.path("");
    let whole = |name: &str| folder.join(name).display().to_string();
    let other = BATCH
        .replace("--source s.obj", "--source ./s.obj")
        .replace("--texture s.png", &format!("--texture {}", whole("s.png")))
        .replace("--targets in", &format!("--targets {}", whole("in")));
    f.run(&format!("{other} -o ./out --report r.json")).succeeds();
    assert_eq!(status(&f.json("r.json"), "a"), "skipped");
    // Another content under the same name is another result.
    write_image(&waves(64), f.path("s.png")).unwrap();
    f.run(&format!("{other} -o ./out --report r.json")).succeeds();
    assert_eq!(status(&f.json("r.json"), "a"), "done");
}

#[test]
fn all_bad_is_nothing_usable() {
    let f = targets(&["a"]);
    f.write("in/a.json", "{}");
    f.run(&format!("{BATCH} -o out")).fails(3, &["1 of 1 targets failed: a"]);
}

/// The parent is a shell that starts the batch, is there for a second, and ends.
#[test]
#[cfg(target_os = "linux")]
fn it_ends_with_its_parent_unless_a_hang_up_is_ignored() {
    use std::time::{Duration, Instant};
    let names: Vec<String> = (10..40).map(|k| format!("t{k}")).collect();
    let f = targets(&names.iter().map(String::as_str).collect::<Vec<_>>());
    let last = names.last().unwrap();
    let start = |signals: &str, out: &str, size: u32| {
        let batch = BATCH.replace("--size 48", &format!("--size {size}"));
        f.shell(&format!("env {signals} barymap {batch} -o {out} >/dev/null 2>&1 & echo $! > pid; sleep 1")).succeeds();
        let pid = f.read("pid").trim().to_owned();
        let begun = Instant::now();
        // A process that nobody waits for may stay as an entry of the table, in state Z.
        let runs = || {
            fs::read_to_string(format!("/proc/{pid}/stat"))
                .is_ok_and(|s| s.rsplit_once(')').is_some_and(|(_, rest)| !rest.trim_start().starts_with('Z')))
        };
        while runs() {
            assert!(begun.elapsed() < Duration::from_secs(100), "it goes on");
            std::thread::sleep(Duration::from_millis(50));
        }
        f.path(out).join(last).exists()
    };
    assert!(!start("--default-signal=HUP", "alone", 1500), "it went on to the end");
    assert!(f.files("alone").iter().all(|p| p.join("item.json").exists()), "something half-made is left");
    assert!(start("--ignore-signal=HUP", "kept", 16), "it ended before its work");
}
