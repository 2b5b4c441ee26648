//! Which way a body faces: bodies are much alike from the front and from behind, but marker names,
//! toes and the walk itself tell.

use std::collections::HashMap;

use glam::{DMat3, DVec3};

use crate::encoding::Similarity;
use crate::io::motion::Motion;

/// Markers beyond which frames are thinned for the direction of the walk.
const FRAMES: usize = 64;
/// Heights, from the lowest to the highest vertex, between which toes and ankles lie.
const TOES: [f64; 2] = [0.0, 0.035];
const ANKLES: [f64; 2] = [0.06, 0.12];
/// How far the toes must reach before the ankles, in heights.
const REACH: f64 = 0.008;

/// The name with left and right exchanged, if it tells a side: `LKNE`, `l_knee`, `LeftArm`,
/// `knee.R`.
fn other_side(name: &str) -> Option<(bool, String)> {
    for (left, a, b) in [
        (true, "Left", "Right"),
        (true, "left", "right"),
        (true, "LEFT", "RIGHT"),
        (false, "Right", "Left"),
        (false, "right", "left"),
        (false, "RIGHT", "LEFT"),
    ] {
        if name.contains(a) {
            return Some((left, name.replacen(a, b, 1)));
        }
    }
    // Subjects' names stand before a colon.
    let (subject, own) = name.split_at(name.rfind(':').map_or(0, |k| k + 1));
    for (left, a, b) in [(true, 'L', 'R'), (true, 'l', 'r'), (false, 'R', 'L'), (false, 'r', 'l')] {
        if let Some(rest) = own.strip_prefix(a) {
            return Some((left, format!("{subject}{b}{rest}")));
        }
        if let Some(rest) = own.strip_suffix(a).filter(|rest| rest.ends_with(['.', '_', '-'])) {
            return Some((left, format!("{subject}{rest}{b}")));
        }
    }
    None
}

/// The direction from right to left in the clip, by points whose names are each other's mirror
/// images.
pub(super) fn left_by_names(motion: &Motion, points: &[(usize, DVec3)]) -> Option<DVec3> {
    let at: HashMap<&str, DVec3> = points.iter().map(|(k, p)| (motion.names[*k].as_str(), *p)).collect();
    let pairs = points.iter().filter_map(|(k, p)| {
        let (left, other) = other_side(&motion.names[*k])?;
        left.then(|| at.get(other.as_str()).map(|q| (*p - *q).normalize_or_zero()))?
    });
    let all: Vec<DVec3> = pairs.collect();
    let sum: DVec3 = all.iter().sum();
    // Two pairs at least, and most of one mind.
    (all.len() >= 2 && sum.length() > 0.5 * all.len() as f64).then(|| sum.normalize())
}

/// The direction in which the body of the reference pose moves: its velocities in all frames, each
/// turned back by how the body turned till then.
pub(super) fn forward_by_walk(motion: &Motion, points: &[(usize, DVec3)]) -> Option<DVec3> {
    let step = motion.frames.len().div_ceil(FRAMES).max(1);
    let pose = |f: usize| -> Vec<(DVec3, DVec3)> {
        points.iter().filter_map(|(k, p)| motion.frames[f][*k].map(|q| (*p, q))).collect()
    };
    let centre = |pairs: &[(DVec3, DVec3)]| pairs.iter().map(|p| p.1).sum::<DVec3>() / pairs.len().max(1) as f64;
    let mut sum = DVec3::ZERO;
    let mut before: Option<DVec3> = None;
    for f in (0..motion.frames.len()).step_by(step) {
        let pairs = pose(f);
        if 2 * pairs.len() < points.len().max(6) {
            before = None;
            continue;
        }
        let now = centre(&pairs);
        if let Some(before) = before {
            sum += Similarity::fit(&pairs).rotation.transpose() * (now - before);
        }
        before = Some(now);
    }
    let size = points.iter().map(|p| p.1.distance(points[0].1)).fold(0.0, f64::max);
    (sum.length() > 0.5 * size).then(|| sum.normalize())
}

/// The horizontal direction of a mesh's toes, if it stands on feet.
pub(super) fn front_by_toes(vertices: &[DVec3], up: DVec3) -> Option<DVec3> {
    let height = |p: &DVec3| p.dot(up);
    let (low, high) =
        vertices.iter().map(height).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
    let size = high - low;
    let middle = |[from, to]: [f64; 2]| -> Option<DVec3> {
        let slab: Vec<DVec3> =
            vertices.iter().filter(|p| (from..=to).contains(&((height(p) - low) / size))).copied().collect();
        // The middle of the box does not depend on how densely a mesh is cut.
        let (a, b) = slab.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(a, b), p| (a.min(*p), b.max(*p)));
        (slab.len() >= 8).then(|| (a + b) * 0.5)
    };
    let d = middle(TOES)? - middle(ANKLES)?;
    let flat = d - up * d.dot(up);
    (flat.length() > REACH * size).then(|| flat.normalize())
}

/// What is known of the way a clip's body and a mesh face.
pub(super) struct Facing {
    left: Option<DVec3>,
    forward: Option<DVec3>,
}

impl Facing {
    pub(super) fn new(motion: &Motion, points: &[(usize, DVec3)]) -> Self {
        Self { left: left_by_names(motion, points), forward: forward_by_walk(motion, points) }
    }

    /// Whether a clip turned by `rotation` faces as the mesh does; `None` if that cannot be told.
    pub(super) fn agrees(&self, rotation: &DMat3, vertices: &[DVec3], up: DVec3) -> Option<bool> {
        let front = front_by_toes(vertices, up)?;
        match (self.left, self.forward) {
            (Some(left), _) => Some((*rotation * left).dot(up.cross(front)) > 0.0),
            (None, Some(forward)) => Some((*rotation * forward).dot(front) > 0.0),
            (None, None) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::{Walker, strider};

    #[test]
    fn sides_are_read_from_names() {
        for (name, other) in [
            ("LKNE", "RKNE"),
            ("subject:LKNE", "subject:RKNE"),
            ("LeftArm", "RightArm"),
            ("upperarm.R", "upperarm.L"),
            ("rtoes", "ltoes"),
            ("knee_l", "knee_r"),
        ] {
            assert_eq!(other_side(name).unwrap().1, other);
        }
        assert!(other_side("HEAD").is_none());
    }

    #[test]
    fn walks_and_toes_point_forward() {
        let walker = Walker::new(0.05);
        let chosen: Vec<usize> = (0..30).map(|k| k * walker.mesh.vertex_count() / 30).collect();
        let frames = (0..40)
            .map(|f| {
                let shape = walker.positions(f as f64 / 30.0, 1.0);
                // It walks a curve, so that the world's directions tell nothing.
                let turn = DMat3::from_rotation_y(0.1 * f as f64);
                let along = DVec3::new(-(0.1 * f as f64).cos(), 0.0, (0.1 * f as f64).sin()) * 0.5;
                chosen
                    .iter()
                    .map(|&v| {
                        Some(turn * (shape[v] * DVec3::new(1.0, 1.0, 1.0) - DVec3::Z * 1.3 * f as f64 / 30.0) + along)
                    })
                    .collect()
            })
            .collect();
        let motion = Motion {
            path: "clip".into(),
            names: (0..30).map(|k| format!("M{k}")).collect(),
            rate: 30.0,
            frames,
            metres_per_unit: None,
            skeleton: None,
            warnings: Vec::new(),
        };
        let points: Vec<(usize, DVec3)> = (0..30).map(|k| (k, motion.frames[0][k].unwrap())).collect();
        let forward = forward_by_walk(&motion, &points).unwrap();
        assert!(forward.z > 0.8, "{forward}");
        for mesh in [walker.mesh, strider().mesh] {
            let front = front_by_toes(&mesh.positions, DVec3::Y).unwrap();
            assert!(front.z > 0.7, "{}: {front}", mesh.name);
        }
    }
}
