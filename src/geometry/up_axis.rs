//! Which axis of a mesh points up: files do not say, and programs differ.

use glam::{DQuat, DVec3};

use super::Mesh;
use crate::words::words;

/// Heights of the slabs at both ends that feet and head must lie in, in parts of the whole.
const SLAB: f64 = 0.04;
/// A standing body is at least this many times as high as it is deep.
const DEPTH: f64 = 2.5;
/// With arms stretched out a body is about as wide as it is high.
const WIDTH: f64 = 0.9;
/// Smallest distance between two feet, in heights.
const APART: f64 = 0.01;
/// Smallest length of a sole, in heights.
const SOLE: f64 = 0.05;
/// Largest distance of the head from the middle between the feet, in heights.
const ASIDE: f64 = 0.08;

/// The axis that points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum UpAxis {
    /// y, as in glTF and most files of games and film; the front looks along z.
    #[default]
    Y,
    /// z, as in files of scanners, CAD and Blender; the front looks along -y.
    Z,
}

words! { UpAxis, "up", "an axis that may point up":
    Y => "y",
    Z => "z",
}

impl UpAxis {
    /// The rotation that makes it y: from z up, z becomes y and -y becomes z.
    pub fn to_y(self) -> DQuat {
        match self {
            Self::Y => DQuat::IDENTITY,
            Self::Z => DQuat::from_rotation_x(-std::f64::consts::FRAC_PI_2),
        }
    }

    /// A direction in a y-up world as it is with this axis up; exact.
    pub fn from_y(self, direction: DVec3) -> DVec3 {
        match self {
            Self::Y => direction,
            Self::Z => DVec3::new(direction.x, -direction.z, direction.y),
        }
    }
}

/// Whether a mesh is a body that stands along z: high, not deep along y, with two soles side by
/// side at the lower end and one head above the middle between them. Modest: what is not plainly so
/// is not, so that nothing else is taken for one. O(vertices).
pub fn stands_along_z(mesh: &Mesh) -> bool {
    let mut used = vec![false; mesh.vertex_count()];
    for t in 0..mesh.triangle_count() {
        mesh.triangle(t).iter().for_each(|&v| used[v as usize] = true);
    }
    let points: Vec<DVec3> =
        mesh.positions.iter().zip(&used).filter(|(p, used)| **used && p.is_finite()).map(|(p, _)| *p).collect();
    let low = points.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = points.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    let size = high - low;
    let height = size.z;
    if !(height > DEPTH * size.y && height > WIDTH * size.x && size.min_element() > 0.0) {
        return false;
    }
    let slab = |from: f64, to: f64| -> Vec<DVec3> {
        let inside = |p: &&DVec3| (low.z + from * height..=low.z + to * height).contains(&p.z);
        let mut slab: Vec<DVec3> = points.iter().filter(inside).copied().collect();
        slab.sort_by(|a, b| a.x.total_cmp(&b.x));
        slab
    };
    let (feet, head) = (slab(0.0, SLAB), slab(1.0 - SLAB, 1.0));
    let Some(gap) = (1..feet.len()).max_by(|&a, &b| {
        let width = |k: usize| feet[k].x - feet[k - 1].x;
        width(a).total_cmp(&width(b))
    }) else {
        return false;
    };
    let (left, right) = feet.split_at(gap);
    let span = |part: &[DVec3], axis: usize| {
        let all = || part.iter().map(|p| p[axis]);
        (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max))
    };
    let length = |part: &[DVec3], axis: usize| {
        let (a, b) = span(part, axis);
        b - a
    };
    let apart = right[0].x - left[left.len() - 1].x > APART * height;
    let even = 3 * left.len().min(right.len()) > left.len().max(right.len());
    // Soles are longer than wide and about as long as one another.
    let (a, b) = (length(left, 1), length(right, 1));
    let soles = a.min(b) > SOLE * height && a.min(b) > 0.7 * a.max(b) && a > length(left, 0) && b > length(right, 0);
    let middle = 0.5 * (span(left, 0).0 + span(right, 0).1);
    let (from, to) = span(&head, 0);
    let crown = to - from < 0.5 * (span(right, 0).1 - span(left, 0).0) + ASIDE * height;
    apart && even && soles && crown && (0.5 * (from + to) - middle).abs() < ASIDE * height
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turned(mesh: &Mesh, turn: impl Fn(DVec3) -> DVec3) -> Mesh {
        let mut mesh = mesh.clone();
        mesh.positions.iter_mut().for_each(|p| *p = turn(*p));
        mesh
    }

    #[test]
    fn z_up_becomes_y_up() {
        for p in [DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(1.0, 2.0, 3.0)] {
            assert!((UpAxis::Z.to_y() * UpAxis::Z.from_y(p)).distance(p) < 1e-12);
            assert_eq!(UpAxis::Y.to_y() * UpAxis::Y.from_y(p), p);
        }
        assert_eq!((UpAxis::Z.from_y(DVec3::Y), UpAxis::Z.from_y(DVec3::Z)), (DVec3::Z, DVec3::NEG_Y));
    }

    #[test]
    fn bodies_are_told_from_other_shapes() {
        let body = crate::models::stout().mesh;
        assert!(!stands_along_z(&body));
        assert!(stands_along_z(&turned(&body, |p| UpAxis::Z.from_y(p))));
        // Looking the other way, and off the origin.
        assert!(stands_along_z(&turned(&body, |p| DVec3::new(-p.x, p.z, p.y) * 7.0 + 50.0)));
        // On its head, on its side, and lying.
        assert!(!stands_along_z(&turned(&body, |p| DVec3::new(p.x, p.z, -p.y))));
        assert!(!stands_along_z(&turned(&body, |p| DVec3::new(p.y, -p.x, p.z))));
        assert!(!stands_along_z(&turned(&body, |p| DVec3::new(p.z, p.x, p.y))));
        let ball = crate::models::shapes::uv_sphere(1.0, 24, 16);
        for shape in [
            ball.clone(),
            turned(&ball, |p| p * DVec3::new(0.3, 0.2, 3.0)),
            turned(&ball, |p| p * DVec3::new(1.0, 0.01, 1.0)),
        ] {
            assert!(!stands_along_z(&shape));
        }
    }

    /// No mesh of the shared data is taken for a body along z as it is; people that are turned are.
    #[test]
    #[ignore = "needs BARYMAP_DATA"]
    fn the_shared_meshes_raise_no_false_alarm() {
        let folder = std::path::PathBuf::from(std::env::var_os("BARYMAP_DATA").expect("BARYMAP_DATA"));
        let mut found = Vec::new();
        let mut turned_found = Vec::new();
        let mut count = 0;
        let mut folders = vec![folder.join("mesh"), folder.join("textured"), folder.join("cage"), folder.join("gt")];
        while let Some(next) = folders.pop() {
            for entry in std::fs::read_dir(next).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    folders.push(path);
                } else if let Ok(loaded) = crate::io::read_mesh(&path) {
                    count += 1;
                    if stands_along_z(&loaded.mesh) {
                        found.push(path.clone());
                    }
                    if stands_along_z(&turned(&loaded.mesh, |p| UpAxis::Z.from_y(p))) {
                        turned_found.push(path.file_name().unwrap().to_string_lossy().into_owned());
                    }
                }
            }
        }
        println!("{count} meshes; along z: {found:?}; turned: {turned_found:?}");
        assert!(count > 10 && found.is_empty(), "{found:?}");
        assert!(turned_found.iter().any(|n| n.contains("human")), "{turned_found:?}");
    }
}
