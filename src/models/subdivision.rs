//! Catmull-Clark subdivision of the cage and evaluation at a parameter.

use std::collections::HashMap;

use glam::DVec3;

/// A point of the base surface: a quad of the cage and parameters in the unit square.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// Quad of the control cage.
    pub quad: u32,
    /// From the quad's corner 0 to its corner 1.
    pub u: f64,
    /// From the quad's corner 0 to its corner 3.
    pub v: f64,
}

/// Grid cells per side of a control quad: four levels of subdivision.
const CELLS: usize = 1 << LEVELS;
const LEVELS: usize = 4;

/// The subdivided cage: per control quad a bilinear patch network of [`CELLS`] by [`CELLS`].
#[derive(Clone, Debug)]
pub(super) struct BaseSurface {
    grid: Vec<DVec3>,
}

impl BaseSurface {
    /// Subdivides quads with control positions. O(quads * 4^levels).
    pub(super) fn new(quads: &[[u32; 4]], positions: &[DVec3]) -> Self {
        let mut faces: Vec<Face> = quads
            .iter()
            .enumerate()
            .map(|(q, &vertices)| Face {
                vertices,
                quad: q as u32,
                places: [[0, 0], [CELLS, 0], [CELLS, CELLS], [0, CELLS]],
            })
            .collect();
        let mut positions = positions.to_vec();
        for _ in 0..LEVELS {
            (faces, positions) = subdivide(&faces, &positions);
        }
        let side = CELLS + 1;
        let mut grid = vec![DVec3::ZERO; quads.len() * side * side];
        for face in &faces {
            for (vertex, [i, j]) in face.vertices.iter().zip(face.places) {
                grid[(face.quad as usize * side + j) * side + i] = positions[*vertex as usize];
            }
        }
        Self { grid }
    }

    /// The point at a parameter, which is clamped to the unit square.
    pub(super) fn position(&self, p: Parameter) -> DVec3 {
        let side = CELLS + 1;
        let cell = |t: f64| {
            let t = t.clamp(0.0, 1.0) * CELLS as f64;
            let i = (t as usize).min(CELLS - 1);
            (i, t - i as f64)
        };
        let ((i, s), (j, t)) = (cell(p.u), cell(p.v));
        let at = |i: usize, j: usize| self.grid[(p.quad as usize * side + j) * side + i];
        at(i, j).lerp(at(i + 1, j), s).lerp(at(i, j + 1).lerp(at(i + 1, j + 1), s), t)
    }
}

#[derive(Clone, Copy)]
struct Face {
    vertices: [u32; 4],
    quad: u32,
    /// Grid places of the vertices in the control quad.
    places: [[usize; 2]; 4],
}

/// One step of Catmull and Clark's rules on a closed mesh of quads.
fn subdivide(faces: &[Face], positions: &[DVec3]) -> (Vec<Face>, Vec<DVec3>) {
    let n = positions.len();
    let mut finer = vec![DVec3::ZERO; n];
    let centre = |f: &Face| f.vertices.iter().map(|&v| positions[v as usize]).sum::<DVec3>() / 4.0;
    let centres: Vec<DVec3> = faces.iter().map(centre).collect();
    // Per vertex: valence, sum of face centres, sum of edge midpoints.
    let mut around = vec![(0.0, DVec3::ZERO, DVec3::ZERO); n];
    let mut edges: HashMap<(u32, u32), u32> = HashMap::with_capacity(2 * faces.len());
    let mut edge_points: Vec<DVec3> = Vec::with_capacity(2 * faces.len());
    let mut children = Vec::with_capacity(4 * faces.len());
    let first_edge = n as u32;
    let first_centre = first_edge + 2 * faces.len() as u32;
    for (f, face) in faces.iter().enumerate() {
        let mut of_edge = [0; 4];
        for (e, mine) in of_edge.iter_mut().enumerate() {
            let (a, b) = (face.vertices[e], face.vertices[(e + 1) % 4]);
            let (pa, pb) = (positions[a as usize], positions[b as usize]);
            let id = *edges.entry((a.min(b), a.max(b))).or_insert_with(|| {
                edge_points.push((pa + pb) / 4.0);
                edge_points.len() as u32 - 1
            });
            edge_points[id as usize] += centres[f] / 4.0;
            *mine = first_edge + id;
            let ring = &mut around[a as usize];
            ring.0 += 1.0;
            ring.1 += centres[f];
            // Each edge of a closed mesh is met from both ends, once from each side.
            ring.2 += (pa + pb) / 2.0;
        }
        for k in 0..4 {
            let mid = |a: usize, b: usize| [0, 1].map(|x| (face.places[a][x] + face.places[b][x]) / 2);
            let (next, before) = ((k + 1) % 4, (k + 3) % 4);
            let mut vertices = [0; 4];
            let mut places = [[0; 2]; 4];
            // Corner k stays corner k, so that all patches keep their orientation.
            vertices[k] = face.vertices[k];
            vertices[next] = of_edge[k];
            vertices[(k + 2) % 4] = first_centre + f as u32;
            vertices[before] = of_edge[before];
            places[k] = face.places[k];
            places[next] = mid(k, next);
            places[(k + 2) % 4] = mid(0, 2);
            places[before] = mid(k, before);
            children.push(Face { vertices, quad: face.quad, places });
        }
    }
    for (v, (valence, centres, midpoints)) in around.into_iter().enumerate() {
        finer[v] = (centres / valence + 2.0 * midpoints / valence + positions[v] * (valence - 3.0)) / valence;
    }
    finer.extend(edge_points);
    finer.resize(first_centre as usize, DVec3::ZERO);
    finer.extend(centres);
    (children, finer)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::cage::Cage;

    #[test]
    fn patches_join_along_all_edges() {
        let cage = Cage::new();
        let positions: Vec<DVec3> = cage.vertices.iter().map(|l| DVec3::from(l.map(f64::from))).collect();
        let surface = BaseSurface::new(&cage.quads, &positions);
        let on_edge = |q: u32, e: usize, t: f64| {
            let (u, v) = [(t, 0.0), (1.0, t), (1.0 - t, 1.0), (0.0, 1.0 - t)][e];
            surface.position(Parameter { quad: q, u, v })
        };
        for (q, around) in cage.neighbours.iter().enumerate() {
            for (e, &(other, f)) in around.iter().enumerate() {
                for t in [0.0, 0.3, 0.77, 1.0] {
                    let gap = on_edge(q as u32, e, t).distance(on_edge(other, f, 1.0 - t));
                    assert!(gap < 1e-12, "quad {q} edge {e}: {gap}");
                }
            }
        }
    }

    #[test]
    fn a_cube_shrinks_to_the_known_size() {
        // After one step a face's centre stays, its edge points have height 3/4 over the other axis
        // and the corners are at 5/9. The limit mask of a regular vertex, (16, 4, 1) / 36, then
        // gives the height of the limit surface; each of the three steps that follow comes nearer
        // by a factor of four.
        let limit = (16.0 + 4.0 * 4.0 * 0.75 + 4.0 * 5.0 / 9.0) / 36.0;
        let slack = (1.0 - limit) / 64.0 + 1e-12;
        let quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
        let positions: Vec<DVec3> = (0..8)
            .map(|i| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2)) * 2.0 - DVec3::ONE)
            .collect();
        let surface = BaseSurface::new(&quads, &positions);
        let centres: Vec<DVec3> = (0..6).map(|quad| surface.position(Parameter { quad, u: 0.5, v: 0.5 })).collect();
        for c in &centres {
            assert!((c.length() - limit).abs() < slack, "{}", c.length());
            assert!((c.abs().max_element() - c.length()).abs() < 1e-12);
        }
    }
}
