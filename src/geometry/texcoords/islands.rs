//! Islands: parts of a mesh over which texture coordinates are continuous and turn one way.

use std::collections::HashMap;

use glam::DVec2;
use robust::{Coord, orient2d};

use crate::geometry::{Mesh, NONE};

/// An island of a mesh's texture coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct Island {
    /// Its lowest triangle.
    pub first: u32,
    /// Number of its triangles.
    pub triangles: u32,
    /// Area on the surface.
    pub area: f64,
    /// Area in texture coordinates.
    pub texture_area: f64,
    /// Clockwise in texture coordinates: the texture appears mirrored.
    pub mirrored: bool,
    /// Materials of its triangles, ascending, [`NONE`] for those without.
    pub materials: Vec<u32>,
    /// Vertices less edges plus triangles: 1 for a disk, 0 for a ring, less with more holes. Where
    /// it touches itself at a vertex only, that counts as two: it does not close a ring.
    pub euler: i64,
    /// No edge of it has more than two of its triangles.
    pub manifold: bool,
}

impl Island {
    /// Whether it is a topological disk.
    pub fn is_disk(&self) -> bool {
        self.manifold && self.euler == 1
    }
}

/// The islands of a mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Islands {
    /// In the order of their first triangles.
    pub islands: Vec<Island>,
    /// Island of each triangle, or [`NONE`] if it has no texture coordinates or no area in the
    /// texture.
    pub island_of: Vec<u32>,
    /// Triangles without texture coordinates, ascending.
    pub missing: Vec<u32>,
    /// Triangles with texture coordinates but without area there, ascending.
    pub flat: Vec<u32>,
}

/// The sign of a triangle's area in texture coordinates, exact: 1 counter-clockwise, -1 clockwise,
/// 0 on a line or not finite.
pub fn orientation(uv: &[DVec2; 3]) -> i8 {
    let [a, b, c] = uv.map(|p| Coord { x: p.x, y: p.y });
    let sign = orient2d(a, b, c);
    i8::from(sign > 0.0) - i8::from(sign < 0.0)
}

impl Islands {
    /// The islands of `mesh`. Triangles are of one island if they turn the same way and share an
    /// edge with equal positions and equal texture coordinates at both ends, whatever indices the
    /// file uses for them. O(n log n).
    pub fn new(mesh: &Mesh) -> Self {
        let n = mesh.triangle_count();
        let mut found = Self { island_of: vec![NONE; n], ..Self::default() };
        let mut ids: HashMap<[u64; 5], u32> = HashMap::new();
        // Ends, orientation, triangle.
        let mut edges: Vec<(u32, u32, i8, u32)> = Vec::with_capacity(3 * n);
        let mut corners: Vec<[u32; 3]> = vec![[NONE; 3]; n];
        for t in 0..n {
            let Some(uv) = mesh.triangle_texcoords(t) else {
                found.missing.push(t as u32);
                continue;
            };
            let turn = orientation(&uv);
            if turn == 0 {
                found.flat.push(t as u32);
                continue;
            }
            let p = mesh.triangle_positions(t);
            corners[t] = [0, 1, 2].map(|k| {
                // Adding zero makes -0 and 0 the same bits.
                let key = [p[k].x, p[k].y, p[k].z, uv[k].x, uv[k].y].map(|c| (c + 0.0).to_bits());
                let next = ids.len() as u32;
                *ids.entry(key).or_insert(next)
            });
            for k in 0..3 {
                let (a, b) = (corners[t][k], corners[t][(k + 1) % 3]);
                edges.push((a.min(b), a.max(b), turn, t as u32));
            }
        }
        edges.sort_unstable();
        found.number(&edges);
        found.measure(mesh, &edges, &corners);
        found
    }

    /// Joins triangles over edges and counts the parts from their lowest triangles.
    fn number(&mut self, edges: &[(u32, u32, i8, u32)]) {
        let mut parent: Vec<u32> = (0..self.island_of.len() as u32).collect();
        for group in edges.chunk_by(|x, y| (x.0, x.1, x.2) == (y.0, y.1, y.2)) {
            for pair in group.windows(2) {
                let (a, b) = (root(&mut parent, pair[0].3), root(&mut parent, pair[1].3));
                // The lowest triangle stands for its island.
                parent[a.max(b) as usize] = a.min(b);
            }
        }
        let mut shown = vec![true; self.island_of.len()];
        for &t in self.missing.iter().chain(&self.flat) {
            shown[t as usize] = false;
        }
        let mut count = 0;
        for t in (0..shown.len()).filter(|&t| shown[t]) {
            let r = root(&mut parent, t as u32) as usize;
            if r == t {
                self.island_of[t] = count;
                count += 1;
            } else {
                self.island_of[t] = self.island_of[r];
            }
        }
    }

    fn measure(&mut self, mesh: &Mesh, edges: &[(u32, u32, i8, u32)], corners: &[[u32; 3]]) {
        for t in 0..self.island_of.len() {
            let (i, Some(uv)) = (self.island_of[t], mesh.triangle_texcoords(t)) else { continue };
            if i == NONE {
                continue;
            }
            if i as usize == self.islands.len() {
                self.islands.push(Island {
                    first: t as u32,
                    triangles: 0,
                    area: 0.0,
                    texture_area: 0.0,
                    mirrored: orientation(&uv) < 0,
                    materials: Vec::new(),
                    euler: 0,
                    manifold: true,
                });
            }
            let island = &mut self.islands[i as usize];
            island.triangles += 1;
            island.euler += 1;
            island.area += mesh.triangle_area(t);
            island.texture_area += 0.5 * (uv[1] - uv[0]).perp_dot(uv[2] - uv[0]).abs();
            let material = mesh.triangle_material(t);
            if let Err(place) = island.materials.binary_search(&material) {
                island.materials.insert(place, material);
            }
        }
        for group in edges.chunk_by(|x, y| (x.0, x.1, x.2) == (y.0, y.1, y.2)) {
            let island = &mut self.islands[self.island_of[group[0].3 as usize] as usize];
            island.euler -= 1;
            island.manifold &= group.len() <= 2;
        }
        // Vertices are fans: the corners at a point that are joined over edges.
        let mut fan: Vec<u32> = (0..3 * corners.len() as u32).collect();
        for group in edges.chunk_by(|x, y| (x.0, x.1, x.2) == (y.0, y.1, y.2)) {
            for pair in group.windows(2) {
                for id in [pair[0].0, pair[0].1] {
                    let corner = |t: u32| corners[t as usize].iter().position(|&c| c == id).map(|k| 3 * t + k as u32);
                    if let (Some(a), Some(b)) = (corner(pair[0].3), corner(pair[1].3)) {
                        let (a, b) = (root(&mut fan, a), root(&mut fan, b));
                        fan[a.max(b) as usize] = a.min(b);
                    }
                }
            }
        }
        for (corner, _) in fan.iter().enumerate().filter(|(c, root)| **root as usize == *c) {
            let island = self.island_of[corner / 3];
            if island != NONE {
                self.islands[island as usize].euler += 1;
            }
        }
    }
}

fn root(parent: &mut [u32], mut t: u32) -> u32 {
    while parent[t as usize] != t {
        let up = parent[parent[t as usize] as usize];
        parent[t as usize] = up;
        t = up;
    }
    t
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Corner, MeshBuilder};
    use crate::models::shapes::{Diagonal, plane_grid};
    use glam::DVec3;

    #[test]
    fn a_grid_is_one_disk() {
        let mesh = plane_grid(5, 4, 1.0, 1.0, Diagonal::default());
        let found = Islands::new(&mesh);
        assert_eq!((found.islands.len(), found.flat.len(), found.missing.len()), (1, 0, 0));
        let island = &found.islands[0];
        assert!(island.is_disk() && !island.mirrored && (island.area - 1.0).abs() < 1e-12, "{island:?}");
        assert_eq!(island.triangles as usize, mesh.triangle_count());
    }

    #[test]
    fn a_ring_and_a_fold_are_told() {
        // A square ring of eight points and its texture; the second mesh folds the grid at its
        // middle.
        let at = |k: usize, r: f64| DVec3::new([r, r, -r, -r][k], [-r, r, r, -r][k], 0.0);
        let mut ring = MeshBuilder::new("ring");
        for k in 0..4 {
            ring.mesh.positions.extend([at(k, 1.0), at(k, 0.5)]);
        }
        ring.mesh.texcoords = ring.mesh.positions.iter().map(|p| p.truncate()).collect();
        for k in 0..4u32 {
            let next = (k + 1) % 4;
            ring.polygon([2 * k, 2 * next, 2 * next + 1, 2 * k + 1].map(|v| Corner {
                vertex: v,
                texcoord: v,
                normal: NONE,
            }));
        }
        let ring = Islands::new(&ring.finish());
        assert_eq!((ring.islands.len(), ring.islands[0].euler, ring.islands[0].is_disk()), (1, 0, false));

        let mut fold = plane_grid(4, 2, 1.0, 1.0, Diagonal::default());
        for t in &mut fold.texcoords {
            t.x = (t.x - 0.5).abs();
        }
        let fold = Islands::new(&fold);
        assert_eq!(fold.islands.len(), 2, "one for each side of the fold");
        assert_ne!(fold.islands[0].mirrored, fold.islands[1].mirrored);
        assert!(fold.islands.iter().all(Island::is_disk));
    }

    #[test]
    fn triangles_without_place_are_listed() {
        let mut mesh = plane_grid(2, 1, 1.0, 1.0, Diagonal::default());
        let t = mesh.triangle_corners(1);
        let a = mesh.texcoords[t[0].texcoord as usize];
        mesh.texcoords[t[1].texcoord as usize] = a;
        let found = Islands::new(&mesh);
        assert!(found.flat.contains(&1) && found.island_of[1] == NONE);
        let bare = Mesh::of_triangles("bare", mesh.positions.clone(), &mesh.triangles());
        assert_eq!(Islands::new(&bare).missing.len(), mesh.triangle_count());
    }
}
