//! The other way through a map: the inverse by numbers, and how far a map and its counterpart are
//! from undoing one another.

use glam::DVec3;
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::geometry::closest::ClosestPoints;
use crate::geometry::{Frame, Mesh, NONE, SurfacePoint, Topology};
use crate::surface::quality::{ErrorSummary, summarise};
use crate::surface::{PackedImage, PackedPoint, PointMap, Status};

use super::vertex_map::VertexMap;

/// Steps at most.
const STEPS: usize = 12;
/// A pre-image whose image misses its point by more than this part of the square root of the area
/// is doubtful.
const MISSED: f64 = 1e-3;
/// Steps end where all points are met this well.
const MET: f64 = 1e-7;

/// A point of the target whose image is a given point of the source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PreImage {
    /// The point of the target and the map's confidence in it; nowhere if there is none. `Valid` if
    /// the map vouches for it and the image meets the point.
    pub point: PackedImage,
    /// Distance in space between its image and the point, over the square root of the source's
    /// area.
    pub residual: f64,
}

/// Pre-images under `map` of points of the source.
///
/// Iterates `y <- y + (q - M(W^-1 y))`, where `W` is the target with every vertex moved to its
/// image and `q` a point of the source. Where several points go to `q`, one of them is found; where
/// none does, the nearest. `vertices` is the map of the target's vertices.
///
/// `O(n log F)` and a map of all points for each of at most 12 steps.
///
/// # Errors
/// If a point is not on the source, or the map fails.
pub fn inverse_map(
    source: &Mesh,
    target: &Mesh,
    map: &dyn PointMap,
    vertices: &VertexMap,
    points: &[SurfacePoint],
) -> Result<Vec<PreImage>> {
    if let Some(i) = points.iter().position(|p| !p.is_valid(source, 1e-3)) {
        return Err(Error::input(format!("point {i} is not on the source"), "Give points of the source"));
    }
    // In a frame of the source, where places do not round.
    let frame = Frame::of_mesh(source);
    let images = image_mesh(target, vertices, |p| frame.place(p, source));
    let closest = ClosestPoints::new(&images, &Topology::new(&images));
    let unit = source.area().sqrt() * frame.scale;
    let wanted: Vec<DVec3> = points.iter().map(|p| frame.place(p, source)).collect();
    let mut at: Vec<DVec3> = wanted.clone();
    let mut best = vec![PreImage { point: PackedImage::NOWHERE, residual: f64::INFINITY }; points.len()];
    for _ in 0..STEPS {
        let candidates: Vec<Option<SurfacePoint>> = at.par_iter().map(|&y| closest.nearest(y).map(|n| n.0)).collect();
        let Some(start) = candidates.iter().flatten().next().copied() else { break };
        let packed: Vec<PackedPoint> = candidates.iter().map(|c| c.unwrap_or(start).into()).collect();
        let mut found = Vec::new();
        map.map(&packed, &mut found)?;
        let mut most = 0.0_f64;
        for i in 0..points.len() {
            let (Some(candidate), Some(image)) = (candidates[i], found[i].point()) else { continue };
            let missed = wanted[i] - frame.place(&image, source);
            let residual = missed.length() / unit;
            if residual < best[i].residual {
                let status =
                    if residual <= MISSED { found[i].status() } else { Status::Doubtful.min(found[i].status()) };
                let p = PackedPoint::from(candidate);
                let point = PackedImage { face: p.face, b0: p.b0, b1: p.b1, status: status as u32, ..found[i] };
                best[i] = PreImage { point, residual };
                most = most.max(residual);
            }
            at[i] = candidate.position(&images) + missed;
        }
        if most <= MET {
            break;
        }
    }
    Ok(best)
}

/// The target's triangles with their vertices at their images; those without have no area.
fn image_mesh(target: &Mesh, vertices: &VertexMap, place: impl Fn(&SurfacePoint) -> DVec3) -> Mesh {
    let at: Vec<DVec3> = vertices.images.iter().map(|i| i.point().map_or(DVec3::ZERO, |p| place(&p))).collect();
    let triangles: Vec<[u32; 3]> = target
        .triangles()
        .iter()
        .map(|t| if t.iter().all(|&v| vertices.positions[v as usize].is_some()) { *t } else { [t[0]; 3] })
        .collect();
    Mesh::of_triangles("images", at, &triangles)
}

/// How far points come back to: A to B by one map and to A again by the other.
#[derive(Clone, Copy, Debug, PartialEq)]
#[doc(hidden)]
pub struct Cycle {
    /// Distance in space between the target's vertices and where they come back to, over the square
    /// root of the target's area.
    pub error: ErrorSummary,
    /// Share of the vertices that came back at all.
    pub returned: f64,
    /// Share of these that came back within a mean edge.
    pub within_edge: f64,
}

/// Sends the images of the target's vertices back by `back`, the map from the source to the target
/// that the same pairs give. Maps made independently agree only where both are determined: what
/// they differ by is an estimate of their errors that needs no truth.
///
/// # Errors
/// Those of the map.
pub fn cycle(target: &Mesh, topology: &Topology, vertices: &VertexMap, back: &dyn PointMap) -> Result<Cycle> {
    let sent: Vec<(usize, PackedPoint)> = vertices
        .images
        .iter()
        .enumerate()
        .filter(|(_, i)| i.face != NONE)
        .map(|(v, i)| (v, PackedPoint { face: i.face, b0: i.b0, b1: i.b1 }))
        .collect();
    let points: Vec<PackedPoint> = sent.iter().map(|s| s.1).collect();
    let mut found = Vec::new();
    back.map(&points, &mut found)?;
    let frame = Frame::of_mesh(target);
    let unit = target.area().sqrt() * frame.scale;
    let errors: Vec<f64> = sent
        .iter()
        .zip(&found)
        .filter_map(|((v, _), i)| {
            i.point().map(|p| frame.place(&p, target).distance(frame.local(target.positions[*v])) / unit)
        })
        .collect();
    let edge = target.mean_edge_length() * frame.scale / unit;
    let count = (0..target.vertex_count() as u32).filter(|&v| topology.vertex_point(v).is_some()).count();
    let share = |n: usize, of: usize| if of > 0 { n as f64 / of as f64 } else { 0.0 };
    Ok(Cycle {
        error: summarise(&errors),
        returned: share(errors.len(), count),
        within_edge: share(errors.iter().filter(|e| **e <= edge).count(), errors.len()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::shapes::lobed_sphere;
    use crate::tools::vertex_map::vertex_map;

    /// Every point goes to the same place of the source, which has the same triangles; `shift`
    /// moves images along their triangle.
    struct Same {
        shift: f32,
    }

    impl PointMap for Same {
        fn map(&self, points: &[PackedPoint], images: &mut Vec<PackedImage>) -> Result<()> {
            images.clear();
            images.extend(points.iter().map(|p| {
                let b0 = (p.b0 + self.shift * p.b0 * p.b1).clamp(0.0, 1.0);
                PackedImage { face: p.face, b0, b1: p.b1.min(1.0 - b0), confidence: 1.0, status: Status::Valid as u32 }
            }));
            Ok(())
        }
    }

    #[test]
    fn the_inverse_undoes_a_map_and_says_where_it_does_not() {
        let target = lobed_sphere(3, 0.3);
        let mut source = target.clone();
        source.positions.iter_mut().for_each(|p| *p = DVec3::new(p.y, p.z, p.x) * 2.0);
        let topology = Topology::new(&target);
        // Not linear within triangles, so that the images of vertices alone do not tell.
        let map = Same { shift: 0.3 };
        let vertices = vertex_map((&source, &Topology::new(&source)), (&target, &topology), &map).unwrap();
        let points: Vec<SurfacePoint> =
            (0..target.triangle_count() as u32).step_by(3).map(|t| SurfacePoint::new(t, [0.2, 0.3, 0.5])).collect();
        let found = inverse_map(&source, &target, &map, &vertices, &points).unwrap();
        for (p, f) in points.iter().zip(&found) {
            assert!(f.residual < 1e-6 && f.point.status() == Status::Valid, "{f:?}");
            assert_eq!(f.point.face, p.face);
            // 0.2 = b0 + 0.3 b0 b1 with b1 = 0.3.
            assert!((f64::from(f.point.b0) - 0.2 / 1.09).abs() < 1e-5, "{f:?}");
        }
        // Without its own triangle a point has no pre-image, and the residual says so.
        let mut torn = vertices.clone();
        target.triangle(0).iter().for_each(|&v| torn.positions[v as usize] = None);
        let found = inverse_map(&source, &target, &map, &torn, &points).unwrap();
        assert!(found[0].residual > 1e-2 && found[0].point.status() != Status::Valid, "{:?}", found[0]);
        assert!(
            inverse_map(&source, &target, &map, &vertices, &[SurfacePoint::new(1 << 30, [1.0, 0.0, 0.0])]).is_err()
        );
    }

    #[test]
    fn a_cycle_of_the_identity_comes_back_and_a_wrong_one_does_not() {
        let mesh = lobed_sphere(3, 0.3);
        let topology = Topology::new(&mesh);
        let same = Same { shift: 0.0 };
        let vertices = vertex_map((&mesh, &topology), (&mesh, &topology), &same).unwrap();
        let c = cycle(&mesh, &topology, &vertices, &same).unwrap();
        assert!(c.error.max < 1e-6 && c.returned == 1.0 && c.within_edge == 1.0, "{c:?}");
        struct Elsewhere(u32);
        impl PointMap for Elsewhere {
            fn map(&self, points: &[PackedPoint], images: &mut Vec<PackedImage>) -> Result<()> {
                Same { shift: 0.0 }.map(points, images)?;
                images.iter_mut().for_each(|i| i.face = (i.face + self.0 / 2) % self.0);
                Ok(())
            }
        }
        let c = cycle(&mesh, &topology, &vertices, &Elsewhere(mesh.triangle_count() as u32)).unwrap();
        assert!(c.error.mean > 0.1 && c.within_edge < 0.1, "{c:?}");
    }
}
