//! The knots of continuous partitions, in the plane and in space (paper, section 4.4).

/// Jacobians from here on need no extra knot in a continuous partition; 1 would be the identity's,
/// 0.5 takes far fewer steps.
const CALM: f64 = 0.5;
/// Extra knots closer to their interval's start than this in t change no digit of the map that can
/// be seen.
const LEAST_SHIFT: f64 = 1e-9;

/// How far an extra knot has moved from the start of its interval (0) to the middle (1).
fn ramp(minimum: f64) -> f64 {
    let part = 1.0 - minimum / CALM;
    // NaN is a fold.
    if part.is_nan() { 1.0 } else { part.clamp(0.0, 1.0) }
}

/// A node of the dyadic tree.
struct Node {
    /// The interval it stands for, whose minimum drives it.
    interval: (f64, f64),
    /// Where that interval's ends are now.
    moved: (f64, f64),
    /// Activation of its parent.
    active: f64,
}

/// Knots from 0 to 1, rising, by a rule that is continuous in every minimum: the knot of a node of
/// the dyadic tree moves from the start of its interval to the middle as the smallest Jacobian of
/// the interval falls from [`CALM`] to 0, by no more than its parent has moved. Every node that
/// Listing 1 splits has moved all the way: its partition is contained. Intervals no longer than
/// `eps` are not divided, nor any once there are `most` knots. `minima` gives the smallest
/// Jacobians of intervals, all of one depth in one call.
///
/// # Errors
/// What `minima` returns.
pub(crate) fn continuous_knots<E>(
    eps: f64,
    most: usize,
    mut minima: impl FnMut(&[(f64, f64)]) -> Result<Vec<f64>, E>,
) -> Result<Vec<f64>, E> {
    let mut knots = vec![0.0, 1.0];
    let mut depth = vec![Node { interval: (0.0, 1.0), moved: (0.0, 1.0), active: 1.0 }];
    while !depth.is_empty() {
        let intervals: Vec<(f64, f64)> = depth.iter().map(|node| node.interval).collect();
        let minima = minima(&intervals)?;
        let mut next = Vec::new();
        for (node, minimum) in depth.iter().zip(minima) {
            let active = node.active * ramp(minimum);
            let ((a, b), (low, high)) = (node.interval, node.moved);
            let (c, moved) = ((a + b) / 2.0, low + active * (high - low) / 2.0);
            if b - a <= eps || knots.len() > most || moved - low <= LEAST_SHIFT {
                continue;
            }
            knots.push(moved);
            next.push(Node { interval: (a, c), moved: (low, moved), active });
            next.push(Node { interval: (c, b), moved: (moved, high), active });
        }
        depth = next;
    }
    knots.sort_by(f64::total_cmp);
    knots.dedup();
    Ok(knots)
}
