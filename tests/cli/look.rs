//! What photographers ask of `warp`: previews, parts, soft borders, perspective, animations.

use crate::support::{Folder, waves};

const WARP: &str = "warp s.png --backend cpu --cage c.json";

/// A picture and a cage whose one corner moves in.
fn pictured() -> Folder {
    let f = Folder::empty();
    barymap::io::write_image(&waves(64), f.path("s.png")).unwrap();
    f.write(
        "c.json",
        r#"{"source": [[0, 0], [64, 0], [64, 64], [0, 64]], "target": [[0, 0], [64, 0], [45, 45], [0, 64]]}"#,
    );
    f
}

#[test]
fn previews_and_parts_show_what_the_whole_does() {
    let f = pictured();
    f.run(&format!("{WARP} -o whole.png")).succeeds();
    f.run(&format!("{WARP} --scale 0.25 -o small.png")).succeeds();
    f.run(&format!("{WARP} --crop 10,20,30,25 -o part.png")).succeeds();
    let (whole, small, part) = (f.image("whole.png"), f.image("small.png"), f.image("part.png"));
    assert_eq!((small.width, small.height), (whole.width / 4, whole.height / 4));
    assert_eq!((part.width, part.height), (30, 25));
    for (x, y) in [(0, 0), (29, 24), (12, 7)] {
        for c in 0..3 {
            assert!((part.get(x, y, c) - whole.get(x + 10, y + 20, c)).abs() <= 1.01 / 255.0, "{x} {y}");
        }
    }
    // A pixel of the preview is about the mean of its sixteen.
    let mean = |x: u32, y: u32| (0..16).map(|k| whole.get(4 * x + k % 4, 4 * y + k / 4, 1)).sum::<f32>() / 16.0;
    assert!((small.get(5, 6, 1) - mean(5, 6)).abs() < 0.05);
    f.run(&format!("{WARP} --crop 60,0,30,10 -o x.png")).fails(2, &["--crop", "beyond"]);
    for wrong in ["--scale 0", "--scale 2", "--crop 1,2,3", "--feather -1"] {
        assert_eq!(f.run(&format!("{WARP} {wrong} -o x.png")).code, Some(2), "{wrong}");
    }
}

#[test]
fn borders_fade_into_what_is_below() {
    let f = pictured();
    f.run(&format!("{WARP} --feather 8 -o x.png")).fails(2, &["--feather", "--outside"]);
    f.run(&format!("{WARP} --outside transparent -o hard.png")).succeeds();
    f.run(&format!("{WARP} --outside transparent --feather 8 -o soft.png")).succeeds();
    let (hard, soft) = (f.image("hard.png"), f.image("soft.png"));
    // The left side of the square stays where it is.
    assert!(hard.get(1, 20, 3) == 1.0 && soft.get(1, 20, 3) < 0.2 && soft.get(4, 20, 3) > soft.get(1, 20, 3));
    assert_eq!(soft.get(24, 24, 3), 1.0);
    f.run(&format!("{WARP} --outside keep --feather 8 -o kept.png")).succeeds();
    let (kept, original) = (f.image("kept.png"), f.image("s.png"));
    assert!((0..3).all(|c| (kept.get(63, 63, c) - original.get(63, 63, c)).abs() < 0.02));
}

#[test]
fn four_corners_in_perspective() {
    let f = pictured();
    f.run("warp s.png --cage c.json --projective -o p.png --heatmap h.png --report r.json").succeeds();
    assert_eq!(f.json("r.json")["projective"], true);
    let (p, s) = (f.image("p.png"), f.image("s.png"));
    assert_eq!((p.width, p.height), (s.width, s.height));
    assert_eq!(f.run("warp s.png --cage c.json --projective --frames 3 -o p.png").code, Some(2));
    f.write("five.json", r#"{"source": [[0,0],[9,0],[9,9],[5,9],[0,9]], "target": [[0,0],[9,0],[9,9],[5,9],[0,9]]}"#);
    f.run("warp s.png --cage five.json --projective -o x.png").fails(1, &["five.json", "four corners"]);
    f.write("dent.json", r#"{"source": [[0,0],[9,0],[9,9],[0,9]], "target": [[0,0],[9,0],[2,2],[0,9]]}"#);
    f.run("warp s.png --cage dent.json --projective -o x.png").fails(1, &["convex"]);
}

#[test]
fn animations_are_one_file() {
    let f = pictured();
    for name in ["a.gif", "a.apng"] {
        let ran = f.run(&format!("{WARP} --frames 4 --rate 10 -o {name}")).succeeds();
        assert!(ran.stdout.contains(&format!("{name} (4 frames)")), "{}", ran.stdout);
    }
    let names = f.names();
    assert!(!names.iter().any(|n| n.contains("_0000")), "{names:?}");
    f.run(&format!("{WARP} --frames 2 -o s2.png")).succeeds();
    assert!(f.names().contains("s2_0000.png") && f.names().contains("s2_0001.png"));
    f.run(&format!("{WARP} --frames 4 -o a.webp")).fails(2, &["ffmpeg", "a_%04d.png", "a.webp"]);
    f.run(&format!("{WARP} --frames 4 --range 0..2 -o b.gif")).fails(2, &["--range", ".png"]);
    assert_eq!(f.run(&format!("{WARP} -o b.gif")).code, Some(2));
}

#[test]
fn drawn_cages_give_what_written_ones_do() {
    let f = pictured();
    f.run(&format!("{WARP} -o json.png")).succeeds();
    f.write(
        "c.svg",
        r#"<svg xmlns="http://www.w3.org/2000/svg"><path id="source" d="M0 0H64V64H0Z"/><path id="target" d="M0 0H64L45 45 0 64Z"/></svg>"#,
    );
    f.run("warp s.png --cage c.svg -o svg.png").succeeds();
    assert_eq!(f.bytes("json.png"), f.bytes("svg.png"));
}

#[test]
fn a_new_folder_of_an_output_is_made() {
    let f = pictured();
    f.run(&format!("{WARP} -o new/w.png")).succeeds();
    assert!(f.path("new/w.png").is_file());
    f.run(&format!("{WARP} -o a/new/one/w.png")).succeeds();
    assert!(f.path("a/new/one/w.png").is_file());
    // One that nothing was written to goes.
    f.run("warp nothing.png --cage c.json -o b/new/w.png").fails(1, &["nothing.png"]);
    assert!(!f.path("b").exists());
    f.write("file", "");
    f.run(&format!("{WARP} -o file/w.png")).fails(1, &["file"]);
}
