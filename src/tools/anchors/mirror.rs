//! Pairs of one side that count for both: where both shapes are their own mirror images.
//!
//! A plane of symmetry is looked for in space: a shape in a pose with one arm up has none, however
//! symmetric the body is, and is refused.

use glam::{DMat3, DVec3};

use crate::control;
use crate::error::{Error, Result};
use crate::geometry::{ClosestPoints, SurfacePoint};
use crate::surface::AnchorPairs;
use crate::surface::correspondence::Shape;

/// Rounds in which a plane is fitted.
const ROUNDS: usize = 12;
/// Points that a plane is fitted to, about.
const SAMPLES: usize = 2000;
/// A mesh whose mirror image is off by more than this, root mean square over the square root of its
/// area, is not symmetric.
const SYMMETRIC: f64 = 0.01;
/// A point nearer to the plane than this is on the middle line, over the square root of the area.
const MIDDLE: f64 = 0.01;
/// A mirrored point nearer than this to a point that was given is not needed: that side has its own.
const TAKEN: f64 = 0.03;

/// The plane about which a mesh is its own mirror image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MirrorPlane {
    /// A point of it.
    pub point: DVec3,
    /// Its unit normal.
    pub normal: DVec3,
    /// What the mirror image is off by, root mean square, over the square root of the area.
    pub off: f64,
}

/// Pairs with their mirror images.
#[derive(Clone, Debug)]
pub struct Mirrored {
    /// Those given, in their order, then those added.
    pub pairs: AnchorPairs,
    /// For each one added the number of the pair that it mirrors.
    pub of: Vec<usize>,
    /// Pairs on the middle lines of both shapes.
    pub middle: usize,
}

impl MirrorPlane {
    /// The plane of symmetry of a mesh, or the nearest to one there is; `None` for a mesh without
    /// an area. Axes and principal axes are tried, and fitted. O(V log F).
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    pub fn of(shape: Shape<'_>) -> Result<Option<Self>> {
        let closest = ClosestPoints::new(shape.mesh, shape.topology);
        let frame = closest.frame();
        let mut used: Vec<DVec3> = (0..shape.mesh.vertex_count())
            .filter(|&v| !shape.topology.vertex_triangles(v as u32).is_empty())
            .map(|v| frame.local(shape.mesh.positions[v]))
            .collect();
        // A few corners may lie near a mirrored surface by chance.
        if used.len() < SAMPLES {
            let usable = (0..shape.mesh.triangle_count() as u32).filter(|&t| shape.topology.usable[t as usize]);
            used.extend(usable.map(|t| frame.place(&SurfacePoint::new(t, [1.0 / 3.0; 3]), shape.mesh)));
        }
        let step = used.len().div_ceil(SAMPLES).max(1);
        let samples: Vec<DVec3> = used.into_iter().step_by(step).collect();
        let length = shape.mesh.area().sqrt() * frame.scale;
        let count = samples.len() as f64;
        if samples.is_empty() || !(length > 0.0) {
            return Ok(None);
        }
        let centre = samples.iter().sum::<DVec3>() / count;
        let spread = samples.iter().map(|p| *p - centre).fold(DMat3::ZERO, |m, d| m + outer(d));
        let starts = [DVec3::X, DVec3::Y, DVec3::Z].into_iter().chain(principal(spread));
        let mut best: Option<(f64, DVec3, DVec3)> = None;
        for start in starts {
            let (mut point, mut normal, mut off) = (centre, start, f64::INFINITY);
            for _ in 0..ROUNDS {
                control::check()?;
                let (mut sum, mut across, mut middle) = (0.0, DMat3::ZERO, DVec3::ZERO);
                for p in &samples {
                    let image = reflect(*p, point, normal);
                    let Some((q, distance)) = closest.nearest_local(image) else { continue };
                    sum += distance * distance;
                    let q = frame.place(&q, shape.mesh);
                    across += outer(*p - q);
                    middle += 0.5 * (*p + q);
                }
                let now = (sum / count).sqrt() / length;
                if best.is_none_or(|b| now < b.0) {
                    best = Some((now, point, normal));
                }
                if now > 0.999 * off {
                    break;
                }
                off = now;
                // Of a reflection all differences are along its normal.
                let [_, _, most] = principal(across);
                (point, normal) = (middle / count, most);
            }
        }
        Ok(best.map(|(off, point, normal)| Self { point: frame.world(point), normal, off }))
    }

    /// The mirror image of a place.
    pub fn reflect(&self, p: DVec3) -> DVec3 {
        reflect(p, self.point, self.normal)
    }

    /// Distance of a place from the plane.
    fn distance(&self, p: DVec3) -> f64 {
        (p - self.point).dot(self.normal).abs()
    }
}

fn reflect(p: DVec3, point: DVec3, normal: DVec3) -> DVec3 {
    p - 2.0 * (p - point).dot(normal) * normal
}

fn outer(d: DVec3) -> DMat3 {
    DMat3::from_cols(d * d.x, d * d.y, d * d.z)
}

/// Eigenvectors of a symmetric matrix, by rising eigenvalue.
fn principal(m: DMat3) -> [DVec3; 3] {
    let matrix = nalgebra::Matrix3::from_fn(|r, c| m.col(c)[r]);
    if matrix.iter().any(|x| !x.is_finite()) {
        return [DVec3::X, DVec3::Y, DVec3::Z];
    }
    let eigen = nalgebra::SymmetricEigen::new(matrix);
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    order.map(|k| {
        let v = eigen.eigenvectors.column(k);
        DVec3::new(v[0], v[1], v[2])
    })
}

/// Adds the mirror image of every pair that is not on the middle lines and whose other side has no
/// pair of its own.
///
/// # Errors
/// [`Error::Input`] naming a mesh that is not its own mirror image, and by how much.
pub fn mirrored(source: Shape<'_>, target: Shape<'_>, pairs: &AnchorPairs) -> Result<Mirrored> {
    let (s, t) = (Side::new(source)?, Side::new(target)?);
    let mut out = Mirrored { pairs: pairs.clone(), of: Vec::new(), middle: 0 };
    let given: Vec<[DVec3; 2]> = pairs
        .source
        .iter()
        .zip(&pairs.target)
        .map(|(p, q)| [p.position(source.mesh), q.position(target.mesh)])
        .collect();
    for (i, [p, q]) in given.iter().enumerate() {
        if s.on_middle(*p) && t.on_middle(*q) {
            out.middle += 1;
            continue;
        }
        let taken = |r: DVec3| given.iter().any(|[_, other]| t.near(r, *other));
        let (Some(p), Some(q)) = (s.image(*p), t.image(*q)) else { continue };
        if !taken(q.position(target.mesh)) {
            out.pairs.source.push(p);
            out.pairs.target.push(q);
            out.of.push(i);
        }
    }
    Ok(out)
}

/// A symmetric mesh.
struct Side {
    plane: MirrorPlane,
    closest: ClosestPoints,
    length: f64,
}

impl Side {
    fn new(shape: Shape<'_>) -> Result<Self> {
        let name = &shape.mesh.name;
        let Some(plane) = MirrorPlane::of(shape)? else {
            return Err(Error::mesh(name, "it has no area", "Give a surface"));
        };
        if plane.off > SYMMETRIC {
            let what = format!(
                "it is not its own mirror image: one side lies {:.3} of the square root of its area off the other",
                plane.off
            );
            return Err(Error::mesh(name, what, "Set pairs on both sides, without --mirror"));
        }
        let closest = ClosestPoints::new(shape.mesh, shape.topology);
        Ok(Self { plane, closest, length: shape.mesh.area().sqrt() })
    }

    fn on_middle(&self, p: DVec3) -> bool {
        self.plane.distance(p) < MIDDLE * self.length
    }

    fn near(&self, p: DVec3, q: DVec3) -> bool {
        p.distance(q) < TAKEN * self.length
    }

    fn image(&self, p: DVec3) -> Option<SurfacePoint> {
        self.closest.nearest(self.plane.reflect(p)).map(|(point, _)| point)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Mesh, Topology};
    use crate::models::{Walker, shapes::lobed_sphere};
    use crate::surface::anchors::vertex_point;

    fn turned(mesh: &Mesh) -> Mesh {
        let mut mesh = mesh.clone();
        let turn = glam::DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 0.5).normalize(), 0.7);
        mesh.positions.iter_mut().for_each(|p| *p = turn * (*p * 12.0) + DVec3::new(3.0, -50.0, 8.0));
        mesh
    }

    #[test]
    fn a_body_has_its_plane_wherever_it_stands() {
        let straight = Walker::new(0.035).mesh;
        for mesh in [straight.clone(), turned(&straight)] {
            let topology = Topology::new(&mesh);
            let plane = MirrorPlane::of(Shape { mesh: &mesh, topology: &topology, embedding: None }).unwrap().unwrap();
            assert!(plane.off < 0.002, "{plane:?}");
            let (low, high) = mesh.bounds().unwrap();
            let middle = mesh.positions.iter().sum::<DVec3>() / mesh.vertex_count() as f64;
            assert!(plane.distance(middle) < 0.01 * low.distance(high));
        }
        // It stands along y and looks along z.
        let topology = Topology::new(&straight);
        let plane = MirrorPlane::of(Shape { mesh: &straight, topology: &topology, embedding: None }).unwrap().unwrap();
        assert!(plane.normal.x.abs() > 0.9999, "{plane:?}");
    }

    #[test]
    fn pairs_of_one_side_count_for_both() {
        let source = Walker::new(0.035).mesh;
        let target = turned(&source);
        let (st, tt) = (Topology::new(&source), Topology::new(&target));
        let shape = |mesh, topology| Shape { mesh, topology, embedding: None };
        // Vertices with x far from 0, of which one has a partner on the other side, and one with x
        // near 0.
        let nearest = |p: DVec3| {
            let off = |v: &u32| source.positions[*v as usize].distance(p);
            (0..source.vertex_count() as u32).min_by(|a, b| off(a).total_cmp(&off(b))).unwrap()
        };
        let (_, high) = source.bounds().unwrap();
        let hand = source.positions.iter().copied().max_by(|a, b| a.x.total_cmp(&b.x)).unwrap();
        let foot = DVec3::new(0.1, 0.02, 0.1);
        let vertices =
            [nearest(hand), nearest(foot), nearest(DVec3::new(-foot.x, foot.y, foot.z)), nearest(DVec3::Y * high.y)];
        let points = |mesh: &Mesh, topology: &Topology| -> Vec<SurfacePoint> {
            vertices.iter().map(|&v| vertex_point(mesh, topology, v, "anchor").unwrap()).collect()
        };
        let pairs = AnchorPairs { source: points(&source, &st), target: points(&target, &tt) };
        let out = mirrored(shape(&source, &st), shape(&target, &tt), &pairs).unwrap();
        assert_eq!((out.of.as_slice(), out.middle), ([0].as_slice(), 1));
        let other = out.pairs.source[4].position(&source);
        assert!(other.distance(DVec3::new(-hand.x, hand.y, hand.z)) < 0.02, "{other}");
        // The same place of the target, which is the source turned.
        let there = out.pairs.target[4];
        assert!(there.position(&source).distance(other) < 0.02);
        // A shape that is not symmetric is named.
        let mut lame = lobed_sphere(3, 0.3);
        lame.positions
            .iter_mut()
            .for_each(|p| *p = DVec3::new(p.x + 0.6 * p.y * p.y + 0.3 * p.z.powi(3), p.y + 0.4 * p.z * p.x, p.z));
        let lt = Topology::new(&lame);
        let points = vec![vertex_point(&lame, &lt, 0, "anchor").unwrap()];
        let pairs = AnchorPairs { source: points, target: pairs.target[..1].to_vec() };
        let error = mirrored(shape(&lame, &lt), shape(&target, &tt), &pairs).unwrap_err().to_string();
        assert!(error.contains("not its own mirror image"), "{error}");
    }
}
