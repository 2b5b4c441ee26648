//! Path data of SVG, as absolute segments.

use std::fmt::Write;

use glam::DVec2;
use kurbo::{SvgArc, Vec2};
use svgtypes::{PathParser, PathSegment};

use super::outline::{Arc, Part, Segment, Vertex};

/// The parts of path data: all commands, relative ones made absolute, arcs kept as arcs.
pub(super) fn parse_path(data: &str) -> std::result::Result<Vec<Part>, String> {
    let mut pen = Pen::default();
    for segment in PathParser::from(data) {
        pen.add(segment.map_err(|e| e.to_string())?)?;
    }
    pen.finish();
    Ok(pen.parts)
}

/// The corners of `points` of a polyline or polygon.
pub(super) fn parse_points(data: &str, closed: bool) -> Vec<Part> {
    let points: Vec<DVec2> = svgtypes::PointsParser::from(data).map(|(x, y)| DVec2::new(x, y)).collect();
    let [first, rest @ ..] = &points[..] else { return Vec::new() };
    let mut segments: Vec<Segment> = rest.iter().map(|p| Segment::Line(*p)).collect();
    if closed && points.last() != Some(first) {
        segments.push(Segment::Line(*first));
    }
    vec![Part { start: *first, segments, closed }]
}

/// Where a path is being drawn.
#[derive(Default)]
struct Pen {
    parts: Vec<Part>,
    part: Option<Part>,
    at: DVec2,
    start: DVec2,
    /// Control point that a smooth cubic, or quadratic, curve continues.
    cubic: Option<DVec2>,
    quadratic: Option<DVec2>,
}

impl Pen {
    fn finish(&mut self) {
        self.parts.extend(self.part.take());
    }

    fn add(&mut self, segment: PathSegment) -> std::result::Result<(), String> {
        let from = |abs: bool| if abs { DVec2::ZERO } else { self.at };
        let (cubic, quadratic) = (self.cubic.take(), self.quadratic.take());
        let reflected = |control: Option<DVec2>| control.map_or(self.at, |c| self.at * 2.0 - c);
        let piece = match segment {
            PathSegment::MoveTo { abs, x, y } => {
                let to = from(abs) + DVec2::new(x, y);
                self.finish();
                self.part = Some(Part { start: to, segments: Vec::new(), closed: false });
                (self.at, self.start) = (to, to);
                return finite(to);
            }
            PathSegment::ClosePath { .. } => {
                if let Some(mut part) = self.part.take() {
                    if self.at != part.start {
                        part.segments.push(Segment::Line(part.start));
                    }
                    part.closed = true;
                    self.parts.push(part);
                }
                self.at = self.start;
                return Ok(());
            }
            PathSegment::LineTo { abs, x, y } => Segment::Line(from(abs) + DVec2::new(x, y)),
            PathSegment::HorizontalLineTo { abs, x } => Segment::Line(DVec2::new(from(abs).x + x, self.at.y)),
            PathSegment::VerticalLineTo { abs, y } => Segment::Line(DVec2::new(self.at.x, from(abs).y + y)),
            PathSegment::CurveTo { abs, x1, y1, x2, y2, x, y } => {
                let o = from(abs);
                Segment::Cubic(o + DVec2::new(x1, y1), o + DVec2::new(x2, y2), o + DVec2::new(x, y))
            }
            PathSegment::SmoothCurveTo { abs, x2, y2, x, y } => {
                let o = from(abs);
                Segment::Cubic(reflected(cubic), o + DVec2::new(x2, y2), o + DVec2::new(x, y))
            }
            PathSegment::Quadratic { abs, x1, y1, x, y } => {
                let o = from(abs);
                Segment::Quadratic(o + DVec2::new(x1, y1), o + DVec2::new(x, y))
            }
            PathSegment::SmoothQuadratic { abs, x, y } => {
                Segment::Quadratic(reflected(quadratic), from(abs) + DVec2::new(x, y))
            }
            PathSegment::EllipticalArc { abs, rx, ry, x_axis_rotation, large_arc, sweep, x, y } => {
                let to = from(abs) + DVec2::new(x, y);
                let turn = x_axis_rotation.to_radians();
                arc(self.at, to, DVec2::new(rx, ry), turn, large_arc, sweep)
            }
        };
        match piece {
            Segment::Cubic(_, control, _) => self.cubic = Some(control),
            Segment::Quadratic(control, _) => self.quadratic = Some(control),
            _ => {}
        }
        // After a closed part the next one begins where that one did.
        let at = self.at;
        self.part.get_or_insert_with(|| Part { start: at, segments: Vec::new(), closed: false }).segments.push(piece);
        self.at = piece.end();
        [0.25, 0.5, 1.0].into_iter().try_for_each(|t| finite(piece.at(at, t)))
    }
}

fn finite(p: DVec2) -> std::result::Result<(), String> {
    if p.is_finite() { Ok(()) } else { Err("a number is out of range".into()) }
}

/// The arc between two points as SVG describes it; a line where there is none.
fn arc(from: DVec2, to: DVec2, radii: DVec2, turn: f64, large_arc: bool, sweep: bool) -> Segment {
    let point = |p: DVec2| kurbo::Point::new(p.x, p.y);
    let described = SvgArc {
        from: point(from),
        to: point(to),
        radii: Vec2::new(radii.x, radii.y),
        x_rotation: turn,
        large_arc,
        sweep,
    };
    let Some(a) = kurbo::Arc::from_svg_arc(&described) else { return Segment::Line(to) };
    let (sin, cos) = a.x_rotation.sin_cos();
    let arc = Arc {
        centre: DVec2::new(a.center.x, a.center.y),
        cosine: DVec2::new(cos, sin) * a.radii.x,
        sine: DVec2::new(-sin, cos) * a.radii.y,
        start: a.start_angle,
        sweep: a.sweep_angle,
        end: to,
    };
    let all = [arc.start, arc.sweep, arc.centre.x, arc.centre.y, arc.cosine.length(), arc.sine.length()];
    if all.iter().all(|v| v.is_finite()) { Segment::Arc(arc) } else { Segment::Line(to) }
}

/// Path data of mapped parts: straight pieces, absolute.
pub(super) fn write_path(parts: &[Vec<Vertex>], closed: &[bool], decimals: usize) -> String {
    let mut data = String::new();
    for (part, closed) in parts.iter().zip(closed) {
        let count = part.len() - usize::from(*closed && part.len() > 1);
        for (k, vertex) in part[..count].iter().enumerate() {
            let command = if k == 0 { "M" } else { "L" };
            let space = if data.is_empty() { "" } else { " " };
            let _ = write!(
                data,
                "{space}{command}{} {}",
                number(vertex.point.x, decimals),
                number(vertex.point.y, decimals)
            );
        }
        if *closed {
            data.push('Z');
        }
    }
    data
}

/// `points` of a mapped part.
pub(super) fn write_points(part: &[Vertex], closed: bool, decimals: usize) -> String {
    let count = part.len() - usize::from(closed && part.len() > 1);
    let pairs =
        part[..count].iter().map(|v| format!("{},{}", number(v.point.x, decimals), number(v.point.y, decimals)));
    pairs.collect::<Vec<_>>().join(" ")
}

/// A number with up to `decimals` digits after the point.
fn number(x: f64, decimals: usize) -> String {
    let text = format!("{x:.decimals$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if text == "-0" { "0".into() } else { text.into() }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn ends(parts: &[Part]) -> Vec<Vec<(f64, f64)>> {
        let pair = |p: DVec2| (p.x, p.y);
        parts
            .iter()
            .map(|p| std::iter::once(p.start).chain(p.segments.iter().map(Segment::end)).map(pair).collect())
            .collect()
    }

    #[test]
    fn every_command_absolute_and_relative() {
        let both = [
            ("M1 2 L3 4 H5 V6 Z", "m1 2l2 2h2v2z"),
            ("M1 2 C1 3 2 3 3 4 S5 6 7 8", "m1 2c0 1 1 1 2 2s2 2 4 4"),
            ("M1 2 Q2 4 3 2 T5 2 T7 2", "m1 2q1 2 2 0t2 0 2 0"),
            ("M1 2 A2 1 30 0 1 3 4 L1 1", "m1 2a2 1 30 0 1 2 2l-2-3"),
            ("M0 0 L1 0 L1 1 Z L5 5 M2 2 L3 3", "M0 0 1 0 1 1zl5 5m-3-3 1 1"),
        ];
        for (absolute, relative) in both {
            let (a, b) = (parse_path(absolute).unwrap(), parse_path(relative).unwrap());
            assert_eq!(ends(&a), ends(&b), "{absolute}");
            for (a, b) in a.iter().zip(&b) {
                let mut at = a.start;
                for (s, t) in a.segments.iter().zip(&b.segments) {
                    for k in 0..=8 {
                        let t0 = f64::from(k) / 8.0;
                        assert!(s.at(at, t0).distance(t.at(at, t0)) < 1e-12, "{absolute}");
                    }
                    at = s.end();
                }
            }
        }
        let parts = parse_path("M0 0 L1 0 L1 1 Z L5 5 M2 2 L3 3").unwrap();
        assert_eq!(
            ends(&parts),
            [
                vec![(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 0.0)],
                vec![(0.0, 0.0), (5.0, 5.0)],
                vec![(2.0, 2.0), (3.0, 3.0)]
            ]
        );
        assert_eq!(parts.iter().map(|p| p.closed).collect::<Vec<_>>(), [true, false, false]);
    }

    #[test]
    fn arcs_are_round() {
        // Half a circle about (5, 0), either way, and one whose radius is too small and grows.
        for (data, side) in
            [("M0 0 A5 5 0 0 1 10 0", -1.0), ("M0 0 A5 5 0 0 0 10 0", 1.0), ("M0 0 A1 1 0 0 1 10 0", -1.0)]
        {
            let part = &parse_path(data).unwrap()[0];
            for k in 1..8 {
                let p = part.segments[0].at(part.start, f64::from(k) / 8.0);
                assert!((p.distance(DVec2::new(5.0, 0.0)) - 5.0).abs() < 1e-9 && p.y * side > 0.0, "{data} {p}");
            }
        }
        // An arc without a radius is a line.
        assert_eq!(parse_path("M0 0 A0 5 0 0 1 10 0").unwrap()[0].segments[0], Segment::Line(DVec2::new(10.0, 0.0)));
    }

    #[test]
    fn numbers_are_short() {
        for (x, text) in [(1.0, "1"), (-0.0, "0"), (0.1234567, "0.123"), (-1e-9, "0"), (100.0, "100"), (2.5, "2.5")] {
            assert_eq!(number(x, 3), text);
        }
        assert_eq!(number(100.0, 0), "100");
    }

    proptest! {
        #[test]
        fn any_data_is_read_or_refused(data in "[MmLlHhVvCcSsQqTtAaZz0-9 ,.e+\\-]{0,60}") {
            if let Ok(parts) = parse_path(&data) {
                for part in parts {
                    prop_assert!(part.start.is_finite() && part.segments.iter().all(|s| s.end().is_finite()));
                }
            }
            parse_points(&data, true);
        }
    }
}
