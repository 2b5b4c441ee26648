//! On which side of the boundary a point lies.

use glam::DVec2;

use super::{EdgeOf, Polygon};

/// Where a point lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// In the open domain.
    Inside,
    /// Exactly on this edge; at a vertex, on one of the two edges that meet there.
    Boundary(EdgeOf),
    /// In the open complement, which holes are part of.
    Outside,
}

/// Twice the signed area of a triangle; its sign is exact (adaptive predicates of Shewchuk 1997).
pub(crate) fn orientation(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    let coord = |p: DVec2| robust::Coord { x: p.x, y: p.y };
    robust::orient2d(coord(a), coord(b), coord(c))
}

/// Whether `p`, which is on the line through `a` and `b`, lies between them.
pub(super) fn between(a: DVec2, b: DVec2, p: DVec2) -> bool {
    let (low, high) = (a.min(b), a.max(b));
    p.cmpge(low).all() && p.cmple(high).all()
}

impl Polygon {
    /// Where `p` lies, decided exactly, by the parity of the edges to the right of it. O(n) in the
    /// number of vertices.
    ///
    /// The polygon is one that passes [`Polygon::check`]; a point that is not finite is outside.
    pub fn contains(&self, p: DVec2) -> Side {
        let mut inside = false;
        for (ring, vertices) in self.loops().iter().enumerate() {
            for edge in 0..vertices.len() {
                let (a, b) = (vertices[edge], vertices[(edge + 1) % vertices.len()]);
                let (low, high) = if a.y <= b.y { (a, b) } else { (b, a) };
                if !(low.y <= p.y && p.y <= high.y) {
                    continue;
                }
                let turn = orientation(low, high, p);
                if turn == 0.0 && between(a, b, p) {
                    return Side::Boundary(EdgeOf { ring, edge });
                }
                // Half-open in y, so that a vertex at the height of p counts once.
                inside ^= p.y < high.y && turn > 0.0;
            }
        }
        if inside { Side::Inside } else { Side::Outside }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn holes_are_outside_and_edges_are_neither() {
        let ring = |half: f64| {
            [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| DVec2::new(x, y) * half).to_vec()
        };
        let mut hole = ring(0.5);
        hole.reverse();
        let polygon = Polygon::from_loops(vec![ring(1.0), hole]);
        assert_eq!(polygon.contains(DVec2::new(0.75, 0.5)), Side::Inside);
        assert_eq!(polygon.contains(DVec2::ZERO), Side::Outside);
        assert_eq!(polygon.contains(DVec2::new(-2.0, 1.0)), Side::Outside);
        assert_eq!(polygon.contains(DVec2::new(1.0, 0.3)), Side::Boundary(EdgeOf { ring: 0, edge: 1 }));
        assert!(matches!(polygon.contains(DVec2::new(0.5, 0.5)), Side::Boundary(EdgeOf { ring: 1, .. })));
        assert_eq!(polygon.contains(DVec2::new(f64::NAN, 0.0)), Side::Outside);
    }

    #[test]
    fn heights_of_vertices_do_not_confuse() {
        // A star: many vertices share the height of the points asked for.
        let star: Vec<DVec2> = [(0., 2.), (-1., 0.), (-2., 0.), (-0.5, -1.), (0., -3.), (0.5, -1.), (2., 0.), (1., 0.)]
            .map(|(x, y)| DVec2::new(x, y))
            .to_vec();
        let polygon = Polygon::from_loops(vec![star]);
        assert_eq!(polygon.contains(DVec2::new(0.0, 0.0)), Side::Inside);
        assert_eq!(polygon.contains(DVec2::new(-3.0, 0.0)), Side::Outside);
        assert_eq!(polygon.contains(DVec2::new(-1.0, -1.0)), Side::Outside);
        assert_eq!(polygon.contains(DVec2::new(0.0, -1.0)), Side::Inside);
        assert!(matches!(polygon.contains(DVec2::new(-1.5, 0.0)), Side::Boundary(_)));
    }
}
