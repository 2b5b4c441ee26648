//! `barymap transfer`: tiles, texture sets, models with their textures, fills, ST-maps, depths.

use barymap::geometry::material::{AlphaMode, Look};
use barymap::geometry::{Corner, Mesh, MeshBuilder, NONE};
use barymap::io::{GlbMaterial, read_mesh, write_image};
use barymap::models::shapes::uv_sphere;
use barymap::picture::{Depth, Image, Pixels};
use barymap::tools::transfer::{UvRegion, seam_steps};
use glam::{DVec2, DVec3};

use crate::support::{Folder, difference, stretched, waves};

const TRANSFER: &str = "transfer --backend cpu --source s.obj --target t.obj --anchors a.json";

/// Columns `from..to` of a picture.
fn columns(image: &Image, from: u32, to: u32) -> Image {
    let mut out = Image::zeros(to - from, image.height, image.channels, image.depth()).unwrap();
    for y in 0..image.height {
        for x in from..to {
            (0..image.channels).for_each(|c| out.set(x - from, y, c, image.get(x, y, c)));
        }
    }
    out
}

/// The spheres of [`Folder::spheres`] with their texture coordinates over two tiles, and the
/// texture in two pictures.
fn tiled() -> Folder {
    let f = Folder::spheres();
    for (name, mut mesh) in [("s.obj", uv_sphere(1.0, 24, 16)), ("t.obj", stretched(30, 18))] {
        mesh.texcoords.iter_mut().for_each(|uv| uv.x *= 2.0);
        barymap::io::write_obj(&mesh, f.path(name)).unwrap();
    }
    write_image(&columns(&waves(128), 0, 64), f.path("s.1001.png")).unwrap();
    write_image(&columns(&waves(128), 64, 128), f.path("s.1002.png")).unwrap();
    f
}

/// A flat grid over `tiles` tiles side by side, with a vertex on every border.
fn sheet(tiles: usize) -> Mesh {
    let mut b = MeshBuilder::new("sheet");
    let (columns, rows) = (4 * tiles, 4);
    for j in 0..=rows {
        for i in 0..=columns {
            let uv = DVec2::new(i as f64, j as f64) / 4.0;
            b.mesh.texcoords.push(uv);
            b.mesh.positions.push(DVec3::new(uv.x, uv.y, 0.1 * (3.0 * uv.x).sin()));
        }
    }
    let id = |i: usize, j: usize| (j * (columns + 1) + i) as u32;
    for j in 0..rows {
        for i in 0..columns {
            let q = [id(i, j), id(i + 1, j), id(i + 1, j + 1), id(i, j + 1)];
            b.polygon(q.map(|v| Corner { vertex: v, texcoord: v, normal: NONE }));
        }
    }
    b.build().unwrap()
}

/// Noise in 16 bits, transparent here and there.
fn noise16(width: u32, height: u32, seed: u32) -> Image {
    let mut x = seed.wrapping_mul(0x9e37_79b9) | 1;
    let mut next = || {
        x ^= x << 13;
        x ^= x >> 17;
        x ^= x << 5;
        x as u16
    };
    let samples = (0..width * height).flat_map(|i| [next(), next(), next(), if i % 7 == 0 { 0 } else { next() }]);
    Image::new(width, height, 4, Pixels::U16(samples.collect())).unwrap()
}

#[test]
fn tiles_come_in_and_go_out() {
    let f = tiled();
    let ran = f
        .run(&format!(
            "{TRANSFER} --texture s.<UDIM>.png --size 64x128 -o o.<UDIM>.png --coverage c.<UDIM>.png --report r.json"
        ))
        .succeeds();
    assert!(!ran.stderr.contains("unit square"), "{}", ran.stderr);
    for (tile, from) in [("1001", 0), ("1002", 64)] {
        let truth = columns(&waves(128), from, from + 64);
        let error = difference(&f.image(&format!("o.{tile}.png")), &truth, &f.image(&format!("c.{tile}.png")));
        assert!(error < 0.03, "{tile}: mean difference {error}");
        let other = columns(&waves(128), 64 - from, 128 - from);
        let wrong = difference(&f.image(&format!("o.{tile}.png")), &other, &f.image(&format!("c.{tile}.png")));
        assert!(wrong > 0.1, "the comparison tells the tiles apart: {wrong}");
    }
    let report = f.json("r.json");
    assert_eq!(report["files"], serde_json::json!(["o.1001.png", "c.1001.png", "o.1002.png", "c.1002.png"]));
    assert_eq!(report["texels"], 2 * 64 * 128);
    assert!(report["valid_fraction"].as_f64().unwrap() > 0.9, "{report}");

    // The other names of tiles, and a model that shows each part with its own picture.
    for (from, to) in [("s.1001.png", "s_u1_v1.png"), ("s.1002.png", "s_u2_v1.png")] {
        std::fs::copy(f.path(from), f.path(to)).unwrap();
    }
    f.run(&format!("{TRANSFER} --texture s_<UVTILE>.png --size 64x128 -o p_<UVTILE>.png --model m.glb")).succeeds();
    assert_eq!(f.bytes("p_u2_v1.png"), f.bytes("o.1002.png"));
    let (document, _, images) = gltf::import(f.path("m.glb")).unwrap();
    let names: Vec<_> = document.materials().map(|m| m.name().unwrap_or_default().to_owned()).collect();
    assert_eq!((names, images.len()), (vec!["transferred.1001".to_owned(), "transferred.1002".to_owned()], 2));

    let ran = f.run(&format!("{TRANSFER} --texture s.1001.png --size 16 -o q.png")).succeeds();
    assert_eq!(ran.stderr.matches("leave the unit square").count(), 2, "{}", ran.stderr);
    f.run(&format!("{TRANSFER} --texture s.<UDIM>.png --size 16 -o q.<UDIM>.png --coverage c.png"))
        .fails(2, &["--coverage", "<UDIM>"]);
}

#[test]
fn missing_tiles_are_named_and_the_rest_goes_on() {
    let f = tiled();
    std::fs::remove_file(f.path("s.1002.png")).unwrap();
    let command =
        format!("{TRANSFER} --texture s.<UDIM>.png --size 64x128 -o o.<UDIM>.png --coverage c.<UDIM>.png --margin 0");
    let ran = f.run(&command).succeeds();
    assert!(ran.stderr.contains("no file for the tiles 1002") && ran.stderr.contains("triangles"), "{}", ran.stderr);
    let error = difference(&f.image("o.1001.png"), &columns(&waves(128), 0, 64), &f.image("c.1001.png"));
    assert!(error < 0.03, "mean difference {error}");
    let share = |name: &str| {
        let image = f.image(name);
        (0..64 * 128).filter(|i| image.sample(*i) == 1.0).count() as f64 / (64.0 * 128.0)
    };
    assert!(share("c.1001.png") > 0.9 && share("c.1002.png") < 0.1);
    // Neither picture is half done: nothing is written where nothing can be read.
    std::fs::remove_file(f.path("s.1001.png")).unwrap();
    std::fs::remove_file(f.path("o.1001.png")).unwrap();
    f.run(&command).fails(1, &["s.1001.png", "none of the tiles", "<UDIM>"]);
    assert!(!f.path("o.1001.png").exists());
}

#[test]
fn the_identity_keeps_every_bit_of_every_tile() {
    let f = Folder::empty();
    barymap::io::write_obj(&sheet(2), f.path("s.obj")).unwrap();
    f.write("a.txt", "0 0\n5 5\n11 11\n20 20\n30 30\n44 44\n");
    let tiles = [("1001", noise16(96, 75, 1)), ("1002", noise16(96, 75, 2))];
    for (tile, image) in &tiles {
        write_image(image, f.path(&format!("s.{tile}.png"))).unwrap();
    }
    let command =
        "transfer --backend cpu --source s.obj --target s.obj --anchors a.txt --texture s.<UDIM>.png --size 96x75";
    for options in ["--filter bilinear", "", "--linear-light", "--filter trilinear --memory 3M"] {
        f.run(&format!("{command} -o o.<UDIM>.png {options}")).succeeds();
        for (tile, image) in &tiles {
            assert!(f.image(&format!("o.{tile}.png")) == *image, "{tile} {options}");
        }
    }
    // At another size texels are averaged, and the comparison sees it.
    f.run(&format!("{command} -o o.<UDIM>.png").replace("96x75", "95x75")).succeeds();
    assert!(f.image("o.1001.png") != tiles[0].1);
    // Floats, too.
    let floats: Vec<f32> = (0..96 * 75 * 3).map(|i| (i as f32 * 0.37).sin() * 40.0).collect();
    let image = Image::new(96, 75, 3, Pixels::F32(floats.clone())).unwrap();
    write_image(&image, f.path("f.1001.exr")).unwrap();
    write_image(&image, f.path("f.1002.exr")).unwrap();
    f.run(&format!("{command} -o g.<UDIM>.exr").replace("s.<UDIM>.png", "f.<UDIM>.exr")).succeeds();
    let out = f.image("g.1002.exr").converted(3, Depth::F32).unwrap();
    assert!(out.pixels == Pixels::F32(floats), "floats keep their bits");
}

#[test]
fn sets_are_transferred_together_and_attached() {
    let f = Folder::spheres();
    let grey = |size: u32| waves(size).converted(1, Depth::U16).unwrap();
    write_image(&grey(32), f.path("rough.png")).unwrap();
    write_image(&grey(64), f.path("metal.png")).unwrap();
    write_image(&grey(16), f.path("height.png")).unwrap();
    let textures = "--texture base_color=s.png --texture roughness:*=rough.png --texture metallic=metal.png --texture height=height.png";
    let ran = f
        .run(&format!("{TRANSFER} {textures} --size 64 -o o_<ROLE>.png --model m.glb --coverage c.png --report r.json"))
        .succeeds();
    assert!(ran.stderr.contains("no place for height"), "{}", ran.stderr);
    let [color, rough, metal] = ["base_color", "roughness", "metallic"].map(|r| f.image(&format!("o_{r}.png")));
    assert_eq!((color.depth(), rough.depth(), f.image("o_height.png").depth()), (Depth::U8, Depth::U16, Depth::U16));
    assert_eq!(f.json("r.json")["roles"], serde_json::json!(["base_color", "roughness", "metallic", "height"]));

    let (document, _, images) = gltf::import(f.path("m.glb")).unwrap();
    let material = document.materials().next().unwrap();
    let pbr = material.pbr_metallic_roughness();
    let base = &images[pbr.base_color_texture().unwrap().texture().source().index()];
    let packed = &images[pbr.metallic_roughness_texture().unwrap().texture().source().index()];
    assert_eq!((images.len(), base.width, packed.width), (2, 64, 64));
    assert_eq!((pbr.metallic_factor(), pbr.roughness_factor()), (1.0, 1.0));
    // Roughness in green, metallic in blue, 16 bits as they came.
    let word =
        |channel: usize, texel: usize| u16::from_le_bytes([0, 1].map(|b| packed.pixels[6 * texel + 2 * channel + b]));
    for texel in [70, 2000, 4000] {
        let (x, y) = (texel as u32 % 64, texel as u32 / 64);
        assert_eq!(f32::from(word(1, texel)) / 65535.0, rough.get(x, y, 0));
        assert_eq!(f32::from(word(2, texel)) / 65535.0, metal.get(x, y, 0));
    }
    // The old forms stay, and mean the same.
    f.run(&format!("{TRANSFER} --texture s.png --texture rough.png --size 64 -o x.png -o y.png")).succeeds();
    assert_eq!((f.bytes("x.png"), f.bytes("y.png")), (f.bytes("o_base_color.png"), f.bytes("o_roughness.png")));

    for (wrong, words) in [
        ("--texture rufness=rough.png", &["rufness", "neither a material", "roughness"][..]),
        ("--texture roughness:skin=rough.png", &["roughness:skin", "neither"]),
        ("--texture roughness=rough.png --texture roughness=s.png", &["roughness", "twice"]),
        ("--texture s.png --texture roughness=rough.png", &["1 outputs for 2 layers", "<ROLE>"]),
    ] {
        f.run(&format!("{TRANSFER} {wrong} --size 16 -o z.png")).fails(2, words);
    }
    f.run(&format!("{TRANSFER} {textures} --size 16 -o z.png -o z.png -o z.png -o z.png"))
        .fails(2, &["z.png", "twice"]);
}

#[test]
fn a_models_textures_arrive_in_their_roles() {
    let f = Folder::spheres();
    let png = |image: &Image| barymap::io::image_file::encode_png(image).unwrap().into();
    let look = Look {
        metallic: 0.75,
        roughness: 0.5,
        emissive: [1.0, 0.5, 0.25],
        normal_scale: 0.5,
        occlusion_strength: 0.25,
        alpha: AlphaMode::Mask(0.25),
        double_sided: true,
    };
    let others = ["metallic_roughness", "normal", "occlusion", "emissive"];
    let material = GlbMaterial {
        name: "skin".into(),
        base_color: [1.0, 0.5, 1.0, 1.0],
        texture: Some(png(&waves(128))),
        textures: others.iter().enumerate().map(|(k, r)| ((*r).to_owned(), png(&waves(16 << k)))).collect(),
        look,
    };
    barymap::io::write_glb(f.path("s.glb"), &uv_sphere(1.0, 24, 16), &[material]).unwrap();
    let source = read_mesh(f.path("s.glb")).unwrap().mesh;
    assert_eq!((source.materials[0].look, source.materials[0].textures.len()), (look, 4));
    f.write("t.obj", &format!("usemtl hero\n{}", f.read("t.obj")));

    let command = TRANSFER.replace("s.obj", "s.glb");
    f.run(&format!("{command} --size 64 --model m.glb")).succeeds();
    let (document, _, images) = gltf::import(f.path("m.glb")).unwrap();
    assert_eq!(images.len(), 5);
    let material = document.materials().next().unwrap();
    let pbr = material.pbr_metallic_roughness();
    assert_eq!((material.name(), document.materials().len()), (Some("hero"), 1));
    assert!(pbr.base_color_texture().is_some() && pbr.metallic_roughness_texture().is_some());
    // The pictures hold the factors.
    assert_eq!((pbr.base_color_factor(), pbr.metallic_factor(), pbr.roughness_factor()), ([1.0; 4], 1.0, 1.0));
    assert_eq!(material.normal_texture().unwrap().scale(), 1.0);
    assert_eq!(material.occlusion_texture().unwrap().strength(), 1.0);
    assert!(material.emissive_texture().is_some());
    assert_eq!(material.emissive_factor(), [1.0; 3]);
    assert_eq!((material.alpha_mode(), material.alpha_cutoff()), (gltf::material::AlphaMode::Mask, Some(0.25)));
    // Pictures of all roles; without <ROLE> the base colour, as ever.
    f.run(&format!("{command} --size 64 -o o_<ROLE>.png")).succeeds();
    assert!(others.iter().chain(&["base_color"]).all(|r| f.path(&format!("o_{r}.png")).exists()));
    f.run(&format!("{command} --size 64 -o o.png")).succeeds();
    assert_eq!(f.bytes("o.png"), f.bytes("o_base_color.png"));
}

/// `s.obj` with its faces in two materials of half each.
fn halved(f: &Folder, name: &str) {
    let text = f.read(name);
    let faces: Vec<&str> = text.lines().filter(|l| l.starts_with("f ")).collect();
    let rest: Vec<&str> = text.lines().filter(|l| !l.starts_with("f ") && !l.starts_with("usemtl")).collect();
    let (low, high) = faces.split_at(faces.len() / 2);
    f.write(name, &format!("{}\nusemtl low\n{}\nusemtl high\n{}\n", rest.join("\n"), low.join("\n"), high.join("\n")));
}

#[test]
fn materials_without_textures_are_named() {
    let f = Folder::spheres();
    halved(&f, "s.obj");
    halved(&f, "t.obj");
    let ran = f.run(&format!("{TRANSFER} --texture low=s.png --size 32 -o o_<MATERIAL>.png --model m.glb")).succeeds();
    assert!(ran.stderr.contains("no base_color for the materials high"), "{}", ran.stderr);
    assert!(ran.stderr.contains("have no colour; --fill"), "{}", ran.stderr);
    assert!(f.path("o_low.png").exists() && f.path("o_high.png").exists());
    let document = gltf::import(f.path("m.glb")).unwrap().0;
    let names: Vec<_> = document.materials().map(|m| m.name().unwrap_or_default().to_owned()).collect();
    assert_eq!(names, ["low", "high"]);
    // One for all, another for one of them.
    let ran = f
        .run(&format!("{TRANSFER} --texture base_color=s.png --texture base_color:low=s.png --size 32 -o o.png"))
        .succeeds();
    assert!(!ran.stderr.contains("no base_color"), "{}", ran.stderr);
}

#[test]
fn holes_are_left_averaged_or_smooth() {
    let f = Folder::spheres();
    halved(&f, "s.obj");
    let command = format!("{TRANSFER} --texture low=s.png --size 128 --coverage c.png --report r.json -o");
    let inside = |image: &Image, share: f32| {
        let alpha = image.channels - 1;
        (0..128 * 128).filter(|i| image.get(i % 128, i / 128, alpha) == 1.0).count() as f32 > share * 128.0 * 128.0
    };
    f.run(&format!("{command} none.png")).succeeds();
    let colorless = f.json("r.json")["colorless"].as_u64().unwrap();
    assert!(colorless > 2000 && f.json("r.json")["filled"] == 0);
    assert!(!inside(&f.image("none.png"), 0.75), "padding leaves holes alone");
    for mode in ["pull-push", "smooth"] {
        let ran = f.run(&format!("{command} {mode}.png --fill {mode}")).succeeds();
        assert!(!ran.stderr.contains("have no colour"), "{}", ran.stderr);
        assert_eq!(f.json("r.json")["filled"].as_u64().unwrap(), colorless);
        let (image, coverage) = (f.image(&format!("{mode}.png")), f.image("c.png"));
        assert!(inside(&image, 0.95), "{mode}");
        let doubtful = (0..128 * 128).filter(|&i| coverage.sample(i) == 128.0 / 255.0).count();
        assert!(doubtful as u64 >= colorless, "filled texels are doubtful");
    }
    // No step where the hole begins: the smooth fill is as even as the texture.
    let mesh = read_mesh(f.path("t.obj")).unwrap().mesh;
    let steps = seam_steps(&mesh, &f.image("smooth.png"), &f.image("c.png"), UvRegion::Repeat).unwrap();
    assert!(steps.inside < 0.25 && steps.across <= 2.0 * steps.inside && steps.pairs > 50, "{steps:?}");

    f.run(&format!("{command} all.png --fill smooth --fill-doubtful")).succeeds();
    assert!(f.json("r.json")["filled"].as_u64().unwrap() >= colorless);
    f.run(&format!("{command} none.png --fill-doubtful")).fails(2, &["--fill-doubtful", "--fill smooth"]);
    let ran = f.run(&format!("{command} tight.png --fill smooth --memory 3M --method transport")).succeeds();
    assert!(ran.stderr.contains("--memory"), "{}", ran.stderr);
}

/// The source's colour at u, v by four texels, as any program applies an ST-map.
fn look_up(image: &Image, u: f32, v: f32, c: u32) -> f32 {
    let p = [u * image.width as f32 - 0.5, (1.0 - v) * image.height as f32 - 0.5];
    let wrap = |i: f32, n: u32| (i as i64).rem_euclid(i64::from(n)) as u32;
    let (x, y) = (p[0].floor(), p[1].floor());
    let at = |i: f32, j: f32| image.get(wrap(x + i, image.width), wrap(y + j, image.height), c);
    let (s, t) = (p[0] - x, p[1] - y);
    (at(0.0, 0.0) * (1.0 - s) + at(1.0, 0.0) * s) * (1.0 - t) + (at(0.0, 1.0) * (1.0 - s) + at(1.0, 1.0) * s) * t
}

#[test]
fn the_map_can_be_applied_by_others() {
    let f = Folder::spheres();
    f.run(&format!(
        "{TRANSFER} --texture s.png --size 100x80 --filter bilinear -o o.png --stmap st.exr --coverage c.png"
    ))
    .succeeds();
    let (out, st, coverage, source) = (f.image("o.png"), f.image("st.exr"), f.image("c.png"), f.image("s.png"));
    assert_eq!((st.width, st.height, st.depth()), (100, 80, Depth::F32));
    let worst = |up: bool| {
        let mut worst = 0.0_f32;
        for y in 0..80 {
            for x in 0..100 {
                assert_eq!(st.get(x, y, 2), coverage.get(x, y, 0), "blue is the coverage");
                assert_eq!(st.get(x, y, 3), f32::from(u8::from(coverage.get(x, y, 0) > 0.0)));
                let (u, v) = (st.get(x, y, 0), st.get(x, y, 1));
                assert!((-1e-3..1.001).contains(&u) && (-1e-3..1.001).contains(&v));
                if coverage.get(x, y, 0) > 0.0 {
                    let v = if up { v } else { 1.0 - v };
                    worst = (0..3).map(|c| (look_up(&source, u, v, c) - out.get(x, y, c)).abs()).fold(worst, f32::max);
                }
            }
        }
        worst
    };
    assert!(worst(true) <= 1.01 / 255.0, "{}", worst(true));
    assert!(worst(false) > 0.5, "v runs up, and the comparison sees it");
    // Tiles: the coordinates are the file's own.
    let f = tiled();
    f.run(&format!("{TRANSFER} --texture s.<UDIM>.png --size 32 -o o.<UDIM>.png --stmap st.<UDIM>.exr --margin 0"))
        .succeeds();
    let st = f.image("st.1002.exr");
    let right = (0..32 * 32).filter(|i| st.get(i % 32, i / 32, 0) > 1.0).count();
    assert!(right > 900, "{right}");
    f.run(&format!("{TRANSFER} --texture s.<UDIM>.png --size 32 -o o.png --stmap st.png"))
        .fails(2, &["--stmap", ".exr"]);
}

#[test]
fn depths_and_ranges_are_kept_with_and_without_light() {
    let f = Folder::spheres();
    let base = waves(64);
    write_image(&base.converted(3, Depth::U16).unwrap(), f.path("s16.png")).unwrap();
    let wide = |i: usize| (base.sample(i) - 0.5) * 100.0;
    let floats = Image::new(64, 64, 3, Pixels::F32((0..64 * 64 * 3).map(wide).collect())).unwrap();
    write_image(&floats, f.path("s.exr")).unwrap();
    for light in ["", "--linear-light"] {
        for (texture, out, depth) in
            [("s.png", "o.png", Depth::U8), ("s16.png", "o16.png", Depth::U16), ("s.exr", "o.exr", Depth::F32)]
        {
            f.run(&format!("{TRANSFER} --texture {texture} --size 64 -o {out} --coverage c.png {light}")).succeeds();
            assert_eq!(f.image(out).depth(), depth);
        }
        let (eight, sixteen, float, coverage) =
            (f.image("o.png"), f.image("o16.png"), f.image("o.exr"), f.image("c.png"));
        assert!(difference(&eight, &sixteen, &coverage) < 0.02);
        // Floats are light already, and go beyond 0..1.
        let range = (0..64 * 64).fold((f32::MAX, f32::MIN), |r, i| {
            let v = float.get(i % 64, i / 64, 0);
            (r.0.min(v), r.1.max(v))
        });
        assert!(range.0 < -30.0 && range.1 > 30.0, "{range:?}");
        if light.is_empty() {
            let mut scaled = Image::zeros(64, 64, 3, Depth::F32).unwrap();
            for i in 0..64 * 64 * 3 {
                let (x, y, c) = (i / 3 % 64, i / 192, i % 3);
                scaled.set(x, y, c, float.get(x, y, c) / 100.0 + 0.5);
            }
            assert!(difference(&scaled, &sixteen, &coverage) < 1e-3);
        }
    }
}

#[test]
fn seams_do_not_show() {
    let f = Folder::spheres();
    f.run(&format!("{TRANSFER} --texture s.png --size 128 -o o.png --coverage c.png")).succeeds();
    let mesh = read_mesh(f.path("t.obj")).unwrap().mesh;
    let (image, coverage) = (f.image("o.png"), f.image("c.png"));
    let steps = seam_steps(&mesh, &image, &coverage, UvRegion::Repeat).unwrap();
    assert!(steps.pairs >= 100 && steps.across <= 2.0 * steps.inside, "{steps:?}");
    // A picture that is brighter towards one side of the seam has a step there.
    let mut ramp = image.clone();
    for y in 0..128 {
        for x in 0..128 {
            (0..3).for_each(|c| ramp.set(x, y, c, 0.5 * image.get(x, y, c) + 0.5 * x as f32 / 128.0));
        }
    }
    let steps = seam_steps(&mesh, &ramp, &coverage, UvRegion::Repeat).unwrap();
    assert!(steps.across > 2.0 * steps.inside, "{steps:?}");
    assert!(seam_steps(&mesh, &image, &waves(64), UvRegion::Repeat).is_err());
}

#[test]
fn awkward_targets_get_what_can_be_given() {
    let f = Folder::spheres();
    let run = |target: &Mesh| {
        barymap::io::write_obj(target, f.path("t.obj")).unwrap();
        f.run(&format!("{TRANSFER} --texture s.png --size 64 -o o.png --report r.json --fill smooth"))
    };
    // Charts without area: the corners of some triangles are one point of the texture.
    let mut flat = stretched(30, 18);
    for t in 0..60 {
        for c in flat.triangle_corners(t) {
            flat.texcoords[c.texcoord as usize] = DVec2::new(0.5, 0.5);
        }
    }
    let ran = run(&flat).succeeds();
    assert!(ran.stderr.contains("without area in the texture"), "{}", ran.stderr);
    assert!(f.json("r.json")["covered"].as_u64().unwrap() > 1000);
    // All of them.
    let mut none = stretched(30, 18);
    none.texcoords.iter_mut().for_each(|uv| *uv = DVec2::new(0.25, 0.25));
    let ran = run(&none).succeeds();
    assert!(ran.stderr.contains("without area in the texture"), "{}", ran.stderr);
    assert_eq!(f.json("r.json")["covered"], 0);
    // Everything on top of everything.
    let mut folded = stretched(30, 18);
    folded.texcoords.iter_mut().for_each(|uv| uv.x = 1.0 - (1.0 - 2.0 * uv.x).abs());
    let ran = run(&folded).succeeds();
    assert!(ran.stderr.contains("belong to several triangles") && ran.stderr.contains(" %)"), "{}", ran.stderr);
    // An edge of three triangles.
    let mut fin = stretched(30, 18);
    let text = {
        fin.positions.push(DVec3::new(0.0, 3.0, 0.0));
        barymap::io::write_obj(&fin, f.path("t.obj")).unwrap();
        let [a, b, _] = fin.triangle(100).map(|v| v + 1);
        let last = fin.positions.len();
        format!("{}f {a}/1 {b}/2 {last}/3\n", f.read("t.obj"))
    };
    f.write("t.obj", &text);
    let ran = f.run(&format!("{TRANSFER} --texture s.png --size 64 -o o.png --report r.json --fill smooth")).succeeds();
    assert!(ran.stderr.contains("of more than two triangles"), "{}", ran.stderr);
}
