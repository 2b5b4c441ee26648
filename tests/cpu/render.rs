//! Pictures of meshes: what is seen, from where, and what cannot be seen.

use barymap::geometry::{Mesh, SurfacePoint, UpAxis};
use barymap::models::shapes::{Diagonal, icosphere, plane_grid, uv_sphere};
use barymap::picture::Image;
use barymap::tools::render::{Coloring, RenderOptions, render, side_by_side};
use glam::DVec3;

const RED: [u8; 3] = [255, 0, 0];
const BLUE: [u8; 3] = [0, 0, 255];

fn flat(width: u32, height: u32) -> RenderOptions {
    RenderOptions {
        width,
        height,
        azimuth: 0.0,
        elevation: 0.0,
        field_of_view: 0.0,
        margin: 0.25,
        lighting: false,
        ..RenderOptions::default()
    }
}

fn pixels(image: &Image) -> impl Iterator<Item = [u8; 4]> {
    (0..image.height).flat_map(move |y| (0..image.width).map(move |x| image.pixel(x, y)))
}

#[test]
fn a_square_covers_exactly_its_pixels() {
    let square = plane_grid(1, 1, 2.0, 2.0, Diagonal::Forward);
    for field_of_view in [0.0, 40.0] {
        let options = RenderOptions { field_of_view, ..flat(40, 40) };
        let picture = render(&square, Coloring::Plain(RED), &[], &options).unwrap();
        for (x, y) in (0..picture.height).flat_map(|y| (0..picture.width).map(move |x| (x, y))) {
            let p = picture.pixel(x, y);
            let inside = (10..30).contains(&x) && (10..30).contains(&y);
            let expected = if inside { [255, 0, 0, 255] } else { [255; 4] };
            assert_eq!(p, expected, "({x}, {y}) at {field_of_view} degrees");
        }
    }
}

/// Two squares, red in front of blue seen from +z.
fn stack() -> (Mesh, Vec<[u8; 3]>) {
    let corner = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
    let mut positions = Vec::new();
    for z in [1.0, -1.0] {
        positions.extend([corner(-1.0, -1.0, z), corner(1.0, -1.0, z), corner(1.0, 1.0, z), corner(-1.0, 1.0, z)]);
    }
    let triangles = [[4, 5, 6], [0, 1, 2], [0, 2, 3], [4, 6, 7]];
    let colors = (0..8).map(|v| if v < 4 { RED } else { BLUE }).collect();
    (Mesh::from_triangles("stack", positions, &triangles).unwrap(), colors)
}

#[test]
fn the_nearer_square_hides_the_other() {
    let (mesh, colors) = stack();
    for (azimuth, expected) in [(0.0, RED), (180.0, BLUE)] {
        for field_of_view in [0.0, 30.0] {
            let options = RenderOptions { azimuth, field_of_view, ..flat(21, 21) };
            let picture = render(&mesh, Coloring::Vertices(&colors), &[], &options).unwrap();
            assert_eq!(picture.pixel(10, 10)[..3], expected, "{azimuth} {field_of_view}");
        }
    }
}

#[test]
fn a_mesh_that_stands_along_z_looks_as_along_y() {
    // A body that has no symmetry: a ball that is stretched and bent.
    let mut upright = barymap::models::shapes::uv_sphere(1.0, 40, 24);
    upright
        .positions
        .iter_mut()
        .for_each(|p| *p = DVec3::new(0.6 * p.x + 0.3 * p.y * p.y, 1.5 * p.y, 0.8 * p.z + 0.2 * p.x));
    let colors: Vec<[u8; 3]> = upright.positions.iter().map(|p| if p.y > 0.5 { RED } else { BLUE }).collect();
    let mut along_z = upright.clone();
    along_z.positions.iter_mut().for_each(|p| *p = UpAxis::Z.from_y(*p));
    for (azimuth, elevation) in [(0.0, 0.0), (70.0, 25.0)] {
        let options = RenderOptions { azimuth, elevation, lighting: true, field_of_view: 25.0, ..flat(120, 120) };
        let expected = render(&upright, Coloring::Vertices(&colors), &[], &options).unwrap();
        let differing = |picture: &Image| {
            pixels(picture).zip(pixels(&expected)).filter(|(a, b)| (0..3).any(|k| a[k].abs_diff(b[k]) > 2)).count()
        };
        let turned =
            render(&along_z, Coloring::Vertices(&colors), &[], &RenderOptions { up: UpAxis::Z, ..options.clone() })
                .unwrap();
        // Sums in another order decide for the other side of an edge here and there.
        assert!(differing(&turned) < 15, "{}", differing(&turned));
        let lying = render(&along_z, Coloring::Vertices(&colors), &[], &options).unwrap();
        assert!(differing(&lying) > 1000);
    }
}

#[test]
fn backs_are_darker() {
    let square = plane_grid(1, 1, 1.0, 1.0, Diagonal::Forward);
    let look = |azimuth: f64| {
        let options = RenderOptions { azimuth, lighting: true, ..flat(9, 9) };
        u32::from(render(&square, Coloring::Plain([200; 3]), &[], &options).unwrap().pixel(4, 4)[0])
    };
    assert!(look(0.0) > look(180.0) + 40, "{} {}", look(0.0), look(180.0));
}

#[test]
fn texture_rows_start_at_the_top() {
    // Four fields: red above left, green above right, blue below left, white below right.
    let texture = Image::from_fn(64, 64, |x, y| match (x < 32, y < 32) {
        (true, true) => [255, 0, 0, 255],
        (false, true) => [0, 255, 0, 255],
        (true, false) => [0, 0, 255, 255],
        (false, false) => [255; 4],
    })
    .unwrap();
    let square = plane_grid(3, 3, 1.0, 1.0, Diagonal::Alternating);
    let picture = render(&square, Coloring::Texture(&texture), &[], &flat(40, 40)).unwrap();
    let at = |x, y| picture.pixel(x, y);
    assert_eq!([at(15, 15), at(25, 15)], [[255, 0, 0, 255], [0, 255, 0, 255]]);
    assert_eq!([at(15, 25), at(25, 25)], [[0, 0, 255, 255], [255; 4]]);
    // The same texture through a material index that does not exist falls back to grey.
    let picture = render(&square, Coloring::Materials(&[None]), &[], &flat(40, 40)).unwrap();
    assert_eq!(picture.pixel(20, 20), [176, 176, 176, 255]);
}

#[test]
fn perspective_keeps_straight_lines_of_the_texture_straight() {
    // A plane seen at a slant: its middle line in the texture is the straight line between the
    // middles of its two ends.
    let mut plane = plane_grid(1, 1, 1.0, 1.0, Diagonal::Forward);
    for p in &mut plane.positions {
        *p = DVec3::new(p.x - 0.5, 0.0, 4.0 * (0.5 - p.y));
    }
    let texture = Image::from_fn(256, 256, |_, y| if y < 128 { [255, 0, 0, 255] } else { [0, 0, 255, 255] }).unwrap();
    let options = RenderOptions { elevation: 25.0, field_of_view: 60.0, margin: 0.0, ..flat(200, 200) };
    let picture = render(&plane, Coloring::Texture(&texture), &[], &options).unwrap();
    // The row where red turns to blue is the same in all columns the plane covers there, also
    // across the diagonal.
    let rows: Vec<u32> = (90..110)
        .map(|x| {
            (0..199)
                .find(|&y| {
                    picture.pixel(x, y)[0] > 200
                        && picture.pixel(x, y)[1] < 50
                        && picture.pixel(x, y + 1)[2] > picture.pixel(x, y + 1)[0]
                })
                .unwrap()
        })
        .collect();
    assert!(rows.iter().all(|r| r.abs_diff(rows[0]) <= 1), "{rows:?}");
}

#[test]
fn nothing_to_see_gives_the_background() {
    let background = [10, 20, 30, 40];
    let options = RenderOptions { background, ..flat(5, 4) };
    let nan = Mesh::from_triangles("nan", vec![DVec3::NAN; 3], &[[0, 1, 2]]).unwrap();
    let point = Mesh::from_triangles("point", vec![DVec3::ONE; 3], &[[0, 1, 2]]).unwrap();
    let huge = [DVec3::splat(f64::MAX), DVec3::splat(-f64::MAX), DVec3::X];
    let huge = Mesh::from_triangles("huge", huge.to_vec(), &[[0, 1, 2]]).unwrap();
    for mesh in [Mesh::from_triangles("empty", Vec::new(), &[]).unwrap(), nan, point, huge] {
        let anchors = [SurfacePoint::new(0, [1.0, 0.0, 0.0]), SurfacePoint::new(9, [f64::NAN; 3])];
        let picture = render(&mesh, Coloring::Plain(RED), &anchors, &options).unwrap();
        assert_eq!((picture.width, picture.height), (5, 4));
        if mesh.name != "point" {
            assert!(pixels(&picture).all(|p| p == background), "{}", mesh.name);
        }
    }
}

#[test]
fn one_bad_vertex_does_not_hide_the_rest() {
    let mut sphere = icosphere(1.0, 3);
    sphere.positions[20] = DVec3::new(f64::NAN, f64::INFINITY, 0.0);
    let picture =
        render(&sphere, Coloring::Plain(RED), &[], &RenderOptions { lighting: true, ..flat(60, 60) }).unwrap();
    let covered = pixels(&picture).filter(|p| *p != [255; 4]).count();
    assert!((600..900).contains(&covered), "{covered}");
}

#[test]
fn transparent_backgrounds_keep_soft_edges() {
    let sphere = uv_sphere(1.0, 40, 20);
    let options = RenderOptions { background: [0; 4], ..flat(50, 50) };
    let picture = render(&sphere, Coloring::Plain(RED), &[], &options).unwrap();
    assert_eq!(picture.pixel(0, 0), [0; 4]);
    assert!(pixels(&picture).any(|p| p[3] > 0 && p[3] < 255));
    // Colour is not mixed with the invisible background.
    assert!(pixels(&picture).all(|p| p[3] == 0 || p[..3] == RED));
}

#[test]
fn anchors_show_in_front_only() {
    let sphere = icosphere(1.0, 3);
    let face_toward = |d: DVec3| {
        let of = |t: &usize| sphere.triangle_positions(*t).iter().sum::<DVec3>().dot(d);
        (0..sphere.triangle_count()).max_by(|a, b| of(a).total_cmp(&of(b))).unwrap() as u32
    };
    let dot = |d: DVec3| SurfacePoint::new(face_toward(d), [1.0 / 3.0; 3]);
    let options = RenderOptions { anchor_numbers: true, ..flat(80, 80) };
    let plain = render(&sphere, Coloring::Plain([90; 3]), &[], &options).unwrap();
    let front = render(&sphere, Coloring::Plain([90; 3]), &[dot(DVec3::Z)], &options).unwrap();
    let behind = render(&sphere, Coloring::Plain([90; 3]), &[dot(-DVec3::Z)], &options).unwrap();
    assert_eq!(plain, behind);
    assert_ne!(plain, front);
    assert_ne!(plain.pixel(40, 40), front.pixel(40, 40));
}

#[test]
fn heights_that_are_no_multiple_of_a_band_and_any_threads() {
    let sphere = icosphere(1.0, 4);
    let options = RenderOptions { wireframe: true, lighting: true, field_of_view: 30.0, ..flat(67, 53) };
    let in_pool = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| render(&sphere, Coloring::Plain([200; 3]), &[], &options).unwrap())
    };
    assert_eq!(in_pool(1), in_pool(3));
}

#[test]
fn options_out_of_range_are_refused() {
    let sphere = icosphere(1.0, 1);
    let good = flat(8, 8);
    let bad = [
        RenderOptions { width: 0, ..good.clone() },
        RenderOptions { height: 1 << 20, ..good.clone() },
        RenderOptions { supersampling: 0, ..good.clone() },
        RenderOptions { supersampling: 9, ..good.clone() },
        RenderOptions { azimuth: f64::NAN, ..good.clone() },
        RenderOptions { field_of_view: 180.0, ..good.clone() },
        RenderOptions { field_of_view: f64::NAN, ..good.clone() },
        RenderOptions { margin: 0.5, ..good },
    ];
    for options in bad {
        assert!(render(&sphere, Coloring::Plain(RED), &[], &options).is_err(), "{options:?}");
    }
}

#[test]
fn pictures_stand_side_by_side() {
    let a = Image::from_fn(2, 4, |_, _| [1, 1, 1, 255]).unwrap();
    let b = Image::from_fn(3, 2, |_, _| [2, 2, 2, 255]).unwrap();
    let row = side_by_side(&[a, b], 1, [9; 4]).unwrap();
    assert_eq!((row.width, row.height), (6, 4));
    assert_eq!([row.pixel(1, 3)[0], row.pixel(2, 0)[0], row.pixel(3, 1)[0]], [1, 9, 2]);
    assert!(side_by_side(&[], 5, [0; 4]).is_err());
}
