//! Moving, turning and scaling all handles moves, turns and scales the mesh, in one pass without
//! any iteration.

use barymap::encoding::Quality;
use barymap::geometry::Mesh;
use barymap::models::shapes::{Diagonal, icosphere, irregular_plane, lobed_sphere, plane_grid, torus, tube, uv_sphere};
use glam::{DQuat, DVec3};

use super::tube::Tube;
use super::{deformer, spread};
use crate::common::{data, load};

/// The largest distance from the exact image, over the image's diagonal.
fn error(mesh: &Mesh, degrees: f64, scale: f64, quality: &Quality) -> (f64, usize) {
    let handles = spread(mesh, 8);
    let (low, high) = mesh.bounds().unwrap();
    let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), degrees.to_radians());
    let image = |p: DVec3| if degrees == 0.0 { p } else { turn * (p - low) * scale + high };
    let targets: Vec<DVec3> = handles.iter().map(|&v| image(mesh.positions[v as usize])).collect();
    let result = deformer(mesh, &handles).deform(&targets, quality, false).unwrap();
    let worst = (0..mesh.vertex_count())
        .filter(|&v| mesh.positions[v].is_finite())
        .map(|v| result.positions[v].distance(image(mesh.positions[v])))
        .fold(0.0, f64::max);
    (worst / (low.distance(high) * scale), result.report.iterations())
}

#[test]
fn similarities_are_exact_on_generated_meshes() {
    let meshes = [
        lobed_sphere(3, 0.5),
        icosphere(2.0, 4),
        uv_sphere(1.0, 60, 20),
        torus(2.0, 0.7, 40, 20, Diagonal::Forward),
        plane_grid(20, 13, 3.0, 2.0, Diagonal::Forward),
        irregular_plane(20, 20, 1.0, 1.0, Diagonal::Alternating, 0.3, 7),
        tube(1.0, 3.0, 24, 16, Diagonal::Alternating),
        Tube::small().mesh,
    ];
    for mesh in meshes {
        for (degrees, scale) in [(0.0, 1.0), (77.0, 1.0), (180.0, 1.0), (200.0, 2.5), (200.0, 0.01)] {
            let (worst, iterations) = error(&mesh, degrees, scale, &Quality::SPLITS);
            assert!(worst <= 1e-12 && iterations == 0, "{}, {degrees} x {scale}: {worst:e}", mesh.name);
        }
        // A minimum already: nothing is iterated, whatever the quality.
        let (worst, iterations) = error(&mesh, 200.0, 2.5, &Quality { stiffness: 1.0, ..Quality::CONVERGED });
        assert!(worst <= 1e-12 && iterations == 0, "{}: {worst:e} after {iterations}", mesh.name);
    }
}

#[test]
fn far_from_the_origin_costs_only_the_digits_of_the_numbers() {
    let mut mesh = lobed_sphere(3, 0.5);
    mesh.positions.iter_mut().for_each(|p| *p += DVec3::splat(1e6));
    let (worst, _) = error(&mesh, 180.0, 1.0, &Quality::SPLITS);
    assert!(worst < 1e-8, "{worst:e}");
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn similarities_are_exact_on_real_meshes() {
    let mut seen = 0;
    for folder in ["mesh", "cage"] {
        let mut files: Vec<_> =
            std::fs::read_dir(data(folder)).unwrap().map(|f| f.unwrap().file_name().into_string().unwrap()).collect();
        files.sort();
        for file in files.iter().filter(|f| f.ends_with(".obj")) {
            let mesh = load(&format!("{folder}/{file}"));
            for (degrees, scale) in [(0.0, 1.0), (180.0, 1.0), (200.0, 2.5)] {
                let (worst, _) = error(&mesh, degrees, scale, &Quality::SPLITS);
                assert!(worst <= 1e-9, "{file}, {degrees} x {scale}: {worst:e}");
            }
            seen += 1;
        }
    }
    assert!(seen > 15, "{seen} meshes");
}
