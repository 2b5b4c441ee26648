use super::*;
use crate::engine::Engine;
use crate::geometry::ClosestPoints;
use crate::geometry::material::{Placement, Wrap};
use crate::models::shapes::{Diagonal, Random, icosphere, irregular_plane, plane_grid, tube};
use crate::picture::{Image, Pixels};
use crate::progress::Quiet;
use crate::tools::transfer::Filter;

/// The closest points of a mesh.
fn on(mesh: &Mesh, points: [DVec3; 4]) -> [SurfacePoint; 4] {
    let closest = ClosestPoints::new(mesh, &Topology::new(mesh));
    points.map(|p| closest.nearest(p).unwrap().0)
}

/// Corners of a square on the cap within `degrees` of the sphere's z axis.
fn cap(mesh: &Mesh, degrees: f64) -> DecalAnchors {
    let (s, c) = degrees.to_radians().sin_cos();
    let d = s / 2f64.sqrt();
    DecalAnchors::corners(on(mesh, [(-d, -d), (d, -d), (d, d), (-d, d)].map(|(x, y)| DVec3::new(x, y, c))))
}

fn lay(mesh: &Mesh, anchors: &DecalAnchors, layout: Layout) -> Result<Decal> {
    decal(mesh, &Topology::new(mesh), anchors, layout, 1.0, &Quiet)
}

/// Every coordinate moved by up to `amount`.
fn rough(mesh: &Mesh, amount: f64, seed: u64) -> Mesh {
    let mut random = Random::new(seed);
    let mut mesh = mesh.clone();
    for p in &mut mesh.positions {
        *p += DVec3::new(random.signed(), random.signed(), random.signed()) * amount;
    }
    mesh
}

#[test]
fn a_plane_is_exact_and_its_patch_is_the_picture() {
    let mesh = irregular_plane(40, 40, 1.0, 1.0, Diagonal::Alternating, 0.3, 3);
    // A parallelogram inside faces.
    let (origin, e, f) = (DVec2::new(0.3, 0.3), DVec2::new(0.4, 0.1), DVec2::new(-0.1, 0.4));
    let at = [origin, origin + e, origin + e + f, origin + f].map(|p| p.extend(0.0));
    let made = lay(&mesh, &DecalAnchors::corners(on(&mesh, at)), Layout::Plate).unwrap();
    let to_picture = glam::DMat2::from_cols(e, f).inverse();
    let mut seen = 0;
    for (p, uv) in mesh.positions.iter().zip(&made.uv) {
        let Some(uv) = uv else { continue };
        assert!(uv.distance(to_picture * (p.truncate() - origin)) < 1e-9, "{p} {uv}");
        seen += 1;
    }
    assert!(seen > 300);
    // The patch is every triangle that meets the square.
    for t in 0..mesh.triangle_count() as u32 {
        let centre = mesh.triangle_positions(t as usize).iter().sum::<DVec3>() / 3.0;
        let q = to_picture * (centre.truncate() - origin);
        if q.min_element() > 0.0 && q.max_element() < 1.0 {
            assert!(made.patch.binary_search(&t).is_ok());
        }
        if q.min_element() < -0.15 || q.max_element() > 1.15 {
            assert!(made.patch.binary_search(&t).is_err());
        }
    }
    let r = made.report;
    assert!(r.stretch_all > 0.9999 && r.flipped_faces == 0 && !r.mirrored && r.anchor_error < 1e-12, "{r:?}");
    assert!(r.shown == 1.0 && r.shown_twice == 0.0, "{r:?}");
    // The paper's layout is as exact as its embedding.
    let averages = lay(&mesh, &DecalAnchors::corners(on(&mesh, at)), Layout::Averages).unwrap();
    let corners = made.patch.iter().flat_map(|&t| mesh.triangle(t as usize));
    let off = corners.filter_map(|v| Some(made.uv[v as usize]?.distance(averages.uv[v as usize]?)));
    let (off, stretch) = (off.fold(0.0, f64::max), averages.report.stretch_all);
    assert!(off < 0.02 && stretch > 0.999, "{off} {stretch}");
}

#[test]
fn many_anchors_bend_the_picture_and_are_met() {
    let mesh = irregular_plane(30, 30, 1.0, 1.0, Diagonal::Alternating, 0.3, 8);
    let closest = ClosestPoints::new(&mesh, &Topology::new(&mesh));
    let grid: Vec<DVec2> = (0..36).map(|k| DVec2::new(f64::from(k % 6), f64::from(k / 6)) / 5.0).collect();
    let points = grid.iter().map(|q| closest.nearest((*q * 0.6 + 0.2).extend(0.0)).unwrap().0).collect();
    let straight = DecalAnchors { points, uv: grid };
    let off = |made: &Decal| {
        let places = mesh.positions.iter().zip(&made.uv);
        places.filter_map(|(p, uv)| Some((*uv)?.distance((p.truncate() - 0.2) / 0.6))).fold(0.0, f64::max)
    };
    let made = lay(&mesh, &straight, Layout::Plate).unwrap();
    assert!(off(&made) < 1e-8 && made.report.shown == 1.0, "{} {:?}", off(&made), made.report);
    let mut bent = straight.clone();
    bent.uv[14] += DVec2::new(0.03, -0.02);
    let made = lay(&mesh, &bent, Layout::Plate).unwrap();
    assert!(made.report.anchor_error < 1e-9 && made.report.flipped_faces == 0, "{:?}", made.report);
    assert!((0.02..0.08).contains(&off(&made)), "{}", off(&made));
}

#[test]
fn a_label_on_a_tube_is_flat() {
    let mesh = tube(1.0, 3.0, 60, 30, Diagonal::Alternating);
    let corner = |angle: f64, y: f64| DVec3::new(angle.sin(), y, angle.cos());
    let at = [corner(-0.7, 1.0), corner(0.7, 1.0), corner(0.7, 2.0), corner(-0.7, 2.0)];
    let anchors = DecalAnchors::corners(on(&mesh, at));
    // 1.4 wide and 1 high.
    let made = decal(&mesh, &Topology::new(&mesh), &anchors, Layout::Plate, 1.4, &Quiet).unwrap();
    let r = made.report;
    assert!(r.stretch_all > 0.9995 && r.flipped_faces == 0 && r.shown == 1.0, "{r:?}");
    // The proportions count: for a square picture it is stretched.
    assert!(lay(&mesh, &anchors, Layout::Plate).unwrap().report.stretch_all < 0.95);
    // Nothing appears on the far side.
    assert!(made.patch.iter().all(|&t| mesh.triangle_positions(t as usize)[0].z > 0.5));
}

#[test]
fn a_cap_keeps_its_stretch_under_noise() {
    let mesh = icosphere(1.0, 4);
    let diagonal = 2.0 * 3f64.sqrt();
    // One percent of the diagonal is half an edge here: too much for embeddings.
    for (layout, amounts) in [(Layout::Plate, vec![0.01, 0.01 * diagonal]), (Layout::Averages, vec![0.01])] {
        for degrees in [20.0, 30.0, 40.0] {
            let smooth = lay(&mesh, &cap(&mesh, degrees), layout).unwrap().report;
            assert!(smooth.stretch_all >= 0.99 && smooth.flipped_faces == 0, "{layout:?} {degrees}: {smooth:?}");
            for &amount in &amounts {
                let noisy = lay(&rough(&mesh, amount, 5), &cap(&mesh, degrees), layout).unwrap().report;
                let (before, after) = (smooth.stretch_all, noisy.stretch_all);
                println!("{layout:?} {degrees} degrees: {before:.4}, with noise of {amount:.4} {after:.4}");
                assert!((before - after).abs() < 0.05, "{layout:?} {degrees}: {noisy:?}");
            }
        }
    }
    // A cap twice as wide.
    assert!(lay(&mesh, &cap(&mesh, 60.0), Layout::Plate).unwrap().report.stretch_all > 0.98);
}

#[test]
fn what_is_wrong_is_named() {
    let mesh = plane_grid(10, 10, 1.0, 1.0, Diagonal::Forward);
    let good = DecalAnchors::corners(on(
        &mesh,
        [(0.2, 0.2), (0.8, 0.2), (0.8, 0.8), (0.2, 0.8)].map(|(x, y)| DVec3::new(x, y, 0.0)),
    ));
    let fails = |anchors: &DecalAnchors, expected: &str| {
        let message = lay(&mesh, anchors, Layout::Plate).unwrap_err().to_string();
        assert!(message.contains(expected), "{message:?} lacks {expected:?}");
    };
    let changed = |change: &dyn Fn(&mut DecalAnchors)| {
        let mut a = good.clone();
        change(&mut a);
        a
    };
    assert!(lay(&mesh, &good, Layout::Plate).is_ok());
    fails(&DecalAnchors::default(), "too few");
    fails(&changed(&|a| a.uv[2] = a.uv[1]), "contradict");
    fails(&changed(&|a| a.points[2] = a.points[1]), "contradict");
    fails(&changed(&|a| a.uv.swap(1, 2)), "turned over");
    fails(&changed(&|a| a.uv[1].x = f64::NAN), "anchor 1");
    fails(&changed(&|a| a.points[3].face = 5000), "anchor 3");
    fails(&changed(&|a| a.points[3].barycentric = [2.0, -1.0, 0.0]), "anchor 3");
    fails(&changed(&|a| a.uv.iter_mut().enumerate().for_each(|(k, q)| *q = DVec2::splat(k as f64 / 4.0))), "one line");
    fails(&changed(&|a| a.uv.truncate(3)), "in the picture");
    let square = lay(&mesh, &good, Layout::Plate).unwrap();
    assert!(decal(&mesh, &Topology::new(&mesh), &good, Layout::Plate, f64::NAN, &Quiet).is_err());
    // From inside it is a mirror.
    let mirrored = changed(&|a| a.points.reverse());
    assert!(!square.report.mirrored && lay(&mesh, &mirrored, Layout::Plate).unwrap().report.mirrored);
    // On two components.
    let mut positions = mesh.positions.clone();
    positions.extend(mesh.positions.iter().map(|p| *p + DVec3::Z));
    let n = mesh.vertex_count() as u32;
    let mut triangles = mesh.triangles();
    triangles.extend(mesh.triangles().iter().map(|t| t.map(|v| v + n)));
    let two = Mesh::of_triangles("two", positions, &triangles);
    let apart = changed(&|a| a.points[2].face += mesh.triangle_count() as u32);
    let message = lay(&two, &apart, Layout::Plate).unwrap_err().to_string();
    assert!(message.contains("0 and 2") && message.contains("not connected"), "{message}");
}

#[test]
fn a_picture_beyond_the_border_is_told() {
    let mesh = plane_grid(20, 20, 1.0, 1.0, Diagonal::Forward);
    // The middle of the picture's left edge is the plane's middle: its right half is beyond.
    let points = on(&mesh, [(0.5, 0.2), (0.9, 0.2), (0.9, 0.8), (0.5, 0.8)].map(|(x, y)| DVec3::new(x, y, 0.0)));
    let uv = [(0.0, 0.2), (0.4, 0.2), (0.4, 0.8), (0.0, 0.8)].map(DVec2::from).to_vec();
    let made = lay(&mesh, &DecalAnchors { points: points.to_vec(), uv }, Layout::Plate).unwrap();
    assert!((made.report.shown - 0.5).abs() < 0.01 && made.report.stretch_all > 0.999, "{:?}", made.report);
}

#[test]
fn painting_a_plane_is_sampling_the_picture() {
    // The texture of the plane is the unit square; the picture covers [0.25, 0.75]^2 of it.
    let mesh = plane_grid(16, 16, 1.0, 1.0, Diagonal::Forward);
    let (lo, hi) = (0.25, 0.75);
    let anchors =
        DecalAnchors::corners(on(&mesh, [(lo, lo), (hi, lo), (hi, hi), (lo, hi)].map(|(x, y)| DVec3::new(x, y, 0.0))));
    let made = lay(&mesh, &anchors, Layout::Plate).unwrap();
    // 32 x 32 texels of the texture are 32 x 32 of the picture: texel by texel.
    let picture = Image::new(32, 32, 3, Pixels::U8((0..32 * 32 * 3).map(|i| (i * 37 % 251) as u8).collect())).unwrap();
    let options = PaintOptions {
        width: 64,
        height: 64,
        margin: 2,
        filter: Filter::Bilinear,
        supersample: 1,
        linear_light: false,
        material: None,
        memory: 1 << 30,
    };
    let painted = paint(&Engine::cpu(), &mesh, &made, &picture, &options, &Quiet).unwrap();
    let base = Image::new(64, 64, 3, Pixels::U8((0..64 * 64 * 3).map(|i| (i * 11 % 241) as u8).collect())).unwrap();
    let result = composite(&base, &painted.image, 1.0, false).unwrap();
    let mut worst = 0.0_f32;
    for y in 0..64 {
        for x in 0..64 {
            for c in 0..3 {
                let inside = (16..48).contains(&x) && (16..48).contains(&y);
                let got = result.get(x, y, c);
                if inside {
                    worst = worst.max((got - picture.get(x - 16, y - 16, c)).abs());
                } else {
                    assert_eq!(got, base.get(x, y, c), "texel {x} {y} outside changed");
                }
            }
        }
    }
    assert!(worst < 0.02, "{worst}");
    // Half opaque lies half way.
    let half = composite(&base, &painted.image, 0.5, false).unwrap();
    let wanted = 0.5 * (base.get(30, 30, 1) + result.get(30, 30, 1));
    assert!((half.get(30, 30, 1) - wanted).abs() < 0.005);
    // A mesh without texture coordinates is told about `barymap unwrap`.
    let bare = Mesh::of_triangles("bare", mesh.positions.clone(), &mesh.triangles());
    let error = paint(&Engine::cpu(), &bare, &made, &picture, &options, &Quiet).unwrap_err();
    assert!(error.to_string().contains("barymap unwrap"), "{error}");
}

#[test]
fn small_decals_are_averaged_not_sampled() {
    // A chequered picture whose squares are much smaller than texels is grey, though the decal is a
    // thousandth of the surface.
    let mesh = plane_grid(64, 64, 1.0, 1.0, Diagonal::Forward);
    let (lo, hi) = (0.5, 0.53125);
    let anchors =
        DecalAnchors::corners(on(&mesh, [(lo, lo), (hi, lo), (hi, hi), (lo, hi)].map(|(x, y)| DVec3::new(x, y, 0.0))));
    let made = lay(&mesh, &anchors, Layout::Plate).unwrap();
    let chequered = (0..512 * 512).map(|i: u32| if (i % 512 + i / 512).is_multiple_of(2) { 255 } else { 0 }).collect();
    let picture = Image::new(512, 512, 1, Pixels::U8(chequered)).unwrap();
    let options = PaintOptions {
        width: 512,
        height: 512,
        margin: 0,
        filter: Filter::Anisotropic,
        supersample: 1,
        linear_light: false,
        material: None,
        memory: 1 << 30,
    };
    let painted = paint(&Engine::cpu(), &mesh, &made, &picture, &options, &Quiet).unwrap().image;
    let mut full = 0;
    for i in 0..512 * 512 {
        if painted.sample(4 * i + 3) > 0.99 {
            assert!((painted.sample(4 * i) - 0.5).abs() < 0.05, "{}", painted.sample(4 * i));
            full += 1;
        }
    }
    assert!(full >= 14 * 14, "{full}");
}

#[test]
fn coordinates_are_handed_out_for_the_patch() {
    let mesh = icosphere(1.0, 3);
    let made = lay(&mesh, &cap(&mesh, 30.0), Layout::Plate).unwrap();
    let whole = with_texcoords(&mesh, &made, false);
    assert_eq!((whole.positions.len(), whole.triangles()), (mesh.positions.len(), mesh.triangles()));
    for t in 0..whole.triangle_count() {
        let shows = made.patch.binary_search(&(t as u32)).is_ok();
        assert_eq!(whole.triangle_texcoords(t).is_some(), shows);
    }
    let part = with_texcoords(&mesh, &made, true);
    assert_eq!(part.triangle_count(), made.patch.len());
    assert!(part.vertex_count() < mesh.vertex_count() / 4);
    for (k, &t) in made.patch.iter().enumerate() {
        assert_eq!(part.triangle_positions(k), mesh.triangle_positions(t as usize));
        let uv = mesh.triangle(t as usize).map(|v| made.uv[v as usize].unwrap());
        assert_eq!(part.triangle_texcoords(k).unwrap(), uv);
    }
}

#[test]
fn one_picture_over_another() {
    let over = Image::new(2, 1, 4, Pixels::U8(vec![200, 100, 0, 255, 9, 9, 9, 0])).unwrap();
    let grey = Image::new(2, 1, 1, Pixels::U16(vec![1000, 2000])).unwrap();
    let result = composite(&grey, &over, 1.0, false).unwrap();
    assert_eq!(result.pixels, Pixels::U16(vec![51400, 25700, 0, 2000, 2000, 2000]));
    // Upon nothing it is itself.
    let nothing = Image::new(2, 1, 4, Pixels::U8(vec![0; 8])).unwrap();
    let result = composite(&nothing, &over, 0.5, true).unwrap();
    assert_eq!(result.pixels, Pixels::U8(vec![200, 100, 0, 128, 0, 0, 0, 0]));
    assert!(composite(&Image::new(1, 1, 3, Pixels::U8(vec![0; 3])).unwrap(), &over, 1.0, false).is_err());
}

#[test]
fn mirrored_and_clamped_textures_get_what_they_show() {
    // The texture lies on the left half of the plane, and beyond its right border once more.
    let plane = plane_grid(16, 16, 1.0, 1.0, Diagonal::Forward);
    let mut builder = MeshBuilder::new("plane");
    builder.mesh.positions.clone_from(&plane.positions);
    builder.mesh.texcoords = plane.texcoords.iter().map(|uv| DVec2::new(2.0 * uv.x, uv.y)).collect();
    builder.mesh.materials = vec![Default::default()];
    builder.material = 0;
    (0..plane.polygon_count()).for_each(|p| builder.polygon(plane.polygon(p).iter().copied()));
    let mesh = builder.finish();
    let colors = |x: u32, y: u32| [8 * x as u8, 4 * y as u8, 200];
    let samples = (0..32 * 64).flat_map(|i| colors(i % 32, i / 32)).collect();
    let picture = Image::new(32, 64, 3, Pixels::U8(samples)).unwrap();
    let options = PaintOptions {
        width: 64,
        height: 64,
        margin: 0,
        filter: Filter::Bilinear,
        supersample: 1,
        linear_light: false,
        material: None,
        memory: 1 << 30,
    };
    let painted = |left: f64, wrap: Wrap| {
        let corners = [(left, 0.25), (left + 0.25, 0.25), (left + 0.25, 0.75), (left, 0.75)];
        let anchors = DecalAnchors::corners(on(&mesh, corners.map(|(x, y)| DVec3::new(x, y, 0.0))));
        let made = lay(&mesh, &anchors, Layout::Plate).unwrap();
        let placement = Placement { wrap: [wrap, Wrap::Repeat], ..Placement::default() };
        paint_placed(&Engine::cpu(), &mesh, &[placement], &made, &picture, &options, &Quiet).unwrap()
    };
    let mirror = |image: &Image| {
        let mut other = image.clone();
        let places = (0..64).flat_map(|y| (0..64).map(move |x| (x, y)));
        places.for_each(|(x, y)| (0..4).for_each(|c| other.set(63 - x, y, c, image.get(x, y, c))));
        other
    };
    let off = |a: &Image, b: &Image| (0..a.pixels.len()).map(|k| (a.sample(k) - b.sample(k)).abs()).fold(0.0, f32::max);
    // On the right half: its repeat is the same texels, its mirror image the other way round.
    let (repeated, mirrored) = (painted(0.625, Wrap::Repeat), painted(0.625, Wrap::Mirror));
    let (same, other) = (off(&mirrored.image, &mirror(&repeated.image)), off(&mirrored.image, &repeated.image));
    assert!(same < 0.02 && other > 0.3, "{same} {other}");
    assert_eq!((mirrored.texels, mirrored.stats.overlapping), (repeated.texels, 0));
    // On the left half there is nothing to turn over.
    let left = painted(0.125, Wrap::Repeat).image;
    assert!(off(&painted(0.125, Wrap::Mirror).image, &left) < 0.02);
    // Across the border both halves are in the same texels, up to it.
    let across = painted(0.375, Wrap::Mirror);
    let alpha = |x: u32| across.image.get(x, 32, 3);
    assert!(alpha(60) == 1.0 && alpha(50) == 1.0 && alpha(40) == 0.0 && alpha(3) == 0.0);
    assert!(across.stats.overlapping > 300, "{}", across.stats.overlapping);
    // Beyond a clamped border there is no texel of its own.
    let clamped = painted(0.625, Wrap::Clamp);
    assert!((0..64 * 64).all(|i| clamped.image.sample(4 * i + 3) == 0.0));
    assert!(off(&painted(0.125, Wrap::Clamp).image, &left) < 0.02);
    // Repeats side by side beyond reason are refused.
    let mut far = mesh.clone();
    far.map_texcoords(|_, uv| DVec2::new(1e4 * uv.x, uv.y));
    let corners = [(0.2, 0.2), (0.8, 0.2), (0.8, 0.8), (0.2, 0.8)];
    let anchors = DecalAnchors::corners(on(&far, corners.map(|(x, y)| DVec3::new(x, y, 0.0))));
    let made = lay(&far, &anchors, Layout::Plate).unwrap();
    let placement = Placement { wrap: [Wrap::Mirror; 2], ..Placement::default() };
    let error = paint_placed(&Engine::cpu(), &far, &[placement], &made, &picture, &options, &Quiet).unwrap_err();
    assert!(error.to_string().contains("repeats"), "{error}");
}
