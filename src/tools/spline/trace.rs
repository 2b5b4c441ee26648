//! From points of a curve to a polyline that lies on the surface: cut at mesh edges, bent as much
//! as the tolerance asks for.

use rayon::prelude::*;

use super::curve::{Curve, Sample, Span};
use super::layout::{Layout, SplineKind};
use crate::geometry::SurfacePoint;
use crate::surface::forward::{Average, Origin};
use crate::surface::psi::Root;

/// Samples evaluated one after the other, each beginning where the one before ended.
const CHUNK: usize = 32;
/// Times an interval between samples is halved: what then has no common triangle is a jump, or a
/// passage through a vertex.
const DEPTH: u32 = 44;
/// Points nearer to one another than this part of the mean edge, on neighbouring triangles, belong
/// together after so many halvings.
const TOUCH: f64 = 1e-6;
/// Barycentric distance outside a triangle at which its root is no longer followed in the search
/// for a crossing.
const BEYOND: f64 = 1.0;
/// Residual, in mean edges, up to which a point outside a triangle is a root there.
const RESIDUAL: f64 = 1e-8;
/// Steps of the search for a crossing.
const STEPS: u32 = 60;

/// Times the line over a jump is halved at most, and the distance of neighbours, in mean edges,
/// that is near enough.
const BRIDGE_LEVELS: u32 = 14;
const BRIDGE_STEP: f64 = 0.5;

/// A place where the curve jumps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Jump {
    pub(super) u: f64,
    pub(super) length: f64,
    /// Whether the polyline goes on over the surface.
    pub(super) bridged: bool,
}

/// What a trace found: runs of points with a break at each jump that has no bridge.
#[derive(Debug, Default)]
pub(super) struct Trace {
    pub(super) runs: Vec<Vec<Sample>>,
    pub(super) jumps: Vec<Jump>,
}

impl Trace {
    /// Length of all segments.
    pub(super) fn length(&self) -> f64 {
        self.runs.iter().flat_map(|r| r.windows(2)).map(|w| w[0].position.distance(w[1].position)).sum()
    }
}

/// Traces a curve: at least `samples` intervals of equal length in the parameter, flat to
/// `tolerance` (a length), each segment within a triangle. Jumps are bridged over the surface where
/// that is possible.
pub(super) fn trace<const D: usize>(curve: &Curve<'_, D>, samples: usize, tolerance: f64) -> Trace {
    trace_with(curve, samples, tolerance, true)
}

fn trace_with<const D: usize>(curve: &Curve<'_, D>, samples: usize, tolerance: f64, bridges: bool) -> Trace {
    let spans = curve.layout.spans();
    // A sample at least every edge or so, lest an excursion to other triangles goes unseen.
    let tasks: Vec<(usize, usize, usize, usize)> = (0..spans)
        .into_par_iter()
        .flat_map_iter(|s| {
            let least = (curve.span(s).length().ceil() as usize).clamp(2, 1 << 14);
            let n = samples.div_ceil(spans).max(least);
            (0..n).step_by(CHUNK).map(move |i| (s, i, (i + CHUNK).min(n), n))
        })
        .collect();
    let place = |s: usize, i: usize, n: usize| s as f64 + i as f64 / n as f64;
    // Where tasks meet, found without what comes before.
    let begin = |s: usize, u: f64| {
        let span = curve.span(s);
        span.at(u, span.near())
    };
    let mut ends: Vec<Sample> = tasks.par_iter().map(|&(s, i, _, n)| begin(s, place(s, i, n))).collect();
    let last = Sample { u: spans as f64, ..ends[0] };
    ends.push(if curve.layout.closed { last } else { begin(spans - 1, spans as f64) });
    let unit = TOUCH * curve.mesh.mean_edge_length();
    let parts: Vec<Trace> = tasks
        .par_iter()
        .enumerate()
        .map(|(k, &(s, from, to, n))| {
            let span = curve.span(s);
            let run = |global: bool| {
                let run = vec![ends[k]];
                let mut tracer = Tracer { span: &span, tolerance, touch: unit, bridges, run, found: Trace::default() };
                let mut now = ends[k];
                for i in from + 1..to {
                    let next = span.at(place(s, i, n), if global { span.near() } else { now.point.face });
                    tracer.connect(&now, &next, 0);
                    now = next;
                }
                tracer.connect(&now, &ends[k + 1], 0);
                tracer.found.runs.push(tracer.run);
                tracer.found
            };
            let found = run(false);
            // Branches that end are found where they end only by samples that do not follow them.
            if found.jumps.is_empty() { found } else { run(true) }
        })
        .collect();
    join(parts)
}

fn join(parts: Vec<Trace>) -> Trace {
    let mut all = Trace::default();
    for part in parts {
        let mut runs = part.runs.into_iter();
        match (all.runs.last_mut(), runs.next()) {
            // Each task begins with the point that the one before ended with.
            (Some(last), Some(first)) => last.extend(first.into_iter().skip(1)),
            (None, Some(first)) => all.runs.push(first),
            _ => {}
        }
        all.runs.extend(runs);
        all.jumps.extend(part.jumps);
    }
    all
}

struct Tracer<'a, const D: usize> {
    span: &'a Span<'a, D>,
    tolerance: f64,
    touch: f64,
    bridges: bool,
    run: Vec<Sample>,
    found: Trace,
}

impl<const D: usize> Tracer<'_, D> {
    /// Appends the curve after `a` up to and including `b`.
    fn connect(&mut self, a: &Sample, b: &Sample, depth: u32) {
        let forward = self.span.curve.forward;
        if let Some(face) = forward.common_face(&[a.point, b.point]) {
            if depth >= DEPTH || a.position.distance(b.position) <= self.tolerance {
                self.run.push(*b);
                return;
            }
            let middle = self.between(a, b, 0.5);
            if self.fits(face, a, b, &middle) && self.fits(face, a, b, &self.between(a, b, 0.25)) {
                self.run.push(*b);
                return;
            }
            self.connect(a, &middle, depth + 1);
            self.connect(&middle, b, depth + 1);
            return;
        }
        if let Some(c) = self.crossing(a, b) {
            self.connect(a, &c, depth + 1);
            self.connect(&c, b, depth + 1);
            return;
        }
        if depth < DEPTH {
            let middle = self.between(a, b, 0.5);
            self.connect(a, &middle, depth + 1);
            self.connect(&middle, b, depth + 1);
            return;
        }
        match self.touching(a, b) {
            Some(c) => self.run.extend([c, *b]),
            None => {
                let bridge = if self.bridges { self.bridge(a, b) } else { None };
                let length = a.position.distance(b.position);
                self.found.jumps.push(Jump { u: b.u, length, bridged: bridge.is_some() });
                match bridge {
                    Some(way) => self.run.extend(way),
                    None => {
                        let run = std::mem::replace(&mut self.run, vec![*b]);
                        self.found.runs.push(run);
                    }
                }
            }
        }
    }

    /// A way over the surface from `a` to `b`: the line of averages of the two, by repeated
    /// averaging. `None` if that jumps too.
    fn bridge(&self, a: &Sample, b: &Sample) -> Option<Vec<Sample>> {
        let curve = self.span.curve;
        let line = Layout::new(SplineKind::BSpline, 1, 2, false)?;
        let mut way = curve.of_same(line, vec![a.point, b.point]);
        for _ in 0..BRIDGE_LEVELS {
            if way.widest() <= BRIDGE_STEP {
                break;
            }
            way = way.halved();
        }
        let mut trace = trace_with(&way, 0, self.tolerance, false);
        let run = trace.runs.pop()?;
        let ends = Sample { u: b.u, ..*b };
        let inner = run.get(1..run.len().saturating_sub(1))?;
        let moved = inner.iter().map(|s| Sample { u: b.u, ..*s });
        trace.jumps.is_empty().then(|| moved.chain([ends]).collect())
    }

    /// Whether `m` lies in `face` and as near to the segment as asked for.
    fn fits(&self, face: u32, a: &Sample, b: &Sample, m: &Sample) -> bool {
        let along = b.position - a.position;
        let w = ((m.position - a.position).dot(along) / along.length_squared()).clamp(0.0, 1.0);
        m.position.distance(a.position + w * along) <= self.tolerance
            && self.span.curve.forward.coordinates_in(&m.point, face).is_some()
    }

    /// A point between two, from whose triangles it is searched; the one nearer to the average
    /// where these lead to different points.
    fn between(&self, a: &Sample, b: &Sample, w: f64) -> Sample {
        let u = a.u + w * (b.u - a.u);
        let first = self.span.at(u, a.point.face);
        if a.point.face == b.point.face || first.point.face == b.point.face || first.origin == Origin::Planar {
            return first;
        }
        let second = self.span.at(u, b.point.face);
        if second.distance_squared < first.distance_squared { second } else { first }
    }

    /// Where the curve crosses the edge between the triangles of two samples.
    ///
    /// On an edge Psi is the same seen from both sides, so the point and its parameter are a root
    /// of either triangle: the parameter is bracketed by the sign of the coordinate that vanishes
    /// on the edge, followed beyond the edge, and found by regula falsi in the Illinois form.
    fn crossing(&self, a: &Sample, b: &Sample) -> Option<Sample> {
        let surface = self.span.curve.forward.surface();
        let (f, g) = (a.point.face, b.point.face);
        let k = surface.triangles[f as usize].neighbours.iter().position(|&t| t == g)?;
        let l = surface.triangles[g as usize].neighbours.iter().position(|&t| t == f)?;
        // Positive in f, negative in g.
        let side = |u: f64| -> Option<(f64, Option<[f64; 3]>)> {
            if let Some(x) = self.root(f, u) {
                return Some((x[k], Some(x)));
            }
            self.root(g, u).map(|x| (-x[l], None))
        };
        let (mut low, mut high) = ((a.u, side(a.u)?.0), (b.u, side(b.u)?.0));
        if !(low.1 >= 0.0 && high.1 <= 0.0) {
            return None;
        }
        let mut kept = 0;
        for step in 0..STEPS {
            let width = high.0 - low.0;
            let falsi = low.0 + width * low.1 / (low.1 - high.1);
            let u = if step % 8 == 7 || !(falsi > low.0 && falsi < high.0) { low.0 + 0.5 * width } else { falsi };
            if !(u > low.0 && u < high.0) {
                break;
            }
            let (value, _) = side(u)?;
            if value >= 0.0 {
                low = (u, value);
                high.1 *= if kept == 1 { 0.5 } else { 1.0 };
                kept = 1;
            } else {
                high = (u, value);
                low.1 *= if kept == 2 { 0.5 } else { 1.0 };
                kept = 2;
            }
            if value.abs() <= 4.0 * f64::EPSILON {
                break;
            }
        }
        let u = if side(high.0)?.0.abs() < side(low.0)?.0.abs() { high.0 } else { low.0 };
        let (value, x) = side(u)?;
        let mut x = x.or_else(|| self.root(f, u))?;
        if value.abs() > 1e-9 {
            return None;
        }
        x[k] = 0.0;
        if x.iter().any(|x| *x < -1e-9) {
            return None;
        }
        let x = x.map(|x| x.max(0.0));
        let sum: f64 = x.iter().sum();
        let point = SurfacePoint::new(f, x.map(|x| x / sum));
        let average = Average { point, origin: Origin::Projection, distance_squared: a.distance_squared };
        Some(self.span.sample(u, average))
    }

    /// The root of a triangle at `u`, which may lie somewhat outside.
    fn root(&self, face: u32, u: f64) -> Option<[f64; 3]> {
        let mean = self.span.mean(u);
        let triangle = self.span.curve.forward.surface().triangle(face);
        let (Root::Inside(x) | Root::Outside(x)) = triangle.project(&mean, BEYOND);
        let [r, s] = triangle.residual(&mean, &x);
        (r.abs() <= RESIDUAL && s.abs() <= RESIDUAL).then_some(x)
    }

    /// A point that two samples on neighbouring triangles touch: on their edge, or their vertex.
    fn touching(&self, a: &Sample, b: &Sample) -> Option<Sample> {
        if a.position.distance(b.position) > self.touch {
            return None;
        }
        let triangles = &self.span.curve.forward.surface().triangles;
        let other = triangles[b.point.face as usize].v;
        let shared = triangles[a.point.face as usize].v.map(|v| other.contains(&v));
        let x: [f64; 3] = std::array::from_fn(|k| if shared[k] { a.point.barycentric[k] } else { 0.0 });
        let sum: f64 = x.iter().sum();
        if sum < 0.5 {
            return None;
        }
        let point = SurfacePoint::new(a.point.face, x.map(|x| x / sum));
        let average = Average { point, origin: a.origin, distance_squared: a.distance_squared };
        let c = self.span.sample(b.u, average);
        (c.position.distance(a.position) <= 4.0 * self.touch).then_some(c)
    }
}
