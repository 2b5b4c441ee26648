//! Materials as other programs write them: names, placements, colours without pictures, vertex
//! colours, normals.
//!
//! Source and target are the same plane, so that the result is what the source's picture shows,
//! texel by texel.

use barymap::geometry::NONE;
use barymap::io::{read_image, write_image};
use barymap::raster::{Image, Pixels};
use serde_json::{Value, json};

use crate::support::{Folder, Ran};

/// Quads along a side of the plane.
const QUADS: usize = 8;
/// Texels along a side of the result.
const SIZE: u32 = 64;

/// A picture whose texels all differ; `which` tells two pictures apart.
fn picture(width: u32, height: u32, which: u8) -> Image {
    let texels = (0..height)
        .flat_map(|y| (0..width).flat_map(move |x| [(255 * x / width) as u8, (255 * y / height) as u8, which]));
    Image::new(width, height, 3, Pixels::U8(texels.collect())).unwrap()
}

/// Vertices and faces of the plane, those of the upper half behind `between`.
fn plane(between: &str, corner: impl Fn(usize) -> String) -> String {
    let n = QUADS + 1;
    let at = |k: usize| k as f64 / QUADS as f64;
    let mut text = String::new();
    for (y, x) in (0..n).flat_map(|y| (0..n).map(move |x| (y, x))) {
        text += &format!("v {} {} {}\nvt {} {}\n", at(x), at(y), 0.1 * (at(x) * 3.0).sin() * at(y), at(x), at(y));
    }
    for y in 0..QUADS {
        if y == QUADS / 2 {
            text += between;
        }
        for x in 0..QUADS {
            let c = [y * n + x, y * n + x + 1, (y + 1) * n + x + 1, (y + 1) * n + x].map(|v| corner(v + 1));
            text += &format!("f {} {} {}\nf {} {} {}\n", c[0], c[1], c[2], c[0], c[2], c[3]);
        }
    }
    text
}

fn both(v: usize) -> String {
    format!("{v}/{v}")
}

/// A folder with `target.obj`, `a.json` and two pictures.
fn folder() -> Folder {
    let f = Folder::empty();
    f.write("target.obj", &plane("", both));
    // By their places: the primitives of a glTF file number their vertices each for itself.
    let anchors = [[0.0, 0.0], [1.0, 0.0], [0.5, 0.5], [0.0, 1.0], [1.0, 1.0_f64]]
        .map(|[x, y]| json!({"position": [x, y, 0.1 * (x * 3.0).sin() * y]}));
    f.write("a.json", &json!({"source": anchors, "target": anchors}).to_string());
    write_image(&picture(SIZE, SIZE, 0), f.path("t.png")).unwrap();
    write_image(&picture(SIZE, SIZE, 200), f.path("t2.png")).unwrap();
    f
}

/// A folder whose source has the material `m` below and `upper` above, defined by `mtl`.
fn with_materials(mtl: &[u8], upper: &str) -> Folder {
    let f = folder();
    std::fs::write(f.path("m.mtl"), mtl).unwrap();
    f.write("source.obj", &format!("mtllib m.mtl\nusemtl m\n{}", plane(&format!("usemtl {upper}\n"), both)));
    f
}

fn transfer(f: &Folder, source: &str, rest: &str) -> Ran {
    f.run(&format!("transfer --source {source} --target target.obj --anchors a.json --size {SIZE} --margin 0 {rest}"))
}

/// Transfers to `out.png` and compares every texel with `expected`, which gets its column and row.
#[track_caller]
fn shows(f: &Folder, source: &str, rest: &str, expected: impl Fn(u32, u32) -> [u8; 3]) -> Ran {
    let ran = transfer(f, source, &format!("{rest} -o out.png")).succeeds();
    is(&read_image(f.path("out.png")).unwrap(), expected);
    ran
}

#[track_caller]
fn is(image: &Image, expected: impl Fn(u32, u32) -> [u8; 3]) {
    let Pixels::U8(samples) = &image.pixels else { panic!("not in eight bits") };
    let n = image.channels as usize;
    for (k, texel) in samples.chunks_exact(n).enumerate() {
        let (x, y) = (k as u32 % image.width, k as u32 / image.width);
        assert_eq!(texel[..3], expected(x, y), "texel {x} {y}");
        assert!(n == 3 || texel[3] == 255, "texel {x} {y} is not opaque");
    }
}

fn texel(which: u8) -> impl Fn(u32, u32) -> [u8; 3] {
    move |x, y| [(255 * x / SIZE) as u8, (255 * y / SIZE) as u8, which]
}

#[test]
fn lines_end_in_any_way_and_comments_with_their_line() {
    let f = with_materials(b"newmtl m\nmap_Kd t.png\n", "m");
    let text = f.read("source.obj");
    for (name, text) in [
        ("cr.obj", text.replace('\n', "\r")),
        ("crlf.obj", text.replace('\n', "\r\n")),
        ("mixed.obj", text.replacen('\n', "\r", 40).replacen("\nf", "\r\nf", 9)),
        (
            "comment.obj",
            text.replacen("f ", "# C:\\scans\\\nf ", 1).replacen("\nusemtl m\nf", "\n# D:\\\r\nusemtl m\nf", 1),
        ),
        ("continued.obj", text.replace("f 1/1 ", "f 1/1 \\ \t\n")),
    ] {
        f.write(name, &text);
        let ran = shows(&f, name, "", texel(0));
        assert!(!ran.stderr.contains("no colour"), "{name}: {}", ran.stderr);
    }
    // The material library, too.
    f.write("m.mtl", "newmtl m\rmap_Kd t.png\r");
    shows(&f, "source.obj", "", texel(0));
}

#[test]
fn names_are_bytes() {
    for (one, two) in [(&b"Haut_\xe4"[..], &b"Haut_\xf6"[..]), (b"\x95\x5c", b"\x83\x5c"), ("ä".as_bytes(), b"\xe4")] {
        let f = folder();
        let mtl = [b"newmtl ", one, b"\nmap_Kd t.png\nnewmtl ", two, b"\nmap_Kd t2.png\n"].concat();
        std::fs::write(f.path("m.mtl"), mtl).unwrap();
        let text = plane("usemtl TWO\n", both);
        let (below, above) = text.split_once("TWO").unwrap();
        let obj = [b"mtllib m.mtl\nusemtl ", one, b"\n", below.as_bytes(), two, above.as_bytes()].concat();
        std::fs::write(f.path("source.obj"), obj).unwrap();
        let ran = shows(&f, "source.obj", "", |x, y| texel(if y < SIZE / 2 { 200 } else { 0 })(x, y));
        assert!(!ran.stderr.contains("not defined"), "{}", ran.stderr);
    }
}

#[test]
fn names_of_pictures_are_read_as_they_are_written_anywhere() {
    for (statement, file, note) in [
        ("map_Kd \"my tex.png\"", "my tex.png", None),
        ("map_Kd t.png -s 1 1 1", "t.png", None),
        ("map_Kd t.png # the skin", "t.png", None),
        ("map_Kd C:\\Users\\someone\\Desktop\\t.png", "t.png", Some("t.png is taken")),
        ("map_Kd /home/someone/maps/T.PNG", "maps/t.png", Some("maps/t.png is taken")),
        ("\tmap_Kd\t-bm 1 skin#1 b.png", "skin#1 b.png", None),
    ] {
        let f = with_materials(format!("newmtl m\n{statement}\n").as_bytes(), "m");
        if file != "t.png" {
            std::fs::create_dir_all(f.path(file).parent().unwrap()).unwrap();
            std::fs::rename(f.path("t.png"), f.path(file)).unwrap();
        }
        let ran = shows(&f, "source.obj", "", texel(0));
        match note {
            Some(note) => assert!(ran.stderr.contains(note), "{statement}: {}", ran.stderr),
            None => assert!(!ran.stderr.contains("texture"), "{statement}: {}", ran.stderr),
        }
    }
}

#[test]
fn libraries_are_found_wherever_they_are_named() {
    let mtl = b"newmtl m\nmap_Kd t.png\n";
    let f = with_materials(mtl, "m");
    std::fs::write(f.path("other.mtl"), "newmtl m\nmap_Kd t2.png\nnewmtl x\n").unwrap();
    std::fs::write(f.path("my lib.mtl"), mtl).unwrap();
    let faces = plane("", both);
    for head in [
        "usemtl m\nFACES\nmtllib m.mtl",
        "mtllib gone.mtl m.mtl\nusemtl m # skin\nFACES",
        "mtllib my lib.mtl other.mtl\nusemtl m\nFACES",
        "mtllib \"my lib.mtl\"\nusemtl \"m\"\nFACES",
        "mtllib C:\\art\\M.MTL\nusemtl m\nFACES",
        // Two files joined: each part has the library before it.
        "mtllib other.mtl\nusemtl x\nf 1 1 1\nmtllib m.mtl\nusemtl m\nFACES",
    ] {
        f.write("source.obj", &head.replace("FACES", &faces).replacen("f 1 1 1\n", "", 1));
        let ran = shows(&f, "source.obj", "", texel(0));
        assert_eq!(ran.stderr.contains("gone.mtl"), head.contains("gone"), "{}", ran.stderr);
    }
}

#[test]
fn pictures_lie_as_mtl_options_say() {
    let half = SIZE / 2;
    // Repeated twice at the size of the result: 32 texels a repeat.
    let f = with_materials(b"newmtl m\nmap_Kd -s 2 2 1 t.png\nnewmtl n\nmap_Kd -clamp on -s 2 2 -o 0 -1 t.png\n", "m");
    write_image(&picture(half, half, 0), f.path("t.png")).unwrap();
    let of = |x: u32, y: u32| [(255 * x / half) as u8, (255 * y / half) as u8, 0];
    shows(&f, "source.obj", "", |x, y| of(x % half, y % half));
    // Another material with the same picture: its upper half, moved down by one, is clamped on the
    // right.
    let upper = with_materials(&f.bytes("m.mtl"), "n");
    write_image(&picture(half, half, 0), upper.path("t.png")).unwrap();
    shows(&upper, "source.obj", "", |x, y| if y < half { of(x.min(half - 1), y) } else { of(x % half, y % half) });
    // The ST-map tells places in the picture.
    transfer(&f, "source.obj", "-o out.png --stmap st.exr").succeeds();
    let st = f.image("st.exr");
    let at = |x: u32, y: u32| [st.get(x, y, 0), st.get(x, y, 1)].map(|c| (c * half as f32) as u32);
    assert_eq!((at(5, 7), at(40, 50)), ([5, half - 1 - 7], [40 - half, half - 1 - (50 - half)]));
    // So does a picture given by hand that takes the place of the material's.
    write_image(&picture(half, half, 77), f.path("new.png")).unwrap();
    let ran =
        shows(&f, "source.obj", "--texture new.png", |x, y| [of(x % half, y % half)[0], of(x % half, y % half)[1], 77]);
    assert!(ran.stderr.contains("lies as material"), "{}", ran.stderr);
}

/// The plane as glTF with these materials, of which the upper half has the second; texture
/// coordinates times `scale` plus `offset`.
fn write_gltf(f: &Folder, scale: f64, offset: f64, extra: Value, colors: Option<(u32, &[u8])>) {
    let n = QUADS + 1;
    let at = |k: usize| k as f64 / QUADS as f64;
    let vertices: Vec<(f64, f64)> = (0..n * n).map(|v| (at(v % n), at(v / n))).collect();
    let mut bytes = Vec::new();
    let mut put = |values: &mut dyn Iterator<Item = f64>| values.for_each(|v| bytes.extend((v as f32).to_le_bytes()));
    put(&mut vertices.iter().flat_map(|&(x, y)| [x, y, 0.1 * (x * 3.0).sin() * y]));
    put(&mut vertices.iter().flat_map(|&(x, y)| [scale * x + offset, scale * (1.0 - y) + offset]));
    let indices = bytes.len();
    for (y, x) in (0..QUADS).flat_map(|y| (0..QUADS).map(move |x| (y, x))) {
        let c = [y * n + x, y * n + x + 1, (y + 1) * n + x + 1, (y + 1) * n + x];
        for v in [c[0], c[1], c[2], c[0], c[2], c[3]] {
            bytes.extend((v as u16).to_le_bytes());
        }
    }
    let color_at = bytes.len();
    if let Some((_, colors)) = colors {
        bytes.extend_from_slice(colors);
    }
    std::fs::write(f.path("p.bin"), &bytes).unwrap();
    let count = 3 * QUADS * QUADS;
    let part = |k: usize| {
        let mut attributes = json!({"POSITION": 0, "TEXCOORD_0": 1});
        if colors.is_some() {
            attributes["COLOR_0"] = json!(4);
        }
        let materials = extra["materials"].as_array().map_or(0, Vec::len);
        let mut part = json!({"attributes": attributes, "indices": 2 + k});
        if materials > 0 {
            part["material"] = json!(k.min(materials - 1));
        }
        part
    };
    let high = [1.0, 1.0, 0.1];
    let mut accessors = vec![
        json!({"bufferView": 0, "componentType": 5126, "count": n * n, "type": "VEC3", "min": [0, 0, 0], "max": high}),
        json!({"bufferView": 1, "componentType": 5126, "count": n * n, "type": "VEC2"}),
        json!({"bufferView": 2, "componentType": 5123, "count": count, "type": "SCALAR"}),
        json!({"bufferView": 2, "byteOffset": 2 * count, "componentType": 5123, "count": count, "type": "SCALAR"}),
    ];
    if let Some((component, _)) = colors {
        accessors.push(json!({"bufferView": 3, "componentType": component, "normalized": component != 5126, "count": n * n, "type": "VEC4"}));
    }
    let views = [(0, 12 * n * n), (12 * n * n, 8 * n * n), (indices, 4 * count), (color_at, bytes.len() - color_at)];
    let views: Vec<Value> = (views.iter().filter(|v| v.1 > 0))
        .map(|(at, length)| json!({"buffer": 0, "byteOffset": at, "byteLength": length}))
        .collect();
    let mut root = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [part(0), part(1)]}],
        "accessors": accessors, "bufferViews": views, "buffers": [{"uri": "p.bin", "byteLength": bytes.len()}],
    });
    for (key, value) in extra.as_object().unwrap() {
        root[key] = value.clone();
    }
    f.write("source.gltf", &root.to_string());
}

#[test]
fn pictures_lie_as_samplers_and_transforms_say() {
    let f = folder();
    let half = SIZE / 2;
    write_image(&picture(half, half, 0), f.path("t.png")).unwrap();
    let of = |x: u32, y: u32| [(255 * x / half) as u8, (255 * y / half) as u8, 0];
    let images = json!([{"uri": "t.png"}, {"uri": "t2.png"}]);
    let textured = |texture: Value| json!({"pbrMetallicRoughness": {"baseColorTexture": texture}});
    // Coordinates from -0.5 to 1.5: mirrored along u, clamped along v.
    write_gltf(
        &f,
        2.0,
        -0.5,
        json!({
            "images": images, "textures": [{"source": 0, "sampler": 0}],
            "samplers": [{"wrapS": 33648, "wrapT": 33071}], "materials": [textured(json!({"index": 0}))],
        }),
        None,
    );
    let mirrored = |x: u32| match x {
        0..16 => 15 - x,
        16..48 => x - 16,
        _ => 47 + half - x,
    };
    let clamped = |y: u32| y.saturating_sub(16).min(half - 1);
    shows(&f, "source.gltf", "", |x, y| of(mirrored(x), clamped(y)));
    // A quarter turn of a picture that is not square, below; above another placement of the same
    // picture.
    write_image(&picture(SIZE, 2 * SIZE, 0), f.path("t2.png")).unwrap();
    let turned = json!({"offset": [0.0, 1.0], "rotation": std::f64::consts::FRAC_PI_2, "scale": [0.5, 1.0]});
    let squeezed = json!({"scale": [1.0, 0.5], "offset": [0.0, 0.25]});
    let transform = |t: &Value| textured(json!({"index": 0, "extensions": {"KHR_texture_transform": t}}));
    write_gltf(
        &f,
        1.0,
        0.0,
        json!({
            "images": images, "textures": [{"source": 1}], "materials": [transform(&turned), transform(&squeezed)],
            "extensionsUsed": ["KHR_texture_transform"], "extensionsRequired": ["KHR_texture_transform"],
        }),
        None,
    );
    let tall = |x: u32, y: u32| [(255 * x / SIZE) as u8, (255 * y / (2 * SIZE)) as u8, 0];
    shows(&f, "source.gltf", "", |x, y| if y < half { tall(x, y + half) } else { tall(y, 2 * SIZE - 1 - x) });
}

#[test]
fn colours_count_as_pictures_and_factors_multiply() {
    let red = |x: u32, y: u32| if y < SIZE / 2 { [255, 0, 0] } else { texel(0)(x, y) };
    let f = with_materials(b"newmtl m\nKd 0.5 0.5 0.5\nmap_Kd t.png\nnewmtl red\nKd 1 0 0\n", "red");
    let ran = shows(&f, "source.obj", "", red);
    assert!(!ran.stderr.contains("no colour"), "{}", ran.stderr);
    // Faces of the colour need no texture coordinates.
    let bare = f.read("source.obj");
    let (below, above) = bare.split_once("usemtl red").unwrap();
    let above: Vec<&str> = above.split('/').collect();
    let above: String = above
        .iter()
        .enumerate()
        .map(|(k, s)| if k == 0 { *s } else { s.trim_start_matches(|c: char| c.is_ascii_digit()) })
        .collect();
    f.write("bare.obj", &format!("{below}usemtl red{above}"));
    shows(&f, "bare.obj", "", red);
    // Nothing but colours: Kd is what viewers show.
    f.write("m.mtl", "newmtl m\nKd 0.2 0.4 0.6\nnewmtl red\nKd 1 0 0\n");
    shows(&f, "source.obj", "", |_, y| if y < SIZE / 2 { [255, 0, 0] } else { [51, 102, 153] });
    // The factors of glTF are light, and multiply pictures as light.
    let f = folder();
    let quarter = json!([0.25, 1.0, 1.0, 1.0]);
    write_gltf(
        &f,
        1.0,
        0.0,
        json!({
            "images": [{"uri": "t.png"}], "textures": [{"source": 0}],
            "materials": [
                {"pbrMetallicRoughness": {"baseColorFactor": quarter, "baseColorTexture": {"index": 0}}},
                {"pbrMetallicRoughness": {"baseColorFactor": quarter}},
            ],
        }),
        None,
    );
    let srgb = |c: f64| if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 };
    let light = |c: f64| if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) };
    let dimmed = |c: u8| (255.0 * srgb(0.25 * light(f64::from(c) / 255.0))).round() as u8;
    shows(&f, "source.gltf", "", |x, y| {
        let [r, g, b] = if y < SIZE / 2 { [255, 255, 255] } else { texel(0)(x, y) };
        [dimmed(r), g, b]
    });
}

#[test]
fn what_has_no_colour_is_named() {
    let f = with_materials(b"newmtl m\nmap_Kd t.png\n", "ghost");
    let ran = transfer(&f, "source.obj", "-o out.png").succeeds();
    assert!(ran.stderr.contains("ghost") && ran.stderr.contains("no colour"), "{}", ran.stderr);
    // Nothing is shown at all: no empty picture.
    f.write("m.mtl", "newmtl other\nmap_Kd t.png\n");
    transfer(&f, "source.obj", "-o none.png").fails(2, &["source.obj", "texture"]);
    assert!(!f.path("none.png").exists());
}

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

/// The plane as PLY whose vertices have red = x, green = y, blue = 1 - x.
fn ply(names: [&str; 3], kind: &str, full: f64) -> String {
    let n = QUADS + 1;
    let at = |k: usize| k as f64 / QUADS as f64;
    let properties: String = names.iter().map(|name| format!("property {kind} {name}\n")).collect();
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n{properties}\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        n * n,
        2 * QUADS * QUADS
    );
    for (y, x) in (0..n).flat_map(|y| (0..n).map(move |x| (at(y), at(x)))) {
        let color = [x, y, 1.0 - x].map(|c| if full > 1.0 { (c * full).round() } else { c });
        text += &format!("{x} {y} {} {} {} {}\n", 0.1 * (x * 3.0).sin() * y, color[0], color[1], color[2]);
    }
    for (y, x) in (0..QUADS).flat_map(|y| (0..QUADS).map(move |x| (y, x))) {
        let c = [y * n + x, y * n + x + 1, (y + 1) * n + x + 1, (y + 1) * n + x];
        text += &format!("3 {} {} {}\n3 {} {} {}\n", c[0], c[1], c[2], c[0], c[2], c[3]);
    }
    text
}

/// Red rises to the right, green upwards, blue to the left.
#[track_caller]
fn is_gradient(image: &Image, within: f32) {
    for (x, y) in [(0, 0), (5, 60), (31, 20), (63, 63), (40, 8)] {
        let (u, v) = ((x as f32 + 0.5) / SIZE as f32, 1.0 - (y as f32 + 0.5) / SIZE as f32);
        for (c, expected) in [u, v, 1.0 - u].into_iter().enumerate() {
            let found = image.get(x, y, c as u32);
            assert!((found - expected).abs() < within, "texel {x} {y} channel {c}: {found}, not {expected}");
        }
    }
}

#[test]
fn vertex_colours_become_a_texture() {
    let f = folder();
    f.write("s.ply", &ply(["red", "green", "blue"], "uchar", 255.0));
    let ran = transfer(&f, "s.ply", "-o out.png").succeeds();
    assert!(ran.stderr.contains("vertex colours are taken"), "{}", ran.stderr);
    is_gradient(&f.image("out.png"), 1.5 / 255.0);
    for (names, kind, full) in [
        (["r", "g", "b"], "float", 1.0),
        (["diffuse_red", "diffuse_green", "diffuse_blue"], "ushort", 65535.0),
        (["Red", "Green", "Blue"], "float", 255.0),
    ] {
        f.write("s.ply", &ply(names, kind, full));
        transfer(&f, "s.ply", "--texture vertex-colors -o out.png").succeeds();
        is_gradient(&f.image("out.png"), 1.5 / 255.0);
    }
    // OBJ, in parts of 255, and beside a picture that comes first.
    let mut text = f.read("target.obj");
    for line in f.read("target.obj").lines().filter(|l| l.starts_with("v ")) {
        let p: Vec<f64> = line.split(' ').skip(1).map(|w| w.parse().unwrap()).collect();
        let color = format!("{line} {} {} {}", 255.0 * p[0], 255.0 * p[1], 255.0 * (1.0 - p[0]));
        text = text.replacen(&format!("{line}\n"), &format!("{color}\n"), 1);
    }
    f.write("s.obj", &text);
    transfer(&f, "s.obj", "-o out.png").succeeds();
    is_gradient(&f.image("out.png"), 1.5 / 255.0);
    f.write("m.mtl", "newmtl m\nmap_Kd t.png\n");
    f.write("s.obj", &format!("mtllib m.mtl\nusemtl m\n{text}"));
    let ran = shows(&f, "s.obj", "", texel(0));
    assert!(ran.stderr.contains("--texture vertex-colors"), "{}", ran.stderr);
    // COLOR_0 holds light: as parts of 65535, and as floats.
    let n = QUADS + 1;
    let light = |c: f64| if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) };
    let at = |k: usize| k as f64 / QUADS as f64;
    let colors = |v: usize| [at(v % n), at(v / n), 1.0 - at(v % n), 1.0].map(light);
    let shorts: Vec<u8> =
        (0..n * n).flat_map(colors).flat_map(|c| ((c * 65535.0).round() as u16).to_le_bytes()).collect();
    let floats: Vec<u8> = (0..n * n).flat_map(colors).flat_map(|c| (c as f32).to_le_bytes()).collect();
    for (component, bytes) in [(5123, &shorts), (5126, &floats)] {
        write_gltf(&f, 1.0, 0.0, json!({"materials": [{}]}), Some((component, bytes)));
        transfer(&f, "source.gltf", "-o out.png").succeeds();
        is_gradient(&f.image("out.png"), 1.5 / 255.0);
    }
    transfer(&f, "target.obj", "--texture vertex-colors -o no.png").fails(2, &["no vertex colours"]);
}

#[test]
fn coloured_points_without_faces_are_a_source() {
    let f = folder();
    let cloud = ply(["red", "green", "blue"], "uchar", 255.0);
    let (head, body) = cloud.split_once("end_header\n").unwrap();
    let points: Vec<&str> = body.lines().take((QUADS + 1) * (QUADS + 1)).collect();
    let head = head.split("element face").next().unwrap();
    f.write("cloud.ply", &format!("{head}end_header\n{}\n", points.join("\n")));
    let ran = transfer(&f, "cloud.ply", "-o out.png --report r.json").succeeds();
    assert!(ran.stderr.contains("no faces") && ran.stderr.contains("nearest points"), "{}", ran.stderr);
    // Points are an eighth apart; the colour is that of a place among the nearest.
    is_gradient(&f.image("out.png"), 0.5 / 8.0);
    assert_eq!(f.json("r.json")["flipped_area"], Value::Null);
    // Without colours there is nothing to take: the error is that of a mesh.
    f.write("bare.ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n");
    transfer(&f, "bare.ply", "-o no.png").fails(1, &["bare.ply", "no face"]);
}

#[test]
fn attributes_read_vertex_colours_of_all_files() {
    let f = folder();
    let color_of = |name: &str| {
        let mesh = barymap::io::read_mesh(f.path(name)).unwrap().mesh;
        mesh.colors[20].map(|c| c * 255.0)[..3].to_vec()
    };
    for (names, kind, full) in [
        (["r", "g", "b"], "uchar", 255.0),
        (["red", "green", "blue"], "float", 255.0),
        (["red", "green", "blue"], "double", 1.0),
    ] {
        f.write("s.ply", &ply(names, kind, full));
        let command = "attributes --source s.ply --target target.obj --anchors a.json --attributes s.ply --kind colors -o out.ply";
        let ran = f.run(command).succeeds();
        assert_eq!(color_of("out.ply"), [64.0, 64.0, 191.0], "{names:?}");
        assert_eq!(ran.stderr.contains("parts of 255"), kind == "float", "{}", ran.stderr);
    }
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
