//! The part of a mesh around the anchors, on which a decal is laid out.

use glam::{DMat2, DMat3, DVec2, DVec3};

use super::DecalAnchors;
use crate::error::{Error, Result};
use crate::geometry::{Frame, Geodesics, March, Mesh, NONE, Topology};

/// How far beyond the picture, in its sides, the layout goes at least: its free border should not
/// be the picture's.
const ROOM: f64 = 0.2;
/// Points whose distances from the anchors fit no point of a plane by more than this part of the
/// anchors' own mean square distance from their middle are on the other side of something.
const BEHIND: f64 = 0.6;

/// Anchors that distances are taken from, at most: the ones farthest apart in the picture.
const MOST: usize = 24;

/// Triangles near the anchors as a mesh of their own, scaled to area one.
#[derive(Debug)]
pub(super) struct Domain {
    /// Vertex of the whole mesh for each vertex of the part, ascending.
    pub(super) vertices: Vec<u32>,
    /// Triangle of the whole mesh for each of the part, ascending.
    pub(super) faces: Vec<u32>,
    /// Scaled positions.
    pub(super) positions: Vec<DVec3>,
    /// Triangles over the part's vertices.
    pub(super) triangles: Vec<[u32; 3]>,
    /// Number of a vertex of the mesh in the part, or [`NONE`].
    pub(super) number: Vec<u32>,
}

/// Where points lie in the picture, roughly: by their distances along the surface from the anchors,
/// as if it were flat there.
///
/// With the picture's metric G (the one that fits the distances between anchors best) and anchors
/// at `a_i`, a point `p` at distances `d_i` has `p' G p - 2 a_i' G p = d_i^2 - a_i' G a_i`, which
/// is linear in `p` and `q = p' G p`: the least squares over all anchors. In a plane that is exact
/// and `q` is what it says; where a surface curves, `q` is too large.
struct Trilateration {
    metric: DMat2,
    middle: DVec2,
    /// Mean of `a' G a` over the anchors.
    size: f64,
    /// How badly the metric fits, in sides of the picture.
    misfit: f64,
}

impl Trilateration {
    /// From the distances between anchors, row by row.
    fn new(uv: &[DVec2], distances: &[f64]) -> Self {
        let n = uv.len();
        let (mut normal, mut right) = (DMat3::ZERO, DVec3::ZERO);
        let (mut sum, mut length) = (0.0, 0.0);
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))).filter(|(i, j)| i != j) {
            let (e, d) = (uv[i] - uv[j], distances[i * n + j]);
            let row = DVec3::new(e.x * e.x, 2.0 * e.x * e.y, e.y * e.y);
            normal += DMat3::from_cols(row * row.x, row * row.y, row * row.z);
            right += row * (d * d);
            sum += d * d;
            length += e.length_squared();
        }
        let isotropic = DMat2::from_diagonal(DVec2::splat(sum / length));
        let found = normal.inverse() * right;
        let fitted = DMat2::from_cols(DVec2::new(found.x, found.y), DVec2::new(found.y, found.z));
        // Anchors on a curved part, or in a wrong order, may fit no metric.
        let floor = 1e-2 * isotropic.x_axis.x;
        let positive = fitted.is_finite() && fitted.determinant() > floor * floor && fitted.x_axis.x > floor;
        let metric = if positive { fitted } else { isotropic };
        let middle = uv.iter().sum::<DVec2>() / n as f64;
        let size = uv.iter().map(|a| (*a - middle).dot(metric * (*a - middle))).sum::<f64>() / n as f64;
        let off = |i: usize, j: usize| {
            let e = uv[i] - uv[j];
            ((e.dot(metric * e)).sqrt() - distances[i * n + j]).powi(2)
        };
        let squares: f64 = (0..n).flat_map(|i| (0..n).map(move |j| (i, j))).map(|(i, j)| off(i, j)).sum();
        let misfit = (squares / (n * (n - 1)) as f64 / isotropic.x_axis.x).sqrt();
        Self { metric, middle, size, misfit }
    }

    /// For each vertex its place in the picture and how much too large `q` is, over
    /// [`Trilateration::size`].
    fn places(&self, uv: &[DVec2], marches: impl Iterator<Item = Vec<f64>>) -> Vec<(DVec2, f64)> {
        let row = |a: DVec2| {
            let g = self.metric * (a - self.middle);
            DVec3::new(-2.0 * g.x, -2.0 * g.y, 1.0)
        };
        let normal: DMat3 =
            uv.iter().map(|&a| row(a)).fold(DMat3::ZERO, |m, r| m + DMat3::from_cols(r * r.x, r * r.y, r * r.z));
        let inverse = normal.inverse();
        let mut right: Vec<DVec3> = Vec::new();
        for (&a, distances) in uv.iter().zip(marches) {
            right.resize(distances.len(), DVec3::ZERO);
            let own = (a - self.middle).dot(self.metric * (a - self.middle));
            for (right, d) in right.iter_mut().zip(distances) {
                *right += row(a) * (d * d - own);
            }
        }
        let place = |r: &DVec3| {
            let x = inverse * *r;
            let p = DVec2::new(x.x, x.y);
            (p + self.middle, (x.z - p.dot(self.metric * p)) / self.size)
        };
        right.iter().map(place).collect()
    }
}

/// Up to [`MOST`] points spread over a set: each as far as possible from those before.
fn spread(points: &[DVec2]) -> Vec<usize> {
    let mut chosen = vec![0];
    let mut distance: Vec<f64> = points.iter().map(|p| p.distance(points[0])).collect();
    while chosen.len() < MOST.min(points.len()) {
        let next = (0..points.len()).fold(0, |best, i| if distance[i] > distance[best] { i } else { best });
        chosen.push(next);
        for (d, p) in distance.iter_mut().zip(points) {
            *d = d.min(p.distance(points[next]));
        }
    }
    chosen
}

impl Domain {
    /// The usable triangles that the picture may reach, with room around, connected with the
    /// anchors' own. `corners` are the anchors' nearest vertices. O(n log n) for n vertices of the
    /// mesh, times the number of anchors up to 24.
    ///
    /// # Errors
    /// [`Error::Input`] if the anchors are not connected along the surface, or all at one point.
    pub(super) fn new(mesh: &Mesh, topology: &Topology, anchors: &DecalAnchors, corners: &[u32]) -> Result<Self> {
        let usable: Vec<[u32; 3]> =
            (0..mesh.triangle_count()).filter(|&t| topology.usable[t]).map(|t| mesh.triangle(t)).collect();
        let geodesics = Geodesics::of(&mesh.positions, &usable);
        let mut march = March::default();
        let mut distances_of = |v: u32| {
            geodesics.distances_from(v, &mut march);
            march.distances.clone()
        };
        let frame = Frame::of_mesh(mesh).in_units();
        let chosen = spread(&anchors.uv);
        let uv: Vec<DVec2> = chosen.iter().map(|&i| anchors.uv[i]).collect();
        let mut between = Vec::with_capacity(chosen.len() * chosen.len());
        for &i in &chosen {
            let d = distances_of(corners[i]);
            // Several anchors in one triangle may share their nearest corner.
            let place = |j: usize| frame.place(&anchors.points[j], mesh);
            let straight = |j: usize| place(i).distance(place(j));
            between.extend(chosen.iter().map(|&j| d[corners[j] as usize].max(straight(j))));
        }
        let most = between.iter().copied().fold(0.0, f64::max);
        if !(most > 0.0 && most.is_finite()) {
            return Err(Error::input(
                "the anchors are not connected along the surface, or all at one point",
                "Spread them over one connected part",
            ));
        }
        let flat = Trilateration::new(&uv, &between);
        let places = flat.places(&uv, chosen.iter().map(|&i| distances_of(corners[i])));
        let room = ROOM + flat.misfit.min(1.0);
        let near = |v: u32| {
            let (p, behind) = places[v as usize];
            let out = (p - 0.5).abs().max_element() - 0.5;
            out <= room && behind <= BEHIND
        };
        let mut stack: Vec<u32> = corners.iter().flat_map(|&v| topology.vertex_triangles(v)).copied().collect();
        stack.extend(anchors.points.iter().map(|p| p.face));
        let mut taken = vec![false; mesh.triangle_count()];
        stack.iter().for_each(|&t| taken[t as usize] = true);
        while let Some(t) = stack.pop() {
            for n in topology.neighbours[t as usize].into_iter().filter(|&n| n != NONE) {
                // A triangle with one corner near is taken too: coarse meshes.
                if !taken[n as usize] && mesh.triangle(n as usize).into_iter().any(near) {
                    taken[n as usize] = true;
                    stack.push(n);
                }
            }
        }
        let faces: Vec<u32> = (0..mesh.triangle_count() as u32).filter(|&t| taken[t as usize]).collect();
        Ok(Self::of(mesh, faces))
    }

    fn of(mesh: &Mesh, faces: Vec<u32>) -> Self {
        let mut number = vec![NONE; mesh.vertex_count()];
        faces.iter().flat_map(|&t| mesh.triangle(t as usize)).for_each(|v| number[v as usize] = 0);
        let vertices: Vec<u32> = (0..mesh.vertex_count() as u32).filter(|&v| number[v as usize] == 0).collect();
        for (i, &v) in vertices.iter().enumerate() {
            number[v as usize] = i as u32;
        }
        let area: f64 = faces.iter().map(|&t| mesh.triangle_area(t as usize)).sum();
        let scale = 1.0 / area.sqrt();
        let centre = Frame::of(vertices.iter().map(|&v| mesh.positions[v as usize])).origin;
        let positions = vertices.iter().map(|&v| (mesh.positions[v as usize] - centre) * scale).collect();
        let triangles = faces.iter().map(|&t| mesh.triangle(t as usize).map(|v| number[v as usize])).collect();
        Self { vertices, faces, positions, triangles, number }
    }

    /// The number of a triangle of the mesh in the part; [`NONE`] if it is not in it.
    pub(super) fn face(&self, t: u32) -> u32 {
        self.faces.binary_search(&t).map_or(NONE, |i| i as u32)
    }
}
