//! Outlines: what vector files have in common.

use glam::DVec2;

/// A piece of an outline from where the one before it ended.
#[derive(Clone, Copy, Debug, PartialEq)]
#[doc(hidden)]
pub enum Segment {
    /// Straight to a point.
    Line(DVec2),
    /// A parabola: its control point and its end.
    Quadratic(DVec2, DVec2),
    /// A cubic Bézier curve: its control points and its end.
    Cubic(DVec2, DVec2, DVec2),
    /// A piece of an ellipse.
    Arc(Arc),
}

/// The points `centre + cosine cos(a) + sine sin(a)` for angles from `start` on over `sweep`
/// radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arc {
    /// Centre of the ellipse.
    pub centre: DVec2,
    /// From the centre to the point of angle 0.
    pub cosine: DVec2,
    /// From the centre to the point of a right angle.
    pub sine: DVec2,
    /// First angle.
    pub start: f64,
    /// Last angle less the first.
    pub sweep: f64,
    /// The last point, as the file has it.
    pub end: DVec2,
}

impl Segment {
    /// Where it ends.
    pub fn end(&self) -> DVec2 {
        match *self {
            Self::Line(e) | Self::Quadratic(_, e) | Self::Cubic(_, _, e) | Self::Arc(Arc { end: e, .. }) => e,
        }
    }

    /// The point at `t`, from 0 at `start` to 1 at the end; both ends are exact.
    pub fn at(&self, start: DVec2, t: f64) -> DVec2 {
        if t <= 0.0 {
            return start;
        }
        if t >= 1.0 {
            return self.end();
        }
        let s = 1.0 - t;
        match *self {
            Self::Line(e) => start * s + e * t,
            Self::Quadratic(c, e) => start * (s * s) + c * (2.0 * s * t) + e * (t * t),
            Self::Cubic(c, d, e) => {
                start * (s * s * s) + c * (3.0 * s * s * t) + d * (3.0 * s * t * t) + e * (t * t * t)
            }
            Self::Arc(arc) => {
                let (sin, cos) = (arc.start + arc.sweep * t).sin_cos();
                arc.centre + arc.cosine * cos + arc.sine * sin
            }
        }
    }

    /// Its image under an affine map of the plane; `linear` is the map without its translation.
    pub fn affine(&self, map: impl Fn(DVec2) -> DVec2, linear: impl Fn(DVec2) -> DVec2) -> Self {
        match *self {
            Self::Line(e) => Self::Line(map(e)),
            Self::Quadratic(c, e) => Self::Quadratic(map(c), map(e)),
            Self::Cubic(c, d, e) => Self::Cubic(map(c), map(d), map(e)),
            Self::Arc(arc) => Self::Arc(Arc {
                centre: map(arc.centre),
                cosine: linear(arc.cosine),
                sine: linear(arc.sine),
                end: map(arc.end),
                ..arc
            }),
        }
    }
}

/// A connected line of an outline, or a single point.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// Where it begins.
    pub start: DVec2,
    /// Its pieces; none for a single point.
    pub segments: Vec<Segment>,
    /// Whether it ends where it begins, and is written so.
    pub closed: bool,
}

/// The outlines of one element of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    /// What messages call it.
    pub name: String,
    /// Its parts in the order of the file.
    pub parts: Vec<Part>,
}

/// A vertex of a mapped part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vertex {
    /// Where it is now.
    pub point: DVec2,
    /// Where it was: the number of its segment, and from 0 to 1 the place on that. A start has 0.
    pub from: (usize, f64),
}

/// The image of a [`Shape`]: the vertices of each part, beginning with the image of its start.
pub type MappedShape = Vec<Vec<Vertex>>;
