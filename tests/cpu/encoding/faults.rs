//! Handles that are missing, too few, wrong or against one another; meshes that are hardly meshes.

use barymap::encoding::Quality;
use barymap::geometry::Mesh;
use barymap::io::cache::Cache;
use barymap::models::shapes::{Random, lobed_sphere};
use barymap::tools::deform::{Deformer, Handles};
use glam::DVec3;

use super::{deformer, spread};

fn message(mesh: &Mesh, vertices: &[u32], region: Option<&[u32]>, targets: &[DVec3]) -> String {
    let wanted = Handles { vertices: vertices.to_vec(), region: region.map(<[u32]>::to_vec) };
    let made = Deformer::new(mesh, wanted, &Default::default(), &Cache::disabled());
    let done = made.and_then(|mut d| d.deform(targets, &Quality::DEFAULT, false));
    done.map_or_else(|e| e.to_string(), |_| panic!("{vertices:?} did not fail"))
}

#[test]
fn wrong_handles_are_named() {
    let mut mesh = lobed_sphere(2, 0.3);
    let n = mesh.vertex_count() as u32;
    mesh.positions.push(DVec3::ONE);
    let (a, b) = (DVec3::X, DVec3::Y);
    for (vertices, region, targets, part) in [
        (&[][..], None, &[][..], "no handles"),
        (&[n + 7], None, &[a][..], "162 + 8"),
        (&[n], None, &[a], "part of no face"),
        (&[3, 3], None, &[a, b], "different positions"),
        (&[3, 4], None, &[a], "1 positions for 2 handles"),
        (&[3, 4, 5], None, &[a, a, a], "one place"),
        (&[3], None, &[DVec3::NAN], "not finite"),
        (&[3], Some(&[4, n + 1][..]), &[a], "region"),
    ] {
        let text = message(&mesh, vertices, region, targets);
        let part = if part.starts_with("162") { format!("vertex {}", n + 7) } else { part.to_owned() };
        assert!(text.contains(&part), "{text}");
    }
    let empty = Mesh::from_triangles("empty", vec![DVec3::ZERO; 3], &[]).unwrap();
    assert!(message(&empty, &[0], None, &[a]).contains("no triangle"));
}

#[test]
fn few_handles_move_the_mesh_by_a_similarity() {
    let mesh = lobed_sphere(3, 0.4);
    let at = |v: u32| mesh.positions[v as usize];
    // One: carried along.
    let one = deformer(&mesh, &[7]).deform(&[at(7) + DVec3::X], &Quality::DEFAULT, false).unwrap();
    for (p, q) in mesh.positions.iter().zip(&one.positions) {
        assert!((*q - *p).distance(DVec3::X) < 1e-12);
    }
    // Two: turned and scaled, exactly.
    let mut pair = deformer(&mesh, &[7, 90]);
    let two = pair.deform(&[at(7) * 2.0, at(90) * 2.0], &Quality::DEFAULT, false).unwrap();
    assert!(pair.measures(&two.positions).g < 1e-20);
    // Three, and more on a line or at one place: something finite that meets them.
    for handles in [vec![7, 90, 300], vec![7, 8, 9, 10]] {
        let targets: Vec<DVec3> = handles.iter().map(|&v| DVec3::X * f64::from(v)).collect();
        let result = deformer(&mesh, &handles).deform(&targets, &Quality::DEFAULT, false).unwrap();
        assert!(result.positions.iter().all(|p| p.is_finite()));
        assert_eq!(result.positions[handles[1] as usize], targets[1]);
    }
    // All vertices are handles: nothing is left to do.
    let all: Vec<u32> = (0..mesh.vertex_count() as u32).collect();
    let targets: Vec<DVec3> = mesh.positions.iter().map(|p| *p * 3.0).collect();
    assert_eq!(deformer(&mesh, &all).deform(&targets, &Quality::CONVERGED, false).unwrap().positions, targets);
}

#[test]
fn soups_of_triangles_never_panic() {
    let mut random = Random::new(11);
    for round in 0..200 {
        let n = 4 + round % 13;
        let mut positions: Vec<DVec3> =
            (0..n).map(|_| DVec3::new(random.signed(), random.signed(), random.signed())).collect();
        if round % 5 == 0 {
            positions.iter_mut().for_each(|p| p.z = 0.0);
        }
        if round % 7 == 0 {
            positions[1] = positions[0];
        }
        if round % 11 == 0 {
            positions[2] = DVec3::NAN;
        }
        let triangles: Vec<[u32; 3]> =
            (0..2 * n).map(|_| [0; 3].map(|_: u32| (random.unit() * n as f64) as u32)).collect();
        let mesh = Mesh::from_triangles("soup", positions, &triangles).unwrap();
        let handles: Vec<u32> = (0..n as u32).step_by(2).collect();
        let targets: Vec<DVec3> =
            handles.iter().map(|_| DVec3::new(random.signed(), random.signed(), random.signed())).collect();
        let wanted = Handles { vertices: handles, region: None };
        let made = Deformer::new(&mesh, wanted, &Default::default(), &Cache::disabled());
        if let Ok(result) = made.and_then(|mut d| d.deform(&targets, &Quality::CONVERGED, false)) {
            for (p, q) in mesh.positions.iter().zip(&result.positions) {
                assert!(q.is_finite() || !p.is_finite(), "round {round}");
            }
        }
    }
}

#[test]
fn nothing_flips_where_handles_are_close() {
    let mesh = lobed_sphere(4, 0.4);
    let handles = spread(&mesh, 12);
    let targets: Vec<DVec3> =
        handles.iter().map(|&v| mesh.positions[v as usize] + 0.05 * DVec3::new(1.0, -1.0, 0.5)).collect();
    let mut deformer = deformer(&mesh, &handles);
    let result = deformer.deform(&targets, &Quality::DEFAULT, false).unwrap();
    assert_eq!(deformer.measures(&result.positions).flipped, 0);
}
