//! Colours in place of pictures, of materials and of vertices.

use super::*;

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
