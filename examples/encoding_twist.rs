//! Figure 3 of the encoding paper: one end of a shape is turned by 90 degrees and held by four
//! vertices at each end. Vertex splits alone leave it rough; Gauss-Newton smooths it in a few
//! iterations. Below, the turn is 180 degrees: plain encoding keeps the shape of every ring but not
//! its size, and the waist pinches; with a stiffness for the edges' lengths it does not.
//!
//! `cargo run --release --example encoding_twist [PICTURE.png]`

use std::error::Error;

use barymap::encoding::{HierarchyOptions, Quality};
use barymap::io::Cache;
use barymap::tools::deform::{Deformer, Handles};

mod shared;
#[path = "../tests/common/tube.rs"]
mod tube;

use tube::{Pose, Tube};

fn main() -> Result<(), Box<dyn Error>> {
    let tube = Tube::small();
    let vertices = tube.points();
    let handles = Handles { vertices: vertices.clone(), region: None };
    let mut deformer = Deformer::new(&tube.mesh, handles, &HierarchyOptions::default(), &Cache::disabled())?;
    let mut shapes = vec![tube.mesh.positions.clone()];
    let stiff = Quality { stiffness: 1.0, ..Quality::CONVERGED };
    for (degrees, name, quality) in [
        (90.0, "splits", Quality::SPLITS),
        (90.0, "converged", Quality::CONVERGED),
        (180.0, "splits", Quality::SPLITS),
        (180.0, "converged", Quality::CONVERGED),
        (180.0, "with a stiffness", stiff),
    ] {
        let result = deformer.deform(&tube.targets(&vertices, Pose::Twist(degrees)), &quality, false)?;
        let m = deformer.measures(&result.positions);
        println!(
            "{degrees} degrees, {name}: G {:.2e}, volume {:.3}, {} triangles flipped, edges {:.3} rms",
            m.g, m.volume_ratio, m.flipped, m.edge_rms
        );
        for level in result.report.levels {
            println!("  {} free vertices: {} iterations", level.free, level.iterations);
        }
        shapes.push(result.positions);
    }
    shared::picture(&tube.mesh, &shapes, 3, [460, 220], (0.0, 15.0), &shared::output("encoding_twist.png"))
}
