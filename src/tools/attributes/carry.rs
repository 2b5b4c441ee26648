//! What a vertex takes from the triangle that its image lies in.

use glam::DVec3;
use rayon::prelude::*;

use super::{Attribute, AttributeKind};
use crate::geometry::{Frame, Mesh, SurfacePoint, Topology};
use crate::surface::Status;
use crate::surface::quality::{normal_at, vertex_normals};
use crate::tools::differential::Differential;
use crate::tools::vertex_map::VertexMap;

/// Edges whose images are this many times longer than sizes of the meshes let expect lead across a
/// jump of the map.
const JUMP: f64 = 8.0;

/// Source, target and the map of the target's vertices.
pub(super) struct Carrier<'a> {
    source: &'a Mesh,
    /// At the source's own size.
    frame: Frame,
    source_normals: Vec<DVec3>,
    target: &'a Mesh,
    around_target: &'a Topology,
    normals: &'a [DVec3],
    map: &'a VertexMap,
}

impl<'a> Carrier<'a> {
    pub(super) fn new(
        source: (&'a Mesh, &Topology),
        target: (&'a Mesh, &'a Topology),
        map: &'a VertexMap,
        normals: &'a [DVec3],
    ) -> Self {
        let source_normals = vertex_normals(source.0, source.1);
        let frame = Frame::of_mesh(source.0).in_units();
        Self { source: source.0, frame, source_normals, target: target.0, around_target: target.1, normals, map }
    }

    /// The image of vertex `v`, its coordinates in the triangle.
    fn image(&self, v: usize) -> Option<SurfacePoint> {
        let point = self.map.images[v].point()?;
        let b = point.barycentric.map(|b| b.max(0.0));
        let sum = b[0] + b[1] + b[2];
        let inside = (point.face as usize) < self.source.triangle_count() && sum > 0.0;
        inside.then(|| SurfacePoint::new(point.face, b.map(|b| b / sum)))
    }

    /// The map's differential at each vertex, fitted to its edges.
    pub(super) fn differentials(&self) -> Vec<Option<Differential>> {
        let ratio = (self.target.area() / self.source.area()).sqrt();
        let ratio = if ratio.is_finite() && ratio > 0.0 { ratio } else { 1.0 };
        (0..self.target.vertex_count())
            .into_par_iter()
            .map(|v| {
                let normal = Some(self.normals[v]).filter(|n| *n != DVec3::ZERO)?;
                let image = self.image(v)?;
                let image_normal = normal_at(self.source, &self.source_normals, &image);
                let image_normal = Some(image_normal).filter(|n| *n != DVec3::ZERO)?;
                let (p, q) = (self.target.positions[v], self.frame.place(&image, self.source));
                let place = |w: usize| self.map.images[w].point().map(|p| self.frame.place(&p, self.source));
                let valid = |w: usize| self.map.images[w].status() == Status::Valid || w == v;
                let steps = self.around_target.one_ring(v as u32).vertices.into_iter().filter_map(|w| {
                    let w = w as usize;
                    let (e, f) = (self.target.positions[w] - p, place(w).filter(|_| valid(w))? - q);
                    (f.length() * ratio <= JUMP * e.length()).then_some((e, f))
                });
                Differential::fit(normal, image_normal, steps)
                    .or_else(|| Differential::shortest_turn(normal, image_normal))
            })
            .collect()
    }

    /// The attribute on the target as the map has it, not finished; NaN where there is nothing.
    pub(super) fn carry(&self, attribute: &Attribute, differentials: &[Option<Differential>]) -> Attribute {
        let n = attribute.columns;
        let mut values = vec![f64::NAN; n * self.target.vertex_count()];
        values.par_chunks_mut(n).enumerate().for_each(|(v, out)| {
            let Some(image) = self.image(v) else { return };
            // A vertex that the file repeats may have other data in each of its places.
            let corners = self.source.file_triangle_corners(image.face as usize).map(|c| c.vertex as usize);
            let rows = corners.map(|c| &attribute.values[c * n..(c + 1) * n]);
            let b = image.barycentric;
            let linear = |k: usize| b[0] * rows[0][k] + b[1] * rows[1][k] + b[2] * rows[2][k];
            match attribute.kind {
                AttributeKind::Labels => {
                    for (k, out) in out.iter_mut().enumerate() {
                        *out = heaviest([rows[0][k], rows[1][k], rows[2][k]], b);
                    }
                }
                AttributeKind::Scalars | AttributeKind::Weights { .. } => {
                    for (k, out) in out.iter_mut().enumerate() {
                        *out = linear(k);
                    }
                }
                AttributeKind::Vectors | AttributeKind::Normals | AttributeKind::Tangents => {
                    let Some(d) = &differentials[v] else { return };
                    for (k, out) in out.chunks_exact_mut(3).enumerate() {
                        let turned = d.turn(DVec3::new(linear(3 * k), linear(3 * k + 1), linear(3 * k + 2)));
                        out.copy_from_slice(&turned.to_array());
                    }
                    if let [_, _, _, hand] = out {
                        *hand = heaviest([rows[0][3], rows[1][3], rows[2][3]], b) * d.orientation();
                    }
                }
            }
        });
        Attribute { name: attribute.name.clone(), kind: attribute.kind, columns: n, values }
    }
}

/// The value that the corners with it weigh most for; the first of equals.
fn heaviest(values: [f64; 3], weights: [f64; 3]) -> f64 {
    let weight = |k: usize| (0..3).filter(|&j| values[j] == values[k]).map(|j| weights[j]).sum::<f64>();
    let mut best = 0;
    for k in 1..3 {
        if weight(k) > weight(best) {
            best = k;
        }
    }
    values[best]
}

/// Brings values to what their kind promises.
pub(super) fn finish(attribute: &mut Attribute, normals: &[DVec3]) {
    let (n, kind) = (attribute.columns, attribute.kind);
    attribute.values.par_chunks_mut(n).zip(normals).for_each(|(row, normal)| match kind {
        AttributeKind::Scalars | AttributeKind::Labels | AttributeKind::Vectors => {}
        AttributeKind::Weights { keep } => share(row, keep),
        AttributeKind::Normals => row.chunks_exact_mut(3).for_each(|v| unit(v, None)),
        AttributeKind::Tangents => {
            unit(&mut row[..3], Some(*normal));
            if let [_, _, _, hand] = row
                && !hand.is_nan()
            {
                *hand = if *hand < 0.0 { -1.0 } else { 1.0 };
            }
        }
    });
}

/// Keeps the largest `keep` weights (all for 0), the first of equals, and divides by their sum.
fn share(row: &mut [f64], keep: usize) {
    // Whatever is no weight at all stays what it is: NaN.
    for w in row.iter_mut() {
        *w = if *w < 0.0 { 0.0 } else { *w };
    }
    if keep > 0 && keep < row.len() {
        let mut order: Vec<usize> = (0..row.len()).collect();
        order.sort_by(|&a, &b| row[b].total_cmp(&row[a]).then(a.cmp(&b)));
        for &k in &order[keep..] {
            row[k] = if row[k].is_nan() { f64::NAN } else { 0.0 };
        }
    }
    let sum: f64 = row.iter().sum();
    if sum > 0.0 {
        row.iter_mut().for_each(|w| *w /= sum);
    }
}

/// Makes a vector one of length 1, across `normal` if given; nothing of no length stays 0.
fn unit(v: &mut [f64], normal: Option<DVec3>) {
    let mut u = DVec3::from_slice(v);
    if u.is_nan() {
        return;
    }
    if let Some(n) = normal {
        u -= n * n.dot(u);
    }
    v.copy_from_slice(&u.normalize_or_zero().to_array());
}
