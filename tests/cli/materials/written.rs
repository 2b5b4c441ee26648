//! What is written of materials: a model looks as the files that it was made of.

use super::*;

/// The largest difference of two pictures of the same size.
fn apart(a: &Image, b: &Image) -> f32 {
    assert_eq!((a.width, a.height, a.channels), (b.width, b.height, b.channels));
    (0..a.pixels.len()).map(|k| (a.sample(k) - b.sample(k)).abs()).fold(0.0, f32::max)
}

/// Renders `before` and `after` from the front, and compares the pictures.
#[track_caller]
fn look_alike(f: &Folder, before: &str, after: &str) {
    for (file, picture) in [(before, "before.png"), (after, "after.png")] {
        f.run(&format!("render {file} --view 0,0 --size 96 -o {picture}")).succeeds();
    }
    let (before, after) = (f.image("before.png"), f.image("after.png"));
    let off = apart(&before, &after);
    assert!(off <= 1.01 / 255.0, "{off}");
    let different = (0..before.pixels.len()).any(|k| (before.sample(k) - before.sample(4)).abs() > 0.2);
    assert!(different, "there is something to see");
}

/// Writes `source.obj` as GLB in the shape that it has.
fn as_glb(f: &Folder) {
    let held = [0, 8, 72, 80].map(|v| (v, [f64::from(v % 9) / 8.0, f64::from(v / 9) / 8.0]));
    let held = held.map(|(v, [x, y])| json!({"vertex": v, "position": [x, y, 0.1 * (x * 3.0).sin() * y]}));
    f.write("h.json", &json!({"handles": held}).to_string());
    f.run("deform source.obj --handles h.json -o m.glb").succeeds();
}

#[test]
fn a_model_of_an_obj_looks_as_the_obj() {
    for (mtl, upper) in [
        (&b"newmtl m\nKd 0.8 0.5 0.25\nnewmtl n\nKd 0.2 0.4 0.9\n"[..], "n"),
        (b"newmtl m\nKd 0.5 0.5 0.5\nmap_Kd t.png\nnewmtl n\nKd 1 0.25 0\n", "n"),
        (b"newmtl m\nmap_Kd -s 2 3 1 -o 0.25 0.5 0 t.png\nnewmtl n\nmap_Kd -clamp on -s 2 2 -o 0 -1 t.png\n", "n"),
    ] {
        let f = with_materials(mtl, upper);
        as_glb(&f);
        look_alike(&f, "source.obj", "m.glb");
        let (document, ..) = gltf::import_slice(f.bytes("m.glb")).unwrap();
        assert_eq!(document.materials().map(|m| m.name().unwrap().to_owned()).collect::<Vec<_>>(), ["m", "n"]);
    }
    // A diffuse colour is light in glTF.
    let f = with_materials(b"newmtl m\nKd 0.5 1 0\n", "m");
    as_glb(&f);
    let (document, ..) = gltf::import_slice(f.bytes("m.glb")).unwrap();
    let factor = document.materials().next().unwrap().pbr_metallic_roughness().base_color_factor();
    assert!((factor[0] - 0.214_041).abs() < 1e-5 && factor[1..] == [1.0, 0.0, 1.0], "{factor:?}");
}

#[test]
fn a_model_of_a_mesh_without_normals_is_shaded_as_the_mesh() {
    let f = Folder::spheres();
    let mesh = barymap::io::read_mesh(f.path("t.obj")).unwrap().mesh;
    let held = [0, 100, 200, 300].map(|v| json!({"vertex": v, "position": mesh.positions[v].to_array()}));
    f.write("h.json", &json!({"handles": held}).to_string());
    f.run("deform t.obj --handles h.json -o m.glb").succeeds();
    look_alike(&f, "t.obj", "m.glb");
}

#[test]
fn a_picture_without_texture_coordinates_and_colours_of_vertices_are_written() {
    let f = folder();
    std::fs::write(f.path("m.mtl"), "newmtl m\nmap_Kd t.png\n").unwrap();
    f.write("source.obj", &format!("mtllib m.mtl\nusemtl m\n{}", plane("", |v| v.to_string())));
    as_glb(&f);
    let mut text = String::new();
    for line in plane("", |v| v.to_string()).lines() {
        let p: Vec<f64> = line.split(' ').skip(1).filter_map(|w| w.parse().ok()).collect();
        text += &match line.starts_with("v ") {
            true => format!("{line} {} {} {}\n", p[0], p[1], 1.0 - p[0]),
            false => format!("{line}\n"),
        };
    }
    f.write("source.obj", &text);
    as_glb(&f);
    look_alike(&f, "source.obj", "m.glb");
    f.run("deform source.obj --handles h.json -o m.ply").succeeds();
    for name in ["source.obj", "m.glb", "m.ply"] {
        let mesh = barymap::io::read_mesh(f.path(name)).unwrap().mesh;
        assert_eq!((mesh.colors.len(), mesh.vertex_count()), ((QUADS + 1).pow(2), (QUADS + 1).pow(2)), "{name}");
        let off = mesh.positions.iter().zip(&mesh.colors).flat_map(|(p, color)| {
            let wanted = [p.x, p.y, 1.0 - p.x].map(|c| c as f32);
            [0, 1, 2].map(|c| (color[c] - wanted[c]).abs())
        });
        assert!(off.fold(0.0, f32::max) < 1.0 / 255.0, "{name}");
    }
}

#[test]
fn older_glossy_materials_are_read_and_leave_no_metal() {
    let f = folder();
    let glossy = |index: usize| {
        json!({"name": "old", "extensions": {"KHR_materials_pbrSpecularGlossiness": {
            "diffuseTexture": {"index": index, "texCoord": 1}, "glossinessFactor": 0.25}}})
    };
    write_gltf(
        &f,
        1.0,
        0.0,
        json!({
            "images": [{"uri": "t.png"}], "textures": [{"source": 0}], "materials": [glossy(0)],
            "extensionsUsed": ["KHR_materials_pbrSpecularGlossiness"],
        }),
        None,
    );
    // The second set is the first one, a quarter to the right.
    let mut text: Value = serde_json::from_str(&f.read("source.gltf")).unwrap();
    let n = (QUADS + 1) * (QUADS + 1);
    let at = |k: usize| k as f32 / QUADS as f32;
    let moved = (0..n).flat_map(|v| [at(v % (QUADS + 1)) + 0.25, 1.0 - at(v / (QUADS + 1))]);
    std::fs::write(f.path("q.bin"), moved.flat_map(f32::to_le_bytes).collect::<Vec<u8>>()).unwrap();
    text["buffers"].as_array_mut().unwrap().push(json!({"uri": "q.bin", "byteLength": 8 * n}));
    text["bufferViews"].as_array_mut().unwrap().push(json!({"buffer": 1, "byteLength": 8 * n}));
    let view = text["bufferViews"].as_array().unwrap().len() - 1;
    let accessors = text["accessors"].as_array_mut().unwrap();
    accessors.push(json!({"bufferView": view, "componentType": 5126, "count": n, "type": "VEC2"}));
    let accessor = accessors.len() - 1;
    for k in 0..2 {
        text["meshes"][0]["primitives"][k]["attributes"]["TEXCOORD_1"] = accessor.into();
    }
    f.write("source.gltf", &text.to_string());
    let ran = shows(&f, "source.gltf", "", |x, y| texel(0)((x + SIZE / 4) % SIZE, y));
    assert!(ran.stderr.contains("pbrSpecularGlossiness"), "{}", ran.stderr);
    // As a target: the new picture lies on that set, and what is left of the model is no metal.
    f.run(&format!(
        "transfer --source target.obj --texture t2.png --target source.gltf --anchors a.json --size {SIZE} -o o.png \
         --model m.glb"
    ))
    .succeeds();
    let (document, _, images) = gltf::import_slice(f.bytes("m.glb")).unwrap();
    assert_eq!(images.len(), 1, "the picture that is replaced is gone");
    let material = document.materials().next().unwrap();
    let pbr = material.pbr_metallic_roughness();
    assert_eq!((pbr.metallic_factor(), pbr.roughness_factor()), (0.0, 0.75));
    assert_eq!(pbr.base_color_texture().unwrap().tex_coord(), 1);
    assert!(document.extensions_used().next().is_none());
}

#[test]
fn pictures_on_another_set_are_named_and_stay_in_the_file() {
    let f = folder();
    write_gltf(
        &f,
        1.0,
        0.0,
        json!({
            "images": [{"uri": "t.png"}, {"uri": "t2.png"}], "textures": [{"source": 0}, {"source": 1}],
            "materials": [{"name": "coat", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}},
                "occlusionTexture": {"index": 1, "texCoord": 1}}],
        }),
        None,
    );
    let mut text: Value = serde_json::from_str(&f.read("source.gltf")).unwrap();
    for k in 0..2 {
        text["meshes"][0]["primitives"][k]["attributes"]["TEXCOORD_1"] = 1.into();
    }
    f.write("source.gltf", &text.to_string());
    let ran = shows(&f, "source.gltf", "", texel(0));
    let said = &ran.stderr;
    assert!(["coat", "occlusion", "set"].iter().all(|word| said.contains(word)), "{said}");
    let command =
        format!("transfer --source target.obj --texture t2.png --target source.gltf --anchors a.json --size {SIZE}");
    f.run(&format!("{command} -o o.png --model m.glb")).succeeds();
    let (document, _, images) = gltf::import_slice(f.bytes("m.glb")).unwrap();
    assert_eq!(images.len(), 2);
    assert_eq!(document.materials().next().unwrap().occlusion_texture().unwrap().tex_coord(), 1);
}

#[test]
fn factors_multiply_grey_pictures_too() {
    let f = folder();
    let grey = Image::new(4, 4, 1, Pixels::U8(vec![255; 16])).unwrap();
    write_image(&grey, f.path("t.png")).unwrap();
    write_gltf(
        &f,
        1.0,
        0.0,
        json!({
            "images": [{"uri": "t.png"}], "textures": [{"source": 0}],
            "materials": [{"alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [1.0, 0.25, 0.0, 0.5],
                "baseColorTexture": {"index": 0}}}],
        }),
        None,
    );
    transfer(&f, "source.gltf", "-o out.png").succeeds();
    let out = f.image("out.png");
    assert_eq!(out.channels, 4);
    let shown = [0, 1, 2, 3].map(|c| (255.0 * out.get(30, 30, c)).round());
    // A quarter of the light is shown as 137, half the opacity as 128.
    assert_eq!(shown, [255.0, 137.0, 0.0, 128.0]);
}

#[test]
fn decals_are_drawn_where_the_material_shows_the_texel() {
    let f = with_materials(b"newmtl m\nmap_Kd -s 0.5 0.5 1 -o 0.5 0 0 t.png\n", "m");
    let corners = [[0.25, 0.25], [0.75, 0.25], [0.75, 0.75], [0.25, 0.75]]
        .map(|[x, y]: [f64; 2]| json!({"position": [x, y, 0.1 * (x * 3.0).sin() * y]}));
    f.write("d.json", &json!({"anchors": corners}).to_string());
    write_image(&Image::new(8, 8, 3, Pixels::U8([255, 255, 0].repeat(64))).unwrap(), f.path("d.png")).unwrap();
    f.run("decal source.obj --anchors d.json --image d.png --texture t.png -o o.png").succeeds();
    let out = f.image("o.png");
    // Of the picture the right half of the lower half is shown; the decal has the middle of it.
    let is_decal = |x: u32, y: u32| [0, 1, 2].map(|c| out.get(x, y, c)) == [1.0, 1.0, 0.0];
    for (x, y, inside) in
        [(48, 48, true), (42, 42, true), (54, 54, true), (38, 48, false), (16, 48, false), (48, 16, false)]
    {
        assert_eq!(is_decal(x, y), inside, "{x} {y}");
    }
}
