//! `barymap cage`: models in cages, and cages that are none.

use std::collections::BTreeMap;
use std::path::Path;

use barymap::geometry::{Corner, Mesh, MeshBuilder, NONE};
use barymap::io::{read_mesh, write_obj};
use barymap::models::shapes::icosphere;
use glam::{DQuat, DVec3};

use crate::support::Folder;

/// The surface of a cube of side 2 in 3 x 3 quads a side, moved by `place`.
fn cube(place: impl Fn(DVec3) -> DVec3) -> Mesh {
    let mut builder = MeshBuilder::new("cage");
    let mut numbers: BTreeMap<[i32; 3], u32> = BTreeMap::new();
    for axis in 0..3 {
        for side in [0, 3] {
            for i in 0..3 {
                for k in 0..3 {
                    let mut ring = [(i, k), (i + 1, k), (i + 1, k + 1), (i, k + 1)];
                    if side == 0 {
                        ring.reverse();
                    }
                    let corners: Vec<Corner> = ring
                        .iter()
                        .map(|&(i, k)| {
                            let mut at = [0; 3];
                            (at[axis], at[(axis + 1) % 3], at[(axis + 2) % 3]) = (side, i, k);
                            let next = numbers.len() as u32;
                            let vertex = *numbers.entry(at).or_insert(next);
                            if vertex == next {
                                let p = DVec3::from(at.map(|x| f64::from(x) * 2.0 / 3.0 - 1.0));
                                builder.mesh.positions.push(place(p));
                            }
                            Corner { vertex, texcoord: NONE, normal: NONE }
                        })
                        .collect();
                    builder.polygon(corners);
                }
            }
        }
    }
    builder.build().unwrap()
}

/// Turned about y, the more the higher.
fn twist(p: DVec3, degrees: f64) -> DVec3 {
    DQuat::from_rotation_y(degrees.to_radians() * (1.35 * p.y).clamp(-0.5, 0.5)) * p
}

fn affine(p: DVec3) -> DVec3 {
    DVec3::new(1.2 * p.x + 0.3 * p.y, 0.9 * p.y - 0.2 * p.z, 1.1 * p.z + 0.1 * p.x) + DVec3::new(0.5, -0.25, 2.0)
}

/// `m.obj`, a ball; `a.obj`, a cube around it; `b.obj`, the cube moved by `place`.
fn folder(place: impl Fn(DVec3) -> DVec3) -> Folder {
    let f = Folder::empty();
    write_obj(&icosphere(0.8, 3), f.path("m.obj")).unwrap();
    write_obj(&cube(|p| p), f.path("a.obj")).unwrap();
    write_obj(&cube(place), f.path("b.obj")).unwrap();
    f
}

fn mesh(f: &Folder, name: &str) -> Mesh {
    read_mesh(f.path(name)).unwrap().mesh
}

/// Largest distance between vertices of the same number.
fn far(a: &Mesh, b: &Mesh) -> f64 {
    assert_eq!(a.triangles(), b.triangles());
    a.positions.iter().zip(&b.positions).map(|(p, q)| p.distance(*q)).fold(0.0, f64::max)
}

#[test]
fn an_affine_cage_moves_the_model_affinely_by_every_partition_and_path() {
    let f = folder(affine);
    let before = mesh(&f, "m.obj");
    for options in [
        "",
        "--path linear",
        "--partition direct",
        "--partition uniform:3",
        "--partition continuous",
        "--backend reference",
    ] {
        f.run(&format!("cage m.obj --from a.obj --to b.obj -o out.obj --report r.json {options}")).succeeds();
        let mut like = before.clone();
        like.positions.iter_mut().for_each(|p| *p = affine(*p));
        let off = far(&mesh(&f, "out.obj"), &like);
        // Single precision, over a diameter of four; along the encoded path steps are not affine,
        // and the composite is not quite.
        let most = if options == "--path linear" || options.contains("direct") { 2e-6 } else { 5e-2 };
        assert!(off < most, "{options}: {off:e}");
    }
    let report = f.json("r.json");
    assert_eq!(report["command"], "cage");
    for key in
        ["vertices", "partition", "steps", "path", "bijective", "self_intersections", "outside", "escaped", "notes"]
    {
        assert!(!report[key].is_null(), "{key} is missing in {report}");
    }
    assert_eq!((&report["bijective"], &report["outside"]["vertices"]), (&"sampled".into(), &0.into()));
    assert!(report["cpu_seconds"].is_object() && report["steps"][0]["at"].as_array().unwrap().len() == 3);
}

#[test]
fn a_twist_folds_directly_and_not_in_steps_and_comes_back() {
    let f = folder(|p| twist(p, 90.0));
    f.run("cage m.obj --from a.obj --to b.obj -o d.obj --partition direct --report d.json").succeeds();
    assert_eq!(f.json("d.json")["bijective"], "failed");
    f.run("cage m.obj --from a.obj --to b.obj -o s.obj --partition direct --strict --report s.json")
        .fails(1, &["--strict"]);
    assert!(!f.path("s.obj").exists() && f.path("s.json").exists());
    f.run("cage m.obj --from a.obj --to b.obj -o t.obj --report t.json --backend reference").succeeds();
    let report = f.json("t.json");
    assert_eq!((&report["bijective"], &report["path"]), (&"sampled".into(), &"encoded".into()));
    let steps = report["steps"].as_array().unwrap();
    assert!(steps.len() > 1 && steps.iter().all(|s| s["j_min"].as_f64().unwrap() > 0.0), "{report}");
    // The inverse undoes the map along the same knots.
    let m = steps.len();
    let knots: Vec<f64> = report["partition"].as_array().unwrap().iter().map(|t| t.as_f64().unwrap()).collect();
    let uniform = knots.windows(2).all(|k| ((k[1] - k[0]) * m as f64 - 1.0).abs() < 1e-12);
    let kind = if uniform { format!("uniform:{m}") } else { "uniform:4".into() };
    f.run(&format!("cage m.obj --from a.obj --to b.obj -o u.obj --partition {kind} --backend reference")).succeeds();
    f.run(&format!("cage u.obj --from a.obj --to b.obj -o back.obj --inverse --partition {kind} --report i.json"))
        .succeeds();
    let off = far(&mesh(&f, "back.obj"), &mesh(&f, "m.obj"));
    assert!(off < 1e-6 * 4.0, "{off:e}");
    assert_eq!((&f.json("i.json")["inverse"], &f.json("i.json")["failed"]), (&true.into(), &0.into()));
    // The same input gives the same bytes.
    let first = f.read("t.obj");
    f.run("cage m.obj --from a.obj --to b.obj -o t.obj --backend reference").succeeds();
    assert_eq!(f.read("t.obj"), first);
}

#[test]
fn cages_may_be_inside_out_and_their_polygons_in_another_order() {
    let f = folder(affine);
    // Both turned over; and the second in reverse order, each polygon from another corner.
    let text = |name: &str, turn: bool| -> String {
        let mut faces: Vec<String> = Vec::new();
        let mut rest = String::new();
        for line in f.read(name).lines() {
            match line.strip_prefix("f ") {
                Some(corners) => {
                    let mut ring: Vec<&str> = corners.split_whitespace().collect();
                    if turn {
                        ring.reverse()
                    } else {
                        ring.rotate_left(1)
                    }
                    faces.push(format!("f {}", ring.join(" ")));
                }
                None => rest += &format!("{line}\n"),
            }
        }
        faces.reverse();
        rest + &faces.join("\n") + "\n"
    };
    f.write("a2.obj", &text("a.obj", true));
    f.write("b2.obj", &text("b.obj", false));
    f.run("cage m.obj --from a.obj --to b.obj -o one.obj --path linear").succeeds();
    f.run("cage m.obj --from a2.obj --to b2.obj -o two.obj --path linear").succeeds();
    assert!(far(&mesh(&f, "one.obj"), &mesh(&f, "two.obj")) < 1e-5);
}

#[test]
fn vertices_outside_are_mapped_and_counted() {
    let f = folder(|p| twist(p, 40.0));
    let mut model = mesh(&f, "m.obj");
    model.positions.iter_mut().for_each(|p| *p *= 1.5);
    let outside = model.positions.iter().filter(|p| p.abs().max_element() > 1.0).count();
    assert!(outside > 0);
    write_obj(&model, f.path("m.obj")).unwrap();
    let ran = f.run("cage m.obj --from a.obj --to b.obj -o out.obj --report r.json").succeeds();
    assert!(ran.stderr.contains(&format!("{outside} of 642 vertices lie outside the cage")), "{}", ran.stderr);
    assert_eq!(f.json("r.json")["outside"]["vertices"], outside);
    assert!(mesh(&f, "out.obj").positions.iter().all(|p| p.is_finite()));
}

#[test]
fn vertices_of_no_face_are_carried_too() {
    let f = folder(affine);
    f.write("p.obj", "v 0 0 0\nv 0.5 0.25 -0.125\nv 0.5 0 0\nv 0 0.5 0\nf 1 3 4\n");
    f.run("cage p.obj --from a.obj --to b.obj -o out.obj --path linear").succeeds();
    let out = mesh(&f, "out.obj");
    assert!(out.positions[1].distance(affine(DVec3::new(0.5, 0.25, -0.125))) < 1e-5);
}

#[test]
fn what_is_no_cage_or_no_model_is_told_by_name() {
    let f = folder(affine);
    let good = f.read("a.obj");
    let faces: Vec<&str> = good.lines().filter(|l| l.starts_with("f ")).collect();
    let vertices: Vec<&str> = good.lines().filter(|l| l.starts_with("v ")).collect();
    let file = |name: &str, v: &[&str], t: &[&str]| f.write(name, &format!("{}\n{}\n", v.join("\n"), t.join("\n")));
    file("open.obj", &vertices, &faces[1..]);
    let third = [&faces[..], &["f 1 2 3", "f 3 2 1"]].concat();
    file("third.obj", &vertices, &third);
    let mut against = faces.clone();
    let first: Vec<&str> = faces[0].split_whitespace().collect();
    let turned = format!("f {} {} {} {}", first[4], first[3], first[2], first[1]);
    against[0] = &turned;
    file("against.obj", &vertices, &against);
    file("fewer.obj", &vertices, &faces[..faces.len() - 1]);
    file("more.obj", &[&vertices[..], &["v 0 0 0"]].concat(), &faces);
    let mut flat = vertices.clone();
    flat[0] = flat[1];
    file("flat.obj", &flat, &faces);
    write_obj(&cube(|p| DVec3::new(-p.x, p.y, p.z)), f.path("mirror.obj")).unwrap();
    file("cloud.obj", &vertices, &[]);
    f.write("empty.obj", "");
    f.write("nan.obj", &good.replacen(vertices[3], "v nan 0 0", 1));
    for (from, to, words) in [
        ("open.obj", "open.obj", &["open.obj", "open at the edge"][..]),
        ("third.obj", "third.obj", &["third.obj", "meet at the edge"]),
        ("against.obj", "against.obj", &["against.obj", "oriented against each other"]),
        ("a.obj", "fewer.obj", &["fewer.obj", "53 polygons"]),
        ("a.obj", "more.obj", &["more.obj", "57 vertices"]),
        ("a.obj", "flat.obj", &["flat.obj", "has no area"]),
        ("flat.obj", "a.obj", &["flat.obj", "has no area"]),
        ("a.obj", "mirror.obj", &["mirror.obj", "inside out"]),
        ("cloud.obj", "cloud.obj", &["cloud.obj", "no face"]),
        ("empty.obj", "a.obj", &["empty.obj"]),
        ("a.obj", "nan.obj", &["nan.obj"]),
        ("a.obj", "gone.obj", &["gone.obj"]),
    ] {
        f.run(&format!("cage m.obj --from {from} --to {to} -o out.obj")).fails(1, words);
    }
    f.run("cage empty.obj --from a.obj --to b.obj -o out.obj").fails(1, &["empty.obj"]);
    f.run("cage nan.obj --from a.obj --to b.obj -o out.obj").fails(1, &["nan.obj"]);
    f.run("cage m.obj --from a.obj --to b.obj -o out.stl").fails(2, &["--output"]);
    f.run("cage m.obj --from a.obj --to b.obj -o out.obj --eps 0").fails(2, &["--eps"]);
    f.run("cage m.obj --from a.obj --to b.obj -o out.obj --resolution 0").fails(2, &["--resolution"]);
    f.run("cage m.obj --from a.obj --to b.obj -o out.obj --partition uniform:4000000000").fails(2, &["--partition"]);
    assert_eq!(f.run("cage m.obj --from a.obj --to b.obj -o out.obj --partition uniform:0").code, Some(2));
    assert!(!f.path("out.obj").exists());
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn published_cages_deform_their_models() {
    let data = std::env::var("BARYMAP_DATA").expect("BARYMAP_DATA names the folder of models");
    let f = Folder::empty();
    let at = |name: &str| Path::new(&data).join(name).display().to_string();
    // Of each: vertices outside the cage at least, and whether its target intersects itself.
    for (model, cage, outside, crossing) in [
        ("textured/spot/spot.obj", "spot", 0, false),
        ("cage/beast.obj", "beast", 100, true),
        ("cage/ogre.obj", "ogre", 20, true),
    ] {
        let cages = (at(&format!("cage/{cage}_cage.obj")), at(&format!("cage/{cage}_cage_deformed.obj")));
        let options = "--partition uniform:4 --resolution 12 --report r.json -o out.ply --backend cpu";
        f.run(&format!("cage {} --from {} --to {} {options}", at(model), cages.0, cages.1)).succeeds();
        let report = f.json("r.json");
        let found = report["outside"]["vertices"].as_u64().unwrap();
        assert!(found >= outside && (outside > 0 || found == 0), "{cage}: {found} outside");
        let at_end = report["self_intersections"].as_array().unwrap().iter().any(|i| i["knot"] == 1.0);
        assert_eq!(at_end, crossing, "{cage}: {}", report["self_intersections"]);
        assert_eq!(report["bijective"], if crossing { "failed" } else { "sampled" });
        assert!(read_mesh(f.path("out.ply")).unwrap().mesh.positions.iter().all(|p| p.is_finite()));
    }
}
