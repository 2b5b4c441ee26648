//! A picture in a cage whose vertices are dragged.

use std::path::PathBuf;

use glam::DVec2;

/// A loop of a cage: where its vertices are on the picture and where they go, in pixels, y down.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Loop {
    /// On the picture.
    pub source: Vec<DVec2>,
    /// On the result; as many.
    pub target: Vec<DVec2>,
}

/// A vertex of a cage: the number of its loop, and its number in there.
pub type VertexId = (usize, usize);

/// A picture in a cage.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CageDocument {
    /// The file of the picture.
    pub picture: Option<PathBuf>,
    /// The outline first, holes after it.
    pub loops: Vec<Loop>,
}

/// Whether the cage is drawn on the picture, or dragged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Stage {
    /// Vertices are placed on the picture; they go nowhere else.
    Draw,
    /// Vertices are dragged to where they go.
    #[default]
    Drag,
}

impl CageDocument {
    /// A rectangle a little within a picture of this size, with `side` vertices on each side, which
    /// goes nowhere yet.
    pub fn rectangle(&mut self, [width, height]: [f64; 2], side: usize) {
        let side = side.max(1);
        let (low, high) = (DVec2::new(0.04 * width, 0.04 * height), DVec2::new(0.96 * width, 0.96 * height));
        let corners = [low, DVec2::new(high.x, low.y), high, DVec2::new(low.x, high.y)];
        let vertex = |k: usize| {
            let (from, to) = (corners[k / side], corners[(k / side + 1) % 4]);
            from.lerp(to, (k % side) as f64 / side as f64)
        };
        let source: Vec<DVec2> = (0..4 * side).map(vertex).collect();
        self.loops = vec![Loop { target: source.clone(), source }];
    }

    /// Adds a loop that goes nowhere yet: the outline if there is none, else a hole.
    pub fn add_loop(&mut self, source: Vec<DVec2>) {
        self.loops.push(Loop { target: source.clone(), source });
    }

    /// All vertices.
    pub fn vertices(&self) -> impl Iterator<Item = VertexId> + '_ {
        self.loops.iter().enumerate().flat_map(|(l, one)| (0..one.source.len()).map(move |v| (l, v)))
    }

    /// Where a vertex is drawn.
    pub fn place(&self, (l, v): VertexId, stage: Stage) -> Option<DVec2> {
        let one = self.loops.get(l)?;
        match stage {
            Stage::Draw => one.source.get(v).copied(),
            Stage::Drag => one.target.get(v).copied(),
        }
    }

    /// Moves a vertex: where it goes, or, while the cage is drawn, where it is, and it goes along.
    pub fn move_by(&mut self, (l, v): VertexId, by: DVec2, stage: Stage) {
        let Some(one) = self.loops.get_mut(l).filter(|one| v < one.source.len()) else { return };
        if stage == Stage::Draw {
            one.source[v] += by;
        }
        one.target[v] += by;
    }

    /// The vertex nearest to a place, within `reach`.
    pub fn nearest(&self, at: DVec2, reach: f64, stage: Stage) -> Option<VertexId> {
        let distance = |id: &VertexId| self.place(*id, stage).map_or(f64::INFINITY, |p| p.distance(at));
        let near = self.vertices().min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
        (distance(&near) <= reach).then_some(near)
    }

    /// The edge nearest to a place, within `reach`: its first vertex, and how far along it is.
    pub fn nearest_edge(&self, at: DVec2, reach: f64, stage: Stage) -> Option<(VertexId, f64)> {
        let near = |(l, v): VertexId| {
            let n = self.loops[l].source.len();
            let (a, b) = (self.place((l, v), stage)?, self.place((l, (v + 1) % n), stage)?);
            let t = ((at - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
            Some(((l, v), t, a.lerp(b, t).distance(at)))
        };
        let best = self.vertices().filter_map(near).min_by(|a, b| a.2.total_cmp(&b.2))?;
        (best.2 <= reach).then_some((best.0, best.1))
    }

    /// Puts a vertex on an edge, `t` of the way along; gives its number.
    pub fn insert(&mut self, (l, v): VertexId, t: f64) -> Option<VertexId> {
        let one = self.loops.get_mut(l).filter(|one| v < one.source.len())?;
        let n = one.source.len();
        for points in [&mut one.source, &mut one.target] {
            let p = points[v].lerp(points[(v + 1) % n], t);
            points.insert(v + 1, p);
        }
        Some((l, v + 1))
    }

    /// Takes a vertex out; a loop of three goes as a whole. Whether there was one.
    pub fn remove(&mut self, (l, v): VertexId) -> bool {
        let Some(one) = self.loops.get_mut(l).filter(|one| v < one.source.len()) else { return false };
        if one.source.len() > 3 {
            one.source.remove(v);
            one.target.remove(v);
        } else {
            self.loops.remove(l);
        }
        true
    }

    /// Everything goes back to where it is on the picture.
    pub fn reset(&mut self) {
        self.loops.iter_mut().for_each(|one| one.target.clone_from(&one.source));
    }

    /// The cage as `barymap warp --cage` reads it.
    pub fn to_json(&self) -> serde_json::Value {
        let loops = |of: fn(&Loop) -> &Vec<DVec2>| -> Vec<Vec<[f64; 2]>> {
            self.loops.iter().map(|one| of(one).iter().map(|p| p.to_array()).collect()).collect()
        };
        serde_json::json!({"units": "pixel", "source": loops(|l| &l.source), "target": loops(|l| &l.target)})
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn document() -> CageDocument {
        let mut document = CageDocument::default();
        document.rectangle([200.0, 100.0], 2);
        document
    }

    #[test]
    fn a_rectangle_runs_around_the_picture() {
        let document = document();
        let source = &document.loops[0].source;
        assert_eq!(source.len(), 8);
        assert_eq!((source[0], source[1]), (DVec2::new(8.0, 4.0), DVec2::new(100.0, 4.0)));
        assert_eq!(source[4], DVec2::new(192.0, 96.0));
    }

    #[test]
    fn vertices_are_dragged_drawn_added_and_taken_away() {
        let mut d = document();
        let id = d.nearest(DVec2::new(99.0, 5.0), 4.0, Stage::Drag).unwrap();
        assert_eq!(id, (0, 1));
        d.move_by(id, DVec2::new(0.0, 20.0), Stage::Drag);
        assert_eq!((d.loops[0].source[1].y, d.loops[0].target[1].y), (4.0, 24.0));
        d.move_by(id, DVec2::new(5.0, 0.0), Stage::Draw);
        assert_eq!((d.loops[0].source[1].x, d.loops[0].target[1].x), (105.0, 105.0));
        assert!(d.nearest(DVec2::new(99.0, 50.0), 4.0, Stage::Drag).is_none());
        // The last edge leads back to the first vertex.
        let (edge, t) = d.nearest_edge(DVec2::new(8.0, 27.0), 2.0, Stage::Drag).unwrap();
        assert_eq!(edge, (0, 7));
        let new = d.insert(edge, t).unwrap();
        assert!(d.loops[0].target[new.1].distance(DVec2::new(8.0, 27.0)) < 1e-9);
        assert!(d.remove(new) && !d.remove((3, 0)));
        d.reset();
        assert_eq!(d.loops[0].source, d.loops[0].target);
        d.add_loop(vec![DVec2::ZERO, DVec2::X, DVec2::Y]);
        assert!(d.remove((1, 0)));
        assert_eq!(d.loops.len(), 1, "a loop of two is none");
    }

    #[test]
    fn the_command_line_reads_the_cage() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cage.json");
        let mut d = document();
        d.move_by((0, 3), DVec2::new(-3.25, 1.0 / 3.0), Stage::Drag);
        std::fs::write(&path, d.to_json().to_string()).unwrap();
        let read = barymap::io::cage::read_cage(&path).unwrap();
        assert_eq!((read.source, read.target), (vec![d.loops[0].source.clone()], vec![d.loops[0].target.clone()]));
    }
}
