//! Mean value weights as jets over a box of parameters.

use super::chart::{Chart, Position, Tip};
use super::domain::Domain;
use super::interval::Interval;
use super::jet::Jet;

/// The weights of all vertices, up to a common factor that does not vanish in the box.
///
/// With `s_i = v_i - v`, `r_i = |s_i|`, `A_i = s_i x s_(i+1)`, `D_i = s_i . s_(i+1)`, `t_i =
/// tan(alpha_i / 2) = A_i / (r_i r_(i+1) + D_i) = (r_i r_(i+1) - D_i) / A_i` the weights are `w_i =
/// (t_(i-1) + t_i) / r_i` (paper, equation 8). Two factors make them finite where the coordinates
/// `b_i = w_i / sum w` are smooth but the weights are not:
///
/// - **On an edge k** t_k has a pole. All weights are multiplied by `tau = 1 / t_k = A_k / (r_k
///   r_(k+1) - D_k)`, which is smooth across the open edge (the denominator is `r_k r_(k+1) (1 -
///   cos alpha_k)`, zero only where alpha_k is). Term k becomes the constant 1. tau vanishes on the
///   edge's line only, so off the edge the coordinates are unchanged, and on it the scaled formula
///   is their continuous, even analytic extension. A box that straddles the edge is no special
///   case.
/// - **At a vertex k**, in the parameters of a [`Fan`](super::chart::Fan): `s_k = -lambda q`. In
///   t_(k-1) and t_k the factor lambda cancels. All weights are multiplied by lambda; that of the
///   vertex itself is then `(t_(k-1) + t_k) / |q|`, and the others keep the factor outside (the
///   entries here are without it). Nothing is left that is not smooth at lambda = 0.
#[derive(Clone, Debug, Default)]
pub(super) struct Weights<const N: usize> {
    /// Per vertex, the other vertices' without the factor lambda in a fan.
    pub(super) of: Vec<Jet<N>>,
    tangents: Vec<Jet<N>>,
    distances: Vec<Jet<N>>,
}

/// What an edge contributes: `A`, `D` and the product of the distances.
struct Edge<const N: usize> {
    cross: Jet<N>,
    dot: Jet<N>,
    product: Jet<N>,
}

impl<const N: usize> Weights<N> {
    /// Fills in the weights over the box `at`, scaled for `edge` if one is named.
    pub(super) fn fill(&mut self, domain: &Domain, chart: &Chart, at: [Interval; 2], edge: Option<usize>) {
        let n = domain.len();
        let position = Position::new(chart, at);
        let tip = match chart {
            Chart::Plane => None,
            Chart::Fan(fan) => Some((fan.vertex, Tip::new(fan, at))),
        };
        self.distances.clear();
        self.distances.extend((0..n).map(|i| match &tip {
            Some((vertex, tip)) if *vertex == i => tip.length,
            _ => position.squared_distance(chart.offset(domain, i)).sqrt(),
        }));
        let tau = edge.map(|k| {
            let parts = self.edge(domain, chart, &position, &tip, k);
            parts.cross.over(&(parts.product - parts.dot))
        });
        self.tangents.clear();
        for i in 0..n {
            let tangent = match &tau {
                Some(_) if edge == Some(i) => Jet::constant(Interval::ONE),
                Some(tau) => self.edge(domain, chart, &position, &tip, i).tangent().times(tau),
                None => self.edge(domain, chart, &position, &tip, i).tangent(),
            };
            self.tangents.push(tangent);
        }
        self.of.clear();
        self.of.extend((0..n).map(|i| (self.tangents[domain.before[i]] + self.tangents[i]).over(&self.distances[i])));
    }

    fn edge(
        &self,
        domain: &Domain,
        chart: &Chart,
        position: &Position<N>,
        tip: &Option<(usize, Tip<N>)>,
        i: usize,
    ) -> Edge<N> {
        let next = domain.after[i];
        let product = self.distances[i].times(&self.distances[next]);
        let (cross, dot) = match tip {
            Some((vertex, tip)) if *vertex == i => {
                let o = chart.offset(domain, next);
                (tip.cross_product(o), tip.dot_product(o))
            }
            Some((vertex, tip)) if *vertex == next => {
                let o = chart.offset(domain, i);
                (Jet::ZERO - tip.cross_product(o), tip.dot_product(o))
            }
            _ => {
                let (o, e) = (chart.offset(domain, i), domain.edge(i));
                (position.cross_product(o, e), position.dot_product(o, e))
            }
        };
        Edge { cross, dot, product }
    }
}

impl<const N: usize> Edge<N> {
    /// tan(alpha / 2) by the form without cancellation; the other one where the angle passes a
    /// right angle.
    fn tangent(&self) -> Jet<N> {
        if self.dot.0[0].mid() < 0.0 && !self.cross.0[0].may_vanish() {
            (self.product - self.dot).over(&self.cross)
        } else {
            self.cross.over(&(self.product + self.dot))
        }
    }
}
