//! Parts of the target without an anchor: each follows the nearest part that has one.
//!
//! A method has nothing to go by on a component of the target (an eye, a button, a boot) that no
//! anchor lies on: embeddings of components are unrelated, and in space the closest point may lie
//! anywhere. But the part lies somewhere beside a part that is mapped, and goes with it: the
//! similarity that takes the surface around it to its images takes the part along. It ends on the
//! part of the source that lies there and has its size, where there is one without anchors, else on
//! the source's surface beside it. All of it is doubtful.

use std::collections::BTreeMap;

use glam::DVec3;
use rayon::prelude::*;

use super::baseline::{Similarity, mean, spread};
use super::checked::DOUBT;
use super::{PointMap, Shape, check_faces};
use crate::error::Result;
use crate::geometry::{ClosestPoints, Frame, Mesh, NONE, SurfacePoint, Topology};
use crate::surface::anchors::AnchorPairs;
use crate::surface::field::FieldReport;
use crate::surface::nearest_vertex::NearestVertex;
use crate::surface::packed::{PackedImage, PackedPoint, Status};

/// Points of a part whose closest points on its neighbour say how it goes, at most; and as many
/// vertices of the neighbour.
const SAMPLES: usize = 48;
/// Part of the spread of those that the similarity of all anchors counts as: it decides only what
/// they leave open.
const PRIOR: f64 = 0.05;
/// Images farther off than this many times the median are left out of a second fit.
const OUTLIER: f64 = 3.0;
/// A part of the source is this one's partner if its centre is not farther from where it should be
/// than both radii, and its radius is within this factor.
const SIZE: f64 = 2.5;
/// An edge whose image is longer than this many times what the similarity makes of it is a tear.
const TEAR: f64 = 3.0;
/// Where images tear, the part is drawn together to these parts of its size, one after the other.
const DRAWN: [f64; 7] = [1.0, 0.5, 0.25, 0.125, 0.0625, 0.03125, 0.0];

/// Which components have anchors, and both surfaces with the others left out.
pub(super) struct Anchored {
    pub(super) source: Topology,
    pub(super) target: Topology,
    on_source: Vec<bool>,
    on_target: Vec<bool>,
}

impl Anchored {
    /// `None` if all components of the target have an anchor.
    pub(super) fn new(source: Shape<'_>, target: Shape<'_>, anchors: &AnchorPairs) -> Option<Self> {
        let on = |points: &[SurfacePoint], topology: &Topology| {
            let mut has = vec![false; topology.component_count as usize];
            for c in points.iter().map(|p| topology.triangle_component(p.face)).filter(|&c| c != NONE) {
                has[c as usize] = true;
            }
            has
        };
        let (on_source, on_target) = (on(&anchors.source, source.topology), on(&anchors.target, target.topology));
        if on_target.iter().all(|a| *a) {
            return None;
        }
        Some(Self {
            source: source.topology.restricted(|c| on_source[c as usize]),
            target: target.topology.restricted(|c| on_target[c as usize]),
            on_source,
            on_target,
        })
    }
}

/// Where a part goes.
struct Follower {
    similarity: Similarity,
    /// The point of the source that it is drawn towards, and how far, if images would tear.
    foot: DVec3,
    drawn: f64,
    /// Component of the source that it ends on.
    component: u32,
}

impl Follower {
    fn place(&self, x: DVec3) -> DVec3 {
        self.foot + (self.similarity.apply(x) - self.foot) * self.drawn
    }
}

/// A map with parts that follow.
pub(super) struct Followed {
    map: Box<dyn PointMap + Send>,
    positions: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    /// Of each triangle of the target the index of its part among `followers`, or [`NONE`].
    follower_of: Vec<u32>,
    followers: Vec<Follower>,
    /// The surfaces of the source that parts end on, by component.
    surfaces: BTreeMap<u32, ClosestPoints>,
}

/// A component as a whole.
struct Part {
    component: u32,
    faces: Vec<u32>,
    vertices: Vec<u32>,
    centre: DVec3,
    /// Root mean square distance of its vertices from the centre.
    radius: f64,
}

/// The components that `wanted` names, in order.
fn parts(shape: &Shape<'_>, wanted: impl Fn(u32) -> bool) -> Vec<Part> {
    let empty =
        |component| Part { component, faces: Vec::new(), vertices: Vec::new(), centre: DVec3::ZERO, radius: 0.0 };
    let mut all: Vec<Part> = (0..shape.topology.component_count).map(empty).collect();
    for (v, &c) in shape.topology.vertex_component.iter().enumerate().filter(|(_, c)| **c != NONE) {
        all[c as usize].vertices.push(v as u32);
    }
    for t in 0..shape.topology.triangles.len() as u32 {
        let c = shape.topology.triangle_component(t);
        if c != NONE {
            all[c as usize].faces.push(t);
        }
    }
    all.retain(|p| wanted(p.component));
    for part in &mut all {
        let points: Vec<DVec3> = part.vertices.iter().map(|&v| shape.mesh.positions[v as usize]).collect();
        part.centre = mean(&points);
        part.radius = spread(&points, part.centre);
    }
    all
}

/// Up to `n` of them, evenly.
fn some(of: &[u32], n: usize) -> impl Iterator<Item = u32> + '_ {
    of.iter().copied().step_by(of.len().div_ceil(n).max(1))
}

/// The surface around each part of the target, and where it goes.
struct Around {
    from: Vec<DVec3>,
    to: Vec<DVec3>,
    /// The component of the source that most of it goes to.
    component: u32,
}

impl Followed {
    /// Fits the followers to what `map` makes of the surface around them.
    ///
    /// # Errors
    /// Those of the map.
    pub(super) fn new(
        map: Box<dyn PointMap + Send>,
        source: Shape<'_>,
        target: Shape<'_>,
        anchors: &AnchorPairs,
        anchored: &Anchored,
    ) -> Result<Self> {
        // Each surface in its own frame, where places do not round.
        let [there, here] = [source, target].map(|s| Frame::of_mesh(s.mesh).mesh(s.mesh));
        let (source, target) = (Shape { mesh: &there, ..source }, Shape { mesh: &here, ..target });
        let followers = parts(&target, |c| !anchored.on_target[c as usize]);
        let around = around(map.as_ref(), source, target, anchored, &followers)?;
        let place = |points: &[SurfacePoint], mesh: &Mesh| points.iter().map(|p| p.position(mesh)).collect::<Vec<_>>();
        let usual = (source.mesh.area() / target.mesh.area()).sqrt();
        let (from, to) = (place(&anchors.target, target.mesh), place(&anchors.source, source.mesh));
        let mut whole = Similarity::fit(&from, &to, usual);
        if anchors.len() < 3 {
            whole.scale = usual;
        }
        let similarities: Vec<Similarity> = around.iter().map(|a| fitted(a, &whole)).collect();
        let free = parts(&source, |c| !anchored.on_source[c as usize]);
        let partners = partners(&followers, &similarities, &free);
        let mut surfaces = BTreeMap::new();
        let mut faces = vec![Vec::new(); source.topology.component_count as usize];
        for t in 0..source.topology.triangles.len() as u32 {
            let c = source.topology.triangle_component(t);
            if c != NONE {
                faces[c as usize].push(t);
            }
        }
        let mut made = Vec::new();
        for (i, part) in followers.iter().enumerate() {
            let partner = partners[i].map(|k| &free[k]);
            let component = partner.map_or(around[i].component, |p| p.component);
            let surface: &ClosestPoints = surfaces
                .entry(component)
                .or_insert_with(|| ClosestPoints::of_faces(source.mesh, faces[component as usize].iter().copied()));
            let similarity = match partner {
                Some(p) => {
                    similarities[i].moved(part.centre, p.centre, p.radius / (similarities[i].scale * part.radius))
                }
                None => similarities[i].clone(),
            };
            let centre = similarity.apply(part.centre);
            let foot = surface.nearest(centre).map_or(centre, |(q, _)| q.position(source.mesh));
            let mut follower = Follower { similarity, foot, drawn: 1.0, component };
            for drawn in DRAWN {
                follower.drawn = drawn;
                if !tears(&follower, part, surface, source.mesh, target) {
                    break;
                }
            }
            made.push(follower);
        }
        let mut follower_of = vec![NONE; target.topology.triangles.len()];
        for (i, part) in followers.iter().enumerate() {
            part.faces.iter().for_each(|&t| follower_of[t as usize] = i as u32);
        }
        let (positions, triangles) = (target.mesh.positions.clone(), target.topology.triangles.clone());
        Ok(Self { map, positions, triangles, follower_of, followers: made, surfaces })
    }

    /// The image of a point of part `i`.
    fn follow(&self, p: &PackedPoint, i: u32) -> PackedImage {
        let follower = &self.followers[i as usize];
        let corners = self.triangles[p.face as usize].map(|v| self.positions[v as usize]);
        let x = p.unpack().barycentric;
        let at = corners[0] * x[0] + corners[1] * x[1] + corners[2] * x[2];
        let surface = &self.surfaces[&follower.component];
        match surface.nearest(follower.place(at)) {
            Some((q, _)) => {
                let PackedPoint { face, b0, b1 } = q.into();
                PackedImage { face, b0, b1, confidence: DOUBT, status: Status::Doubtful as u32 }
            }
            None => PackedImage::NOWHERE,
        }
    }
}

impl PointMap for Followed {
    fn map(&self, points: &[PackedPoint], images: &mut Vec<PackedImage>) -> Result<()> {
        check_faces(points, self.follower_of.len())?;
        let follower = |p: &PackedPoint| self.follower_of[p.face as usize];
        let rest: Vec<PackedPoint> = points.iter().copied().filter(|p| follower(p) == NONE).collect();
        let mut found = Vec::new();
        self.map.map(&rest, &mut found)?;
        let followed: Vec<Option<PackedImage>> = points
            .par_iter()
            .map(|p| match follower(p) {
                NONE => None,
                i => Some(self.follow(p, i)),
            })
            .collect();
        let mut found = found.into_iter();
        images.clear();
        images.extend(followed.into_iter().map(|f| f.or_else(|| found.next()).unwrap_or(PackedImage::NOWHERE)));
        Ok(())
    }

    fn handed_back(&self) -> Option<u64> {
        self.map.handed_back()
    }

    fn field(&self) -> Option<&FieldReport> {
        self.map.field()
    }
}

/// For each part points of the anchored part that comes nearest to it, and their images: those
/// closest to points of the part, which lie as it does, and the vertices nearest to its centre.
fn around(
    map: &dyn PointMap,
    source: Shape<'_>,
    target: Shape<'_>,
    anchored: &Anchored,
    followers: &[Part],
) -> Result<Vec<Around>> {
    let closest = ClosestPoints::new(target.mesh, &anchored.target);
    let used: Vec<u32> =
        (0..target.mesh.vertex_count() as u32).filter(|&v| !anchored.target.vertex_triangles(v).is_empty()).collect();
    let index = NearestVertex::<3>::of_points(used, |v| target.mesh.positions[v as usize].to_array());
    let near = |part: &Part| -> Vec<SurfacePoint> {
        let at = |v: u32| target.mesh.positions[v as usize];
        let found: Vec<(SurfacePoint, f64)> =
            some(&part.vertices, SAMPLES).filter_map(|v| closest.nearest(at(v))).collect();
        let Some(&(first, _)) = found.iter().min_by(|a, b| a.1.total_cmp(&b.1)) else { return Vec::new() };
        let of = |p: &SurfacePoint| target.topology.triangle_component(p.face);
        let leader = of(&first);
        let vertices = index.find_several(&part.centre.to_array(), SAMPLES);
        let vertices = vertices.into_iter().filter_map(|v| anchored.target.vertex_point(v));
        found.iter().map(|f| f.0).chain(vertices).filter(|p| of(p) == leader).collect()
    };
    let points: Vec<Vec<SurfacePoint>> = followers.par_iter().map(near).collect();
    let packed: Vec<PackedPoint> = points.iter().flatten().map(|&p| p.into()).collect();
    let mut images = Vec::new();
    map.map(&packed, &mut images)?;
    let mut images = images.into_iter();
    let mut all = Vec::new();
    for points in points {
        let (mut from, mut to) = (Vec::new(), Vec::new());
        let mut count = BTreeMap::new();
        for (p, image) in points.iter().zip(images.by_ref()) {
            let Some(q) = image.point() else { continue };
            from.push(p.position(target.mesh));
            to.push(q.position(source.mesh));
            *count.entry(source.topology.triangle_component(q.face)).or_insert(0usize) += 1;
        }
        // The lowest of equally frequent ones; where nothing was found, the first that has an
        // anchor.
        let frequent = count.into_iter().rev().max_by_key(|c| c.1).map(|c| c.0);
        let first = anchored.on_source.iter().position(|a| *a).unwrap_or(0) as u32;
        all.push(Around { from, to, component: frequent.filter(|&c| c != NONE).unwrap_or(first) });
    }
    Ok(all)
}

/// The similarity of what is around a part, the whole one where that leaves it open; once more
/// without outliers.
fn fitted(around: &Around, whole: &Similarity) -> Similarity {
    let all = whole.local(&around.from, &around.to, PRIOR);
    let off: Vec<f64> = around.from.iter().zip(&around.to).map(|(p, q)| all.apply(*p).distance(*q)).collect();
    let mut sorted = off.clone();
    sorted.sort_by(f64::total_cmp);
    let Some(&median) = sorted.get(sorted.len() / 2) else { return all };
    let kept =
        |x: &[DVec3]| x.iter().zip(&off).filter(|(_, d)| **d <= OUTLIER * median).map(|(x, _)| *x).collect::<Vec<_>>();
    whole.local(&kept(&around.from), &kept(&around.to), PRIOR)
}

/// For each follower the part of the source that plays its role, if there is one: the pairs that
/// fit best first, each part once, then what is left over with parts that are taken.
fn partners(followers: &[Part], similarities: &[Similarity], free: &[Part]) -> Vec<Option<usize>> {
    if free.is_empty() {
        return vec![None; followers.len()];
    }
    let index = NearestVertex::<3>::of_points((0..free.len() as u32).collect(), |k| free[k as usize].centre.to_array());
    let mut fits = Vec::new();
    for (i, (part, s)) in followers.iter().zip(similarities).enumerate() {
        let (centre, radius) = (s.apply(part.centre), s.scale * part.radius);
        for k in index.find_several(&centre.to_array(), SAMPLES) {
            let other = &free[k as usize];
            let (apart, ratio) =
                (centre.distance(other.centre) / (radius + other.radius), (other.radius / radius).ln());
            if apart <= 1.0 && ratio.abs() <= SIZE.ln() {
                fits.push((apart + ratio.abs(), i, k as usize));
            }
        }
    }
    fits.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut partner = vec![None; followers.len()];
    let mut taken = vec![false; free.len()];
    for &(_, i, k) in &fits {
        if partner[i].is_none() && !taken[k] {
            (partner[i], taken[k]) = (Some(k), true);
        }
    }
    for &(_, i, k) in &fits {
        partner[i] = partner[i].or(Some(k));
    }
    partner
}

/// Whether the images of two neighbouring vertices of a part lie much farther apart than they
/// should.
fn tears(follower: &Follower, part: &Part, surface: &ClosestPoints, source: &Mesh, target: Shape<'_>) -> bool {
    let places: Vec<DVec3> = part.vertices.iter().map(|&v| follower.place(target.mesh.positions[v as usize])).collect();
    let images: Vec<Option<DVec3>> =
        surface.nearest_all(&places).into_iter().map(|f| f.map(|(q, _)| q.position(source))).collect();
    let at = |v: u32| part.vertices.binary_search(&v).ok().and_then(|k| images[k]);
    part.faces.par_iter().any(|&t| {
        let v = target.topology.triangles[t as usize];
        (0..3).any(|k| {
            let (a, b) = (v[k], v[(k + 1) % 3]);
            let long = target.mesh.positions[a as usize].distance(target.mesh.positions[b as usize]);
            match (at(a), at(b)) {
                (Some(p), Some(q)) => p.distance(q) > TEAR * follower.similarity.scale * long,
                _ => false,
            }
        })
    })
}
