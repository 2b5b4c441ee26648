//! How much a finished map strains the target: what a wrong pair does and a right one does not.

use glam::DVec3;
use rayon::prelude::*;

use super::Field;
use super::pair::FieldPair;

/// Strain of a triangle, at most: one that collapses counts no more than one that is stretched by
/// e^2.
const MOST: f64 = 4.0;

/// The mean over the area of `triangles` of `min(log^2 s1 + log^2 s2, 4)`, s the singular values of
/// the map of a triangle from its corners to their images, both surfaces at unit area. What has no
/// image counts as much as what collapses. O(F).
pub(crate) fn strain_of(
    triangles: impl Iterator<Item = [u32; 3]>,
    corner: impl Fn(u32) -> DVec3,
    image: impl Fn(u32) -> Option<DVec3>,
) -> f64 {
    let (mut sum, mut area) = (0.0, 0.0);
    for t in triangles {
        let [a, b, c] = t.map(&corner);
        let (e, f) = (b - a, c - a);
        let double = e.cross(f).length();
        let strain = match t.map(&image) {
            [Some(a), Some(b), Some(c)] => triangle([e, f], [b - a, c - a], double),
            _ => MOST,
        };
        sum += strain * double;
        area += double;
    }
    sum / area
}

impl<const D: usize> FieldPair<'_, D> {
    /// [`strain_of`] the map from the target onto the source. O(V + F).
    pub(super) fn strain<const K: usize>(&self, field: &Field<f64, K>) -> f64 {
        let shapes = &self.shapes;
        let topology = shapes.target.topology;
        let image = |v: usize| -> Option<DVec3> {
            let point = topology.vertex_point(v as u32)?;
            field.map_point(point.into()).point().map(|p| shapes.source_point(&p))
        };
        let images: Vec<Option<DVec3>> = (0..shapes.used.len()).into_par_iter().map(image).collect();
        let usable = topology.triangles.iter().zip(&topology.usable).filter(|(_, usable)| **usable).map(|(t, _)| *t);
        strain_of(usable, |v| shapes.target_position(v as usize), |v| images[v as usize])
    }
}

/// Strain of the linear map that takes two edges to two others; `double` is the area of the first
/// two, twice.
fn triangle([e, f]: [DVec3; 2], [g, h]: [DVec3; 2], double: f64) -> f64 {
    let (ee, ef, ff) = (e.dot(e), e.dot(f), f.dot(f));
    let (gg, gh, hh) = (g.dot(g), g.dot(h), h.dot(h));
    // Squares of the singular values: their sum and product.
    let trace = (ff * gg - 2.0 * ef * gh + ee * hh) / (double * double);
    let product = (g.cross(h).length() / double).powi(2);
    let root = (0.25 * trace * trace - product).max(0.0).sqrt();
    let larger = 0.5 * trace + root;
    let smaller = product / larger;
    let strain = 0.25 * (larger.ln().powi(2) + smaller.ln().powi(2));
    if strain <= MOST { strain } else { MOST }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strain_is_the_logarithms_of_the_singular_values() {
        let [e, f] = [DVec3::new(1.0, 0.0, 0.0), DVec3::new(0.3, 2.0, 0.0)];
        let of = |x: f64, y: f64| {
            let map = |p: DVec3| DVec3::new(0.0, x * p.x, y * p.y);
            triangle([e, f], [map(e), map(f)], e.cross(f).length())
        };
        assert!(of(1.0, 1.0).abs() < 1e-24 && of(-1.0, 1.0).abs() < 1e-24);
        let expected = 2.0_f64.ln().powi(2) + 0.25_f64.ln().powi(2);
        assert!((of(2.0, 0.25) - expected).abs() < 1e-12 && (of(2.0, 0.26) - expected).abs() > 1e-3);
        assert_eq!(of(1.0, 0.0), MOST);
        assert_eq!(of(1e9, 1.0), MOST);
    }
}
