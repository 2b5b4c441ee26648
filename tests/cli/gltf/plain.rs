//! Models of targets of other formats.

use super::*;

#[test]
fn a_model_far_from_the_origin_keeps_its_vertices_apart() {
    let f = Folder::empty();
    for offset in [DVec3::new(5e5, 4.6e6, 0.0), DVec3::new(-3.3e6, 120.5, 7e4), DVec3::ZERO] {
        let mut mesh =
            barymap::models::shapes::plane_grid(2, 2, 1.0, 1.0, barymap::models::shapes::Diagonal::Alternating);
        mesh.positions.iter_mut().for_each(|p| *p += offset);
        write_obj(&mesh, f.path("p.obj")).unwrap();
        barymap::io::write_image(
            &barymap::picture::Image::zeros(8, 8, 3, barymap::picture::Depth::U8).unwrap(),
            f.path("p.png"),
        )
        .unwrap();
        f.write("p.txt", "0 0\n2 2\n6 6\n8 8\n");
        f.run(
            "transfer --source p.obj --texture p.png --target p.obj --anchors p.txt -o o.png --size 16 --model m.glb",
        )
        .succeeds();
        let back = read_mesh(f.path("m.glb")).unwrap().mesh;
        let sorted = |m: &Mesh| {
            let mut p: Vec<[u64; 3]> =
                m.positions.iter().map(|p| (*p + DVec3::ZERO).to_array().map(f64::to_bits)).collect();
            p.sort_unstable();
            p
        };
        assert_eq!(sorted(&back), sorted(&mesh), "{offset}");
    }
}

#[test]
fn hard_edges_stay_hard_in_a_model() {
    let f = Folder::empty();
    let mut obj = String::new();
    for k in 0..8 {
        obj += &format!("v {} {} {}\n", k & 1, k >> 1 & 1, k >> 2);
    }
    obj += "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
    for n in ["0 0 -1", "0 0 1", "0 -1 0", "0 1 0", "-1 0 0", "1 0 0"] {
        obj += &format!("vn {n}\n");
    }
    for (n, face) in
        [[1, 3, 4, 2], [5, 6, 8, 7], [1, 2, 6, 5], [3, 7, 8, 4], [1, 5, 7, 3], [2, 4, 8, 6]].iter().enumerate()
    {
        let corners: Vec<String> = face.iter().zip(1..).map(|(v, t)| format!("{v}/{t}/{}", n + 1)).collect();
        obj += &format!("f {}\n", corners.join(" "));
    }
    f.write("c.obj", &obj);
    f.write("c.txt", "0 0\n1 1\n2 2\n4 4\n7 7\n");
    barymap::io::write_image(
        &barymap::picture::Image::zeros(8, 8, 3, barymap::picture::Depth::U8).unwrap(),
        f.path("c.png"),
    )
    .unwrap();
    f.run("transfer --source c.obj --texture c.png --target c.obj --anchors c.txt -o o.png --size 16 --model m.glb")
        .succeeds();
    let (document, buffers, _) = ::gltf::import_slice(f.bytes("m.glb")).unwrap();
    let primitive = document.meshes().next().unwrap().primitives().next().unwrap();
    let reader = primitive.reader(|b| Some(&buffers[b.index()]));
    let (positions, normals): (Vec<Vec3>, Vec<Vec3>) =
        reader.read_positions().unwrap().map(Vec3::from).zip(reader.read_normals().unwrap().map(Vec3::from)).unzip();
    assert_eq!(positions.len(), 24);
    for triangle in reader.read_indices().unwrap().into_u32().collect::<Vec<_>>().chunks(3) {
        let p = [0, 1, 2].map(|k| positions[triangle[k] as usize]);
        let flat = (p[1] - p[0]).cross(p[2] - p[0]).normalize();
        assert!(triangle.iter().all(|&v| normals[v as usize] == flat), "{flat}");
    }
    // New texture coordinates leave them.
    f.run("unwrap m.glb -o n.glb").succeeds();
    let (document, buffers, _) = ::gltf::import_slice(f.bytes("n.glb")).unwrap();
    let primitive = document.meshes().next().unwrap().primitives().next().unwrap();
    let reader = primitive.reader(|b| Some(&buffers[b.index()]));
    assert!(reader.read_normals().unwrap().all(|n| Vec3::from(n).abs().max_element() == 1.0));
}
