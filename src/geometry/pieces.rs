//! Triangles cut at vertices that lie on their edges.
//!
//! At a T-junction a long edge runs along several shorter ones. The surface is one there if the
//! triangle of the long edge has the ends of the short ones as further corners: for geometry it is
//! a polygon, and that is cut into triangles, its *pieces*. The first piece keeps the number of the
//! triangle, the others are numbered after all triangles of the file, so that no number of the file
//! changes. Texture coordinates and normals of the further corners are those of the long edge
//! there: pictures stay the same.

use std::collections::{BTreeMap, HashMap};

use super::SurfacePoint;

/// A vertex on an edge of a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct OnEdge {
    pub(crate) triangle: u32,
    /// The corner that the edge lies opposite to.
    pub(crate) corner: u32,
    /// Place along the edge in the direction of the triangle, 0 to 1.
    pub(crate) along: f64,
    pub(crate) vertex: u32,
}

/// What cut triangles are made of.
#[derive(Clone, Debug, Default)]
pub(super) struct Pieces {
    /// What they are cut at.
    pub(super) vertices: Vec<OnEdge>,
    /// The corners of each triangle of the file that is cut, as indices of the mesh's corners.
    whole: HashMap<u32, [u32; 3]>,
    /// For each further corner: the triangle of the file, and its place there.
    pub(super) corners: Vec<(u32, [f64; 3])>,
    /// For each piece, by its number: the triangle of the file, and the places of its corners
    /// there.
    places: HashMap<u32, (u32, [[f64; 3]; 3])>,
    /// The pieces of each triangle that is cut, the first one first.
    members: HashMap<u32, Vec<u32>>,
    /// How many texture coordinates and normals of the mesh, the last ones, are of further corners.
    pub(super) texcoords: usize,
    pub(super) normals: usize,
    /// Vertices that lie on edges: the ends of the edge, and the place along it. One whose edge
    /// ends in another one of them comes after that.
    pub(super) hanging: Vec<Hanging>,
}

/// A vertex, the ends of the edge it lies on, and the place along that.
pub(super) type Hanging = (u32, [u32; 2], f64);

/// A corner of a piece: one of the triangle's three, or a further one.
type Place = (usize, [f64; 3]);

impl Pieces {
    /// Cuts triangles at `vertices`, sorted by triangle, corner and place along the edge.
    /// `triangles` are replaced by their first pieces, and the others appended; `first` is the
    /// index of the first further corner, which come in the order of `vertices`.
    pub(super) fn cut(vertices: &[OnEdge], first: u32, triangles: &mut Vec<[u32; 3]>) -> Self {
        let mut pieces = Self { vertices: vertices.to_vec(), ..Self::default() };
        for group in vertices.chunk_by(|a, b| a.triangle == b.triangle) {
            let t = group[0].triangle;
            let whole = triangles[t as usize];
            // The corners on the edge that begins at corner k.
            let mut chains: [Vec<Place>; 3] = Default::default();
            for v in group {
                let k = (v.corner as usize + 1) % 3;
                let mut place = [0.0; 3];
                (place[k], place[(k + 1) % 3]) = (1.0 - v.along, v.along);
                chains[k].push((whole.len() + pieces.corners.len(), place));
                pieces.corners.push((t, place));
            }
            let unit = |k: usize| -> [f64; 3] { std::array::from_fn(|i| if i == k { 1.0 } else { 0.0 }) };
            let mut made = Vec::new();
            fan([0, 1, 2].map(|k| (k, unit(k))), chains, &mut made);
            let index = |c: &Place| if c.0 < 3 { whole[c.0] } else { first + (c.0 - 3) as u32 };
            let mut members = Vec::new();
            for (i, piece) in made.iter().enumerate() {
                let corners = [0, 1, 2].map(|k| index(&piece[k]));
                let number = if i == 0 { t } else { triangles.len() as u32 };
                if i == 0 {
                    triangles[t as usize] = corners;
                } else {
                    triangles.push(corners);
                }
                pieces.places.insert(number, (t, [0, 1, 2].map(|k| piece[k].1)));
                members.push(number);
            }
            pieces.whole.insert(t, whole);
            pieces.members.insert(t, members);
        }
        pieces
    }

    /// Keeps one edge for each vertex that lies on several, and sorts them; two that lie on edges
    /// of one another hang on neither.
    pub(super) fn hang(&mut self, all: Vec<Hanging>) {
        let edges: BTreeMap<u32, Hanging> = all.into_iter().rev().map(|h| (h.0, h)).collect();
        #[derive(Clone, Copy, PartialEq)]
        enum Seen {
            Begun,
            Done,
        }
        let mut seen: HashMap<u32, Seen> = HashMap::new();
        for &first in edges.keys() {
            let mut stack = vec![first];
            while let Some(&v) = stack.last() {
                let ends = edges.get(&v).filter(|_| seen.get(&v) != Some(&Seen::Done)).map(|h| h.1);
                let Some(ends) = ends else {
                    stack.pop();
                    continue;
                };
                if seen.insert(v, Seen::Begun).is_none() {
                    stack.extend(ends.into_iter().filter(|end| edges.contains_key(end) && !seen.contains_key(end)));
                    continue;
                }
                let cyclic = ends.iter().any(|end| edges.contains_key(end) && seen.get(end) == Some(&Seen::Begun));
                if !cyclic {
                    self.hanging.push(edges[&v]);
                }
                seen.insert(v, Seen::Done);
                stack.pop();
            }
        }
    }

    /// How many pieces come after the triangles of the file.
    pub(super) fn beyond(&self) -> usize {
        self.places.len() - self.members.len()
    }

    /// The corners of triangle `t` of the file, if it is cut.
    pub(super) fn whole(&self, t: u32) -> Option<[u32; 3]> {
        self.whole.get(&t).copied()
    }

    /// Puts the triangles of the file back.
    pub(super) fn restore(self, triangles: &mut [[u32; 3]]) {
        for (t, corners) in self.whole {
            triangles[t as usize] = corners;
        }
    }

    /// The triangle of the file that a triangle is, or is a piece of.
    pub(super) fn triangle(&self, t: u32) -> u32 {
        self.places.get(&t).map_or(t, |(file, _)| *file)
    }

    /// A point of the file's triangles, in the piece that it lies in.
    pub(super) fn located(&self, p: SurfacePoint) -> SurfacePoint {
        let Some(members) = self.members.get(&p.face) else { return p };
        let inside = |piece: &u32| -> (f64, SurfacePoint) {
            let c = within(&self.places[piece].1, p.barycentric);
            (c.into_iter().fold(f64::INFINITY, f64::min), SurfacePoint::new(*piece, c))
        };
        // The first one of those it lies deepest in, so that a point of an edge has one place.
        let best = members.iter().map(inside).reduce(|a, b| if b.0 > a.0 + 1e-12 { b } else { a });
        let Some((_, found)) = best else { return p };
        let kept = found.barycentric.map(|x| x.max(0.0));
        let sum: f64 = kept.iter().sum();
        SurfacePoint::new(found.face, kept.map(|x| x / sum))
    }

    /// A point of the pieces, in the triangle of the file.
    pub(super) fn in_file(&self, p: SurfacePoint) -> SurfacePoint {
        let Some((t, places)) = self.places.get(&p.face) else { return p };
        let at = |i: usize| (0..3).map(|k| p.barycentric[k] * places[k][i]).sum();
        SurfacePoint::new(*t, std::array::from_fn(at))
    }
}

/// Triangles of a triangle with further corners on its edges, `chains[k]` on the one from corner k
/// to the next: a fan from the corner opposite to the first edge that has some, whose outer
/// triangles have what lies on the other two.
fn fan(corners: [Place; 3], chains: [Vec<Place>; 3], made: &mut Vec<[Place; 3]>) {
    let Some(k) = (0..3).find(|&k| !chains[k].is_empty()) else {
        made.push(corners);
        return;
    };
    let [mut a, b, apex] = [k, k + 1, k + 2].map(|i| corners[i % 3]);
    let [on, mut beyond, mut before] = [k, k + 1, k + 2].map(|i| chains[i % 3].clone());
    let last = on.len();
    for (i, next) in on.into_iter().chain([b]).enumerate() {
        // The edges a-next, next-apex, apex-a.
        let second = if i == last { std::mem::take(&mut beyond) } else { Vec::new() };
        let third = if i == 0 { std::mem::take(&mut before) } else { Vec::new() };
        fan([a, next, apex], [Vec::new(), second, third], made);
        a = next;
    }
}

/// The barycentric coordinates in the triangle of `corners` of a point, all given in another one.
fn within(corners: &[[f64; 3]; 3], p: [f64; 3]) -> [f64; 3] {
    let [a, b, c] = corners.map(|c| [c[0], c[1]]);
    let twice = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
    let (p, whole) = ([p[0], p[1]], twice(a, b, c));
    [twice(p, b, c) / whole, twice(a, p, c) / whole, twice(a, b, p) / whole]
}
