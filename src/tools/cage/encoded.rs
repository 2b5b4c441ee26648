//! The path of a cage's vertices by mean-value encoding (Kraevoy, Sheffer 2006, section 4.3).
//!
//! The paper on composite maps takes in-between polyhedra from Winkler et al. 2010. Averages of
//! encodings do the same work: they are independent of rotation, so that a twist stays a twist on
//! the way.

use glam::DVec3;

use crate::encoding::{HierarchyOptions, MarchQuality};
use crate::error::{Error, Result};
use crate::geometry::Mesh;
use crate::mapping::space::{Cage, VertexPath};
use crate::tools::morph::Morpher;

/// In-betweens that are decoded; between them the path is a Catmull-Rom curve.
const FRAMES: usize = 64;

/// The last in-between may be farther from the target than others from their next by this factor
/// before that is told.
const JUMP: f64 = 8.0;

/// A path by mean-value encoding.
#[derive(Clone, Debug)]
pub struct Encoded {
    /// At t = 0, 1 / [`FRAMES`], ... 1.
    frames: Vec<Vec<DVec3>>,
    /// What is odd but no error.
    pub notes: Vec<String>,
}

impl Encoded {
    /// Encodes both polyhedra of `cage` and decodes the averages, from the source on.
    ///
    /// # Errors
    /// [`Error::Numeric`] where no finite in-between is found, and what [`Morpher::new`] refuses.
    pub fn new(cage: &Cage) -> Result<Self> {
        let mesh = |name: &str, p: &[DVec3]| Mesh::of_triangles(name, p.to_vec(), &cage.triangles);
        let (source, target) = (mesh("the source cage", &cage.source), mesh("the target cage", &cage.target));
        let mut morpher = Morpher::new(&[&source, &target], None, &HierarchyOptions::default())?;
        let mut notes = std::mem::take(&mut morpher.warnings);
        let mut frames = vec![cage.source.clone()];
        for k in 1..FRAMES {
            let t = k as f64 / FRAMES as f64;
            let (positions, _) = morpher.shape(&[1.0 - t, t], &MarchQuality::CONVERGED)?;
            if positions.iter().any(|p| !p.is_finite()) {
                return Err(Error::numeric(format!("no finite in-between at t = {t}"), "Take the linear path"));
            }
            frames.push(positions);
        }
        frames.push(cage.target.clone());
        let far = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        let strides: Vec<f64> = frames.windows(2).map(|w| far(&w[0], &w[1])).collect();
        let last = strides[FRAMES - 1];
        let usual = strides[..FRAMES - 1].iter().fold(0.0, |a: f64, b| a.max(*b));
        if last > JUMP * usual {
            notes.push(format!("the path by encoding arrives with a jump of {last:.3e}; --path linear has none"));
        }
        Ok(Self { frames, notes })
    }
}

impl VertexPath for Encoded {
    fn positions(&self, t: f64) -> Result<Vec<DVec3>> {
        let place = t.clamp(0.0, 1.0) * FRAMES as f64;
        let k = (place as usize).min(FRAMES - 1);
        let s = place - k as f64;
        if s == 0.0 || s == 1.0 {
            return Ok(self.frames[k + s as usize].clone());
        }
        let (here, there) = (&self.frames[k], &self.frames[k + 1]);
        let before = k.checked_sub(1).map(|k| &self.frames[k]);
        let after = self.frames.get(k + 2);
        let between = |v: usize| {
            let (p, q) = (here[v], there[v]);
            // One-sided at the ends.
            let out = before.map_or(q - p, |b| (q - b[v]) * 0.5);
            let into = after.map_or(q - p, |a| (a[v] - p) * 0.5);
            let (s2, s3) = (s * s, s * s * s);
            p * (2.0 * s3 - 3.0 * s2 + 1.0) + out * (s3 - 2.0 * s2 + s) + q * (3.0 * s2 - 2.0 * s3) + into * (s3 - s2)
        };
        Ok((0..here.len()).map(between).collect())
    }

    fn name(&self) -> &str {
        "encoded"
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Corner;
    use crate::mapping::space::{Linear, volume};
    use crate::models::shapes::uv_sphere;

    /// A ball, and the same turned about y by `degrees` between its poles.
    fn twisted(degrees: f64) -> Cage {
        let from = uv_sphere(1.0, 12, 8);
        let mut to = from.clone();
        let turn = |p: DVec3| glam::DQuat::from_rotation_y(degrees.to_radians() * 0.5 * p.y) * p;
        to.positions.iter_mut().for_each(|p| *p = turn(*p));
        Cage::new(&from, &to).unwrap()
    }

    #[test]
    fn the_path_begins_and_ends_at_the_cages_and_is_continuous() {
        let cage = twisted(120.0);
        let path = Encoded::new(&cage).unwrap();
        assert_eq!(path.notes, Vec::<String>::new());
        assert_eq!(path.positions(0.0).unwrap(), cage.source);
        assert_eq!(path.positions(1.0).unwrap(), cage.target);
        let mut before = cage.source.clone();
        for k in 1..=512 {
            let here = path.positions(f64::from(k) / 512.0).unwrap();
            let stride = before.iter().zip(&here).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
            // The whole way is two thirds of a turn at most.
            assert!(stride < 0.02, "{k}: {stride}");
            before = here;
        }
        assert_eq!(path.positions(0.3).unwrap(), path.positions(0.3).unwrap());
        assert_eq!(Encoded::new(&cage).unwrap().positions(0.7).unwrap(), path.positions(0.7).unwrap());
    }

    #[test]
    fn a_twist_keeps_its_volume_on_the_way_where_the_straight_path_shrinks() {
        let cage = twisted(180.0);
        // Half of the twist is what the middle should be.
        let half = volume(&cage.triangles, &twisted(90.0).target);
        let middle = |path: &dyn VertexPath| volume(&cage.triangles, &path.positions(0.5).unwrap()) / half;
        let (encoded, linear) = (middle(&Encoded::new(&cage).unwrap()), middle(&Linear::new(&cage)));
        assert!(encoded > 0.95 && encoded < 1.25 && linear < 0.9, "{encoded} {linear}");
    }

    #[test]
    fn the_smallest_cage_has_a_path_or_says_why_not() {
        // The smallest closed cage there is.
        let mut builder = crate::geometry::MeshBuilder::new("tetrahedron");
        builder.mesh.positions = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        for t in [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]] {
            builder.polygon(t.map(|vertex| Corner {
                vertex,
                texcoord: crate::geometry::NONE,
                normal: crate::geometry::NONE,
            }));
        }
        let mesh = builder.finish();
        let mut moved = mesh.clone();
        moved.positions[3] *= 2.0;
        let cage = Cage::new(&mesh, &moved).unwrap();
        if let Ok(path) = Encoded::new(&cage) {
            assert!(path.positions(0.5).unwrap().iter().all(|p| p.is_finite()));
        }
    }
}
