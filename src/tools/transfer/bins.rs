//! The host's half of `rasterize_atlas`: triangles in texels, and the bins they fall in.

use rayon::prelude::*;

use super::atlas::{AtlasTriangle, BIN, BinEntry, SUBTEXEL, Tile, edge};
use crate::error::{Error, Result};
use crate::geometry::Mesh;

/// Largest extent of a triangle in sub-texels; keeps the kernel's edge functions within 32 bits.
const LARGEST_EXTENT: i64 = 1 << 24;
/// Largest number of repeats of the texture that a triangle may reach over, per axis.
const MOST_REPEATS: i64 = 256;
/// Texture coordinates beyond this have no texel-sized precision left.
const LARGEST_COORDINATE: f64 = 1e6;

/// Which part of the plane of texture coordinates the texture shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum UvRegion {
    /// All of it: coordinates outside 0..1 wrap around.
    #[default]
    Repeat,
    /// The unit square with this lower corner only (UDIM 1001 is `[0, 0]`); the rest is left out.
    Square([i32; 2]),
}

/// The triangles of a target in its texture.
#[derive(Clone, Debug, Default)]
pub struct Atlas {
    /// One record for each repeat a triangle shows in, by face.
    pub triangles: Vec<AtlasTriangle>,
    /// Barycentric coordinates over the texture, of each record, before snapping.
    planes: Vec<Plane>,
    /// Faces without texture coordinates.
    pub missing: u64,
    /// Faces whose corners fall on a line or point of the 1/256 texel grid.
    pub degenerate: u64,
    /// Faces whose texture is mirrored (clockwise in texture coordinates).
    pub mirrored: u64,
}

/// Barycentric coordinates 0 and 1 (in the mesh's corner order) as affine functions of the texel
/// position.
#[derive(Clone, Copy, Debug)]
struct Plane {
    origin: [f64; 2],
    gradient: [[f64; 2]; 2],
}

impl Plane {
    /// Of a triangle with these corners in texels; `None` if they are on a line.
    fn new(p: &[[f64; 2]; 3]) -> Option<Self> {
        let d = |a: usize, b: usize, axis: usize| p[a][axis] - p[b][axis];
        let area = d(1, 0, 0) * d(2, 0, 1) - d(1, 0, 1) * d(2, 0, 0);
        let gradient = [[d(1, 2, 1) / area, d(2, 1, 0) / area], [d(2, 0, 1) / area, d(0, 2, 0) / area]];
        let origin = [0, 1].map(|k| f64::from(k == 0) - gradient[k][0] * p[0][0] - gradient[k][1] * p[0][1]);
        let finite = gradient.iter().flatten().chain(&origin).all(|c| c.is_finite());
        finite.then_some(Self { origin, gradient })
    }

    /// Coordinate `k` at a position in texels.
    fn at(&self, k: usize, p: [f64; 2]) -> f64 {
        self.origin[k] + self.gradient[k][0] * p[0] + self.gradient[k][1] * p[1]
    }
}

impl Atlas {
    /// Bytes of one record.
    pub const RECORD: usize = size_of::<AtlasTriangle>() + size_of::<Plane>();

    /// The triangles of `mesh` in a texture of `width` x `height` texels; with `material`, those of
    /// that material only.
    ///
    /// # Errors
    /// If a triangle has a texture coordinate that is not finite or beyond 1e6, or reaches over
    /// more repeats than 256 or 65,536 texels; if more than `most` records are needed.
    pub fn new(
        mesh: &Mesh,
        width: u32,
        height: u32,
        region: UvRegion,
        material: Option<u32>,
        most: usize,
    ) -> Result<Self> {
        let mut atlas = Self::default();
        for face in 0..mesh.triangle_count() {
            if material.is_some_and(|m| mesh.triangle_material(face) != m) {
                continue;
            }
            match mesh.triangle_texcoords(face) {
                None => atlas.missing += 1,
                Some(uv) => atlas.push(mesh, face, uv.map(|p| [p.x, p.y]), [width, height], region, most)?,
            }
        }
        Ok(atlas)
    }

    fn push(
        &mut self,
        mesh: &Mesh,
        face: usize,
        uv: [[f64; 2]; 3],
        size: [u32; 2],
        region: UvRegion,
        most: usize,
    ) -> Result<()> {
        if !uv.iter().flatten().all(|c| c.abs() <= LARGEST_COORDINATE) {
            return Err(Error::mesh(
                &mesh.name,
                format!("triangle {face} has the texture coordinates {uv:?}"),
                "Give finite texture coordinates between -1e6 and 1e6",
            ));
        }
        // Texels: x right, y down; v = 1 is the top row.
        let texel = uv.map(|[u, v]| [u * f64::from(size[0]), (1.0 - v) * f64::from(size[1])]);
        let snapped = texel.map(|p| p.map(|c| (c * f64::from(SUBTEXEL)).round() as i64));
        let side = size.map(|s| i64::from(s) * i64::from(SUBTEXEL));
        let bounds = [0, 1].map(|axis| {
            let v = snapped.map(|p| p[axis]);
            (v[0].min(v[1]).min(v[2]), v[0].max(v[1]).max(v[2]))
        });
        let area = (snapped[1][0] - snapped[0][0]) * (snapped[2][1] - snapped[0][1])
            - (snapped[1][1] - snapped[0][1]) * (snapped[2][0] - snapped[0][0]);
        // y points down here, so counter-clockwise texture coordinates have a negative area.
        self.mirrored += u64::from(area > 0);
        let Some(plane) = Plane::new(&texel).filter(|_| area != 0) else {
            self.degenerate += 1;
            return Ok(());
        };
        for axis in 0..2 {
            let extent = bounds[axis].1 - bounds[axis].0;
            if extent > LARGEST_EXTENT || extent / side[axis] > MOST_REPEATS {
                return Err(Error::mesh(
                    &mesh.name,
                    format!("triangle {face} reaches over {} repeats of the texture", extent / side[axis]),
                    format!(
                        "At this size a triangle may reach over {}; split it or scale its texture coordinates",
                        MOST_REPEATS.min(LARGEST_EXTENT / side[axis])
                    ),
                ));
            }
        }
        let repeats = match region {
            UvRegion::Repeat => {
                [0, 1].map(|a| (bounds[a].0.div_euclid(side[a]), (bounds[a].1 - 1).div_euclid(side[a])))
            }
            // Row 0 of square (i, j) is v = j + 1.
            UvRegion::Square([i, j]) => [i64::from(i), -i64::from(j)].map(|r| (r, r)),
        };
        for ry in repeats[1].0..=repeats[1].1 {
            for rx in repeats[0].0..=repeats[0].1 {
                let origin = [rx * side[0], ry * side[1]];
                let outside = (0..2).any(|a| bounds[a].0 - origin[a] >= side[a] || bounds[a].1 - origin[a] <= 0);
                if outside {
                    continue;
                }
                let mut corners = snapped.map(|p| [(p[0] - origin[0]) as i32, (p[1] - origin[1]) as i32]);
                if area < 0 {
                    corners.swap(1, 2);
                }
                if !meets(&corners, [0, 0], side) {
                    continue;
                }
                if self.triangles.len() >= most {
                    return Err(Error::Memory {
                        what: format!("mesh {}: the triangles of its texture, with {most} repeats of them,", mesh.name),
                        required: (most as u64 + 1) * Self::RECORD as u64,
                        allowed: most as u64 * Self::RECORD as u64,
                    });
                }
                self.triangles.push(AtlasTriangle {
                    face: face as u32,
                    swapped: u32::from(area < 0),
                    corners,
                    gradient: plane.gradient.map(|g| g.map(|c| c as f32)),
                });
                let moved = [rx, ry].map(|r| r as f64);
                let at = [moved[0] * f64::from(size[0]), moved[1] * f64::from(size[1])];
                self.planes.push(Plane { origin: [plane.at(0, at), plane.at(1, at)], ..plane });
            }
        }
        Ok(())
    }
}

/// Whether the closed triangle meets the open box [low, high).
fn meets(corners: &[[i32; 2]; 3], low: [i64; 2], high: [i64; 2]) -> bool {
    (0..3).all(|k| {
        let [a, b] = edge(corners, k).map(i64::from);
        let from = corners[(k + 1) % 3].map(i64::from);
        let x = if a > 0 { high[0] } else { low[0] };
        let y = if b > 0 { high[1] } else { low[1] };
        a * (x - from[0]) + b * (y - from[1]) > 0
    })
}

/// Lists of triangles by the bins that a tile meets.
///
/// Bins start at multiples of [`BIN`] in the texture, not in the tile, so that a texel comes out
/// the same, bit for bit, in any tile.
#[derive(Clone, Debug, Default)]
pub struct Bins {
    /// Column and row of the first bin.
    pub first: [u32; 2],
    /// Bins along a row of bins.
    pub columns: u32,
    /// First entry of each bin, and the number of entries at the end.
    pub start: Vec<u32>,
    /// Triangles of the bins, in each bin by index.
    pub entries: Vec<BinEntry>,
}

impl Bins {
    /// The bins of `tile`.
    ///
    /// # Errors
    /// If there are more than `most` entries.
    pub fn new(tile: &Tile, atlas: &Atlas, most: usize) -> Result<Self> {
        let first_bin = [tile.x / BIN, tile.y / BIN];
        let columns = (tile.x + tile.width).div_ceil(BIN) - first_bin[0];
        let rows = (tile.y + tile.height).div_ceil(BIN) - first_bin[1];
        let step = i64::from(BIN) * i64::from(SUBTEXEL);
        let origin = first_bin.map(|c| i64::from(c) * step);
        let visit = |first: usize, triangles: &[AtlasTriangle], found: &mut Vec<(u32, u32)>| {
            for (t, triangle) in triangles.iter().enumerate() {
                let range = |axis: usize, count: u32| {
                    let v = triangle.corners.map(|p| i64::from(p[axis]) - origin[axis]);
                    let low = v[0].min(v[1]).min(v[2]).div_euclid(step).max(0);
                    let high = (v[0].max(v[1]).max(v[2]) - 1).div_euclid(step).min(i64::from(count) - 1);
                    low..=high
                };
                for by in range(1, rows) {
                    if found.len() > most {
                        return;
                    }
                    for bx in range(0, columns) {
                        let low = [origin[0] + bx * step, origin[1] + by * step];
                        if meets(&triangle.corners, low, [low[0] + step, low[1] + step]) {
                            found.push(((by * i64::from(columns) + bx) as u32, (first + t) as u32));
                        }
                    }
                }
            }
        };
        const CHUNK: usize = 4096;
        let pairs: Vec<Vec<(u32, u32)>> = atlas
            .triangles
            .par_chunks(CHUNK)
            .enumerate()
            .map(|(c, triangles)| {
                let mut found = Vec::new();
                visit(c * CHUNK, triangles, &mut found);
                found
            })
            .collect();
        let count: usize = pairs.iter().map(Vec::len).sum();
        if count > most.min(u32::MAX as usize) {
            return Err(Error::Memory {
                what: format!(
                    "the atlas between rows {} and {}, with {count} triangles in bins,",
                    tile.y,
                    tile.y + tile.height
                ),
                required: count as u64 * size_of::<BinEntry>() as u64,
                allowed: most as u64 * size_of::<BinEntry>() as u64,
            });
        }
        let mut start = vec![0_u32; columns as usize * rows as usize + 1];
        for &(bin, _) in pairs.iter().flatten() {
            start[bin as usize + 1] += 1;
        }
        for b in 1..start.len() {
            start[b] += start[b - 1];
        }
        let mut next = start.clone();
        let mut sorted = vec![(0_u32, 0_u32); count];
        for &(bin, triangle) in pairs.iter().flatten() {
            let place = &mut next[bin as usize];
            sorted[*place as usize] = (bin, triangle);
            *place += 1;
        }
        let entry = |&(bin, triangle): &(u32, u32)| {
            let corner = [i64::from(bin % columns), i64::from(bin / columns)];
            let at = [0, 1].map(|a| origin[a] + corner[a] * step + i64::from(SUBTEXEL / 2));
            BinEntry::new(triangle, &atlas.triangles[triangle as usize], &atlas.planes[triangle as usize], at)
        };
        let entries = sorted.par_iter().map(entry).collect();
        Ok(Self { first: first_bin, columns, start, entries })
    }

    /// The entries of a bin.
    pub fn of(&self, bin: u32) -> &[BinEntry] {
        let bin = bin as usize;
        &self.entries[self.start[bin] as usize..self.start[bin + 1] as usize]
    }
}

impl BinEntry {
    /// The triangle seen from `at`, the centre of a bin's first texel in sub-texels.
    fn new(index: u32, triangle: &AtlasTriangle, plane: &Plane, at: [i64; 2]) -> Self {
        let mut quotient = [0; 3];
        let mut remainder = 0;
        for (k, quotient) in quotient.iter_mut().enumerate() {
            let [a, b] = edge(&triangle.corners, k).map(i64::from);
            let from = triangle.corners[(k + 1) % 3].map(i64::from);
            let value = a * (at[0] - from[0]) + b * (at[1] - from[1]);
            // A i + B j stays below 2^30 for texels of the bin.
            *quotient = value.div_euclid(256).clamp(-(1 << 30), 1 << 30) as i32;
            remainder |= (value.rem_euclid(256) as u32) << (8 * k);
        }
        let p = at.map(|c| c as f64 / f64::from(SUBTEXEL));
        Self {
            triangle: index,
            face: triangle.face,
            quotient,
            remainder,
            barycentric: [plane.at(0, p) as f32, plane.at(1, p) as f32],
        }
    }
}
