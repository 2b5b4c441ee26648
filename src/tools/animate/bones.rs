//! Vertices around the bones of a skeleton that lies in a mesh.

use std::collections::BTreeSet;

use glam::DVec3;
use rayon::prelude::*;

use super::binding::{Bond, Reference, reference_point};
use super::guess::spread_out;
use crate::encoding::Similarity;
use crate::error::Result;
use crate::io::motion::{Motion, Segment};

/// Where along a bone vertices are taken, and how many around it at each place.
const ALONG: [f64; 2] = [0.3, 0.7];
const AROUND: usize = 4;
/// Vertices bound to a tuft of short bones.
const TUFT: usize = 6;

/// A bone on the mesh.
struct Bone {
    /// The joint its vertices move with.
    carrier: usize,
    /// Whether it is one of a tuft of short bones (a hand, a face), whose vertices all move with
    /// the joint the tuft hangs on.
    short: bool,
    a: DVec3,
    b: DVec3,
}

fn bones(
    motion: &Motion,
    segments: &[Segment],
    reference: Reference,
    fit: &Similarity,
    short: f64,
) -> Result<Vec<Bone>> {
    let mut bones = Vec::with_capacity(segments.len());
    for segment in segments {
        let a = fit.apply(reference_point(motion, reference, segment.from)?);
        let b = fit.apply(reference_point(motion, reference, segment.to)?);
        bones.push(Bone { carrier: segment.follows, short: a.distance(b) < short, a, b });
    }
    // Parents come before children, so that the carrier of a short bone's short parent is known.
    let mut into = vec![None; motion.point_count()];
    for (k, segment) in segments.iter().enumerate() {
        let parent = into.get(segment.from).copied().flatten();
        if let Some(parent) = parent.filter(|&p: &usize| bones[k].short && bones[p].short) {
            bones[k].carrier = bones[parent].carrier;
        }
        into[segment.to] = Some(k);
    }
    Ok(bones)
}

/// Vertices around the bones: at two places along each, four around it; of a tuft of short bones,
/// six that lie far apart. Each vertex belongs to the bone it is nearest to. Parts without any
/// bound vertex could grow and shrink, because the encoding does not know about size.
pub(super) fn around_bones(
    motion: &Motion,
    reference: Reference,
    used: &[u32],
    vertices: &[DVec3],
    fit: &Similarity,
    short: f64,
) -> Result<Vec<Bond>> {
    let Some(skeleton) = &motion.skeleton else { return Ok(Vec::new()) };
    let bones = bones(motion, &skeleton.segments, reference, fit, short)?;
    let distance = |p: DVec3, bone: &Bone| {
        let d = bone.b - bone.a;
        let t = ((p - bone.a).dot(d) / d.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        p.distance(bone.a + d * t)
    };
    let owner: Vec<usize> = vertices
        .par_iter()
        .map(|p| {
            let all = bones.iter().enumerate().map(|(k, bone)| (distance(*p, bone), k));
            all.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(0, |x| x.1)
        })
        .collect();
    let mut taken = vec![false; vertices.len()];
    let mut bonds: Vec<Bond> = Vec::new();
    for (k, bone) in bones.iter().enumerate().filter(|(_, bone)| !bone.short) {
        for v in around_bone(bone, vertices, |v| owner[v] == k) {
            if !std::mem::replace(&mut taken[v], true) {
                bonds.push(Bond { vertex: used[v], point: bone.carrier });
            }
        }
    }
    let tufts: BTreeSet<usize> = bones.iter().filter(|b| b.short).map(|b| b.carrier).collect();
    for carrier in tufts {
        let own: Vec<usize> = (0..vertices.len())
            .filter(|&v| bones[owner[v]].short && bones[owner[v]].carrier == carrier && !taken[v])
            .collect();
        let places: Vec<DVec3> = own.iter().map(|&v| vertices[v]).collect();
        for place in spread_out(&places, TUFT) {
            if let Some(&v) = own.iter().find(|&&v| vertices[v] == place) {
                taken[v] = true;
                bonds.push(Bond { vertex: used[v], point: carrier });
            }
        }
    }
    Ok(bonds)
}

/// The own vertices nearest to half lines out of a bone.
fn around_bone(bone: &Bone, vertices: &[DVec3], own: impl Fn(usize) -> bool) -> Vec<usize> {
    let length = bone.a.distance(bone.b);
    let axis = (bone.b - bone.a) / length;
    let side = axis.any_orthonormal_vector();
    let other = axis.cross(side);
    let mut found = Vec::new();
    for along in ALONG {
        let centre = bone.a.lerp(bone.b, along);
        for k in 0..AROUND {
            let angle = std::f64::consts::TAU * (k as f64 + 2.0 * along) / AROUND as f64;
            let ray = side * angle.cos() + other * angle.sin();
            let off = |v: usize| {
                let d = vertices[v] - centre;
                let out = d.dot(ray);
                if out > 0.0 { (d - ray * out).length() } else { f64::INFINITY }
            };
            let best = (0..vertices.len()).filter(|&v| own(v)).map(|v| (off(v), v)).min_by(|a, b| a.0.total_cmp(&b.0));
            found.extend(best.filter(|best| best.0 < 0.2 * length).map(|best| best.1));
        }
    }
    found
}
