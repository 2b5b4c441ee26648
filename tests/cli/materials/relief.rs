//! Normal maps, normals and smoothing.

use barymap::geometry::NONE;

use super::*;

#[test]
fn a_bump_map_that_holds_normals_is_a_normal_map() {
    let f = with_materials(b"newmtl m\nmap_Kd t.png\nmap_Bump -bm 1.000000 nrm.png\n", "m");
    let normals = Image::new(4, 4, 3, Pixels::U8([210, 128, 225].repeat(16))).unwrap();
    write_image(&normals, f.path("nrm.png")).unwrap();
    let ran = transfer(&f, "source.obj", "-o out_<ROLE>.png").succeeds();
    assert!(ran.stderr.contains("normal map"), "{}", ran.stderr);
    let near =
        |image: &Image| (0..3).all(|c| (image.get(30, 30, c) * 255.0 - [210.0, 128.0, 225.0][c as usize]).abs() < 2.0);
    assert!(near(&f.image("out_normal.png")));
    assert!(!f.path("out_height.png").exists());
    // Heights stay heights.
    write_image(&Image::new(4, 4, 1, Pixels::U8((0..16).map(|k| 16 * k).collect())).unwrap(), f.path("nrm.png"))
        .unwrap();
    transfer(&f, "source.obj", "-o h_<ROLE>.png").succeeds();
    assert!(f.path("h_height.png").exists() && !f.path("h_normal.png").exists());
}

#[test]
fn normals_and_smoothing_stay_and_are_shown() {
    let f = folder();
    // Two normals a vertex: flat below, tilted above.
    let text = plane("s off\n", |v| format!("{v}/{v}/1")).replacen("s off\n", "s off\ng top\no part\n", 1);
    let split = text.find("s off").unwrap();
    let text = format!(
        "vn 0 0 1\nvn 0 0.6 0.8\ns 4\n{}{}",
        &text[..split],
        text[split..].replace("/1 ", "/2 ").replace("/1\n", "/2\n")
    );
    f.write("s.obj", &text);
    f.write(
        "h.json",
        &json!({"handles": [
            {"vertex": 0, "position": [0.0, 0.0, 0.0]}, {"vertex": 8, "position": [1.0, 0.0, 0.0]},
            {"vertex": 72, "position": [0.0, 0.0, 1.0]}, {"vertex": 80, "position": [1.0, 0.0, 1.0]},
        ]})
        .to_string(),
    );
    f.run("deform s.obj --handles h.json -o out.obj").succeeds();
    let (before, after) = (
        barymap::io::read_mesh(f.path("s.obj")).unwrap().mesh,
        barymap::io::read_mesh(f.path("out.obj")).unwrap().mesh,
    );
    assert_eq!((before.normals.len(), after.normals.len()), (2, 2));
    for p in 0..before.polygon_count() {
        assert_eq!(before.polygon(p), after.polygon(p), "corners that shared a normal share it");
        assert_eq!(before.polygon_smoothing(p), after.polygon_smoothing(p));
        let name =
            |m: &barymap::geometry::Mesh, k: u32| if k == NONE { None } else { m.groups.get(k as usize).cloned() };
        assert_eq!(name(&before, before.polygon_group(p)), name(&after, after.polygon_group(p)));
        assert_eq!(name(&before, before.polygon_object(p)), name(&after, after.polygon_object(p)));
    }
    // The plane was turned up by a quarter: so were its normals.
    assert!(after.normals[0].y < -0.8, "{:?}", after.normals);
    // A picture is shaded by the file's normals.
    f.run("render s.obj --size 64 --view 0,0 -o a.png").succeeds();
    f.write("bare.obj", &plane("", both));
    f.run("render bare.obj --size 64 --view 0,0 -o b.png").succeeds();
    let brightness = |name: &str, y: u32| f.image(name).get(32, y, 1);
    assert!((brightness("a.png", 20) - brightness("b.png", 20)).abs() > 0.01, "tilted normals are seen");
    assert!((brightness("a.png", 50) - brightness("b.png", 50)).abs() < 0.05);
}
