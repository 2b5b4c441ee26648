//! A source and a target polygon that belong together.

use glam::DVec2;

use crate::error::{Error, Result};
use crate::geometry::{Defect, Polygon};

/// Most vertices of a cage: the work of a map grows with points times vertices, that of its minimum
/// with their square.
pub const MAX_VERTICES: usize = 16_384;

/// A source and a target polygon: as many loops, as many vertices in each, nested alike.
///
/// Orientation is normalised on construction, of both together so that vertices stay paired: a loop
/// inside an even number of others runs anticlockwise (y up), the rest clockwise, and the first
/// vertex of each loop stays the first.
#[derive(Clone, Debug, PartialEq)]
pub struct Cage {
    /// What the map starts from.
    pub source: Polygon,
    /// What it ends at.
    pub target: Polygon,
}

impl Cage {
    /// Pairs the loops of a source with those of a target, vertex by vertex.
    ///
    /// # Errors
    /// [`Error::Input`] where the counts of loops or vertices differ, a polygon has a [`Defect`],
    /// the loops are nested differently, or a loop of the target runs the other way round (a
    /// mirrored target, which no map without folds reaches). O(n log n) for n vertices.
    pub fn new(source: Vec<Vec<DVec2>>, target: Vec<Vec<DVec2>>) -> Result<Self> {
        if source.len() != target.len() {
            return Err(Error::input(
                format!("the cage has {} loops in its source and {} in its target", source.len(), target.len()),
                "Give every loop of the source its counterpart in the target, in the same order",
            ));
        }
        for (ring, (a, b)) in source.iter().zip(&target).enumerate() {
            if a.len() != b.len() {
                return Err(Error::input(
                    format!(
                        "loop {ring} of the cage has {} vertices in its source and {} in its target",
                        a.len(),
                        b.len()
                    ),
                    "Give every vertex of the source its counterpart in the target, in the same order",
                ));
            }
        }
        let (source, target) = (Polygon::from_loops(source), Polygon::from_loops(target));
        if source.vertex_count() > MAX_VERTICES {
            return Err(Error::input(
                format!("the cage has {} vertices, {MAX_VERTICES} are supported", source.vertex_count()),
                "Simplify its outline",
            ));
        }
        let from = source.nesting().map_err(|defect| refused("source", &defect))?;
        let to = target.nesting().map_err(|defect| refused("target", &defect))?;
        if let Some(ring) = (0..from.parents.len()).find(|&ring| from.parents[ring] != to.parents[ring]) {
            let place = |parent: Option<usize>| {
                parent.map_or_else(|| "around all others".to_owned(), |parent| format!("in loop {parent}"))
            };
            return Err(Error::input(
                format!(
                    "loop {ring} of the cage lies {} in its source and {} in its target",
                    place(from.parents[ring]),
                    place(to.parents[ring])
                ),
                "A map cannot move one loop into or out of another; nest the loops alike",
            ));
        }
        let wrong = |ring: usize| !source.well_oriented(&from, ring);
        if let Some(ring) = (0..from.parents.len()).find(|&ring| wrong(ring) == target.well_oriented(&to, ring)) {
            return Err(Error::input(
                format!("loop {ring} of the cage's target runs the other way round than in its source: it is mirrored"),
                "Mirror the target, or reverse the order of its vertices if they were numbered the other way round",
            ));
        }
        Ok(Self { target: target.reversed(wrong), source: source.reversed(wrong) })
    }
}

/// A defect of one of the two polygons, with what to do about it.
fn refused(which: &str, defect: &Defect) -> Error {
    let remedy = match defect {
        Defect::Empty | Defect::TooFew { .. } | Defect::Collinear { .. } => {
            "Every loop needs at least 3 vertices that are not on one line"
        }
        Defect::NotFinite(_) | Defect::Range => "Give finite coordinates of moderate size",
        Defect::Repeated(..) => "Vertices must be apart; do not repeat the first one at the end",
        Defect::Outside { .. } => "One loop must lie around all others; make a cage of each part",
        _ => "Loops must not cross or touch themselves or one another",
    };
    Error::input(format!("the cage's {which} is no polygon to map: {defect}"), remedy)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(x: f64, y: f64, half: f64) -> Vec<DVec2> {
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(u, v)| DVec2::new(x + half * u, y + half * v))
            .to_vec()
    }

    fn clockwise(mut ring: Vec<DVec2>) -> Vec<DVec2> {
        ring[1..].reverse();
        ring
    }

    #[test]
    fn both_polygons_are_turned_together() {
        // The outer loop the wrong way round in both, the hole the wrong way round in both.
        let source = vec![square(0., 0., 0.25), clockwise(square(0., 0., 1.0))];
        let target = vec![square(1., 0., 0.5), clockwise(square(1., 0., 2.0))];
        let cage = Cage::new(source.clone(), target.clone()).unwrap();
        cage.source.check().unwrap();
        cage.target.check().unwrap();
        let paired: Vec<(DVec2, DVec2)> = source.concat().into_iter().zip(target.concat()).collect();
        for pair in cage.source.vertices().zip(cage.target.vertices()) {
            assert!(paired.contains(&pair), "vertices stay paired");
        }
        assert_eq!(cage.source.loops()[1][0], source[1][0]);
    }

    #[test]
    fn what_does_not_belong_together_is_refused_by_name() {
        let (outer, hole) = (square(0., 0., 1.0), square(0., 0., 0.25));
        let says = |source: Vec<Vec<DVec2>>, target: Vec<Vec<DVec2>>, words: &str| {
            let message = Cage::new(source, target).unwrap_err().to_string();
            assert!(message.contains(words), "{message}");
        };
        says(vec![outer.clone()], vec![outer.clone(), hole.clone()], "1 loops in its source and 2 in its target");
        says(vec![outer.clone()], vec![outer[..3].to_vec()], "loop 0 of the cage has 4 vertices");
        says(vec![], vec![], "source is no polygon to map: it has no loop");
        says(
            vec![outer.clone()],
            vec![clockwise(outer.clone())],
            "loop 0 of the cage's target runs the other way round",
        );
        says(
            vec![outer.clone(), hole.clone()],
            vec![outer.clone(), clockwise(hole.clone())],
            "loop 1 of the cage's target runs the other way round",
        );
        says(
            vec![outer.clone(), hole.clone()],
            vec![hole.clone(), outer.clone()],
            "loop 0 of the cage lies around all others in its source and in loop 1 in its target",
        );
        says(
            vec![outer.clone(), hole.clone()],
            vec![outer.clone(), square(5., 0., 1.0)],
            "target is no polygon to map: loop 1 lies outside loop 0",
        );
        let mut bow = outer.clone();
        bow.swap(1, 2);
        says(vec![bow.clone()], vec![outer.clone()], "source is no polygon to map: edge 0 of loop 0 meets edge 2");
        says(vec![outer.clone()], vec![bow], "target is no polygon to map");
        let mut holed = outer.clone();
        holed[2].y = f64::INFINITY;
        says(vec![outer.clone()], vec![holed], "vertex 2 of loop 0 is not finite");
        let many: Vec<DVec2> =
            (0..=MAX_VERTICES).map(|i| DVec2::from_angle(i as f64 * 6.0 / MAX_VERTICES as f64)).collect();
        says(vec![many.clone()], vec![many], "16385 vertices, 16384 are supported");
    }
}
