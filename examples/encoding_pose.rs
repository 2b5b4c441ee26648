//! Figures 4 and 6 of the encoding paper: large deformations by few vertices. A body raises its
//! arms and bows, held at its hands, head and feet; the bumpy tube is bent by 120 degrees. Handles
//! are points: their turns follow from the shape.
//!
//! `cargo run --release --example encoding_pose [PICTURE.png]`

use std::error::Error;

use barymap::encoding::{HierarchyOptions, Quality};
use barymap::io::Cache;
use barymap::models::Walker;
use barymap::tools::deform::{Deformer, Handles};
use glam::{DQuat, DVec3};

mod shared;

fn main() -> Result<(), Box<dyn Error>> {
    let mesh = Walker::new(0.022).mesh;
    let nearest = |p: DVec3| {
        let distance = |v: &usize| mesh.positions[*v].distance(p);
        (0..mesh.vertex_count()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(0) as u32
    };
    // Four around each wrist and ankle, four around the waist, and the head's top, chin and ears.
    let rest = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
    let mut places = Vec::new();
    for side in [-1.0, 1.0] {
        places.extend(
            [(0.0, 0.05), (0.0, -0.05), (0.05, 0.0), (-0.05, 0.0)].map(|(y, z)| (0, rest(side * 0.75, 1.32 + y, z))),
        );
        places.extend(
            [(0.07, 0.0), (-0.07, 0.0), (0.0, 0.08), (0.0, -0.08)].map(|(x, z)| (1, rest(side * 0.105 + x, 0.12, z))),
        );
    }
    places.extend([(0.2, 0.0), (-0.2, 0.0), (0.0, 0.12), (0.0, -0.12)].map(|(x, z)| (2, rest(x, 0.95, z))));
    places.extend(
        [(0.0, 0.19, 0.0), (0.0, 0.0, 0.17), (0.15, 0.0, 0.0), (-0.15, 0.0, 0.0)]
            .map(|(x, y, z)| (3, rest(x, 1.66 + y, z))),
    );
    let vertices: Vec<u32> = places.iter().map(|p| nearest(p.1)).collect();
    let handles = Handles { vertices: vertices.clone(), region: None };
    let mut deformer = Deformer::new(&mesh, handles, &HierarchyOptions::default(), &Cache::disabled())?;
    let pose = |raise: f64, bow: f64| -> Vec<DVec3> {
        let about = |angle: DQuat, centre: DVec3, p: DVec3| centre + angle * (p - centre);
        let bowed = |p: DVec3| about(DQuat::from_rotation_x(bow), DVec3::Y * 0.95, p);
        places
            .iter()
            .zip(&vertices)
            .map(|((part, _), &v)| {
                let p = mesh.positions[v as usize];
                match part {
                    0 => {
                        let shoulder = DVec3::new(0.2 * p.x.signum(), 1.32, 0.0);
                        bowed(about(DQuat::from_rotation_z(raise * p.x.signum()), shoulder, p))
                    }
                    3 => bowed(p),
                    _ => p,
                }
            })
            .collect()
    };
    let mut shapes = vec![mesh.positions.clone()];
    for (raise, bow, stiffness) in [(1.1, 0.0, 0.0), (0.0, 1.0, 0.0), (1.1, 1.0, 0.0), (1.1, 1.0, 1.0)] {
        let quality = Quality { stiffness, ..Quality::DEFAULT };
        let result = deformer.deform(&pose(raise, bow), &quality, false)?;
        let m = deformer.measures(&result.positions);
        println!(
            "raised {raise}, bowed {bow}, stiffness {stiffness}: G {:.2e}, edges {:.3} rms, {} flipped",
            m.g_normalised, m.edge_rms, m.flipped
        );
        shapes.push(result.positions);
    }
    shared::picture(&mesh, &shapes, 5, [330, 460], (50.0, 8.0), &shared::output("encoding_pose.png"))
}
