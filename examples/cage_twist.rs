//! Figure 11 of the mapping paper, on a built-in shape: a model in a cage whose top is twisted, by
//! one mean value mapping and by a composite of them. The direct map turns parts of the model over;
//! the composite turns none.
//!
//! `cargo run --release --example cage_twist [PICTURE.png]`

mod shared;

#[path = "shared/device.rs"]
mod device;

use std::error::Error;

use barymap::geometry::Mesh;
use barymap::mapping::space::{Cage, CompositeMap, PartitionKind, PartitionOptions, VertexPath, partition};
use barymap::models::shapes::uv_sphere;
use barymap::progress::Quiet;
use barymap::tools::cage::Encoded;
use glam::{DQuat, DVec3};

use shared::{output, picture};

/// A rounded box, as the cage and, finer and smaller, as the model.
fn pillow(size: f64, slices: usize, stacks: usize) -> Mesh {
    let mut mesh = uv_sphere(1.0, slices, stacks);
    for p in &mut mesh.positions {
        // Between the sphere and the cube around it.
        *p = size * p.normalize_or_zero() / p.normalize_or_zero().powf(6.0).element_sum().powf(1.0 / 6.0);
    }
    mesh
}

/// A third of a turn, all of it in the middle.
fn twist(p: DVec3) -> DVec3 {
    DQuat::from_rotation_y(120f64.to_radians() * (1.6 * p.y).clamp(-0.5, 0.5)) * p
}

fn main() -> Result<(), Box<dyn Error>> {
    let (model, from) = (pillow(0.85, 96, 64), pillow(1.0, 6, 6));
    let mut to = from.clone();
    to.positions.iter_mut().for_each(|p| *p = twist(*p));
    let cage = Cage::new(&from, &to)?;
    let path = Encoded::new(&cage)?;
    let engine = device::engine()?;
    let mut shapes = vec![model.positions.clone()];
    let mut turned = Vec::new();
    for kind in [PartitionKind::Direct, PartitionKind::Binary] {
        let options = PartitionOptions { kind, ..PartitionOptions::default() };
        let found = partition(&engine, &cage, &path, &model.positions, &options, &Quiet)?;
        for step in &found.steps {
            println!("{kind:?}, {} to {}: smallest Jacobian {:.3}", step.from, step.to, step.minimum.value);
        }
        let map = CompositeMap::new(cage.triangles.clone(), found.polyhedra.clone())?;
        let images = map.forward(&model.positions);
        turned.push(images.iter().filter(|m| !(m.jacobian() > 0.0)).count());
        shapes.push(images.iter().map(|m| m.point).collect());
    }
    println!(
        "{} vertices: {} turned over directly, {} in steps, along the {} path",
        model.vertex_count(),
        turned[0],
        turned[1],
        path.name()
    );
    assert!(turned[0] > 0 && turned[1] == 0);
    picture(&model, &shapes, 3, [420, 480], (25.0, 12.0), &output("cage_twist.png"))
}
