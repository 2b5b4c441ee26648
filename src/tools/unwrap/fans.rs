//! Fans of many triangles around one vertex, unfolded by themselves.
//!
//! Thousands of needles that meet at a point all lie in one another's boxes, and whatever compares
//! triangles by these compares them all. A fan needs no such help: it unfolds into the plane as it
//! is, each triangle beside the one before, without distortion, and nothing overlaps as long as
//! the angles make no full turn. So fans are cut into sectors, and a sector is charted and packed
//! as a few wide triangles that cover it; its own triangles are put into these afterwards.
//!
//! Copies of a face around such a vertex, each of which would be a chart, are put where the first
//! of them is.

mod hub;

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use glam::{DMat2, DVec2, DVec3};

use self::hub::Hub;
use crate::geometry::{Corner, Frame, Mesh, MeshBuilder, NONE, Topology};

/// A fan of no more triangles is treated like the rest of the mesh.
const LONGEST: usize = 512;
/// Triangles lower than this part of the mesh's diagonal are no shapes in single precision.
const LEAST_HEIGHT: f64 = 1e-6;
/// Distance of the sectors' planes, in parts of the mesh's size: they must not touch.
const APART: f64 = 1e-3;

/// Triangles in order around a vertex, unfolded.
struct Sector {
    triangles: Vec<u32>,
    /// Which corner of each triangle is the hub.
    hub: Vec<usize>,
    /// The last triangle is beside the first.
    closed: bool,
    /// The outer vertices about the hub: of each triangle the first, and at the end the last one.
    outer: Vec<DVec2>,
    /// Directions of the outer vertices, in radians.
    angle: Vec<f64>,
    /// First triangle of each part, and the number of triangles at the end.
    parts: Vec<usize>,
    /// How far the wide triangles reach at the ends of the parts.
    reach: Vec<f64>,
}

/// The fans of a mesh that are unfolded by themselves.
pub(super) struct Fans {
    sectors: Vec<Sector>,
    /// Triangles with the corners of another around a vertex of many, and that one, each with the
    /// place of its lowest vertex.
    copies: Vec<[(u32, usize); 2]>,
    /// Of each triangle whether it is in a sector or a copy.
    inside: Vec<bool>,
}

impl Fans {
    /// Those of all vertices of more than 512 triangles. O(F).
    pub(super) fn new(mesh: &Mesh, topology: &Topology) -> Self {
        let inside = vec![false; mesh.triangle_count()];
        let mut fans = Self { sectors: Vec::new(), copies: Vec::new(), inside };
        let diagonal = mesh.bounds().map_or(0.0, |(low, high)| low.distance(high));
        for v in 0..topology.vertex_count() as u32 {
            let around = topology.vertex_triangles(v);
            if around.len() > LONGEST {
                fans.find_copies(mesh, around);
                let hub = Hub::new(mesh, topology, v, LEAST_HEIGHT * diagonal, &fans.inside);
                let runs = hub.runs(around);
                for (run, closed) in runs.into_iter().filter(|(run, _)| run.len() > LONGEST) {
                    if let Some(sectors) = hub.sectors(run, closed) {
                        sectors.iter().flat_map(|s| &s.triangles).for_each(|&t| fans.inside[t as usize] = true);
                        fans.sectors.extend(sectors);
                    }
                }
            }
        }
        fans
    }

    /// Notes which triangles around a vertex have the corners of another, in its orientation and
    /// material.
    fn find_copies(&mut self, mesh: &Mesh, around: &[u32]) {
        let mut first: HashMap<([u32; 3], u32), (u32, usize)> = HashMap::new();
        for &t in around {
            if self.inside[t as usize] {
                continue;
            }
            let mut corners = mesh.triangle(t as usize);
            let lowest = (0..3).min_by_key(|&k| corners[k]).unwrap_or(0);
            corners.rotate_left(lowest);
            match first.entry((corners, mesh.triangle_material(t as usize))) {
                Entry::Vacant(entry) => {
                    entry.insert((t, lowest));
                }
                Entry::Occupied(entry) => {
                    self.copies.push([(t, lowest), *entry.get()]);
                    self.inside[t as usize] = true;
                }
            }
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.sectors.is_empty() && self.copies.is_empty()
    }

    /// How many faces are where another is.
    pub(super) fn copies(&self) -> usize {
        self.copies.len()
    }

    /// The mesh with the wide triangles, each a polygon, in the place of the fans. They come last,
    /// sector by sector; the others keep their order.
    pub(super) fn coarse(&self, mesh: &Mesh) -> Mesh {
        let mut builder = MeshBuilder::like(mesh);
        builder.mesh.positions.clone_from(&mesh.positions);
        builder.mesh.normals.clone_from(&mesh.normals);
        let mut kept = vec![true; mesh.polygon_count()];
        (0..mesh.triangle_count())
            .filter(|&t| self.inside[t])
            .for_each(|t| kept[mesh.triangle_polygon(t) as usize] = false);
        // Polygons of which some triangles are in a sector are their triangles.
        let bare = |c: Corner| Corner { texcoord: NONE, ..c };
        let mut t = 0;
        for p in 0..mesh.polygon_count() {
            builder.follow(mesh, p);
            let count = mesh.file_polygon(p).len().saturating_sub(2);
            if kept[p] {
                builder.polygon(mesh.file_polygon(p).map(bare));
            } else {
                (t..t + count)
                    .filter(|&t| !self.inside[t])
                    .for_each(|t| builder.polygon(mesh.file_triangle_corners(t).map(bare)));
            }
            t += count;
        }
        let frame = Frame::of_mesh(mesh);
        let (low, high) = mesh.bounds().unwrap_or_default();
        let size = (high - low).max_element();
        for (k, sector) in self.sectors.iter().enumerate() {
            builder.follow(mesh, mesh.triangle_polygon(sector.triangles[0] as usize) as usize);
            let first = builder.mesh.positions.len() as u32;
            let lift = (0.5 + APART * (k + 1) as f64) * size;
            let place = |p: DVec2| frame.origin + DVec3::new(p.x, p.y, lift);
            builder.mesh.positions.push(place(DVec2::ZERO));
            let ends = sector.parts.len() - usize::from(sector.closed);
            builder.mesh.positions.extend((0..ends).map(|i| place(sector.end(i))));
            for i in 0..sector.parts.len() as u32 - 1 {
                let corners = [first, first + 1 + i, first + 1 + (i + 1) % ends as u32];
                builder.polygon(corners.map(|vertex| Corner { vertex, texcoord: NONE, normal: NONE }));
            }
        }
        let mut coarse = builder.finish();
        let joined = (0..coarse.vertex_count() as u32).map(|v| mesh.representative(v)).collect();
        coarse.join(joined);
        coarse
    }

    /// The texture coordinates of the mesh, and of each corner of each triangle which it has, from
    /// those of the coarse mesh.
    pub(super) fn texcoords(&self, coarse: &Mesh) -> (Vec<DVec2>, Vec<u32>) {
        let mut made = Made { coarse, texcoords: Vec::new(), known: HashMap::new() };
        let mut corners = vec![[NONE; 3]; self.inside.len()];
        let mut at = 0;
        for (t, _) in self.inside.iter().enumerate().filter(|(_, inside)| !**inside) {
            corners[t] = coarse.triangle_corners(at).map(|c| made.same(c.texcoord));
            at += 1;
        }
        for sector in &self.sectors {
            sector.put(&mut made, at, &mut corners);
            at += sector.parts.len() - 1;
        }
        for [(copy, lowest), (first, its_lowest)] in &self.copies {
            let mut three = corners[*first as usize];
            three.rotate_left(*its_lowest);
            three.rotate_right(*lowest);
            corners[*copy as usize] = three;
        }
        (made.texcoords, corners.into_flattened())
    }

    /// The triangles of the mesh that triangle `t` of the coarse one is or covers, copies aside.
    pub(super) fn triangles_of(&self, t: usize) -> Vec<u32> {
        let others = self.inside.iter().filter(|inside| !**inside).count();
        if t < others {
            let outside = (0..).zip(&self.inside).filter(|(_, inside)| !**inside);
            return outside.map(|(t, _)| t).nth(t).into_iter().collect();
        }
        let mut at = others;
        for sector in &self.sectors {
            let parts = sector.parts.len() - 1;
            if t < at + parts {
                return sector.triangles[sector.parts[t - at]..sector.parts[t - at + 1]].to_vec();
            }
            at += parts;
        }
        Vec::new()
    }
}

/// Texture coordinates that are made from those of the coarse mesh.
struct Made<'a> {
    coarse: &'a Mesh,
    texcoords: Vec<DVec2>,
    /// Those that are the same in both.
    known: HashMap<u32, u32>,
}

impl Made<'_> {
    fn same(&mut self, texcoord: u32) -> u32 {
        let Some(&place) = self.coarse.texcoords.get(texcoord as usize) else { return NONE };
        *self.known.entry(texcoord).or_insert_with(|| {
            self.texcoords.push(place);
            self.texcoords.len() as u32 - 1
        })
    }

    /// In the precision that files keep.
    fn add(&mut self, place: DVec2) -> u32 {
        self.texcoords.push(place.as_vec2().as_dvec2());
        self.texcoords.len() as u32 - 1
    }
}

impl Sector {
    /// Where the wide triangles meet at end `i` of the parts.
    fn end(&self, i: usize) -> DVec2 {
        self.reach[i] * DVec2::from_angle(self.angle[self.parts[i]])
    }

    /// Puts the triangles into the wide ones, which are those of the coarse mesh from number
    /// `first` on.
    fn put(&self, made: &mut Made<'_>, first: usize, corners: &mut [[u32; 3]]) {
        // The last vertex that was placed, and which of the coarse mesh's texture coordinates the
        // wide triangle has at its end.
        let mut last = (NONE, NONE);
        let mut begin = (NONE, NONE);
        for (i, part) in self.parts.windows(2).enumerate() {
            let wide = made.coarse.triangle_corners(first + i).map(|c| c.texcoord);
            let Some(uv) = made.coarse.triangle_texcoords(first + i) else { continue };
            let from = DMat2::from_cols(self.end(i), self.end(i + 1)).inverse();
            let to = DMat2::from_cols(uv[1] - uv[0], uv[2] - uv[0]);
            let place = |k: usize| uv[0] + to * (from * self.outer[k]);
            let hub = made.same(wide[0]);
            let mut one = if last.0 == wide[1] { last.1 } else { made.add(place(part[0])) };
            if i == 0 {
                begin = (wide[1], one);
            }
            for k in part[0]..part[1] {
                let back = k + 1 == self.triangles.len() && self.closed && begin.0 == wide[2];
                let other = if back { begin.1 } else { made.add(place(k + 1)) };
                let mut three = [hub, one, other];
                three.rotate_right(self.hub[k]);
                corners[self.triangles[k] as usize] = three;
                one = other;
            }
            last = (wide[2], one);
        }
    }
}

#[cfg(test)]
mod tests;
