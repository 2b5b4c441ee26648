//! Where the two evaluations of a spline disagree.

use super::curve::Curve;

/// Parameters at which curves are compared at least.
const LEAST: usize = 1024;
/// The same at most.
const MOST: usize = 1 << 17;
/// Distance, in diagonals of the mesh, from which an interval is named.
const NOTABLE: f64 = 0.01;

/// An interval of parameters in which two curves are farther apart than a hundredth of the mesh's
/// diagonal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DisagreementInterval {
    /// Where it begins and ends.
    pub parameters: [f64; 2],
    /// The largest distance in it.
    pub distance: f64,
}

/// How far the direct spline and the subdivided one are from one another, at equal parameters, in
/// space.
#[derive(Clone, Debug, PartialEq)]
pub struct Disagreement {
    /// The largest distance.
    pub distance: f64,
    /// Its parameter.
    pub parameter: f64,
    /// The mean distance.
    pub mean: f64,
    /// Number of parameters compared, evenly spread.
    pub compared: usize,
    /// Where they are more than a hundredth of the diagonal apart.
    pub intervals: Vec<DisagreementInterval>,
}

pub(super) fn compare<const D: usize>(a: &Curve<'_, D>, b: &Curve<'_, D>, diagonal: f64) -> Disagreement {
    let n = (64 * a.layout.spans()).clamp(LEAST, MOST);
    let parameters: Vec<f64> = (0..=n).map(|i| i as f64 / n as f64).collect();
    let distances: Vec<f64> = a
        .points(&parameters)
        .iter()
        .zip(&b.points(&parameters))
        .map(|(a, b)| a.position.distance(b.position))
        .collect();
    let mut found = Disagreement { distance: 0.0, parameter: 0.0, mean: 0.0, compared: n + 1, intervals: Vec::new() };
    let mut open = false;
    for (&t, &d) in parameters.iter().zip(&distances) {
        found.mean += d / (n + 1) as f64;
        if d > found.distance {
            (found.distance, found.parameter) = (d, t);
        }
        let notable = d > NOTABLE * diagonal;
        match found.intervals.last_mut().filter(|_| open && notable) {
            Some(last) => {
                last.parameters[1] = t;
                last.distance = last.distance.max(d);
            }
            None if notable => found.intervals.push(DisagreementInterval { parameters: [t, t], distance: d }),
            None => {}
        }
        open = notable;
    }
    found
}
