//! One mesh twice: the identity, and a pull around each pair that leads elsewhere.
//!
//! Anchors say little of such a map and the mesh says everything, so nothing is predicted from
//! them. What a pair moves its surroundings follow, less and less with the distance along the
//! surface; pairs that stay hold theirs. That needs one pair.

use glam::DVec3;
use nalgebra::{DMatrix, Dyn, linalg::Cholesky};

use super::made::Predicted;
use super::pair::FieldPair;
use super::predict::Known;
use super::{Field, FieldOptions, FieldReport, Relaxation, joined};
use crate::engine::Real;
use crate::error::{Error, Result};
use crate::surface::anchors::AnchorPairs;
use crate::surface::vector::{Vector, distance_squared};

/// A pull reaches so many times as far as the longest move: the slope of the bump is at most
/// 135/64 over its reach, so that no part of the surface is pulled over another one, and most of it
/// is stretched by less than two.
const REACH: f64 = 4.0;
/// Added to the diagonal, so that pairs at one place have a solution: their mean.
const RIDGE: f64 = 1e-9;

/// Displacements in embedding and space, spread from the pairs.
pub(super) struct Pulled<const D: usize> {
    centres: Vec<Vector<f64, D>>,
    /// A row a pair: the embedding's coordinates, then those of space.
    weights: DMatrix<f64>,
    reach: f64,
}

/// Wendland's bump of two continuous derivatives: one at zero, none from one on.
fn bump(r: f64) -> f64 {
    let left = (1.0 - r).max(0.0);
    left.powi(4) * (4.0 * r + 1.0)
}

fn distance<const D: usize>(a: &Vector<f64, D>, b: &Vector<f64, D>) -> f64 {
    distance_squared(a, b).sqrt()
}

impl<const D: usize> Pulled<D> {
    /// From pairs whose places on the target are those on the source but for what is pulled. `None`
    /// where nothing is. O(n^3).
    pub(super) fn new(known: &Known<D>) -> Option<Self> {
        let n = known.a.len();
        let longest = (0..n).map(|i| distance(&known.a[i], &known.b[i])).fold(0.0, f64::max);
        let reach = REACH * longest;
        if !(reach > 0.0 && reach.is_finite()) {
            return None;
        }
        let kernel = DMatrix::from_fn(n, n, |i, j| {
            bump(distance(&known.a[i], &known.a[j]) / reach) + if i == j { RIDGE } else { 0.0 }
        });
        let moves = DMatrix::from_fn(n, D + 3, |i, k| match k.checked_sub(D) {
            None => known.b[i][k] - known.a[i][k],
            Some(c) => (known.t[i] - known.s[i])[c],
        });
        // The kernel is positive definite in spaces of three dimensions; the surface, laid out in
        // more of them, has two.
        let weights = match Cholesky::<f64, Dyn>::new(kernel.clone()) {
            Some(factor) => factor.solve(&moves),
            None => kernel.lu().solve(&moves)?,
        };
        weights.iter().all(|w| w.is_finite()).then(|| Self { centres: known.a.clone(), weights, reach })
    }

    /// How a point of the target moves: in the embedding and in space.
    pub(super) fn at(&self, y: &Vector<f64, D>) -> (Vector<f64, D>, [f64; 3]) {
        let (mut embedded, mut spatial) = ([0.0; D], [0.0; 3]);
        for (i, centre) in self.centres.iter().enumerate() {
            let phi = bump(distance(y, centre) / self.reach);
            if phi > 0.0 {
                embedded.iter_mut().enumerate().for_each(|(k, x)| *x += phi * self.weights[(i, k)]);
                spatial.iter_mut().enumerate().for_each(|(k, x)| *x += phi * self.weights[(i, D + k)]);
            }
        }
        (embedded, spatial)
    }
}

impl<S: Real, const K: usize> Field<S, K> {
    /// The field of one mesh twice: the identity but around the pairs that are moved.
    pub(super) fn of_self<const D: usize>(
        pair: &FieldPair<'_, D>,
        known: &Known<D>,
        anchors: &AnchorPairs,
        options: &FieldOptions,
    ) -> Result<Self> {
        let FieldPair { shapes, to, .. } = pair;
        if known.a.is_empty() {
            return Err(Error::input("there are no anchors", "Give at least one pair"));
        }
        let pulled = Pulled::new(known);
        let own = |v: usize| to.surface.vertices[v].y.map(|x| x * to.edge);
        let image = |v: usize| {
            let (y, x) = (own(v), shapes.target_position(v));
            let (dy, dx) = pulled.as_ref().map_or(([0.0; D], [0.0; 3]), |p| p.at(&y));
            let y: Vector<f64, D> = std::array::from_fn(|k| y[k] + dy[k]);
            joined(&y, 1.0, (x + DVec3::from(dx)).to_array())
        };
        let predicted = Predicted {
            source: (0..shapes.source.mesh.vertex_count())
                .map(|v| joined::<D, K>(&own(v), 1.0, shapes.source_position(v).to_array()))
                .collect(),
            image: &image,
            anchors: known.b.iter().zip(&known.t).map(|(b, t)| joined(b, 1.0, t.to_array())).collect(),
            apart: known.a.len(),
            unit: 1.0,
            error: 0.0,
        };
        // Where nothing is pulled there is nothing to be drawn.
        let relaxation = if pulled.is_some() { options.relaxation() } else { Relaxation::Off };
        let (mut field, _) = Self::drawn(shapes, predicted, anchors, relaxation, options.relax)?;
        field.unit /= 2.0_f64.sqrt();
        if options.confidence {
            field.drift = vec![0.0; field.z.len()];
            field.doubt_turned();
        }
        field.report = FieldReport {
            embedded: vec![("identity", 1.0)],
            spatial: vec![("identity", 1.0)],
            lambda: 1.0,
            relaxation: Some(options.relaxation()),
            left_out: vec![0.0; known.a.len()],
            ..field.report
        };
        Ok(field)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A point of the plane, laid out in four dimensions: vectors have a multiple of four.
    fn laid(p: [f64; 2]) -> [f64; 4] {
        [p[0], p[1], 0.0, 0.0]
    }

    fn known(pairs: &[([f64; 2], [f64; 2])]) -> Known<4> {
        let flat = |p: &[f64; 2]| DVec3::new(p[0], p[1], 0.0);
        Known {
            places: Vec::new(),
            a: pairs.iter().map(|p| laid(p.0)).collect(),
            b: pairs.iter().map(|p| laid(p.1)).collect(),
            s: pairs.iter().map(|p| flat(&p.0)).collect(),
            t: pairs.iter().map(|p| flat(&p.1)).collect(),
        }
    }

    #[test]
    fn pairs_are_met_far_points_stay_and_nothing_is_turned_over() {
        let pulled = Pulled::new(&known(&[([0.0, 0.0], [0.05, 0.0]), ([0.12, 0.0], [0.12, 0.0])])).unwrap();
        let (y, x) = pulled.at(&laid([0.0, 0.0]));
        assert!((y[0] - 0.05).abs() < 1e-8 && y[1].abs() < 1e-8 && (x[0] - 0.05).abs() < 1e-8 && x[2] == 0.0);
        assert!(pulled.at(&laid([0.12, 0.0])).0[0].abs() < 1e-8);
        assert_eq!(pulled.at(&laid([-0.21, 0.0])), ([0.0; 4], [0.0; 3]));
        let alone = Pulled::new(&known(&[([0.0, 0.0], [0.05, 0.0])])).unwrap();
        let step = 1e-4;
        let slopes = (0..4000)
            .map(|i| f64::from(i) * step - 0.2)
            .map(|x| (alone.at(&laid([x + step, 0.0])).0[0] - alone.at(&laid([x, 0.0])).0[0]) / step);
        let (least, most) = slopes.fold((0.0_f64, 0.0_f64), |(a, b), s| (a.min(s), b.max(s)));
        assert!(least > -0.55 && most < 0.55, "{least} {most}");
    }

    #[test]
    fn pairs_at_one_place_and_pairs_that_stay_do_no_harm() {
        assert!(Pulled::new(&known(&[([0.0, 0.0], [0.0, 0.0])])).is_none());
        assert!(Pulled::new(&known(&[])).is_none());
        let twice = Pulled::new(&known(&[([0.0, 0.0], [0.04, 0.0]), ([0.0, 0.0], [0.02, 0.0])])).unwrap();
        assert!((twice.at(&laid([0.0, 0.0])).0[0] - 0.03).abs() < 1e-6);
    }
}
