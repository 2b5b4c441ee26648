//! Which loop lies in which, and the orientation that follows from it.

use super::measure::signed_area;
use super::{Defect, Polygon, sweep};

/// How the loops of a polygon lie in one another.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Nesting {
    /// Of each loop, the loop right around it.
    pub parents: Vec<Option<usize>>,
    /// Of each loop, the number of loops around it: even ones run anticlockwise.
    pub depths: Vec<usize>,
}

impl Nesting {
    fn new(parents: Vec<Option<usize>>) -> Self {
        let mut depths: Vec<Option<usize>> = vec![None; parents.len()];
        for ring in 0..parents.len() {
            // Up to a loop whose depth is known, then down again: every loop is passed twice at
            // most.
            let mut chain = vec![ring];
            while let Some(parent) = parents[chain[chain.len() - 1]]
                && depths[parent].is_none()
            {
                chain.push(parent);
            }
            for ring in chain.into_iter().rev() {
                depths[ring] = Some(parents[ring].map_or(0, |parent| depths[parent].map_or(0, |depth| depth + 1)));
            }
        }
        Self { parents, depths: depths.into_iter().map(|depth| depth.unwrap_or(0)).collect() }
    }
}

impl Polygon {
    /// How the loops lie in one another, whichever way round they run.
    ///
    /// O(n log n) for n vertices. The sign of every decision is exact.
    ///
    /// # Errors
    /// All of [`Polygon::check`] but the orientation.
    pub fn nesting(&self) -> Result<Nesting, Defect> {
        let nesting = Nesting::new(sweep::parents(self)?);
        let mut outermost = (0..self.loops().len()).filter(|&ring| nesting.parents[ring].is_none());
        match (outermost.next(), outermost.next()) {
            (Some(outer), Some(ring)) => Err(Defect::Outside { ring, outer }),
            _ => Ok(nesting),
        }
    }

    /// Whether the loops bound one domain, each running the right way round.
    ///
    /// That is: every loop has three vertices or more, finite, no two at the same place, not all on
    /// one line; no two edges cross, touch or overlap; one loop is around all others; loops inside
    /// an even number of others run anticlockwise (y up), the rest clockwise. A straight angle is
    /// allowed.
    ///
    /// # Errors
    /// The first [`Defect`] met.
    pub fn check(&self) -> Result<(), Defect> {
        let nesting = self.nesting()?;
        match (0..self.loops().len()).find(|&ring| !self.well_oriented(&nesting, ring)) {
            Some(ring) => Err(Defect::Orientation { ring, depth: nesting.depths[ring] }),
            None => Ok(()),
        }
    }

    /// Whether a loop runs the way its depth asks for.
    pub fn well_oriented(&self, nesting: &Nesting, ring: usize) -> bool {
        (signed_area(&self.loops()[ring]) > 0.0) == nesting.depths[ring].is_multiple_of(2)
    }

    /// With every loop the right way round for its nesting depth; the first vertex of each stays
    /// the first.
    ///
    /// # Errors
    /// As [`Polygon::nesting`].
    pub fn normalised(&self) -> Result<Self, Defect> {
        let nesting = self.nesting()?;
        Ok(self.reversed(|ring| !self.well_oriented(&nesting, ring)))
    }

    /// With some loops the other way round; the first vertex of each stays the first.
    pub fn reversed(&self, which: impl Fn(usize) -> bool) -> Self {
        let mut loops = self.loops().to_vec();
        for vertices in loops.iter_mut().enumerate().filter(|(ring, _)| which(*ring)).map(|(_, v)| v) {
            if let Some(rest) = vertices.get_mut(1..) {
                rest.reverse();
            }
        }
        Self::from_loops(loops)
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::super::{EdgeOf, Side, VertexOf};
    use super::*;

    fn ring(points: &[(f64, f64)]) -> Vec<DVec2> {
        points.iter().map(|&(x, y)| DVec2::new(x, y)).collect()
    }

    fn square(x: f64, y: f64, half: f64) -> Vec<DVec2> {
        ring(&[(x - half, y - half), (x + half, y - half), (x + half, y + half), (x - half, y + half)])
    }

    fn nesting(loops: Vec<Vec<DVec2>>) -> Result<Nesting, Defect> {
        Polygon::from_loops(loops).nesting()
    }

    #[test]
    fn loops_nest_whatever_their_order_and_direction() {
        let mut island = square(-0.5, 0.0, 0.125);
        island.reverse();
        let loops = vec![square(-0.5, 0.0, 0.25), island, square(0.0, 0.0, 1.0), square(0.5, 0.0, 0.25)];
        let polygon = Polygon::from_loops(loops);
        let found = polygon.nesting().unwrap();
        assert_eq!(found.parents, [Some(2), Some(0), None, Some(2)]);
        assert_eq!(found.depths, [1, 2, 0, 1]);
        assert_eq!(polygon.check(), Err(Defect::Orientation { ring: 0, depth: 1 }));
        let normal = polygon.normalised().unwrap();
        normal.check().unwrap();
        assert_eq!(normal.loops()[0][0], polygon.loops()[0][0], "the first vertex stays");
        assert!((normal.area() - (4.0 - 2.0 * 0.25 + 0.0625)).abs() < 1e-14);
        assert_eq!(normal.contains(DVec2::new(-0.5, 0.0)), Side::Inside);
        assert_eq!(normal.contains(DVec2::new(0.5, 0.0)), Side::Outside);
    }

    #[test]
    fn bad_loops_are_named() {
        let outer = square(0.0, 0.0, 1.0);
        let of = |ring, vertex| VertexOf { ring, vertex };
        assert_eq!(nesting(vec![]), Err(Defect::Empty));
        assert_eq!(nesting(vec![vec![]]), Err(Defect::TooFew { ring: 0, count: 0 }));
        assert_eq!(
            nesting(vec![outer.clone(), ring(&[(0., 0.), (0.1, 0.)])]),
            Err(Defect::TooFew { ring: 1, count: 2 })
        );
        assert_eq!(nesting(vec![ring(&[(0., 0.), (1., f64::NAN), (0., 1.)])]), Err(Defect::NotFinite(of(0, 1))));
        assert_eq!(nesting(vec![ring(&[(0., 0.), (1e200, 0.), (0., 1e200)])]), Err(Defect::Range));
        assert_eq!(nesting(vec![ring(&[(0., 0.), (1e-200, 0.), (0., 1e-200)])]), Err(Defect::Range));
        assert_eq!(
            nesting(vec![ring(&[(0., 0.), (1., 0.), (1., 0.), (0., 1.)])]),
            Err(Defect::Repeated(of(0, 1), of(0, 2)))
        );
        assert_eq!(nesting(vec![ring(&[(0., 0.); 3])]), Err(Defect::Repeated(of(0, 0), of(0, 1))));
        // Closed explicitly, as some formats do.
        assert_eq!(
            nesting(vec![ring(&[(0., 0.), (1., 0.), (0., 1.), (0., 0.)])]),
            Err(Defect::Repeated(of(0, 0), of(0, 3)))
        );
        // Two corners that touch.
        assert_eq!(
            nesting(vec![ring(&[(0., 0.), (2., 0.), (1., 1.), (2., 2.), (0., 2.), (1., 1.0)])]),
            Err(Defect::Repeated(of(0, 2), of(0, 5)))
        );
        assert_eq!(nesting(vec![ring(&[(0., 0.), (1., 1.), (3., 3.), (2., 2.)])]), Err(Defect::Collinear { ring: 0 }));
        assert!(matches!(nesting(vec![ring(&[(0., 0.), (1., 0.), (0.5, 1e-13)])]), Err(Defect::Collinear { ring: 0 })));
        assert_eq!(nesting(vec![outer.clone(), square(3.0, 0.0, 0.5)]), Err(Defect::Outside { ring: 1, outer: 0 }));
        let edge = |ring, edge| EdgeOf { ring, edge };
        let meets = |loops: Vec<Vec<DVec2>>| match nesting(loops) {
            Err(Defect::Crossing { first, second, .. }) => (first, second),
            other => panic!("{other:?}"),
        };
        // A bow tie; a vertex on an edge; a spike; an edge along an edge; loops that cross.
        assert_eq!(meets(vec![ring(&[(0., 0.), (1., 1.), (1., 0.), (0., 1.)])]), (edge(0, 0), edge(0, 2)));
        let (a, b) = meets(vec![ring(&[(0., 0.), (4., 0.), (4., 4.), (2., 0.), (0., 4.)])]);
        assert!(a == edge(0, 0) && (b == edge(0, 2) || b == edge(0, 3)));
        let (a, b) = meets(vec![ring(&[(0., 0.), (2., 0.), (1., 0.), (0., 2.)])]);
        assert!(a == edge(0, 0) && (b == edge(0, 1) || b == edge(0, 2)));
        assert_eq!(meets(vec![outer.clone(), square(0.5, 0.0, 0.5)]).1.ring, 1);
        assert_eq!(meets(vec![outer.clone(), square(0.8, 0.1, 0.5)]).0.ring, 0);
        assert!(
            Defect::Crossing { first: edge(0, 3), second: edge(1, 2), near: DVec2::ONE }
                .to_string()
                .contains("edge 3 of loop 0 meets edge 2 of loop 1 near (1")
        );
    }

    /// Deterministic numbers in 0..1.
    fn random(state: &mut u64) -> f64 {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*state >> 11) as f64 / (1u64 << 53) as f64
    }

    /// By every pair of edges, in the same exact arithmetic.
    fn simple_by_pairs(vertices: &[DVec2]) -> bool {
        let n = vertices.len();
        let turn = |a: usize, b: usize, c: usize| {
            let sign = super::super::locate::orientation(vertices[a % n], vertices[b % n], vertices[c % n]);
            if sign == 0.0 {
                0
            } else if sign > 0.0 {
                1
            } else {
                -1
            }
        };
        (0..n).all(|i| {
            (i + 2..n).filter(|&j| (j + 1) % n != i).all(|j| {
                let (c, d) = (turn(i, i + 1, j), turn(i, i + 1, j + 1));
                let (a, b) = (turn(j, j + 1, i), turn(j, j + 1, i + 1));
                let boxes = |i: usize, j: usize| {
                    let (a, b, c, d) = (vertices[i], vertices[(i + 1) % n], vertices[j], vertices[(j + 1) % n]);
                    a.min(b).cmple(c.max(d)).all() && c.min(d).cmple(a.max(b)).all()
                };
                c * d > 0 || a * b > 0 || (a == 0 && b == 0 && !boxes(i, j))
            })
        })
    }

    #[test]
    fn the_sweep_agrees_with_all_pairs() {
        let mut state = 7;
        let mut simple = 0;
        for trial in 0..4000 {
            let n = 4 + trial % 9;
            // Coordinates on a small grid every other time: touching, vertical and overlapping
            // edges abound.
            let grid = if trial % 2 == 0 { 6.0 } else { 1e6 };
            let mut point = || DVec2::new((random(&mut state) * grid).floor(), (random(&mut state) * grid).floor());
            let mut vertices: Vec<DVec2> = (0..n).map(|_| point()).collect();
            if trial % 3 > 0 {
                let centre = vertices.iter().sum::<DVec2>() / n as f64;
                vertices.sort_by(|a, b| (*a - centre).to_angle().total_cmp(&(*b - centre).to_angle()));
            }
            let found = nesting(vec![vertices.clone()]);
            match found {
                Ok(_) => assert!(simple_by_pairs(&vertices), "{vertices:?}"),
                Err(Defect::Crossing { first, second, .. }) => {
                    // Adjacent edges that overlap are not seen by the pairs.
                    let apart = second.edge - first.edge;
                    assert!(apart == 1 || apart == n - 1 || !simple_by_pairs(&vertices), "{vertices:?}");
                }
                Err(Defect::Repeated(..) | Defect::Collinear { .. }) => {}
                Err(other) => panic!("{other}"),
            }
            simple += usize::from(found.is_ok());
        }
        assert!(simple > 500, "{simple}");
    }

    #[test]
    fn a_long_comb_is_checked_in_no_time_and_a_flaw_in_it_is_found() {
        // Teeth that all overlap in x and in y: the worst case of boxes and grids.
        let teeth = 100_000;
        let mut vertices = Vec::with_capacity(2 * teeth + 2);
        for i in 0..teeth {
            let y = i as f64;
            vertices.push(DVec2::new(2.0 * teeth as f64 + y, y));
            vertices.push(DVec2::new(y, y + 0.5));
        }
        vertices.push(DVec2::new(-10.0, teeth as f64));
        vertices.push(DVec2::new(-10.0, -1.0));
        assert!(nesting(vec![vertices.clone()]).is_ok());
        vertices[100_001].x -= 120_000.0;
        assert!(matches!(nesting(vec![vertices]), Err(Defect::Crossing { .. })));
    }
}
