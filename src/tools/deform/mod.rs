//! Deformation: a mesh posed by a few of its vertices (mean-value encoding, section 4.1).
//!
//! Handles are points; their rotations follow from the encoding. Everything is computed about the
//! rest shape's centre at diagonal one.

mod followers;
pub(super) mod normals;
mod request;

use std::collections::BTreeMap;
use std::ops::Range;

use glam::DVec3;

use crate::encoding::measures::{Measures, measure};
use crate::encoding::{
    Connectivity, DecodeReport, Decoder, Frame, Hierarchy, HierarchyOptions, Quality, SequenceQuality, Similarity, V3,
    cache_key,
};
use crate::engine::Engine;
use crate::error::{Error, Result};
use crate::geometry::{self, Mesh, NONE};
use crate::io::cache::Cache;

use followers::Followers;
use normals::turn_normals;
pub use request::Handles;

/// A posed mesh.
#[derive(Clone, Debug)]
pub struct Deformation {
    /// A position for every vertex of the mesh.
    pub positions: Vec<DVec3>,
    /// What the decoder did.
    pub report: DecodeReport,
}

/// A frame of [`Deformer::play`].
#[derive(Clone, Debug)]
#[doc(hidden)]
pub struct PlayedFrame {
    /// A position for every vertex of the mesh.
    pub positions: Vec<DVec3>,
    /// The frame before did not lead here (the handles jumped): the shape in the large was found
    /// anew.
    pub anew: bool,
}

/// Handles at their places, and where the vertices begin.
struct Posed {
    targets: BTreeMap<u32, DVec3>,
    held: Vec<V3<f64>>,
    scale: f64,
    /// Of each component.
    starts: Vec<Similarity>,
}

/// Poses one mesh by one set of handles, frame after frame. Moving the handles never rebuilds
/// anything.
#[derive(Debug)]
pub struct Deformer {
    name: String,
    connectivity: Connectivity,
    triangles: Vec<[u32; 3]>,
    /// The mesh at rest, as in the file.
    mesh: Mesh,
    /// Centred, with diagonal one.
    rest: Vec<V3<f64>>,
    centre: DVec3,
    diagonal: f64,
    handles: Handles,
    decoder: Decoder,
    followers: Followers,
    /// What is odd but no error, a sentence each.
    pub warnings: Vec<String>,
}

impl Deformer {
    /// Prepares `mesh` for `handles`: the hierarchy is made, or taken from the cache.
    ///
    /// # Errors
    /// [`Error::Mesh`] if nothing of the mesh can be used; [`Error::Input`] for a handle that is
    /// part of no triangle.
    pub fn new(mesh: &Mesh, handles: Handles, options: &HierarchyOptions, cache: &Cache) -> Result<Self> {
        let handles = handles.on(mesh)?;
        let connectivity = Connectivity::new(mesh);
        let used = |v: usize| !connectivity.rings[v].is_empty();
        let frame = geometry::Frame::of((0..mesh.vertex_count()).filter(|&v| used(v)).map(|v| mesh.positions[v]));
        let centre = frame.origin;
        let (low, high) = (0..mesh.vertex_count())
            .filter(|&v| used(v))
            .map(|v| mesh.positions[v] - centre)
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
        let diagonal = low.distance(high);
        if !(diagonal > 0.0) || !diagonal.is_finite() {
            return Err(Error::mesh(&mesh.name, "there is no triangle to deform", "Use a mesh with faces"));
        }
        let local = |p: DVec3| ((p - centre) / diagonal).to_array();
        let rest: Vec<V3<f64>> =
            mesh.positions.iter().enumerate().map(|(v, &p)| if used(v) { local(p) } else { [0.0; 3] }).collect();
        let mut held = handles.held(&connectivity)?;
        held.sort_unstable();
        let key = cache_key(&connectivity, &rest, &held, options);
        let kept = cache.get(&key).and_then(|bytes| Hierarchy::from_bytes(&bytes).ok());
        let mut warnings = Vec::new();
        let hierarchy = match kept.filter(|h| h.order.iter().all(|&v| (v as usize) < rest.len())) {
            Some(hierarchy) => hierarchy,
            None => {
                let made = Hierarchy::new(&connectivity, &rest, &held, options)?;
                if let Err(error) = cache.put(&key, &made.to_bytes()) {
                    warnings.push(format!("the hierarchy is not cached: {error}"));
                }
                made
            }
        };
        let followers = Followers::new(&connectivity, &rest, &hierarchy);
        warnings.extend(notes(mesh, &connectivity, &hierarchy, &followers));
        Ok(Self {
            name: mesh.name.clone(),
            triangles: mesh.triangles(),
            mesh: mesh.clone(),
            rest: rest.clone(),
            centre,
            diagonal,
            handles,
            decoder: Decoder::new(hierarchy, &rest),
            followers,
            warnings,
            connectivity,
        })
    }

    /// Does on the device of `engine`, if it has one, what a decode does there; see
    /// [`Decoder::decode_on`].
    pub fn decode_on(&mut self, engine: &Engine) {
        self.decoder.decode_on(engine);
    }

    /// The decoder, with its hierarchy.
    pub fn decoder(&self) -> &Decoder {
        &self.decoder
    }

    /// Where every vertex goes when handle `k` of the [`Handles`] is put at `positions[k]`.
    ///
    /// The start is the similarity that fits the handles best, so that moving, turning and scaling
    /// all of them moves, turns and scales the mesh exactly. With `warm` the frame before is where
    /// coarse stages begin; equal positions give equal results, bit for bit.
    ///
    /// # Errors
    /// [`Error::Input`] for handles that contradict one another or all come to one place;
    /// [`Error::Numeric`] if no finite shape was found.
    pub fn deform(&mut self, positions: &[DVec3], quality: &Quality, warm: bool) -> Result<Deformation> {
        let posed = self.posed(positions)?;
        let component = self.components();
        let start = |v: usize, p: V3<f64>| posed.starts[component[v] as usize].apply(DVec3::from(p)).to_array();
        let (decoded, report) = self.decoder.decode(&posed.held, start, posed.scale, quality, warm)?;
        Ok(Deformation { positions: self.place(&posed, &decoded), report })
    }

    /// Plays frames of handle positions, as [`Deformer::deform`] takes them, in order; `sink`
    /// receives those numbered `wanted` and may end the work with an error.
    ///
    /// Much cheaper than as many calls of [`Deformer::deform`], and smooth in time; see
    /// [`SequenceQuality`]. Handles that stay where they were give the shape of the frame before,
    /// bit for bit; the number of threads changes nothing, nor does it which frames are wanted.
    ///
    /// # Errors
    /// As [`Deformer::deform`]; what `sink` returns.
    pub fn play(
        &self,
        frames: &[Vec<DVec3>],
        wanted: Range<usize>,
        quality: &SequenceQuality,
        mut sink: impl FnMut(usize, PlayedFrame) -> Result<()>,
    ) -> Result<()> {
        let frames = &frames[..wanted.end.min(frames.len())];
        let posed: Vec<Posed> = frames.iter().map(|f| self.posed(f)).collect::<Result<_>>()?;
        let component = self.components();
        let start = |f: usize, v: usize, p: V3<f64>| -> V3<f64> {
            posed[f].starts[component[v] as usize].apply(DVec3::from(p)).to_array()
        };
        let list: Vec<Frame<'_>> = posed.iter().map(|p| Frame { held: &p.held, scale: p.scale }).collect();
        self.decoder.play(&list, wanted, start, quality, |f, played| {
            let positions = self.place(&posed[f], &played.positions);
            sink(f, PlayedFrame { positions, anew: played.anew && f > 0 })
        })
    }

    /// Handles at `positions`, as the decoder takes them.
    fn posed(&self, positions: &[DVec3]) -> Result<Posed> {
        let targets = self.handles.targets(positions)?;
        let hierarchy = self.decoder.hierarchy();
        let held: Vec<V3<f64>> = hierarchy.order[..hierarchy.held]
            .iter()
            .map(|v| targets.get(v).map_or(self.rest[*v as usize], |p| ((*p - self.centre) / self.diagonal).to_array()))
            .collect();
        let (scale, starts) = self.starts(&held);
        Ok(Posed { targets, held, scale, starts })
    }

    /// Component of each number of the hierarchy.
    fn components(&self) -> Vec<u32> {
        self.decoder.hierarchy().order.iter().map(|&v| self.connectivity.component[v as usize]).collect()
    }

    /// Decoded positions in the mesh's units and order.
    fn place(&self, posed: &Posed, decoded: &[V3<f64>]) -> Vec<DVec3> {
        let hierarchy = self.decoder.hierarchy();
        let mut result = self.mesh.positions.clone();
        let back = |p: V3<f64>| DVec3::from(p) * self.diagonal + self.centre;
        for (&v, &p) in hierarchy.order.iter().zip(decoded) {
            result[v as usize] = back(p);
        }
        for &v in &hierarchy.order[..hierarchy.held] {
            // Given positions come back as they were given.
            result[v as usize] = posed.targets.get(&v).copied().unwrap_or(self.mesh.positions[v as usize]);
        }
        self.followers.place(&self.rest, hierarchy, decoded, |v, p| result[v as usize] = back(p));
        self.mesh.spread_positions(&mut result, |v| posed.targets.contains_key(&v));
        result
    }

    /// Puts a result's positions into `mesh`, which is the one this deformer was made for, and
    /// turns its normals along.
    ///
    /// # Errors
    /// [`Error::Input`] if `mesh` has another number of vertices.
    pub fn pose(&self, mesh: &mut Mesh, positions: Vec<DVec3>) -> Result<()> {
        let count = self.mesh.vertex_count();
        if positions.len() != count || mesh.vertex_count() != count {
            let what = format!("{} positions for {} of {} vertices", positions.len(), mesh.name, mesh.vertex_count());
            return Err(Error::input(what, "Use the mesh the deformer was made for"));
        }
        mesh.positions = positions;
        turn_normals(mesh, &self.connectivity, &self.mesh.positions);
        Ok(())
    }

    /// Compares a shape with the rest shape; see [`Measures`].
    pub fn measures(&self, positions: &[DVec3]) -> Measures {
        let local: Vec<V3<f64>> = positions.iter().map(|&p| ((p - self.centre) / self.diagonal).to_array()).collect();
        let mut result = measure(&self.connectivity, &self.triangles, &self.rest, &local);
        result.g *= self.diagonal * self.diagonal;
        result
    }

    /// Name of the mesh.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The similarity with which each component begins, that of all held vertices, then that of its
    /// own; and the scale of the first.
    fn starts(&self, held: &[V3<f64>]) -> (f64, Vec<Similarity>) {
        let hierarchy = self.decoder.hierarchy();
        let pairs: Vec<(DVec3, DVec3)> =
            self.decoder.rest()[..hierarchy.held].iter().zip(held).map(|(&a, &b)| (a.into(), b.into())).collect();
        let all = Similarity::fit(&pairs);
        let mut own = vec![Vec::new(); self.connectivity.component_count as usize];
        for (&v, &(a, b)) in hierarchy.order.iter().zip(&pairs) {
            own[self.connectivity.component[v as usize] as usize].push((all.apply(a), b));
        }
        (all.scale, own.iter().map(|pairs| all.then(&Similarity::fit(pairs))).collect())
    }
}

/// What deserves to be told about a mesh and its hierarchy.
fn notes(mesh: &Mesh, connectivity: &Connectivity, hierarchy: &Hierarchy, followers: &Followers) -> Vec<String> {
    let mut notes = Vec::new();
    let irregular: Vec<usize> =
        connectivity.irregular.iter().enumerate().filter(|(_, i)| **i).map(|(v, _)| v).collect();
    if let Some(first) = irregular.first() {
        let what = "where several parts of the surface touch (non-manifold)";
        notes.push(format!("{} vertices (first: {first}) {what}: shaped by the largest part", irregular.len()));
    }
    if let Some(first) = hierarchy.left_out.first() {
        let what = "could not be encoded (all their neighbours on a line, or at one place)";
        notes.push(format!("{} vertices (first: {first}) {what}: their shape is not kept", hierarchy.left_out.len()));
    }
    if followers.components > 0 {
        let what = if followers.components == 1 { "component has" } else { "components have" };
        notes.push(format!("{} {what} no handle and moves with what is nearest", followers.components));
    }
    let loose = (0..connectivity.rings.len())
        .filter(|&v| connectivity.rings[v].is_empty() && connectivity.component[v] == NONE)
        .filter(|&v| !mesh.is_repeated(v as u32))
        .count();
    if loose > 0 {
        notes.push(format!("{loose} vertices of no face stay where they are"));
    }
    notes
}
