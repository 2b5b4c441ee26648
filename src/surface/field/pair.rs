//! What a field between two surfaces needs whatever the anchors are.

use glam::DVec3;
use rayon::prelude::*;

use super::predict::Known;
use super::{Field, FieldOptions};
use crate::engine::Real;
use crate::error::{Error, Result};
use crate::geometry::bending::Bending;
use crate::geometry::{Frame, Mesh, SurfacePoint};
use crate::surface::PhongSurface;
use crate::surface::anchors::AnchorPairs;
use crate::surface::correspondence::Shape;
use crate::surface::correspondence::drift::{Place, place};

/// Two surfaces at unit area, each about one of its points, and the bending energy of the target.
#[derive(Debug)]
pub(super) struct Shapes<'a> {
    pub(super) source: Shape<'a>,
    pub(super) target: Shape<'a>,
    /// Where the vertices are; those of no usable triangle at the origin.
    pub(super) source_places: Vec<DVec3>,
    pub(super) target_places: Vec<DVec3>,
    pub(super) bending: Bending,
    /// For each vertex of the target whether a usable triangle has it.
    pub(super) used: Vec<bool>,
}

impl<'a> Shapes<'a> {
    pub(super) fn new(source: Shape<'a>, target: Shape<'a>) -> Result<Self> {
        let used: Vec<bool> =
            (0..target.mesh.vertex_count()).map(|v| !target.topology.vertex_triangles(v as u32).is_empty()).collect();
        let (source_places, target_places) = (places(&source), places(&target));
        let bending = Bending::new(&target_places, &usable_triangles(&target))?;
        Ok(Self { source, target, source_places, target_places, bending, used })
    }

    pub(super) fn source_position(&self, v: usize) -> DVec3 {
        self.source_places[v]
    }

    pub(super) fn target_position(&self, v: usize) -> DVec3 {
        self.target_places[v]
    }

    /// The place of a point of the source.
    pub(super) fn source_point(&self, p: &SurfacePoint) -> DVec3 {
        combine(&self.source_places, self.source.mesh, p)
    }

    /// Positions of the anchors.
    pub(super) fn on_source(&self, anchors: &AnchorPairs) -> Vec<DVec3> {
        anchors.source.iter().map(|p| self.source_point(p)).collect()
    }

    pub(super) fn on_target(&self, anchors: &AnchorPairs) -> Vec<DVec3> {
        anchors.target.iter().map(|p| combine(&self.target_places, self.target.mesh, p)).collect()
    }
}

/// The vertices of a surface at unit area in its own frame.
fn places(shape: &Shape<'_>) -> Vec<DVec3> {
    let frame = Frame::of_mesh(shape.mesh);
    let length = shape.mesh.area().sqrt() * frame.scale;
    let used = |v: usize| !shape.topology.vertex_triangles(v as u32).is_empty();
    let at = |(v, p): (usize, &DVec3)| if used(v) { frame.local(*p) / length } else { DVec3::ZERO };
    shape.mesh.positions.iter().enumerate().map(at).collect()
}

fn combine(places: &[DVec3], mesh: &Mesh, p: &SurfacePoint) -> DVec3 {
    let corners = mesh.triangle(p.face as usize);
    (0..3).map(|k| places[corners[k] as usize] * p.barycentric[k]).sum()
}

/// An embedding at unit area of its mesh.
#[derive(Debug)]
pub(super) struct Side<const D: usize> {
    pub(super) surface: PhongSurface<f64, D>,
    /// Edges of the embedding at unit area.
    pub(super) edge: f64,
}

impl<const D: usize> Side<D> {
    fn new(shape: &Shape<'_>) -> Result<Self> {
        let Some(e) = shape.embedding.filter(|e| e.dimension == D) else {
            return Err(Error::input("an embedding is missing", "Embed both meshes with the same --dimension"));
        };
        let surface = PhongSurface::<f64, D>::new(shape.topology, &e.points)?;
        let edge = surface.edge / shape.mesh.area().sqrt();
        Ok(Self { surface, edge })
    }

    pub(super) fn place(&self, p: &SurfacePoint) -> Place<D> {
        let (y, basis) = place(&self.surface, p);
        (y.map(|x| x * self.edge), basis)
    }
}

/// Two surfaces embedded in R^D, made ready for fields: their tangents, and the bending energy of
/// the target. An anchor that is moved, added or taken away leaves all of this as it is.
#[derive(Debug)]
pub struct FieldPair<'a, const D: usize> {
    pub(super) shapes: Shapes<'a>,
    pub(super) from: Side<D>,
    pub(super) to: Side<D>,
}

impl<'a, const D: usize> FieldPair<'a, D> {
    /// Prepares both surfaces. O(V + F), and the analysis of one sparse factorisation.
    ///
    /// # Errors
    /// If an embedding is missing or not of dimension `D`, or there is not enough memory.
    pub fn new(source: Shape<'a>, target: Shape<'a>) -> Result<Self> {
        let (sides, shapes) = rayon::join(
            || rayon::join(|| Side::<D>::new(&target), || Side::<D>::new(&source)),
            || Shapes::new(source, target),
        );
        Ok(Self { from: sides.0?, to: sides.1?, shapes: shapes? })
    }

    /// The field through these anchors. `O(V n D^2)` for the prediction, three numerical
    /// factorisations and 18 rounds of closest points for the relaxation, and the same again for
    /// each pair that is suspected of being wrong.
    ///
    /// # Errors
    /// If there is no anchor, or the relaxation breaks down.
    pub fn field<S: Real, const K: usize>(&self, anchors: &AnchorPairs, options: &FieldOptions) -> Result<Field<S, K>> {
        // A field that is not relaxed, or of a mesh on itself, has nothing to be judged by.
        let judging = options.relax && !self.is_self_map();
        let (field, options) = if judging && !options.keep_all {
            let mut judged = self.judged(anchors, options)?;
            let kept = anchors.part(&judged.kept);
            let (field, options) = self.chosen(judged.field, &kept, options)?;
            judged.field = field;
            (self.name(judged, anchors), options)
        } else {
            let field: Field<f64, K> = Field::of(self, anchors, options)?;
            if judging { self.chosen(field, anchors, options)? } else { (field, *options) }
        };
        if !(options.anchor_error > 0.0) {
            return Ok(field.into_precision());
        }
        let options = &options;
        let left: Vec<usize> = field.report.contradicted.iter().map(|c| c.index).collect();
        let kept: Vec<usize> = (0..anchors.len()).filter(|i| !left.contains(i)).collect();
        let loosened = self.loosened::<K>(&anchors.part(&kept), options.anchor_error, options)?;
        let moved: Field<f64, K> = Field::of(self, &loosened.anchors, options)?;
        Ok(moved.vouched_less(loosened.error, field.report).into_precision())
    }

    /// Whether both surfaces are one mesh: then a pair that contradicts the identity is what the
    /// user wants, a texture that is pulled.
    pub(super) fn is_self_map(&self) -> bool {
        let (source, target) = (&self.shapes.source, &self.shapes.target);
        source.topology.triangles == target.topology.triangles && source.mesh.positions == target.mesh.positions
    }

    /// What the anchors say.
    pub(super) fn known(&self, anchors: &AnchorPairs) -> Known<D> {
        let places: Vec<Place<D>> = anchors.target.par_iter().map(|p| self.from.place(p)).collect();
        Known {
            a: places.iter().map(|p| p.0).collect(),
            places,
            b: anchors.source.iter().map(|p| self.to.place(p).0).collect(),
            s: self.shapes.on_target(anchors),
            t: self.shapes.on_source(anchors),
        }
    }
}

fn usable_triangles(shape: &Shape<'_>) -> Vec<[u32; 3]> {
    let t = shape.topology;
    t.triangles.iter().zip(&t.usable).filter(|(_, u)| **u).map(|(t, _)| *t).collect()
}
