//! A spline whose control points are known in R^D, and its points on the surface.

use glam::DVec3;
use rayon::prelude::*;

use super::layout::{Layout, de_boor};
use super::subdivide::halve;
use crate::geometry::{Frame, Mesh, NONE, SurfacePoint};
use crate::surface::forward::{Average, Forward, Origin, planar};
use crate::surface::vector::{Vector, distance_squared};

/// Points evaluated one after the other, each beginning where the one before ended.
const CHUNK: usize = 64;
/// Two control points farther apart than this, in mean edges, are averaged by a search over the
/// whole surface.
const FAR: f64 = 4.0;

/// A spline on a surface.
pub(super) struct Curve<'a, const D: usize> {
    pub(super) mesh: &'a Mesh,
    /// Where samples are told, in the units of the mesh.
    frame: Frame,
    pub(super) forward: &'a Forward<D>,
    pub(super) layout: Layout,
    pub(super) controls: Vec<SurfacePoint>,
    embedded: Vec<Vector<f64, D>>,
}

/// A span with its knots and control points at hand.
pub(super) struct Span<'a, const D: usize> {
    pub(super) curve: &'a Curve<'a, D>,
    index: usize,
    knots: Vec<f64>,
    controls: Vec<Vector<f64, D>>,
    planar: Option<(u32, Vec<[f64; 3]>)>,
}

/// A point of the curve.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    /// In `0..=spans`.
    pub(super) u: f64,
    pub(super) point: SurfacePoint,
    /// About the origin of the curve's frame.
    pub(super) position: DVec3,
    pub(super) origin: Origin,
    pub(super) distance_squared: f64,
}

impl<'a, const D: usize> Curve<'a, D> {
    /// `frame` is one of the mesh at its own size ([`Frame::in_units`]).
    pub(super) fn new(
        (mesh, frame): (&'a Mesh, Frame),
        forward: &'a Forward<D>,
        layout: Layout,
        controls: Vec<SurfacePoint>,
    ) -> Self {
        let embedded = controls.iter().map(|p| forward.embed(p)).collect();
        Self { mesh, frame, forward, layout, controls, embedded }
    }

    /// Another curve on the same surface.
    pub(super) fn of_same(&self, layout: Layout, controls: Vec<SurfacePoint>) -> Self {
        Self::new((self.mesh, self.frame), self.forward, layout, controls)
    }

    pub(super) fn span(&'a self, s: usize) -> Span<'a, D> {
        let at = |i: usize| self.layout.control(s, i);
        let points: Vec<SurfacePoint> = (0..=self.layout.degree).map(|i| self.controls[at(i)]).collect();
        let planar = self.forward.common_face(&points).and_then(|face| {
            let x: Option<Vec<[f64; 3]>> = points.iter().map(|p| self.forward.coordinates_in(p, face)).collect();
            Some((face, x?))
        });
        Span {
            curve: self,
            index: s,
            knots: (0..2 * self.layout.degree).map(|j| self.layout.knot(s, j)).collect(),
            controls: (0..=self.layout.degree).map(|i| self.embedded[at(i)]).collect(),
            planar,
        }
    }

    /// The points at parameters in 0..=1.
    pub(super) fn points(&self, parameters: &[f64]) -> Vec<Sample> {
        let chunk = |ts: &[f64]| {
            let mut out: Vec<Sample> = Vec::with_capacity(ts.len());
            let mut span: Option<(usize, Span<'_, D>)> = None;
            for &t in ts {
                let (s, u) = self.layout.locate(t);
                if span.as_ref().is_none_or(|(now, _)| *now != s) {
                    span = Some((s, self.span(s)));
                }
                let Some((_, span)) = &span else { continue };
                let near = out
                    .last()
                    .filter(|l| (l.u - u).abs() * span.length() <= 1.0)
                    .map_or_else(|| span.near(), |l| l.point.face);
                out.push(span.at(u, near));
            }
            out
        };
        parameters.par_chunks(CHUNK).flat_map_iter(chunk).collect()
    }

    /// Length of the control polygon, in mean edges.
    pub(super) fn length(&self) -> f64 {
        let (n, closed) = (self.embedded.len(), self.layout.closed);
        let step = |i: usize| distance_squared(&self.embedded[i], &self.embedded[(i + 1) % n]).sqrt();
        (0..if closed { n } else { n - 1 }).map(step).sum()
    }

    /// The largest distance of two neighbouring control points, in mean edges.
    pub(super) fn widest(&self) -> f64 {
        let (n, closed) = (self.embedded.len(), self.layout.closed);
        let steps = (0..if closed { n } else { n - 1 })
            .map(|i| distance_squared(&self.embedded[i], &self.embedded[(i + 1) % n]));
        steps.fold(0.0, f64::max).sqrt()
    }

    /// The curve of repeated averages: every span halved once.
    pub(super) fn halved(&self) -> Self {
        let average = |a: &SurfacePoint, b: &SurfacePoint, w: f64| {
            let far = distance_squared(&self.forward.embed(a), &self.forward.embed(b)) > FAR * FAR;
            self.forward.average(&[*a, *b], &[1.0 - w, w], if far { NONE } else { a.face }).point
        };
        self.of_same(self.layout.halved(), halve(&self.layout, &self.controls, &average))
    }
}

impl<const D: usize> Span<'_, D> {
    /// Length of the control polygon, in mean edges: a bound of the length in R^D.
    pub(super) fn length(&self) -> f64 {
        self.controls.windows(2).map(|w| distance_squared(&w[0], &w[1]).sqrt()).sum()
    }

    /// Where a search for any of its points begins: at a control point where all are near one
    /// another, else everywhere.
    pub(super) fn near(&self) -> u32 {
        if self.length() > FAR {
            return NONE;
        }
        let layout = &self.curve.layout;
        self.curve.controls[layout.control(self.index, layout.degree / 2)].face
    }

    /// The weighted average of the control points in R^D.
    pub(super) fn mean(&self, u: f64) -> Vector<f64, D> {
        de_boor(&self.knots, &self.controls, u)
    }

    /// The point at `u`, searched from triangle `start`, or everywhere ([`NONE`]).
    pub(super) fn at(&self, u: f64, start: u32) -> Sample {
        let average = match &self.planar {
            Some((face, x)) => planar(*face, de_boor(&self.knots, x, u)),
            None => self.curve.forward.project(&self.mean(u), start),
        };
        self.sample(u, average)
    }

    pub(super) fn sample(&self, u: f64, a: Average) -> Sample {
        let position = self.curve.frame.place(&a.point, self.curve.mesh);
        Sample { u, point: a.point, position, origin: a.origin, distance_squared: a.distance_squared }
    }
}
