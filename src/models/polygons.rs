//! Pairs of polygons whose maps are known well: from the mapping paper's figures, and hard cases
//! measured for this project.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::DVec2;

use crate::geometry::Polygon;

/// A source and a target with the same loops.
#[derive(Clone, Debug, PartialEq)]
#[doc(hidden)]
pub struct PolygonPair {
    /// Where points come from.
    pub source: Polygon,
    /// Where they go.
    pub target: Polygon,
}

impl PolygonPair {
    fn of(source: Vec<Vec<DVec2>>, target: Vec<Vec<DVec2>>) -> Self {
        Self { source: Polygon::from_loops(source), target: Polygon::from_loops(target) }
    }
}

/// Vertices around `centre`, anticlockwise from `turn` (radians) on, at `radii` in turn.
pub fn star(count: usize, radii: &[f64], turn: f64, centre: DVec2) -> Vec<DVec2> {
    let vertex = |i: usize| {
        let angle = TAU * i as f64 / count.max(1) as f64 + turn;
        centre + DVec2::from_angle(angle) * radii.get(i % radii.len().max(1)).copied().unwrap_or(1.0)
    };
    (0..count).map(vertex).collect()
}

/// The unit square whose upper right corner moves to (1 - s, 1 - s): its smallest Jacobian is 1 -
/// (2 √2 - 1) s (Figures 8 and 9 of the paper).
pub fn square_corner(s: f64) -> PolygonPair {
    let square = |corner: f64| vec![vec![DVec2::ZERO, DVec2::X, DVec2::splat(corner), DVec2::Y]];
    PolygonPair::of(square(1.0), square(1.0 - s))
}

/// Nested squares, the inner one a hole of half side 0.4 that is turned by 90 degrees (Figure 1).
pub fn nested_squares() -> PolygonPair {
    let diagonal = |half: f64, turn: f64| star(4, &[half * 2.0_f64.sqrt()], turn - 3.0 * FRAC_PI_2 / 2.0, DVec2::ZERO);
    let outer = diagonal(1.0, 0.0);
    let hole = |turn: f64| diagonal(0.4, turn).into_iter().rev().collect::<Vec<_>>();
    PolygonPair::of(vec![outer.clone(), hole(0.0)], vec![outer, hole(FRAC_PI_2)])
}

/// A star of ten vertices whose tips and notches change places.
pub fn inverted_star() -> PolygonPair {
    let star = |radii: [f64; 2]| vec![star(10, &radii, 0.0, DVec2::ZERO)];
    PolygonPair::of(star([1.0, 0.4]), star([0.4, 1.0]))
}

/// A star of ten vertices whose tips turn by 54 degrees while its notches stay.
pub fn twisted_star() -> PolygonPair {
    let source = star(10, &[1.0, 0.4], 0.0, DVec2::ZERO);
    let turn = DVec2::from_angle(54.0_f64.to_radians());
    let target = source.iter().enumerate().map(|(i, v)| if i % 2 == 0 { turn.rotate(*v) } else { *v }).collect();
    PolygonPair::of(vec![source], vec![target])
}

/// Strictly convex hexagons between which the mean value map folds, by a little.
pub fn convex_witness() -> PolygonPair {
    let hexagon = |xy: [[f64; 2]; 6]| vec![xy.map(DVec2::from).to_vec()];
    PolygonPair::of(
        hexagon([
            [-0.918, -0.202],
            [-0.560, -0.736],
            [-0.425, -0.875],
            [-0.322, -0.979],
            [0.867, 0.708],
            [0.775, 0.807],
        ]),
        hexagon([
            [-0.346, 1.046],
            [-0.721, -0.058],
            [0.690, -0.668],
            [0.714, -0.678],
            [0.666, -0.596],
            [-0.285, 1.006],
        ]),
    )
}
