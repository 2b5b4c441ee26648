//! UDIM: textures in several pictures, each on a unit square of texture coordinates.
//!
//! The square with the lower corner (i, j) is number 1001 + i + 10 j, with i below 10 (the
//! convention of Mari and of the Open Shading Language); names of the form `u1_v1` count both from
//! 1 and have no such limit.

use std::collections::BTreeMap;

use glam::DVec2;

use crate::geometry::Mesh;

/// Columns and rows of squares that have a name.
const MOST_COLUMNS: i32 = 10;
const MOST_ROWS: i32 = 900;
/// Triangles that reach over a border by no more than this lie on it: texture coordinates of files
/// are rounded.
const SLACK: f64 = 1e-5;

/// The unit square with this lower corner.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct UvTile {
    /// Row, from v = 0 up; the first of the order, so that sorted tiles have rising numbers.
    pub v: i32,
    /// Column, from u = 0 to the right.
    pub u: i32,
}

impl UvTile {
    /// The square that the centroid of a triangle lies in; points on a border belong to the
    /// triangle's own side this way.
    pub fn of(uv: &[DVec2; 3]) -> Self {
        let centroid = (uv[0] + uv[1] + uv[2]) / 3.0;
        // Casts saturate, and take NaN to 0.
        Self { u: centroid.x.floor() as i32, v: centroid.y.floor() as i32 }
    }

    /// Its UDIM number, if it has one: columns 0 to 9, rows from 0.
    pub fn udim(self) -> Option<u32> {
        let named = (0..MOST_COLUMNS).contains(&self.u) && (0..MOST_ROWS).contains(&self.v);
        named.then(|| 1001 + self.u as u32 + 10 * self.v as u32)
    }

    /// The lower corner, as [`super::UvRegion::Square`] takes it.
    pub fn corner(self) -> [i32; 2] {
        [self.u, self.v]
    }
}

/// The squares that a mesh's texture coordinates use.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TilesUsed {
    /// Triangles whose centroids lie in each square that has a number.
    pub tiles: BTreeMap<UvTile, u64>,
    /// Triangles in squares without a number, and the first of them.
    pub unnumbered: (u64, usize),
    /// Triangles that reach over the border of their square, and the first of them.
    pub crossing: (u64, usize),
}

impl TilesUsed {
    /// Of the triangles that `wanted` names and that have texture coordinates. O(triangles log
    /// tiles).
    pub fn of(mesh: &Mesh, wanted: impl Fn(usize) -> bool) -> Self {
        let mut used = Self::default();
        let count = |n: &mut (u64, usize), t: usize| {
            if n.0 == 0 {
                n.1 = t;
            }
            n.0 += 1;
        };
        for t in (0..mesh.triangle_count()).filter(|&t| wanted(t)) {
            let Some(uv) = mesh.triangle_texcoords(t) else { continue };
            let tile = UvTile::of(&uv);
            if tile.udim().is_none() {
                count(&mut used.unnumbered, t);
                continue;
            }
            *used.tiles.entry(tile).or_insert(0) += 1;
            let corner = DVec2::new(f64::from(tile.u), f64::from(tile.v));
            let outside = |p: &DVec2| {
                let q = *p - corner;
                q.min_element() < -SLACK || q.max_element() > 1.0 + SLACK
            };
            if uv.iter().any(outside) {
                count(&mut used.crossing, t);
            }
        }
        used
    }

    /// Whether some triangle lies outside the unit square.
    pub fn beyond_the_unit_square(&self) -> bool {
        self.unnumbered.0 > 0 || self.tiles.keys().any(|t| t.corner() != [0, 0])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Corner, MeshBuilder, NONE};
    use glam::DVec3;

    fn mesh(triangles: &[[[f64; 2]; 3]]) -> Mesh {
        let mut b = MeshBuilder::new("tiles");
        for t in triangles {
            let first = b.mesh.texcoords.len() as u32;
            b.mesh.texcoords.extend(t.map(DVec2::from));
            b.mesh.positions.extend(t.map(|p| DVec3::new(p[0], p[1], 0.0)));
            b.polygon((first..first + 3).map(|i| Corner { vertex: i, texcoord: i, normal: NONE }));
        }
        b.finish()
    }

    #[test]
    fn numbers_are_those_of_the_convention() {
        let number = |u, v| UvTile { u, v }.udim();
        assert_eq!(
            (number(0, 0), number(9, 0), number(0, 1), number(3, 12)),
            (Some(1001), Some(1010), Some(1011), Some(1124))
        );
        assert_eq!((number(10, 0), number(-1, 0), number(0, -1), number(0, i32::MAX)), (None, None, None, None));
    }

    #[test]
    fn borders_belong_to_the_side_of_the_triangle() {
        let used = TilesUsed::of(
            &mesh(&[
                [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]],
                [[1.0, 0.0], [2.0, 0.0], [2.0, 1.0]],
                [[1.0, 1.0], [2.0, 1.0], [1.0, 2.0]],
                [[0.5, 0.2], [1.5, 0.2], [0.6, 0.3]],
                [[-0.5, 0.2], [-0.4, 0.2], [-0.4, 0.3]],
                [[f64::NAN, 0.2], [1e300, 0.2], [-0.4, 0.3]],
            ]),
            |_| true,
        );
        let counts: Vec<(Option<u32>, u64)> = used.tiles.iter().map(|(t, n)| (t.udim(), *n)).collect();
        assert_eq!(counts, [(Some(1001), 3), (Some(1002), 1), (Some(1012), 1)]);
        assert_eq!((used.crossing, used.unnumbered.0, used.unnumbered.1), ((2, 3), 1, 4));
        assert!(used.beyond_the_unit_square());
    }
}
