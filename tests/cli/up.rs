//! `--up`: meshes whose files are z up.

use barymap::geometry::UpAxis;
use barymap::io::write_obj;
use barymap::models::stout;
use barymap::picture::Image;
use glam::{Mat4, Vec3};

use crate::support::Folder;

/// `y.obj`, a standing character, and `z.obj`, the same with z up.
fn character() -> Folder {
    let folder = Folder::empty();
    let mut mesh = stout().mesh;
    write_obj(&mesh, folder.path("y.obj")).unwrap();
    mesh.positions.iter_mut().for_each(|p| *p = UpAxis::Z.from_y(*p));
    write_obj(&mesh, folder.path("z.obj")).unwrap();
    folder
}

/// Mean difference of two pictures, 0..1.
fn difference(a: &Image, b: &Image) -> f32 {
    assert_eq!((a.width, a.height, a.channels), (b.width, b.height, b.channels));
    let count = a.width * a.height * a.channels;
    (0..count as usize).map(|i| (a.sample(i) - b.sample(i)).abs()).sum::<f32>() / count as f32
}

#[test]
fn what_stands_along_z_is_shown_upright() {
    let f = character();
    let plain = f.run("render y.obj --size 200 -o y.png").succeeds();
    assert!(!plain.stderr.contains("--up"), "{}", plain.stderr);
    f.run("render y.obj --size 200 --up y -o same.png").succeeds();
    assert_eq!(f.bytes("y.png"), f.bytes("same.png"));
    let turned = f.run("render z.obj --size 200 --up z -o z.png").succeeds();
    assert!(!turned.stderr.contains("--up"), "{}", turned.stderr);
    assert!(difference(&f.image("y.png"), &f.image("z.png")) < 0.002);
    // Without the option it lies, and a note says why.
    let lying = f.run("render z.obj --size 200 -o lying.png").succeeds();
    assert!(lying.stderr.contains("z.obj") && lying.stderr.contains("--up z"), "{}", lying.stderr);
    assert!(difference(&f.image("y.png"), &f.image("lying.png")) > 0.05);
    // Said to be right, it is no news.
    assert!(!f.run("render z.obj --size 200 --up y -o l.png").succeeds().stderr.contains("--up"));
    assert_eq!(f.run("render z.obj --up x -o l.png").code, Some(2));
}

#[test]
fn written_gltf_is_y_up() {
    let f = character();
    f.run("unwrap z.obj --up z -o u.glb").succeeds();
    f.run("unwrap y.obj -o plain.glb").succeeds();
    // Lowest and highest corner of what a viewer shows.
    let bounds = |name: &str| {
        let (document, buffers, _) = gltf::import(f.path(name)).unwrap();
        let (mut low, mut high) = (Vec3::MAX, Vec3::MIN);
        let mut open: Vec<(gltf::Node<'_>, Mat4)> =
            document.scenes().next().unwrap().nodes().map(|n| (n, Mat4::IDENTITY)).collect();
        while let Some((node, outer)) = open.pop() {
            let place = outer * Mat4::from_cols_array_2d(&node.transform().matrix());
            open.extend(node.children().map(|n| (n, place)));
            for primitive in node.mesh().iter().flat_map(|m| m.primitives()) {
                let reader = primitive.reader(|b| Some(&buffers[b.index()]));
                for p in reader.read_positions().unwrap() {
                    let p = place.transform_point3(Vec3::from(p));
                    (low, high) = (low.min(p), high.max(p));
                }
            }
        }
        (low, high)
    };
    let ((low, high), (plain_low, plain_high)) = (bounds("u.glb"), bounds("plain.glb"));
    assert!(
        low.distance(plain_low) < 1e-4 && high.distance(plain_high) < 1e-4,
        "{low} {high}, {plain_low} {plain_high}"
    );
    // Without the option a note says that it will lie.
    assert!(f.run("unwrap z.obj -o l.glb").succeeds().stderr.contains("--up z"));
}
