//! Materials as other programs write them: names, placements, colours without pictures, vertex
//! colours, normals.
//!
//! Source and target are the same plane, so that the result is what the source's picture shows,
//! texel by texel.

mod colors;
mod placed;
mod relief;
mod text;
mod written;

use barymap::io::{read_image, write_image};
use barymap::picture::{Image, Pixels};
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
    let rises = vertices.iter().map(|&(x, y)| (0.1 * (x * 3.0).sin() * y) as f32);
    let high = [1.0, 1.0, rises.fold(0.0, f32::max)];
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
