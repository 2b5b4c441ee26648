//! The derivative of F in closed form, and products with I - dF and its transpose as gathers over
//! slots.

use rayon::prelude::*;

use super::decode::{BLOCK, Frame, REGULARISATION};
use super::vector::{add, add_scaled, cross, dot, scale, sub, zero};
use super::{Encoding, Stencils, V3};
use crate::engine::Real;
use crate::geometry::NONE;

/// What the derivative of one row's F needs beside the positions.
///
/// With q = sum w v, p_k = q - v_k, N = I - n nᵀ, d_k the regularised length of N p_k, u_k = N p_k
/// / d_k, c the vector area, L = |c|: `g` = sum w_k b_k u_k, `h` = sum w_k b_k (n.p_k) u_k,
/// `offset` = sum w_k b_k d_k, and dF/dv_k = w_k I + n (w_k g + z_k)ᵀ + (offset I - n hᵀ) N/L
/// [v_{k+1} - v_{k-1}]x with z_k = -w_k b_k u_k + kappa (v_k - mean); the last part is from the
/// regularisation, kappa = tau²/m sum w_k b_k / d_k.
#[derive(Clone, Copy, Debug, Default)]
pub struct RowDerivative<R> {
    /// Unit normal n.
    pub normal: V3<R>,
    /// 1 / L.
    pub inverse_length: R,
    /// sum w b d.
    pub offset: R,
    /// See above.
    pub g: V3<R>,
    /// See above.
    pub h: V3<R>,
}

/// The derivative of F at given positions, for all rows.
#[derive(Clone, Debug, Default)]
pub struct Linearisation<R> {
    /// One entry a row.
    pub rows: Vec<RowDerivative<R>>,
    /// z_k, one entry a slot.
    pub z: Vec<V3<R>>,
}

impl<R: Real> Linearisation<R> {
    /// Linearises at `positions`.
    pub fn new(stencils: &Stencils, encoding: &Encoding<R>, positions: &[V3<R>]) -> Self {
        let mut z = vec![zero(); stencils.neighbour.len()];
        let mut rows = vec![RowDerivative::default(); stencils.row_count()];
        let mut parts = Vec::new();
        let (mut rest, mut begin) = (z.as_mut_slice(), 0);
        for (block, rows) in rows.chunks_mut(BLOCK).enumerate() {
            let end = stencils.start[block * BLOCK + rows.len()] as usize;
            let (head, tail) = rest.split_at_mut(end - begin);
            (rest, begin) = (tail, end);
            parts.push((rows, head));
        }
        parts.into_par_iter().enumerate().for_each(|(block, (rows, z))| {
            let first = stencils.start[block * BLOCK] as usize;
            for (row, out) in (block * BLOCK..).zip(rows) {
                let slots = stencils.slots(row);
                let z = &mut z[slots.start - first..slots.end - first];
                *out = row_derivative(
                    positions,
                    &stencils.neighbour[slots.clone()],
                    &encoding.w[slots.clone()],
                    &encoding.b[slots],
                    z,
                );
            }
        });
        Self { rows, z }
    }
}

fn row_derivative<R: Real>(positions: &[V3<R>], ring: &[u32], w: &[R], b: &[R], z: &mut [V3<R>]) -> RowDerivative<R> {
    let frame = Frame::new(positions, ring, w);
    let origin = positions[ring[0] as usize];
    let mut out = RowDerivative {
        normal: frame.normal,
        inverse_length: frame.inverse_length,
        offset: R::ZERO,
        g: zero(),
        h: zero(),
    };
    let mut kappa = R::ZERO;
    for k in 0..ring.len() {
        let p = sub(positions[ring[k] as usize], origin);
        let (r, along, d) = frame.offset(p);
        let wb = w[k] * b[k];
        // All neighbours at one place: no direction.
        let over = if d > R::ZERO { R::ONE / d } else { R::ZERO };
        let u = scale(add_scaled(r, frame.normal, R::ZERO - along), over);
        out.offset += wb * d;
        out.g = add_scaled(out.g, u, wb);
        out.h = add_scaled(out.h, u, wb * along);
        z[k] = scale(u, R::ZERO - wb);
        kappa += wb * over;
    }
    kappa *= R::of(REGULARISATION * REGULARISATION / ring.len() as f64);
    for k in 0..ring.len() {
        let p = sub(positions[ring[k] as usize], origin);
        z[k] = add_scaled(z[k], sub(p, frame.mean), kappa);
    }
    out
}

/// v_{k+1} - v_{k-1} around a ring.
#[inline(always)]
fn chord<R: Real>(positions: &[V3<R>], ring: &[u32], k: usize) -> V3<R> {
    let m = ring.len();
    let next = if k + 1 == m { 0 } else { k + 1 };
    let before = if k == 0 { m - 1 } else { k - 1 };
    sub(positions[ring[next] as usize], positions[ring[before] as usize])
}

/// y = (I - dF) x for every row; `direction` has an entry a vertex, zero where it is held. CPU
/// reference of the kernel `encoding_apply`.
pub fn encoding_apply<R: Real>(
    stencils: &Stencils,
    encoding: &Encoding<R>,
    at: &Linearisation<R>,
    positions: &[V3<R>],
    direction: &[V3<R>],
    out: &mut [V3<R>],
) {
    out.par_chunks_mut(BLOCK).enumerate().for_each(|(block, out)| {
        for (row, y) in (block * BLOCK..).zip(out) {
            let slots = stencils.slots(row);
            let (ring, w) = (&stencils.neighbour[slots.clone()], &encoding.w[slots.clone()]);
            let (d, z) = (&at.rows[row], &at.z[slots]);
            let (mut dq, mut dc, mut ds) = (zero(), zero(), R::ZERO);
            for k in 0..ring.len() {
                let x = direction[ring[k] as usize];
                dq = add_scaled(dq, x, w[k]);
                dc = add(dc, cross(chord(positions, ring, k), x));
                ds += dot(z[k], x);
            }
            let dn = scale(add_scaled(dc, d.normal, R::ZERO - dot(d.normal, dc)), d.inverse_length);
            let ds = ds + dot(d.g, dq) - dot(d.h, dn);
            let df = add(dq, add_scaled(scale(dn, d.offset), d.normal, ds));
            *y = sub(direction[stencils.vertex[row] as usize], df);
        }
    });
}

/// What a row passes on to its neighbours in the transposed product: n.y, yc = N (offset y - (n.y)
/// h) / L and yq = y + (n.y) g.
#[derive(Clone, Copy, Debug, Default)]
pub struct RowTranspose<R> {
    along: R,
    curl: V3<R>,
    mean: V3<R>,
}

/// out = (I - dF)ᵀ y for the vertices from `held` on; `y` has an entry a row. CPU reference of the
/// kernel `encoding_apply_transpose`: a sweep over the rows, then a gather over the slots that name
/// a vertex.
#[expect(clippy::too_many_arguments, reason = "the bindings of the kernel")]
pub fn encoding_apply_transpose<R: Real>(
    stencils: &Stencils,
    encoding: &Encoding<R>,
    at: &Linearisation<R>,
    positions: &[V3<R>],
    y: &[V3<R>],
    held: usize,
    scratch: &mut Vec<RowTranspose<R>>,
    out: &mut [V3<R>],
) {
    scratch.resize(stencils.row_count(), RowTranspose::default());
    scratch.par_chunks_mut(BLOCK).enumerate().for_each(|(block, part)| {
        for (row, t) in (block * BLOCK..).zip(part) {
            let d = &at.rows[row];
            let along = dot(d.normal, y[row]);
            let c = add_scaled(scale(y[row], d.offset), d.h, R::ZERO - along);
            let curl = scale(add_scaled(c, d.normal, R::ZERO - dot(d.normal, c)), d.inverse_length);
            *t = RowTranspose { along, curl, mean: add_scaled(y[row], d.g, along) };
        }
    });
    out[..held].iter_mut().for_each(|x| *x = zero());
    out[held..].par_chunks_mut(BLOCK).enumerate().for_each(|(block, out)| {
        for (v, x) in (held + block * BLOCK..).zip(out) {
            let own = stencils.row_of[v];
            let mut sum = if own == NONE { zero() } else { y[own as usize] };
            for &slot in stencils.incoming(v) {
                let (slot, row) = (slot as usize, stencils.slot_row[slot as usize] as usize);
                let t = &scratch[row];
                let a = chord(positions, stencils.ring(row), slot - stencils.start[row] as usize);
                let part = add_scaled(scale(t.mean, encoding.w[slot]), at.z[slot], t.along);
                sum = sub(sum, add(part, cross(t.curl, a)));
            }
            *x = sum;
        }
    });
}

/// dF/dv for every slot, row-major: the blocks that the direct solver and the CPU's conjugate
/// gradients read.
pub(crate) fn blocks(
    stencils: &Stencils,
    encoding: &Encoding<f64>,
    at: &Linearisation<f64>,
    positions: &[V3<f64>],
) -> Vec<[f64; 9]> {
    let mut out = vec![[0.0; 9]; stencils.neighbour.len()];
    out.par_chunks_mut(8 * BLOCK).enumerate().for_each(|(chunk, out)| {
        for (slot, block) in (chunk * 8 * BLOCK..).zip(out) {
            let row = stencils.slot_row[slot] as usize;
            let d = &at.rows[row];
            let a = chord(positions, stencils.ring(row), slot - stencils.start[row] as usize);
            let along = add_scaled(at.z[slot], d.g, encoding.w[slot]);
            // N/L [a]x, column by column: N (a x e_c) / L.
            for c in 0..3 {
                let mut e = [0.0; 3];
                e[c] = 1.0;
                let t = cross(a, e);
                let dn = scale(add_scaled(t, d.normal, -dot(d.normal, t)), d.inverse_length);
                let ds = along[c] - dot(d.h, dn);
                for r in 0..3 {
                    block[3 * r + c] =
                        d.normal[r] * ds + d.offset * dn[r] + if r == c { encoding.w[slot] } else { 0.0 };
                }
            }
        }
    });
    out
}

#[cfg(test)]
mod tests {
    use super::super::Connectivity;
    use super::super::decode::{encoding_residual, ring_value};
    use super::super::encode::Encoded;
    use super::super::vector::length;
    use super::*;
    use crate::models::shapes::{Diagonal, Random, lobed_sphere, plane_grid};

    fn case() -> (Encoded, Vec<V3<f64>>) {
        let mesh = lobed_sphere(2, 0.5);
        let rest: Vec<V3<f64>> = mesh.positions.iter().map(|p| p.to_array()).collect();
        let encoded = Encoded::new(&Connectivity::new(&mesh).rings, &rest, |_| true);
        let mut random = Random::new(5);
        let bent = rest.iter().map(|p| p.map(|x| x + 0.05 * random.signed())).collect();
        (encoded, bent)
    }

    #[test]
    fn the_derivative_is_the_limit_of_differences() {
        let (encoded, x) = case();
        let (s, e) = (&encoded.stencils, &encoded.encoding);
        let blocks = blocks(s, e, &Linearisation::new(s, e, &x), &x);
        let f = |row: usize, x: &[V3<f64>]| ring_value(x, s.ring(row), &e.w[s.slots(row)], &e.b[s.slots(row)]);
        let step = 1e-5;
        let mut worst = 0.0_f64;
        for row in (0..s.row_count()).step_by(7) {
            for slot in s.slots(row) {
                for c in 0..3 {
                    let moved = |by: f64| {
                        let mut x = x.clone();
                        x[s.neighbour[slot] as usize][c] += by;
                        f(row, &x)
                    };
                    let d = scale(sub(moved(step), moved(-step)), 0.5 / step);
                    for r in 0..3 {
                        worst = worst.max((blocks[slot][3 * r + c] - d[r]).abs());
                    }
                }
            }
        }
        assert!(worst < 1e-8, "{worst}");
    }

    #[test]
    fn products_are_those_of_the_blocks_and_adjoint() {
        let (encoded, x) = case();
        let (s, e) = (&encoded.stencils, &encoded.encoding);
        let at = Linearisation::new(s, e, &x);
        let blocks = blocks(s, e, &at, &x);
        let held = 5;
        let mut random = Random::new(9);
        let mut vector = || [random.signed(), random.signed(), random.signed()];
        let mut direction: Vec<V3<f64>> = x.iter().map(|_| vector()).collect();
        direction[..held].iter_mut().for_each(|d| *d = [0.0; 3]);
        let y: Vec<V3<f64>> = (0..s.row_count()).map(|_| vector()).collect();
        let mut forward = vec![[0.0; 3]; s.row_count()];
        encoding_apply(s, e, &at, &x, &direction, &mut forward);
        for row in 0..s.row_count() {
            let mut expected = direction[s.vertex[row] as usize];
            for slot in s.slots(row) {
                let d = direction[s.neighbour[slot] as usize];
                for r in 0..3 {
                    expected[r] -= (0..3).map(|c| blocks[slot][3 * r + c] * d[c]).sum::<f64>();
                }
            }
            assert!(length(sub(expected, forward[row])) < 1e-13);
        }
        let mut back = vec![[0.0; 3]; x.len()];
        encoding_apply_transpose(s, e, &at, &x, &y, held, &mut Vec::new(), &mut back);
        let left: f64 = forward.iter().zip(&y).map(|(a, b)| dot(*a, *b)).sum();
        let right: f64 = direction.iter().zip(&back).map(|(a, b)| dot(*a, *b)).sum();
        assert!((left - right).abs() < 1e-12 * left.abs().max(1.0), "{left} {right}");
        // A wrong product must not pass.
        back[held + 3][1] += 1e-6;
        let wrong: f64 = direction.iter().zip(&back).map(|(a, b)| dot(*a, *b)).sum();
        assert!((left - wrong).abs() > 1e-9);
    }

    #[test]
    fn single_precision_follows_double() {
        let mesh = plane_grid(9, 7, 1.0, 0.8, Diagonal::Forward);
        let far: Vec<V3<f64>> = mesh.positions.iter().map(|p| [p.x + 100.0, p.y, (5.0 * p.x).sin()]).collect();
        let near: Vec<V3<f64>> = far.iter().map(|p| p.map(|x| f64::from(x as f32))).collect();
        let encoded = Encoded::new(&Connectivity::new(&mesh).rings, &near, |_| true);
        let single = encoded.encoding.to_precision::<f32>();
        let x: Vec<V3<f32>> = near.iter().map(|p| p.map(|x| x as f32)).collect();
        let mut residual = vec![[0f32; 3]; encoded.stencils.row_count()];
        encoding_residual(&encoded.stencils, &single, &x, &mut residual);
        // Ring-local arithmetic: errors are of the size of an edge (0.15) times the precision, plus
        // one rounding of the result.
        let worst = residual.iter().flatten().fold(0f32, |a, b| a.max(b.abs()));
        assert!(worst <= 1.6e-5, "{worst}");
    }
}
