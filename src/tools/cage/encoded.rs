//! The path of a cage's vertices by mean-value encoding (Kraevoy, Sheffer 2006, section 4.3).
//!
//! The paper on composite maps takes in-between polyhedra from Winkler et al. 2010. Averages of encodings do the same work: they are
//! independent of rotation, so that a twist stays a twist on the way.

use glam::DVec3;

use crate::encoding::HierarchyOptions;
use crate::error::{Error, Result};
use crate::geometry::Mesh;
use crate::mapping::space::{Cage, VertexPath};
use crate::tools::morph::{Morpher, QUALITY};

/// In-betweens that are decoded; between them the path is a Catmull-Rom curve.
const FRAMES: usize = 64;

/// The last in-between may be farther from the target than others from their next by this factor before that is told.
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
        let mesh = |name: &str, p: &[DVec3]| Mesh::from_triangles(name, p.to_vec(), &cage.triangles);
        let (source, target) = (mesh("the source cage", &cage.source), mesh("the target cage", &cage.target));
        let mut morpher = Morpher::new(&[&source, &target], None, &HierarchyOptions::default())?;
        let mut notes = std::mem::take(&mut morpher.warnings);
        let mut frames = vec![cage.source.clone()];
        for k in 1..FRAMES {
            let t = k as f64 / FRAMES as f64;
            let (positions, _) = morpher.shape(&[1.0 - t, t], &QUALITY)?;
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
