//! Boxes that cover the polygon.

use std::f64::consts::FRAC_PI_4;

use super::chart::{Chart, Fan};
use super::domain::{Domain, cross, dot, minus, point};
use super::interval::Interval;

/// A box of parameters.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell {
    pub(super) chart: Chart,
    pub(super) at: [Interval; 2],
    /// A lower bound of the Jacobian that is already proved for it.
    pub(super) proved: f64,
    /// The parameter to cut next.
    pub(super) cut: usize,
    /// Share of the progress.
    pub(super) weight: f64,
}

/// The neighbourhood of a vertex that fans cover.
#[derive(Clone, Debug)]
pub(super) struct Corner {
    pub(super) fans: Vec<Fan>,
    /// All points of the polygon not farther than this from the vertex are in the fans.
    pub(super) radius: f64,
}

/// The directions at a vertex are padded by this angle, so that no rounding leaves a gap at its
/// edges.
const PAD: f64 = 1e-11;

impl Corner {
    /// Covers the polygon about vertex `k`; none if its angle or its distance to other edges
    /// vanishes numerically.
    ///
    /// Let R be the length of the fans' sides, at most half the distance of the vertex to every
    /// edge that does not end in it and at most half its own edges. (The distance is computed in
    /// plain doubles, with an error of a few units of rounding of the lengths involved; a distance
    /// below 1e-9 of them is refused, so half of it is a true bound.) Within R of the vertex the
    /// polygon is the wedge between its two edges. Consecutive fans share a direction, the first
    /// begins to the right of the outgoing edge, the last ends to the left of the incoming one, and
    /// each turns to the left by less than a right angle: checked in interval arithmetic. The fans'
    /// triangles hold all points of the wedge up to the distance of their far sides.
    pub(super) fn new(domain: &Domain, k: usize) -> Option<Self> {
        let vertex = domain.vertices[k];
        let (after, before) = (domain.after[k], domain.before[k]);
        let toward = |i: usize| [domain.vertices[i][0] - vertex[0], domain.vertices[i][1] - vertex[1]];
        let (out, back) = (toward(after), toward(before));
        let mut reach = length(out).min(length(back));
        for i in (0..domain.len()).filter(|&i| i != k && i != before) {
            let (a, b) = (toward(i), toward(domain.after[i]));
            let distance = distance_to_segment(a, b);
            if !(distance > 1e-9 * (length(a) + length(b))) {
                return None;
            }
            reach = reach.min(distance);
        }
        let side = 0.5 * reach;
        let start = out[1].atan2(out[0]);
        let angle = (out[0] * back[1] - out[1] * back[0]).atan2(out[0] * back[0] + out[1] * back[1]);
        let angle = if angle > 0.0 { angle } else { angle + std::f64::consts::TAU };
        let count = (angle / FRAC_PI_4).ceil().max(1.0);
        let direction = |i: f64| {
            let turned = start - PAD + (angle + 2.0 * PAD) * i / count;
            [side * turned.cos(), side * turned.sin()]
        };
        let fans: Vec<Fan> = (0..count as usize)
            .map(|i| Fan { vertex: k, first: direction(i as f64), last: direction(i as f64 + 1.0) })
            .collect();
        let edges = [after, before].map(|i| minus(point(domain.vertices[i]), point(vertex)));
        let ahead = |a, b| cross(a, b).lo > 0.0 && dot(a, b).lo > 0.0;
        let covered = ahead(point(fans.first()?.first), edges[0])
            && ahead(edges[1], point(fans.last()?.last))
            && fans.iter().all(|f| ahead(point(f.first), point(f.last)));
        let height = |fan: &Fan| {
            let e = fan.sweep();
            (fan.area() * (e[0].square() + e[1].square()).sqrt().recip()).lo
        };
        let radius = fans.iter().map(height).fold(f64::INFINITY, f64::min);
        (covered && radius > 0.0).then_some(Self { fans, radius })
    }

    /// Whether the wedge is inside of the polygon: false where the loop runs the wrong way round.
    pub(super) fn is_inside(&self, domain: &Domain) -> bool {
        let fan = self.fans[self.fans.len() / 2];
        let middle = Chart::Fan(fan).position(domain, [Interval::point(0.5); 2]).map(Interval::mid);
        domain.winding(middle).is_none_or(|w| w == 1)
    }
}

fn length(a: [f64; 2]) -> f64 {
    a[0].hypot(a[1])
}

fn distance_to_segment(a: [f64; 2], b: [f64; 2]) -> f64 {
    let e = [b[0] - a[0], b[1] - a[1]];
    let t = (-(a[0] * e[0] + a[1] * e[1]) / (e[0] * e[0] + e[1] * e[1])).clamp(0.0, 1.0);
    length([a[0] + t * e[0], a[1] + t * e[1]])
}

/// What is to be done with a cell before anything is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fate {
    /// Bound the Jacobian on it.
    Examine,
    /// It holds no point of the polygon that is not covered otherwise.
    Drop,
    /// It is too close to a vertex for its size.
    Cut,
}

impl Cell {
    pub(super) fn new(chart: Chart, at: [Interval; 2], weight: f64) -> Self {
        Self { chart, at, proved: f64::NEG_INFINITY, cut: 0, weight }
    }

    /// Parameters of the point to expand about.
    pub(super) fn centre(&self) -> [f64; 2] {
        self.at.map(Interval::mid)
    }

    /// A cell of the plane is dropped where it lies within a corner's radius, or outside of the
    /// polygon: clear of all edges, with its centre outside. Where that is unclear it is kept. The
    /// fans lie in the polygon but for their pads.
    pub(super) fn fate(&self, domain: &Domain, corners: &[Corner]) -> Fate {
        if let Chart::Fan(_) = self.chart {
            return Fate::Examine;
        }
        let [x, y] = self.at;
        let centre = self.centre();
        let half = 0.5 * length([x.hi - x.lo, y.hi - y.lo]);
        let mut nearest = f64::INFINITY;
        for (v, corner) in domain.vertices.iter().zip(corners) {
            nearest = nearest.min(length([v[0] - centre[0], v[1] - centre[1]]));
            let [dx, dy] = [x - Interval::point(v[0]), y - Interval::point(v[1])];
            if (dx.square() + dy.square()).hi <= (Interval::point(corner.radius).square()).lo {
                return Fate::Drop;
            }
        }
        let is_clear = (0..domain.len()).all(|i| domain.is_clear_of_edge(i, x, y));
        if is_clear && domain.winding(centre) == Some(0) {
            return Fate::Drop;
        }
        if half > 0.75 * nearest { Fate::Cut } else { Fate::Examine }
    }

    /// Whether the centre certainly is a point of the polygon (in a fan: a direction that leads
    /// into it).
    pub(super) fn centre_is_inside(&self, domain: &Domain) -> bool {
        let centre = self.centre();
        match &self.chart {
            Chart::Plane => domain.winding(centre) == Some(1),
            Chart::Fan(fan) => leads_inside(domain, fan, centre[1]),
        }
    }

    /// The parameter to cut where bounds cannot tell: the one in which the cell is wider. In a fan
    /// that alternates between radius and direction; near the vertex the direction matters as much
    /// as anywhere.
    pub(super) fn wider_parameter(&self) -> usize {
        let [a, b] = self.at.map(|i| i.hi - i.lo);
        usize::from(b >= a)
    }

    /// Two halves, along the parameter to cut, that share a side exactly; none if the doubles in
    /// between are used up.
    pub(super) fn halves(&self) -> Option<[Self; 2]> {
        let side = self.cut;
        let Interval { lo, hi } = self.at[side];
        let middle = self.at[side].mid();
        if !(lo < middle && middle < hi) {
            return None;
        }
        let half = |at: Interval| {
            let mut cell = Self { weight: 0.5 * self.weight, ..*self };
            cell.at[side] = at;
            cell
        };
        Some([half(Interval::new(lo, middle)), half(Interval::new(middle, hi))])
    }
}

/// Whether direction `mu` of a fan certainly points between the two edges of its vertex.
pub(super) fn leads_inside(domain: &Domain, fan: &Fan, mu: f64) -> bool {
    let q = fan.direction(Interval::point(mu));
    let vertex = point(domain.vertices[fan.vertex]);
    let [out, back] =
        [domain.after[fan.vertex], domain.before[fan.vertex]].map(|i| minus(point(domain.vertices[i]), vertex));
    let (left_of_out, right_of_back) = (cross(out, q).lo > 0.0, cross(q, back).lo > 0.0);
    if cross(out, back).hi < 0.0 { left_of_out || right_of_back } else { left_of_out && right_of_back }
}
