//! Points without faces as something that has colours everywhere near them.

use std::num::NonZero;

use glam::DVec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::geometry::{Corner, Mesh, MeshBuilder, NONE};

/// Neighbours among which the corners of a point's triangle are chosen.
const NEIGHBOURS: NonZero<usize> = NonZero::new(9).unwrap();
/// Corners of a triangle lie in a line if its area is below this share of its longest side's
/// square.
const FLAT: f64 = 1e-2;

/// A triangle for each point: the point, its nearest neighbour, and the nearest of the others that
/// is not in line with both. The closest point of these triangles lies among the nearest points,
/// and is a weighted mean of three of them: this is what colours are interpolated by. The triangles
/// are no surface: they overlap, and have no orientation.
///
/// Vertices and colours are those of `points`. O(n log n).
///
/// # Errors
/// If there are fewer than three different finite points, or all lie in a line.
pub fn triangles_of_points(points: &Mesh) -> Result<Mesh> {
    let finite: Vec<u32> =
        (0..points.vertex_count() as u32).filter(|&v| points.positions[v as usize].is_finite()).collect();
    let at = |v: u32| points.positions[v as usize];
    let coordinates: Vec<[f64; 3]> = finite.iter().map(|&v| at(v).to_array()).collect();
    let tree: ImmutableKdTree<f64, 3> = ImmutableKdTree::new_from_slice(&coordinates);
    let triangle = |&v: &u32| -> Option<[u32; 3]> {
        let found = tree.nearest_n::<SquaredEuclidean>(&at(v).to_array(), NEIGHBOURS);
        let mut near: Vec<(f64, u32)> = found.iter().map(|n| (n.distance, finite[n.item as usize])).collect();
        near.retain(|(distance, u)| *u != v && *distance > 0.0);
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let (_, first) = *near.first()?;
        let wide = |u: u32| {
            let (a, b) = (at(first) - at(v), at(u) - at(v));
            let side = a.length_squared().max(b.length_squared()).max((b - a).length_squared());
            0.5 * a.cross(b).length() > FLAT * side
        };
        let second = near[1..].iter().map(|n| n.1).find(|&u| wide(u))?;
        Some([v, first, second])
    };
    let triangles: Vec<[u32; 3]> = finite.par_iter().filter_map(triangle).collect();
    if triangles.is_empty() {
        let what = format!("its {} points span no triangle", points.vertex_count());
        return Err(Error::mesh(&points.name, what, "Give a cloud of at least three points that are not in a line"));
    }
    let mut builder = MeshBuilder::new(points.name.clone());
    builder.mesh.positions.clone_from(&points.positions);
    builder.mesh.colors.clone_from(&points.colors);
    for t in triangles {
        builder.polygon(t.map(|vertex| Corner { vertex, texcoord: NONE, normal: NONE }));
    }
    builder.build()
}

/// Whether a mesh is a cloud: points, and no face.
pub fn is_cloud(mesh: &Mesh) -> bool {
    mesh.triangle_count() == 0 && mesh.positions.iter().any(|p: &DVec3| p.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{ClosestPoints, Topology};

    #[test]
    fn colours_are_interpolated_among_the_nearest_points() {
        let mut positions: Vec<DVec3> =
            (0..400).map(|k| DVec3::new(f64::from(k % 20), f64::from(k / 20), 0.0)).collect();
        // A point twice, and one that is nowhere.
        positions.extend([positions[17], DVec3::NAN]);
        let points = Mesh::of_triangles("grid", positions, &[]);
        assert!(is_cloud(&points));
        let mesh = triangles_of_points(&points).unwrap();
        assert!(!is_cloud(&mesh) && mesh.vertex_count() == 402);
        let topology = Topology::new(&mesh);
        let closest = ClosestPoints::new(&mesh, &topology);
        for p in [DVec3::new(7.3, 11.6, 0.4), DVec3::new(0.1, 18.8, -0.2), DVec3::new(5.0, 5.0, 0.0)] {
            let (q, _) = closest.nearest(p).unwrap();
            // A colour that is linear in space comes back where the triangles lie; they leave gaps
            // of less than a step.
            let found = q.position(&mesh);
            assert!(found.distance(DVec3::new(p.x, p.y, 0.0)) < 0.75, "{p}: {found}");
        }
        let line = Mesh::of_triangles("line", (0..9).map(|k| DVec3::X * f64::from(k)).collect(), &[]);
        assert!(triangles_of_points(&line).is_err());
        assert!(triangles_of_points(&Mesh::default()).is_err());
    }
}
