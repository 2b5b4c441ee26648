//! Damaged files of every family that is read: 450 mutants of each, none of which may panic.
//!
//! The mutants are the same on every run. What is written into them is what trips readers: numbers
//! out of range, words of the format in wrong places, counts that lie, pieces missing or twice.

use std::path::Path;

use super::*;
use crate::models::shapes::uv_sphere;
use crate::picture::{Depth, Image, Pixels};

/// Mutants of each family.
const MUTANTS: u64 = 450;

/// Pieces that are set into texts.
const WORDS: [&str; 20] = [
    "nan",
    "-1",
    "1e400",
    "4294967296",
    "-9223372036854775809",
    "99999999999999999999",
    "0",
    "",
    "{",
    "]",
    "\"",
    "\\",
    "\n",
    "\r",
    "\u{feff}",
    "\u{fffd}",
    ",",
    " ",
    "null",
    "<!",
];
/// Numbers that are set into binary files, little-endian.
const NUMBERS: [u32; 6] = [0, 1, 0x7fff_ffff, 0x8000_0000, 0xffff_ffff, 0x7fc0_0000];

/// Numbers in a fixed order (splitmix64).
struct Order(u64);

impl Order {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, count: usize) -> usize {
        (self.next() % count.max(1) as u64) as usize
    }
}

/// Mutant `k` of a file.
fn mutant(seed: &[u8], k: u64) -> Vec<u8> {
    let mut order = Order(k.wrapping_mul(0x0001_0001_0001));
    let mut bytes = seed.to_vec();
    for _ in 0..=order.below(4) {
        let at = order.below(bytes.len());
        let end = (at + 1 + order.below(24)).min(bytes.len());
        match order.below(8) {
            0 if !bytes.is_empty() => bytes[at] = order.next() as u8,
            1 if !bytes.is_empty() => bytes[at] = b'0' + order.below(10) as u8,
            2 => drop(bytes.drain(at..end)),
            3 => bytes.truncate(at),
            4 => {
                let piece = bytes[at..end].to_vec();
                let to = order.below(bytes.len() + 1);
                drop(bytes.splice(to..to, piece));
            }
            5 => {
                let number = NUMBERS[order.below(NUMBERS.len())].to_le_bytes();
                let end = (at + 4).min(bytes.len());
                bytes[at..end].copy_from_slice(&number[..end - at]);
            }
            // In the place of a number or a word.
            6 => {
                let is_part = |b: &u8| b.is_ascii_alphanumeric() || b"+-.".contains(b);
                let first = (0..at).rev().take_while(|&i| is_part(&bytes[i])).last().unwrap_or(at);
                let last = (at..bytes.len()).take_while(|&i| is_part(&bytes[i])).last().map_or(at, |i| i + 1);
                drop(bytes.splice(first..last, WORDS[order.below(WORDS.len())].bytes()));
            }
            _ => drop(bytes.splice(at..at, WORDS[order.below(WORDS.len())].bytes())),
        }
    }
    bytes
}

/// A kind of file: the name it has, an example, and how it is read. A reader says whether it took
/// the file.
struct Family {
    file: String,
    seed: Vec<u8>,
    read: fn(&Path) -> bool,
}

fn family(file: impl Into<String>, seed: impl Into<Vec<u8>>, read: fn(&Path) -> bool) -> Family {
    Family { file: file.into(), seed: seed.into(), read }
}

/// A mesh that is read is whole.
fn mesh(path: &Path) -> bool {
    let _ = read_points(path);
    let Ok(loaded) = read_mesh(path) else { return false };
    let mesh = loaded.mesh;
    assert!(mesh.triangle_count() > 0);
    assert!(mesh.triangles().iter().flatten().all(|v| mesh.positions[*v as usize].is_finite()));
    true
}

fn picture(path: &Path) -> bool {
    // Not more than a few pixels could fill: what a lying header asks for is refused.
    let read = image_file::decode_image(&std::fs::read(path).unwrap(), path);
    read.is_ok_and(|image| image.pixels.len() as u64 == u64::from(image.width * image.height * image.channels))
}

/// Files that other files refer to, by these names.
fn surroundings(folder: &Path) {
    std::fs::write(folder.join("t.png"), image_file::encode_png(&Image::zeros(2, 2, 3, Depth::U8).unwrap()).unwrap())
        .unwrap();
    std::fs::write(folder.join("m.mtl"), "newmtl a\nKd 1 0 0\n").unwrap();
    std::fs::write(folder.join("skeleton.asf"), motion::tests::ASF).unwrap();
}

fn meshes(folder: &Path) -> Vec<Family> {
    let sphere = uv_sphere(1.0, 4, 3);
    write_ply(&sphere, Some(&vec![[1, 2, 3]; sphere.vertex_count()]), folder.join("seed.ply")).unwrap();
    let ply = std::fs::read(folder.join("seed.ply")).unwrap();
    let obj = "mtllib m.mtl\nv 0 0 0 1 0 0\nv 1 0 0\nv 0 1 0\nvt 0 1\nvn 0 0 1\ng a\ns 1\nusemtl a\nf 1/1/1 2//1 3/1 -1\nf -1 -2 \\\n -3\n";
    let ascii = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n\
        property list uchar int vertex_indices\nproperty list uchar float texcoord\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 6 0 0 1 0 0 1\n";
    let mut all = vec![
        family("a.obj", obj, mesh),
        family("a.off", "STOFF\n3 1 0\n0 0 0 1 1\n1 0 0 0 0\n0 1 0 .5 .5\n3 0 1 2\n", mesh),
        family("ascii.ply", ascii, mesh),
        family("binary.ply", ply, mesh),
        family(
            "a.mtl",
            "# by hand\nnewmtl a\nKd 1 0.5 0 # red\nd -halo 0.5\nNs 10\nKe 1 1 1\nmap_Kd -s 2 -o 0.5 0 -mm 0 1 -clamp on t.png\nbump -bm 2 \"t.png\"\n",
            |p| material_library::read(p, &mut source::Notes::default()).is_ok_and(|all| !all.is_empty()),
        ),
    ];
    all.push(family("text.gltf", text_gltf(), mesh));
    for (name, sample) in gltf_samples::all() {
        all.push(family(format!("{name}.glb"), sample.glb(), mesh));
    }
    for (k, (_, bytes)) in gltf_compressed::tests::COMPRESSED.iter().enumerate() {
        all.push(family(format!("compressed_{k}.glb"), *bytes, mesh));
    }
    all
}

/// A triangle with a buffer and a picture by name.
fn text_gltf() -> String {
    let data = "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA";
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0,"scale":[1,1,2]}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"mode":4,"material":0}}]}}],"materials":[{{"name":"m","pbrMetallicRoughness":
        {{"baseColorTexture":{{"index":0}}}}}}],"textures":[{{"source":0}}],"images":[{{"uri":"t.png"}}],
        "buffers":[{{"uri":"data:application/octet-stream;base64,{data}","byteLength":36}}],
        "bufferViews":[{{"buffer":0,"byteOffset":0,"byteLength":36}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}}]}}"#
    )
}

fn lists() -> Vec<Family> {
    let pairs = r#"{"source": [1, {"face": 2, "barycentric": [1, 0, 0]}], "target": [{"position": [1, 2, 3]}, 4], "pairs": [{"name": "a"}, {}]}"#;
    let cage = r#"{"units": "unit", "source": [[0, 0], [1, 0], [1, 1]], "target": [[[0, 0], [1, 0.5], [1, 1]]]}"#;
    let svg = r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9"><g transform="translate(1 2) rotate(30)"><path d="M0 0h4v4C1 2 3 4 5 6A2 3 4 0 1 7 8z"/>
        </g><polygon points="0,0 1,0 1,1"/><rect width="3" height="2" rx="1"/><circle r="4"/></svg>"#;
    let geojson = r#"{"type": "FeatureCollection", "features": [{"type": "Feature", "properties": {"name": "x"}, "geometry":
        {"type": "Polygon", "coordinates": [[[0, 0], [1, 0], [1, 1], [0, 0]]]}}, {"type": "Feature", "geometry": {"type": "MultiPolygon",
        "coordinates": [[[[0, 0], [2, 0], [2, 2], [0, 0]]]]}}]}"#;
    vec![
        family("pairs.json", pairs, |p| anchors::read_pairs(p.to_str().unwrap()).is_ok()),
        family("pairs.txt", "1 2\n3 4 # x\n5 6\n", |p| anchors::read_pairs(p.to_str().unwrap()).is_ok()),
        family("places.json", r#"{"anchors": [1, {"vertex": 2}, {"position": [1, 2, 3], "name": "nose"}]}"#, |p| {
            anchors::read_single(p).is_ok() | anchors::read_places(p).is_ok()
        }),
        family("decal.json", r#"{"anchors": [0, 1, 2, 3], "uv": [[0, 0], [1, 0], [1, 1], [0, 1]]}"#, |p| {
            decal_anchors::read_decal_anchors(p).is_ok()
        }),
        family(
            "handles.json",
            r#"{"handles": [{"vertex": 1, "position": [0, 1, 2]}, {"at": [0, 0, 1], "position": [1, 1, 1]}]}"#,
            |p| {
                let _ = handles::read_handles(p);
                read_handles_on(p, &uv_sphere(1.0, 4, 3)).is_ok()
            },
        ),
        family("region.txt", "1\n2\n3 # three\n", |p| {
            let _ = read_vertices_on(p, &uv_sphere(1.0, 4, 3));
            handles::read_vertex_list(p).is_ok()
        }),
        family(
            "markers.json",
            r#"{"markers": {"LKNE": 47, "HEAD": [0.0, 1.7, 0.1], "ARM": {"vertices": [1, 2]}}}"#,
            |p| read_markers(p).is_ok(),
        ),
        family("mask.txt", "0\n0.5\n1\n", |p| read_mask(p, 3, 2).is_ok()),
        family("cage.json", cage, |p| cage::read_cage(p).is_ok()),
        family("cage.svg", svg, |p| {
            let _ = cage::read_cage(p);
            svg::Svg::read(p).is_ok_and(|file| file.shapes().len() < 1000)
        }),
        family("cage.geojson", geojson, |p| {
            let _ = cage::read_cage(p);
            geojson::GeoJson::read(p).is_ok_and(|file| file.shapes().len() < 1000)
        }),
        family(
            "list.json",
            r#"[{"name": "a", "target": "a.obj", "anchors": "a.json"}, {"target": "b.obj", "anchors": ["x", "y"]}]"#,
            |p| target_list::read_targets(p, None).is_ok(),
        ),
        family("list.csv", "name,target,anchors\na,a.obj,a.json\nb,\"b, c.obj\",b.json\n", |p| {
            target_list::read_targets(p, None).is_ok()
        }),
    ]
}

fn tables(folder: &Path) -> Vec<Family> {
    npy::write_npy(folder.join("seed.npy"), 2, &[1.0, 2.0, 3.0, 4.0], |_| false).unwrap();
    let matrix = std::fs::read(folder.join("seed.npy")).unwrap();
    let attributes = |p: &Path| attribute_table::read_attributes(p, &attribute_table::Columns::Data).is_ok();
    vec![
        family("a.npy", matrix.clone(), |p| npy::read_npy(p).is_ok_and(|m| m.values.len() == 4)),
        family("attributes.csv", "vertex,red,\"a, b\"\n0,0.5,x\n1,0.25,y\n2,1e-3,z\n", attributes),
        family("german.csv", "a;b\n0,5;1\n1,25;2\n", attributes),
        family("attributes.npy", matrix, attributes),
        family("colors.csv", "r,g,b\n0,1,0\n1,0,1\n", |p| attribute_table::read_colors(p).is_ok()),
        family("surface.csv", "face,b0,b1,b2\n0,1,0,0\n3,0.5,0.25,0.25\n", |p| {
            points::read_points(p, &uv_sphere(1.0, 4, 3)).is_ok()
        }),
        family("weights.csv", "0.5,0.25,0.25\n1,0,0\n", |p| points::read_weights(p, 3).is_ok()),
        family("points.csv", "name,x,y\na,1,2\nb,3.5,-4\n", |p| point_table::read_point_table(p).is_ok()),
    ]
}

fn motions() -> Vec<Family> {
    use motion::tests::{AMC, ASF, BVH, TRC, c3d};
    fn read(p: &Path) -> bool {
        read_motion(p).is_ok_and(|m| m.frames.iter().flatten().flatten().all(|p| p.is_finite()))
    }
    let csv = "# rate: 50\ntime,L.x,L.y,L.z,R.x,R.y,R.z\n0,1,2,3,4,5,6\n0.02,1,2,3,4,5,6\n0.04,,,,7,8,9\n";
    vec![
        family("a.c3d", c3d(84, false), read),
        family("vax.c3d", c3d(85, true), read),
        family("mips.c3d", c3d(86, false), read),
        family("a.trc", TRC, read),
        family("a.csv", csv, read),
        family("a.bvh", BVH, read),
        family("skeleton.amc", AMC, read),
        family("bones.asf", ASF, |p| {
            let clip = p.with_file_name("clip.amc");
            std::fs::write(&clip, AMC).unwrap();
            motion::read_acclaim(p, clip).is_ok()
        }),
    ]
}

fn pictures(folder: &Path) -> Vec<Family> {
    let samples: Vec<u8> = (0..5 * 4 * 3).map(|k| (k * 37 % 251) as u8).collect();
    let image = Image::new(5, 4, 3, Pixels::U8(samples)).unwrap();
    let floats = Image::new(3, 2, 3, Pixels::F32((0..18).map(|k| k as f32 / 7.0).collect())).unwrap();
    let mut all = Vec::new();
    for file in ["p.png", "p.jpg", "p.tif", "p.exr", "p.webp", "p.tga", "p.bmp", "p.qoi"] {
        let path = folder.join(file);
        write_image(if file == "p.exr" { &floats } else { &image }, &path).unwrap();
        all.push(family(file, std::fs::read(path).unwrap(), picture));
    }
    for file in ["p.gif", "moving.apng"] {
        let path = folder.join(file);
        let kind = image_file::animation::AnimationFormat::of_name(&path).unwrap();
        image_file::animation::write_animation(&path, kind, &[image.clone(), image.clone()], &Default::default(), 10.0)
            .unwrap();
        all.push(family(file, std::fs::read(path).unwrap(), picture));
    }
    all.push(family("p.ppm", b"P6\n2 2\n255\nabcdefghijkl".to_vec(), picture));
    all.push(family(
        "p.hdr",
        b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n\x80\x40\x20\x81\x80\x40\x20\x81".to_vec(),
        picture,
    ));
    all
}

#[test]
fn no_mutant_of_any_family_panics() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path();
    surroundings(place);
    let mut all = meshes(place);
    all.extend(lists());
    all.extend(tables(place));
    all.extend(motions());
    all.extend(pictures(place));
    assert!(all.len() >= 50, "{} families", all.len());
    let mut faults = Vec::new();
    for family in &all {
        let path = place.join(&family.file);
        std::fs::write(&path, &family.seed).unwrap();
        if !(family.read)(&path) {
            faults.push(format!("{} is not read as it is", family.file));
        }
        let mut taken = 0;
        for k in 0..MUTANTS {
            std::fs::write(&path, mutant(&family.seed, k)).unwrap();
            match std::panic::catch_unwind(|| (family.read)(&path)) {
                Ok(read) => taken += u64::from(read),
                Err(_) => faults.push(format!("{}: mutant {k}", family.file)),
            }
        }
        // Mutants that nobody refuses, or everybody, would try little.
        assert!(taken < MUTANTS || family.seed.len() < 40, "{}: every mutant is read", family.file);
        std::fs::write(&path, &family.seed).unwrap();
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    println!("{MUTANTS} mutants of each of {} families", all.len());
}

#[test]
fn mutants_differ_and_are_the_same_on_every_run() {
    let seed = b"v 1 2 3\nv 4 5 6\n";
    let all: std::collections::HashSet<Vec<u8>> = (0..MUTANTS).map(|k| mutant(seed, k)).collect();
    assert!(all.len() > 400, "{}", all.len());
    assert_eq!(mutant(seed, 7), mutant(seed, 7));
}
