//! A triangulation that keeps given edges, and walks over it.

use std::collections::{BTreeMap, BTreeSet, HashMap, VecDeque};

use glam::DVec2;
use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation as _};

/// An edge without direction, the smaller vertex first.
pub(super) fn undirected(a: usize, b: usize) -> (usize, usize) {
    (a.min(b), a.max(b))
}

/// Faces that cover the convex hull of points, with kept edges among their edges.
pub(super) struct Triangulation<'a> {
    kept: &'a BTreeSet<(usize, usize)>,
    /// Anticlockwise.
    faces: Vec<[usize; 3]>,
    /// The face to the left of a directed edge.
    left: HashMap<(usize, usize), usize>,
}

impl<'a> Triangulation<'a> {
    /// The constrained Delaunay triangulation; `None` where rounding made the kept edges meet.
    pub(super) fn new(points: &[DVec2], kept: &'a BTreeSet<(usize, usize)>) -> Option<Self> {
        let mut delaunay = ConstrainedDelaunayTriangulation::<Point2<f64>>::new();
        let handles =
            points.iter().map(|p| delaunay.insert(Point2::new(p.x, p.y))).collect::<Result<Vec<_>, _>>().ok()?;
        if handles.iter().enumerate().any(|(i, handle)| handle.index() != i) {
            return None;
        }
        for &(a, b) in kept {
            if delaunay.try_add_constraint(handles[a], handles[b]).is_empty() {
                return None;
            }
        }
        let faces: Vec<[usize; 3]> =
            delaunay.inner_faces().map(|face| face.vertices().map(|vertex| vertex.index())).collect();
        let sides = |face: &[usize; 3]| [(face[0], face[1]), (face[1], face[2]), (face[2], face[0])];
        let left: HashMap<(usize, usize), usize> =
            faces.iter().enumerate().flat_map(|(index, face)| sides(face).map(|side| (side, index))).collect();
        // A vertex on a kept edge would have cut it in two.
        let whole = kept.iter().all(|&(a, b)| left.contains_key(&(a, b)) || left.contains_key(&(b, a)));
        whole.then_some(Self { kept, faces, left })
    }

    /// The third vertex of the face to the left of the edge from `a` to `b`.
    fn apex(&self, a: usize, b: usize) -> Option<(usize, usize)> {
        let &face = self.left.get(&(a, b))?;
        self.faces[face].iter().find(|&&v| v != a && v != b).map(|&v| (face, v))
    }

    /// Faces at `a` anticlockwise from the edge to `b` as far as the next kept edge, each with its
    /// other two vertices.
    pub(super) fn wedge(&self, a: usize, b: usize) -> Vec<(usize, [usize; 2])> {
        let mut faces = Vec::new();
        let mut b = b;
        while let Some((face, c)) = self.apex(a, b) {
            faces.push((face, [b, c]));
            if self.kept.contains(&undirected(a, c)) || faces.len() > self.faces.len() {
                break;
            }
            b = c;
        }
        faces
    }

    /// Edges crossed on the way from the wedge of `from` to that of `to` over fewest faces,
    /// crossing no kept edge; wedges are given by their vertex and the end of their first edge.
    /// Empty where an edge joins the two.
    pub(super) fn crossed(&self, from: (usize, usize), to: (usize, usize)) -> Option<Vec<(usize, usize)>> {
        let goals: BTreeSet<usize> = self.wedge(to.0, to.1).into_iter().map(|(face, _)| face).collect();
        let mut seen = vec![false; self.faces.len()];
        // Of a face, the one before it on the way and the edge between them; none for those of the
        // first wedge.
        let mut before: HashMap<usize, (usize, (usize, usize))> = HashMap::new();
        let mut queue = VecDeque::new();
        for (face, _) in self.wedge(from.0, from.1) {
            seen[face] = true;
            queue.push_back(face);
        }
        while let Some(face) = queue.pop_front() {
            if goals.contains(&face) {
                let mut edges = Vec::new();
                let mut at = face;
                while let Some(&(last, edge)) = before.get(&at) {
                    edges.push(edge);
                    at = last;
                }
                edges.reverse();
                return Some(edges);
            }
            let [a, b, c] = self.faces[face];
            for (a, b) in [(a, b), (b, c), (c, a)] {
                if self.kept.contains(&undirected(a, b)) {
                    continue;
                }
                if let Some(&next) = self.left.get(&(b, a))
                    && !seen[next]
                {
                    seen[next] = true;
                    before.insert(next, (face, (a, b)));
                    queue.push_back(next);
                }
            }
        }
        None
    }

    /// The triangles of a disc by the places of their corners in its word, rising; the word is the
    /// disc's boundary, with it to the left, and has no vertex within. `None` if they do not fill
    /// it.
    pub(super) fn disc(&self, word: &[usize]) -> Option<Vec<[usize; 3]>> {
        let n = word.len();
        let mut corners: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for place in 0..n {
            for (face, _) in self.wedge(word[place], word[(place + 1) % n]) {
                corners.entry(face).or_default().push(place);
            }
        }
        // Places come in rising order: anticlockwise in the disc.
        let triangles: Vec<[usize; 3]> = corners.into_values().map(Vec::try_into).collect::<Result<_, _>>().ok()?;
        (triangles.len() + 2 == n).then_some(triangles)
    }
}
