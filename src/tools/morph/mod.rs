//! Morphing and blending of shapes of the same connectivity through their encodings (section 4.3);
//! shapes of another connectivity get that of the first through a correspondence
//! ([`compatible_mesh`]).
//!
//! In-betweens turn where a blend of positions would shrink. They are reached in small steps from
//! an input, each beginning where the one before ended, so that no step can jump to a folded shape.

mod anchors;
mod compatible;
mod frame;
mod untangle;

use glam::DVec3;

use crate::encoding::{
    Blend, Connectivity, DecodeReport, Decoder, Hierarchy, HierarchyOptions, Quality, Similarity, V3,
};
use crate::error::{Error, Result};
use crate::geometry::{Corner, Frame, Mesh, NONE};

use anchors::Anchors;
pub use compatible::{Compatible, CompatibleReport, LONG, compatible_mesh};
pub use frame::{FrameReport, FrameWatch};

/// Largest change of a weight in one step.
const STEP: f64 = 1.0 / 16.0;

/// The quality for in-betweens: converged, and with edges kept near the averages of their lengths.
/// Averages of encodings belong to no shape, and without that the size of an in-between drifts
/// along slender parts.
pub const QUALITY: Quality = Quality { stiffness: 100.0, ..Quality::CONVERGED };

/// Blends a list of shapes.
#[derive(Debug)]
pub struct Morpher {
    first: Mesh,
    decoder: Decoder,
    blend: Blend,
    anchors: Anchors,
    /// As given; vertices outside the hierarchy are blended linearly.
    originals: Vec<Vec<DVec3>>,
    /// In the hierarchy's numbering, each about its centre, the first with diagonal one.
    shapes: Vec<Vec<V3<f64>>>,
    /// The same vertex in all shapes.
    centres: Vec<DVec3>,
    diagonal: f64,
    weights: Vec<f64>,
    /// What is odd but no error, a sentence each.
    pub warnings: Vec<String>,
}

impl Morpher {
    /// Encodes `meshes`, two or more with the same triangles. `anchors` are vertices that carry the
    /// position, turn and size of an in-between: four or more, best near one another where the
    /// shapes move least; they are chosen so where none are given.
    ///
    /// # Errors
    /// [`Error::Input`] for fewer than two meshes, different connectivity (naming the first
    /// difference) or anchors out of range; [`Error::Mesh`] for a mesh without triangles.
    pub fn new(meshes: &[&Mesh], anchors: Option<&[u32]>, options: &HierarchyOptions) -> Result<Self> {
        let [first, others @ ..] = meshes else {
            return Err(Error::input("there is nothing to morph", "Give two or more meshes"));
        };
        if others.is_empty() {
            return Err(Error::input("one mesh alone cannot be morphed", "Give two or more meshes"));
        }
        others.iter().try_for_each(|other| same_connectivity(first, other))?;
        let connectivity = Connectivity::new(first);
        let used = |v: usize| !connectivity.rings[v].is_empty();
        let frame = Frame::of((0..first.vertex_count()).filter(|&v| used(v)).map(|v| first.positions[v]));
        // The same vertex of every mesh: wherever they stand, none is far from its own.
        let middle = first.positions.iter().position(|p| *p == frame.origin).unwrap_or(0);
        let centres: Vec<DVec3> = meshes.iter().map(|m| m.positions[middle]).collect();
        let (low, high) = (0..first.vertex_count())
            .filter(|&v| used(v))
            .map(|v| first.positions[v] - frame.origin)
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(p), h.max(p)));
        let diagonal = low.distance(high);
        if !(diagonal > 0.0) || !diagonal.is_finite() {
            return Err(Error::mesh(&first.name, "there is no triangle to morph", "Use a mesh with faces"));
        }
        let local = |(mesh, &centre): (&&Mesh, &DVec3)| -> Vec<V3<f64>> {
            mesh.positions
                .iter()
                .enumerate()
                .map(|(v, &p)| if used(v) { ((p - centre) / diagonal).to_array() } else { [0.0; 3] })
                .collect()
        };
        let locals: Vec<Vec<V3<f64>>> = meshes.iter().zip(&centres).map(local).collect();
        if let Some(k) = locals.iter().position(|l| l.iter().flatten().any(|x| !x.is_finite())) {
            return Err(Error::mesh(&meshes[k].name, "a used position is not finite", "Export the surface again"));
        }
        let anchors: Option<Vec<u32>> = anchors.map(|a| a.iter().map(|&v| first.representative(v)).collect());
        let away: Vec<DVec3> = centres.iter().map(|c| (*c - frame.origin) / diagonal).collect();
        let anchors = Anchors::new(&connectivity, &locals, &away, anchors.as_deref())?;
        let hierarchy = Hierarchy::new(&connectivity, &locals[0], &anchors.held, options)?;
        let shapes: Vec<Vec<V3<f64>>> =
            locals.iter().map(|l| hierarchy.order.iter().map(|&v| l[v as usize]).collect()).collect();
        let blend = Blend::new(&hierarchy, &shapes)?;
        let mut warnings = Vec::new();
        if blend.borrowed > 0 {
            let what = "rings have no area in some shape: their detail is the first shape's";
            warnings.push(format!("{} {what}", blend.borrowed));
        }
        let mut decoder = Decoder::new(hierarchy, &locals[0]);
        decoder.set_last(Some(shapes[0].clone()));
        let mut weights = vec![0.0; meshes.len()];
        weights[0] = 1.0;
        Ok(Self {
            first: (*first).clone(),
            decoder,
            blend,
            anchors,
            originals: meshes.iter().map(|m| m.positions.clone()).collect(),
            shapes,
            centres,
            diagonal,
            weights,
            warnings,
        })
    }

    /// The anchors in use.
    pub fn anchors(&self) -> &[u32] {
        &self.anchors.held
    }

    /// Name of the first mesh.
    pub fn name(&self) -> &str {
        &self.first.name
    }

    /// The shape at `weights` (one an input, summing to one), reached from the one before, or from
    /// the nearest input if that is nearer.
    ///
    /// # Errors
    /// [`Error::Option`] for weights that do not fit; [`Error::Numeric`] if no finite shape was
    /// found.
    pub fn shape(&mut self, weights: &[f64], quality: &Quality) -> Result<(Vec<DVec3>, DecodeReport)> {
        self.check(weights)?;
        if let Some(only) = weights.iter().position(|&w| w == 1.0) {
            // Not decoded, but as given, to the last bit.
            self.weights = weights.to_vec();
            self.decoder.set_last(Some(self.shapes[only].clone()));
            return Ok((self.originals[only].clone(), DecodeReport::default()));
        }
        let (corner, weight) =
            weights.iter().enumerate().fold((0, f64::MIN), |b, (k, &w)| if w > b.1 { (k, w) } else { b });
        let far = self.weights.iter().zip(weights).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        if 1.0 - weight < far {
            self.weights = (0..weights.len()).map(|k| if k == corner { 1.0 } else { 0.0 }).collect();
            self.decoder.set_last(Some(self.shapes[corner].clone()));
        }
        let from = self.weights.clone();
        let far = from.iter().zip(weights).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let steps = (far / STEP).ceil().max(1.0) as usize;
        let mut report = DecodeReport::default();
        let mut decoded = Vec::new();
        for step in 1..=steps {
            let s = step as f64 / steps as f64;
            let here: Vec<f64> = if step == steps {
                weights.to_vec()
            } else {
                from.iter().zip(weights).map(|(a, b)| a + s * (b - a)).collect()
            };
            let blend = &self.blend;
            self.decoder.change_encoding(|h| blend.write(h, |_| &here));
            (decoded, report) = self.solve(&here, quality)?;
        }
        self.weights = weights.to_vec();
        Ok((self.place(&decoded, weights, |_| weights), report))
    }

    /// The shape with weights of its own at every vertex: `weights` holds one an input, vertex by
    /// vertex of the mesh. Position, turn and size are those of the mean weights at the anchors.
    ///
    /// # Errors
    /// As [`Morpher::shape`].
    pub fn masked(&mut self, weights: &[f64], quality: &Quality) -> Result<(Vec<DVec3>, DecodeReport)> {
        let mut result = None;
        self.toward_mask(weights, &[1.0], quality, |_, shape, report| {
            result = Some((shape, report));
            Ok(())
        })?;
        result.ok_or_else(|| Error::numeric("the march to the mask made no shape", "Use fewer meshes"))
    }

    /// Shapes on the way from the mesh that rules at the anchors to the one [`Morpher::masked`]
    /// makes: at each of `times`, which ascend from 0 to 1, the vertices have that share of their
    /// mask. `sink` receives them in order and may end the work with an error.
    ///
    /// # Errors
    /// As [`Morpher::shape`]; what `sink` returns.
    pub fn toward_mask(
        &mut self,
        weights: &[f64],
        times: &[f64],
        quality: &Quality,
        mut sink: impl FnMut(usize, Vec<DVec3>, DecodeReport) -> Result<()>,
    ) -> Result<()> {
        let k = self.shapes.len();
        let n = self.originals[0].len();
        if weights.len() != k * n {
            let what = format!("{} weights for {n} vertices and {k} meshes", weights.len());
            return Err(Error::option("weights", what, "Give one a mesh for every vertex"));
        }
        weights.chunks_exact(k).try_for_each(|w| self.check(w))?;
        let order = &self.decoder.hierarchy().order;
        let numbered: Vec<f64> = order.iter().flat_map(|&v| &weights[v as usize * k..][..k]).copied().collect();
        let mut mean = vec![0.0; k];
        for &v in &self.anchors.held {
            mean.iter_mut().zip(&weights[v as usize * k..][..k]).for_each(|(m, w)| *m += w);
        }
        let total: f64 = mean.iter().sum();
        mean.iter_mut().for_each(|m| *m /= total);
        // From the shape that rules at the anchors, in steps.
        let corner = (0..k).fold(0, |b, i| if mean[i] > mean[b] { i } else { b });
        self.decoder.set_last(Some(self.shapes[corner].clone()));
        // The next call of `shape` begins at an input.
        self.weights = vec![f64::INFINITY; k];
        let mut before = 0.0;
        for (f, &time) in times.iter().enumerate() {
            let steps = ((time - before) / STEP).ceil().max(1.0) as usize;
            let mut last = (Vec::new(), DecodeReport::default());
            let (mut here, mut at) = (Vec::new(), mean.clone());
            for step in 1..=steps {
                let s = if step == steps { time } else { before + (time - before) * step as f64 / steps as f64 };
                let toward = |i: usize, w: f64| {
                    if s == 1.0 { w } else { s * w + if i == corner { 1.0 - s } else { 0.0 } }
                };
                here = numbered.iter().enumerate().map(|(i, &w)| toward(i % k, w)).collect();
                at = mean.iter().enumerate().map(|(i, &w)| toward(i, w)).collect();
                let blend = &self.blend;
                self.decoder.change_encoding(|h| blend.write(h, |v| &here[v as usize * k..][..k]));
                last = self.solve(&at, quality)?;
            }
            before = time;
            let numbers = self.decoder.hierarchy().numbers(n);
            let weight = |v: usize| match numbers[v] {
                NONE => &weights[v * k..][..k],
                number => &here[number as usize * k..][..k],
            };
            let shape = self.place(&last.0, &at, weight);
            sink(f, shape, last.1)?;
        }
        Ok(())
    }

    fn check(&self, weights: &[f64]) -> Result<()> {
        let wrong = |what: String| Error::option("weights", what, "Give one nonnegative number a mesh, summing to 1");
        if weights.len() != self.shapes.len() {
            return Err(wrong(format!("{} weights for {} meshes", weights.len(), self.shapes.len())));
        }
        let sum: f64 = weights.iter().sum();
        if weights.iter().any(|w| !(*w >= 0.0)) || !((sum - 1.0).abs() < 1e-9) {
            return Err(wrong(format!("the weights {weights:?} are negative or sum to {sum}")));
        }
        Ok(())
    }

    fn solve(&mut self, weights: &[f64], quality: &Quality) -> Result<(Vec<V3<f64>>, DecodeReport)> {
        let hierarchy = self.decoder.hierarchy();
        let held = self.anchors.blended(&self.shapes, hierarchy.held, weights);
        let pairs: Vec<(DVec3, DVec3)> =
            self.shapes[0].iter().zip(&held).map(|(&a, &b)| (a.into(), b.into())).collect();
        let fit = Similarity::fit(&pairs);
        let start = |_: usize, p: V3<f64>| fit.apply(DVec3::from(p)).to_array();
        // The lengths are blended as they are, at the shapes' own size.
        self.decoder.decode(&held, start, 1.0, quality, true)
    }

    /// Decoded positions in the meshes' units, `at` being the weights of the shapes' places;
    /// vertices the hierarchy does not have are blended linearly.
    fn place<'w>(&self, decoded: &[V3<f64>], at: &[f64], weights: impl Fn(usize) -> &'w [f64]) -> Vec<DVec3> {
        let shared = self.centres[0];
        let centre = shared + self.centres.iter().zip(at).map(|(c, &w)| (*c - shared) * w).sum::<DVec3>();
        let mut result: Vec<DVec3> = (0..self.originals[0].len())
            .map(|v| {
                self.originals.iter().zip(weights(v)).map(|(o, &w)| if w == 0.0 { DVec3::ZERO } else { o[v] * w }).sum()
            })
            .collect();
        for (&v, &p) in self.decoder.hierarchy().order.iter().zip(decoded) {
            result[v as usize] = DVec3::from(p) * self.diagonal + centre;
        }
        self.first.spread_positions(&mut result, |_| false);
        result
    }
}

/// The same mesh with corners that name no normal: those of an in-between would be wrong, and
/// readers make their own.
pub fn without_normals(mesh: &Mesh) -> Mesh {
    let mut bare = mesh.with_corners(|c| Corner { normal: NONE, ..c });
    bare.normals.clear();
    bare
}

/// Fails at the first difference.
fn same_connectivity(a: &Mesh, b: &Mesh) -> Result<()> {
    let wrong = |what: String| {
        Err(Error::input(
            format!("{} and {} differ: {what}", a.name, b.name),
            "Meshes of different connectivity need pairs of anchors (--pairs P.json)",
        ))
    };
    if a.vertex_count() != b.vertex_count() {
        return wrong(format!("{} and {} vertices", a.vertex_count(), b.vertex_count()));
    }
    if a.triangle_count() != b.triangle_count() {
        return wrong(format!("{} and {} triangles", a.triangle_count(), b.triangle_count()));
    }
    match (0..a.triangle_count()).find(|&t| a.triangle(t) != b.triangle(t)) {
        Some(t) => wrong(format!("triangle {t} is {:?} and {:?}", a.triangle(t), b.triangle(t))),
        None => Ok(()),
    }
}
