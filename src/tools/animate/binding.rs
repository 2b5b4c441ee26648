//! Which point of a clip moves which vertex, and where the vertices go.
//!
//! A similarity takes the clip to the mesh: it is fitted in one frame, the reference, in which the
//! performer stands as the mesh does. What it leaves between a marker and its vertex (the thickness
//! of flesh, other proportions) is carried along: it turns as the bone turns or, for markers, as
//! the markers around turn. In the reference frame every vertex is where it is at rest.

use glam::{DMat3, DQuat, DVec3};

use crate::encoding::Similarity;
use crate::error::{Error, Result};
use crate::geometry::Mesh;
use crate::geometry::off_mesh::{ELSEWHERE, FARTHEST, lies_off};
use crate::io::AnchorSpec;
use crate::io::handles::vertex_at;
use crate::io::markers::MarkerPlace;
use crate::io::motion::Motion;

/// Markers whose motion tells how the surface at a marker turns.
const NEIGHBOURS: usize = 6;

/// Mean distance of joints from their vertices, in diagonals of the mesh, above which a skeleton's
/// pose is not that of the mesh.
const APART: f64 = 0.07;

/// One vertex and what moves it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bond {
    /// The vertex.
    pub vertex: u32,
    /// The point of the clip: a marker or a joint.
    pub point: usize,
}

/// The pose of a clip in which the performer stands as the mesh does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reference {
    /// A frame, counted from 0.
    Frame(usize),
    /// All rotations zero; of skeletons only.
    Rest,
}

/// Vertices bound to the points of a clip.
#[derive(Clone, Debug, PartialEq)]
pub struct Binding {
    /// Each vertex once.
    pub bonds: Vec<Bond>,
    /// Takes the clip's units and axes to the mesh's.
    pub fit: Similarity,
    /// The pose in which it was fitted.
    pub reference: Reference,
    /// For each bond the distance from the fitted point to its vertex, in the mesh's units.
    pub residuals: Vec<f64>,
    /// What is odd but no error.
    pub warnings: Vec<String>,
}

impl Binding {
    /// Binds by given places: the similarity is the one that fits the points to their vertices best
    /// (for several vertices of one joint, to their mean).
    ///
    /// # Errors
    /// [`Error::Input`] for names the clip does not have, vertices the mesh does not have, a point
    /// with a gap in the reference frame, or fewer than three points at different places, which
    /// leave the fit open.
    pub fn given(motion: &Motion, mesh: &Mesh, places: &[(String, MarkerPlace)], reference: Reference) -> Result<Self> {
        let mut bonds: Vec<Bond> = Vec::new();
        let mut pairs = Vec::new();
        for (name, place) in places {
            let point = motion.index_of(name)?;
            let vertices = match place {
                MarkerPlace::Vertices(list) => list.clone(),
                MarkerPlace::Position(p) => vec![nearest_vertex(mesh, name, *p)?],
                MarkerPlace::Face(face, barycentric) => {
                    let spec = AnchorSpec::Face { face: *face, barycentric: *barycentric };
                    let wrong = |what| Error::input(format!("marker {name}: {what} (mesh {})", mesh.name), ELSEWHERE);
                    vec![vertex_at(&spec, mesh).map_err(wrong)?.0]
                }
            };
            let from = reference_point(motion, reference, point)?;
            let mut mean = DVec3::ZERO;
            for &vertex in &vertices {
                let Some(p) = mesh.positions.get(vertex as usize) else {
                    let what =
                        format!("marker {name} names vertex {vertex}, {} has {}", mesh.name, mesh.vertex_count());
                    return Err(Error::input(what, "Vertex indices count from 0, in the order of the file"));
                };
                mean += *p / vertices.len() as f64;
                let given = vertex;
                let vertex = mesh.representative(given);
                if let Some(other) = bonds.iter().find(|b| b.vertex == vertex) {
                    if other.point == point && vertex != given {
                        // The same place, repeated by the file.
                        continue;
                    }
                    let what = format!("vertex {vertex} is bound to {} and to {name}", motion.names[other.point]);
                    return Err(Error::input(what, "Bind it to one of them"));
                }
                bonds.push(Bond { vertex, point });
            }
            pairs.push((from, mean));
        }
        let distinct = pairs.iter().filter(|p| p.0 != pairs[0].0).count();
        if distinct < 2 || spread(&pairs) < 1e-6 {
            let what = format!("{} markers, or all on one line, leave open how the clip lies on the mesh", pairs.len());
            return Err(Error::input(what, "Bind at least three markers that are not on one line"));
        }
        Self::fitted(motion, mesh, bonds, Similarity::fit(&pairs), reference)
    }

    /// The binding of `bonds` with a similarity that is known.
    ///
    /// # Errors
    /// [`Error::Input`] for a point with a gap in the reference frame.
    pub fn fitted(
        motion: &Motion,
        mesh: &Mesh,
        bonds: Vec<Bond>,
        fit: Similarity,
        reference: Reference,
    ) -> Result<Self> {
        let mut residuals = Vec::with_capacity(bonds.len());
        for bond in &bonds {
            let at = fit.apply(reference_point(motion, reference, bond.point)?);
            residuals.push(at.distance(mesh.positions[bond.vertex as usize]));
        }
        let mut binding = Self { bonds, fit, reference, residuals, warnings: Vec::new() };
        let size = mesh.bounds().map_or(0.0, |(low, high)| low.distance(high));
        let far = |b: &usize| binding.residuals[*b] > 0.1 * size;
        let far: Vec<&str> = (0..binding.bonds.len())
            .filter(far)
            .map(|b| motion.names[binding.bonds[b].point].as_str())
            .take(8)
            .collect();
        if motion.skeleton.is_none() && !far.is_empty() {
            binding.warnings.push(format!(
                "markers far from their vertices (over a tenth of the mesh's size): {}. Check their places, and that the reference frame shows the \
                 performer in the pose of the mesh",
                far.join(", ")
            ));
        }
        if motion.skeleton.is_some() && binding.rms() > APART * size {
            binding.warnings.push(format!(
                "joints and the vertices around them are {:.1} % of the mesh's size apart (rms): the skeleton's reference pose and the mesh hardly agree. Choose \
                 another reference frame, or bind by a file",
                100.0 * binding.rms() / size
            ));
        }
        Ok(binding)
    }

    /// Root mean square of the residuals.
    pub fn rms(&self) -> f64 {
        (self.residuals.iter().map(|r| r * r).sum::<f64>() / self.residuals.len().max(1) as f64).sqrt()
    }

    /// The points of the clip that are bound, each once, in ascending order.
    pub fn points(&self) -> Vec<usize> {
        let mut points: Vec<usize> = self.bonds.iter().map(|b| b.point).collect();
        points.sort_unstable();
        points.dedup();
        points
    }

    /// Where the bound vertices go in each frame of `motion`, a part of the clip `bound` that the
    /// binding was made with: `result[frame][bond]`. `tracks[frame][k]` is where the `k`-th of
    /// [`Binding::points`] is.
    ///
    /// # Errors
    /// As [`Binding::given`], if the clip is not the one that was bound.
    pub fn trajectories(
        &self,
        bound: &Motion,
        motion: &Motion,
        mesh: &Mesh,
        tracks: &[Vec<DVec3>],
    ) -> Result<Vec<Vec<DVec3>>> {
        let points = self.points();
        let start: Vec<DVec3> =
            points.iter().map(|&p| reference_point(bound, self.reference, p)).collect::<Result<_>>()?;
        let slot: Vec<usize> = self.bonds.iter().map(|b| points.binary_search(&b.point).unwrap_or(0)).collect();
        let around = neighbourhoods(&start);
        let mut frames = Vec::with_capacity(tracks.len());
        for (f, track) in tracks.iter().enumerate() {
            let turns: Vec<DMat3> = (0..points.len())
                .map(|k| match (&motion.skeleton, &bound.skeleton) {
                    (Some(now), Some(then)) => {
                        let before = match self.reference {
                            Reference::Rest => DQuat::IDENTITY,
                            Reference::Frame(f) => then.rotations[f][points[k]],
                        };
                        DMat3::from_quat(now.rotations[f][points[k]] * before.inverse())
                    }
                    _ => turning(&start, track, &around[k]),
                })
                .collect();
            let place = |(bond, &k): (&Bond, &usize)| {
                let rest = mesh.positions[bond.vertex as usize];
                // The vertex as seen from the point, in the clip's axes.
                let away = self.fit.rotation.transpose() * (rest - self.fit.apply(start[k]));
                self.fit.apply(track[k]) + self.fit.rotation * (turns[k] * away)
            };
            frames.push(self.bonds.iter().zip(&slot).map(place).collect());
        }
        Ok(frames)
    }
}

/// Where a point is in the reference pose.
pub(super) fn reference_point(motion: &Motion, reference: Reference, point: usize) -> Result<DVec3> {
    let file = motion.path.display();
    let found = match (reference, &motion.skeleton) {
        (Reference::Rest, None) => {
            let what = format!("{file}: markers have no pose at rest");
            return Err(Error::option("reference", what, "Name the frame that shows the pose of the mesh"));
        }
        (Reference::Rest, Some(skeleton)) => skeleton.rest.get(point).copied(),
        (Reference::Frame(f), _) if f >= motion.frames.len() => {
            let what = format!("{file}: frame {f} of {}", motion.frames.len());
            return Err(Error::option("reference", what, "Frames count from 0"));
        }
        (Reference::Frame(f), _) => motion.frames[f][point],
    };
    found.ok_or_else(|| {
        let what = format!("{file}: marker {} is not seen in the reference pose {reference:?}", motion.names[point]);
        Error::input(what, "Choose a reference frame in which it is seen, or leave it out")
    })
}

/// A frame in which most of `points` are seen, the first of them.
pub fn fullest_frame(motion: &Motion, points: &[usize]) -> usize {
    let seen = |f: usize| points.iter().filter(|&&p| motion.frames[f][p].is_some()).count();
    (0..motion.frames.len()).max_by_key(|&f| (seen(f), std::cmp::Reverse(f))).unwrap_or(0)
}

fn nearest_vertex(mesh: &Mesh, name: &str, p: DVec3) -> Result<u32> {
    let distance = |v: &usize| mesh.positions[*v].distance_squared(p);
    let finite = (0..mesh.vertex_count()).filter(|&v| mesh.positions[v].is_finite());
    let nearest = finite.min_by(|a, b| distance(a).total_cmp(&distance(b)));
    let nearest = nearest.ok_or_else(|| Error::mesh(&mesh.name, "there are no vertices", "Use a mesh with faces"))?;
    let diagonal = mesh.bounds().map_or(0.0, |(low, high)| low.distance(high));
    let away = distance(&nearest).sqrt();
    if !(away <= FARTHEST * diagonal) {
        let what = format!(
            "marker {name}: the position {} {} (mesh {})",
            crate::io::place(p),
            lies_off(away, diagonal),
            mesh.name
        );
        return Err(Error::input(what, ELSEWHERE));
    }
    Ok(nearest as u32)
}

/// How far the points are from lying on one line: the area of the largest triangle with the two
/// that are farthest apart, over their distance squared.
fn spread(pairs: &[(DVec3, DVec3)]) -> f64 {
    let Some(first) = pairs.first() else { return 0.0 };
    let far = |from: DVec3| pairs.iter().map(|p| p.0).max_by(|a, b| a.distance(from).total_cmp(&b.distance(from)));
    let Some(a) = far(first.0) else { return 0.0 };
    let Some(b) = far(a) else { return 0.0 };
    let area = pairs.iter().map(|p| (b - a).cross(p.0 - a).length()).fold(0.0, f64::max);
    area / (b - a).length_squared().max(f64::MIN_POSITIVE)
}

/// For each point itself and its nearest ones.
fn neighbourhoods(points: &[DVec3]) -> Vec<Vec<usize>> {
    let around = |p: &DVec3| {
        let mut order: Vec<usize> = (0..points.len()).collect();
        order.sort_by(|&a, &b| points[a].distance_squared(*p).total_cmp(&points[b].distance_squared(*p)));
        order.truncate(NEIGHBOURS);
        order
    };
    points.iter().map(around).collect()
}

/// The rotation of a neighbourhood from the reference to a frame.
fn turning(start: &[DVec3], now: &[DVec3], around: &[usize]) -> DMat3 {
    let pairs: Vec<(DVec3, DVec3)> = around.iter().map(|&k| (start[k], now[k])).collect();
    if pairs.len() < 3 { DMat3::IDENTITY } else { Similarity::fit(&pairs).rotation }
}

#[cfg(test)]
#[path = "binding_tests.rs"]
mod tests;
