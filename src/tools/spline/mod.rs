//! Splines on surfaces (Panozzo et al. 2013, section 4.1, Figure 2): B-splines and Bezier curves
//! whose points are weighted averages of control points on the surface.
//!
//! [`Evaluation::Direct`] is the paper's: each point is one weighted average, the basis functions
//! being the weights. It is the fastest, but where control points are far apart an average may have
//! several projections nearly as close, and the curve jumps from one to another.
//! [`Evaluation::Subdivision`] first halves all spans by repeated averages of two neighbouring
//! control points (Lane and Riesenfeld 1980; Wallner and Pottmann 2006 and Mancinelli et al. 2022
//! on surfaces) until neighbours are about an edge apart, and then evaluates the finer curve in the
//! same way: all averages are of points that are near one another or the middle of two. Where the
//! surface is curved the two are different curves; [`Disagreement`] tells where and by how much.
//!
//! The polyline lies on the surface: every segment in one triangle, every crossing of a mesh edge a
//! point of that edge.

mod compare;
mod curve;
mod drawing;
mod layout;
mod subdivide;
mod trace;

use glam::DVec3;

pub use compare::Disagreement;
#[doc(hidden)]
pub use compare::DisagreementInterval;
pub use drawing::{DrawingOptions, drawing};
#[doc(hidden)]
pub use layout::MOST_DEGREE;
pub use layout::SplineKind;

use crate::error::{Error, Result};
use crate::forward_in_dimension as in_dimension;
use crate::geometry::{Frame, Mesh, NONE, SurfacePoint, Topology};
use crate::surface::correspondence::Shape;
use crate::surface::forward::{AnyForward, Forward, Origin};
use crate::words::words;
use curve::{Curve, Sample};
use layout::Layout;

/// Largest number of samples.
const MOST_SAMPLES: usize = 2_000_000;
/// Points that a curve may be expected to take.
const MOST_POINTS: f64 = 3e6;
/// Smallest tolerance, in diagonals of the mesh.
const LEAST_TOLERANCE: f64 = 1e-9;
/// Control points of a subdivided curve at most.
const MOST_CONTROLS: usize = 1 << 20;
/// Distance of neighbouring control points, in mean edges, at which a curve is fine enough.
const FINE: f64 = 1.0;

/// How the points of a spline are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Evaluation {
    /// One weighted average each.
    #[default]
    Direct,
    /// By repeated averages of neighbours first.
    Subdivision,
}

words! { Evaluation, "mode", "a way to evaluate a spline":
    Direct => "direct",
    Subdivision => "subdivision",
}

/// What a spline is like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SplineOptions {
    /// B-spline or Bezier.
    pub kind: SplineKind,
    /// Degree: 1 to 5 of a B-spline, 1 to [`MOST_DEGREE`] of Bezier pieces. 0 takes 3 for a
    /// B-spline and for closed Bezier pieces, else a single piece.
    pub degree: usize,
    /// Whether the curve ends where it began.
    pub closed: bool,
    /// How its points are found.
    pub evaluation: Evaluation,
    /// Largest distance of the curve from its polyline, in diagonals of the mesh; 1e-9 or more.
    pub tolerance: f64,
    /// Least number of intervals of the polyline.
    pub samples: usize,
}

impl Default for SplineOptions {
    fn default() -> Self {
        Self {
            kind: SplineKind::default(),
            degree: 0,
            closed: false,
            evaluation: Evaluation::default(),
            tolerance: 1e-5,
            samples: 0,
        }
    }
}

/// A point of a spline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurvePoint {
    /// Its parameter, 0..=1.
    pub parameter: f64,
    /// The point.
    pub point: SurfacePoint,
    /// The same in space.
    pub position: DVec3,
    /// Which definition it follows.
    pub origin: Origin,
}

/// A place where a spline jumps: its averages have several projections nearly as close, and go from
/// one to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurveJump {
    /// Its parameter.
    pub parameter: f64,
    /// Its length in space.
    pub length: f64,
    /// Whether the polyline goes on over the surface, along the averages of the two ends; their
    /// parameter is that of the jump.
    pub bridged: bool,
}

/// A spline as a polyline on the surface.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceCurve {
    /// Runs of points joined by segments, each within one triangle; more than one where a jump has
    /// no bridge.
    pub runs: Vec<Vec<CurvePoint>>,
    /// The jumps.
    pub jumps: Vec<CurveJump>,
    /// Whether the last point is the first.
    pub closed: bool,
    /// Number of spans.
    pub spans: usize,
    /// Times every span was halved.
    pub levels: u32,
    length: f64,
}

impl SurfaceCurve {
    /// All points, run by run.
    pub fn points(&self) -> impl Iterator<Item = &CurvePoint> {
        self.runs.iter().flatten()
    }

    /// Length of all segments, summed in the frame of the mesh: far from the origin the rounding of
    /// the [positions](CurvePoint::position) lengthens each of the many short segments beside a
    /// jump.
    pub fn length(&self) -> f64 {
        self.length
    }

    /// Points for which there was no Phong projection.
    pub fn without_projection(&self) -> usize {
        self.points().filter(|p| p.origin == Origin::Closest).count()
    }
}

/// A surface prepared for splines.
#[derive(Debug)]
pub struct SplineSurface<'a> {
    mesh: &'a Mesh,
    topology: &'a Topology,
    /// At the mesh's own size.
    frame: Frame,
    prepared: AnyForward,
    diagonal: f64,
}

impl<'a> SplineSurface<'a> {
    /// Prepares the surface of `shape`. O(F D + V log V).
    ///
    /// # Errors
    /// [`Error::Input`] if the embedding is missing or does not fit the mesh; as [`Forward::new`].
    pub fn new(shape: Shape<'a>) -> Result<Self> {
        let prepared = AnyForward::new(shape)?;
        let diagonal = shape.mesh.bounds().map_or(0.0, |(low, high)| low.distance(high));
        Ok(Self {
            mesh: shape.mesh,
            topology: shape.topology,
            frame: Frame::of_mesh(shape.mesh).in_units(),
            prepared,
            diagonal,
        })
    }

    /// The spline as a polyline on the surface, evaluated adaptively. Deterministic for any number
    /// of threads.
    ///
    /// # Errors
    /// [`Error::Option`] for options out of range; [`Error::Input`] naming the control point: too
    /// few, not on the mesh, on another component than the first, or not finite.
    pub fn trace(&self, controls: &[SurfacePoint], options: &SplineOptions) -> Result<SurfaceCurve> {
        let layout = self.check(controls, options)?;
        let tolerance = options.tolerance * self.diagonal;
        Ok(in_dimension!(&self.prepared, forward => {
            let (curve, levels) = self.curve(forward, layout, controls, options.evaluation);
            // Two points an edge, and more where the tolerance is far below the bend of a piece as
            // long as an edge.
            let edges = curve.length();
            let expected = edges * (2.0 + 0.5 / (tolerance / self.mesh.mean_edge_length()).sqrt());
            if expected > MOST_POINTS {
                let what = format!("a curve as long as {edges:.0} edges of the mesh would take about {expected:.0e} points");
                return Err(Error::option("tolerance", what, "Give a larger one, or fewer control points"));
            }
            let trace = trace::trace(&curve, options.samples, tolerance);
            let spans = curve.layout.spans();
            let point = |s: &Sample| self.point(s, spans);
            SurfaceCurve {
                runs: trace.runs.iter().map(|r| r.iter().map(point).collect()).collect(),
                jumps: trace
                    .jumps
                    .iter()
                    .map(|j| CurveJump { parameter: j.u / spans as f64, length: j.length, bridged: j.bridged })
                    .collect(),
                closed: layout.closed && trace.runs.len() == 1,
                spans: layout.spans(),
                levels,
                length: trace.length(),
            }
        }))
    }

    /// The points of the spline at parameters of 0..=1, in parallel; fastest where these rise.
    /// About a microsecond each for a direct evaluation.
    ///
    /// # Errors
    /// As [`Self::trace`].
    pub fn points(
        &self,
        controls: &[SurfacePoint],
        options: &SplineOptions,
        parameters: &[f64],
    ) -> Result<Vec<CurvePoint>> {
        let layout = self.check(controls, options)?;
        if let Some(t) = parameters.iter().find(|t| !(0.0..=1.0).contains(*t)) {
            return Err(Error::input(format!("the parameter {t} is not in 0..=1"), "A curve ends at parameter 1"));
        }
        Ok(in_dimension!(&self.prepared, forward => {
            let (curve, _) = self.curve(forward, layout, controls, options.evaluation);
            let spans = curve.layout.spans();
            curve.points(parameters).iter().map(|s| self.point(s, spans)).collect()
        }))
    }

    /// Where the direct and the subdivided spline disagree. The evaluation that the options name
    /// does not count.
    ///
    /// # Errors
    /// As [`Self::trace`].
    pub fn compare(&self, controls: &[SurfacePoint], options: &SplineOptions) -> Result<Disagreement> {
        let layout = self.check(controls, options)?;
        Ok(in_dimension!(&self.prepared, forward => {
            let (direct, _) = self.curve(forward, layout, controls, Evaluation::Direct);
            let (subdivided, _) = self.curve(forward, layout, controls, Evaluation::Subdivision);
            compare::compare(&direct, &subdivided, self.diagonal)
        }))
    }

    fn curve<'s, const D: usize>(
        &'s self,
        forward: &'s Forward<D>,
        layout: Layout,
        controls: &[SurfacePoint],
        evaluation: Evaluation,
    ) -> (Curve<'s, D>, u32) {
        let mut curve = Curve::new((self.mesh, self.frame), forward, layout, controls.to_vec());
        let mut levels = 0;
        if evaluation == Evaluation::Subdivision {
            while curve.widest() > FINE && 2 * curve.controls.len() <= MOST_CONTROLS && levels < 20 {
                curve = curve.halved();
                levels += 1;
            }
        }
        (curve, levels)
    }

    fn point(&self, s: &Sample, spans: usize) -> CurvePoint {
        let position = s.point.position(self.mesh);
        CurvePoint { parameter: s.u / spans as f64, point: s.point, position, origin: s.origin }
    }

    fn check(&self, controls: &[SurfacePoint], o: &SplineOptions) -> Result<Layout> {
        let n = controls.len();
        if !(o.tolerance >= LEAST_TOLERANCE && o.tolerance.is_finite()) {
            let what = format!("{} is not a number from {LEAST_TOLERANCE:e} on", o.tolerance);
            return Err(Error::option("tolerance", what, "Give a fraction of the mesh's diagonal, such as 1e-5"));
        }
        if o.samples > MOST_SAMPLES {
            let what = format!("{} is more than {MOST_SAMPLES}", o.samples);
            return Err(Error::option("samples", what, "Give fewer"));
        }
        let most = if o.kind == SplineKind::BSpline { 5 } else { MOST_DEGREE };
        let degree = match (o.degree, o.kind) {
            (0, SplineKind::BSpline) => 3,
            // A single piece through all control points, as far as the degree goes.
            (0, SplineKind::Bezier) if o.closed => 3,
            (0, SplineKind::Bezier) => n.saturating_sub(1).clamp(1, most),
            (d, _) => d,
        };
        if degree > most {
            return Err(Error::option("degree", format!("{degree} is not 1 to {most}"), "3 is usual"));
        }
        if n > MOST_CONTROLS / 2 {
            return Err(Error::input(
                format!("there are {n} control points"),
                format!("Give at most {}", MOST_CONTROLS / 2),
            ));
        }
        let Some(layout) = Layout::new(o.kind, degree, n, o.closed) else {
            let (what, remedy) = match (o.kind, o.closed) {
                (SplineKind::BSpline, false) => (
                    format!(
                        "an open B-spline of degree {degree} has {} control points or more, there are {n}",
                        degree + 1
                    ),
                    "Give more points or a lower --degree",
                ),
                (SplineKind::BSpline, true) => {
                    (format!("a closed curve has 3 control points or more, there are {n}"), "Give more points")
                }
                (SplineKind::Bezier, false) => (
                    format!("Bezier pieces of degree {degree} have {degree} k + 1 control points, there are {n}"),
                    "Add or leave out points, or give another --degree",
                ),
                (SplineKind::Bezier, true) => (
                    format!(
                        "closed Bezier pieces of degree {degree} have {degree} k control points and two pieces or more, there are {n}"
                    ),
                    "Add or leave out points, or give another --degree",
                ),
            };
            return Err(Error::input(what, remedy));
        };
        let mut component = NONE;
        for (i, p) in controls.iter().enumerate() {
            if !p.is_valid(self.mesh, 1e-6) {
                let what = format!(
                    "control point {i} (face {}, {:?}) is not a point of {}",
                    p.face, p.barycentric, self.mesh.name
                );
                return Err(Error::input(
                    what,
                    "Barycentric coordinates are nonnegative and sum to one; faces are counted from 0",
                ));
            }
            let here = self.topology.triangle_component(p.face);
            if here == NONE {
                let what =
                    format!("control point {i} lies on the degenerate triangle {} of {}", p.face, self.mesh.name);
                return Err(Error::input(what, "Move it to a neighbouring triangle"));
            }
            if component != NONE && here != component {
                let what = format!(
                    "control point {i} lies on component {here} of {}, those before on component {component}",
                    self.mesh.name
                );
                return Err(Error::input(
                    what,
                    "Points of parts that do not touch have no average on the surface: take all from one part",
                ));
            }
            component = here;
        }
        Ok(layout)
    }
}

#[cfg(test)]
mod tests;
