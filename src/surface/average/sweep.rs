//! Inverse problem and average on SIMD lanes: the fast path of the CPU back end.
//!
//! The weights are those of [`super::weights`]. Unlike the form of the kernel, three numbers are
//! kept per anchor and lane: no offset is computed twice, and nothing is lost in a shift of the
//! moments.

use super::GAMMA;
use super::solve::rank_limit;
use crate::engine::lane::MAX_LANES;
use crate::engine::{Lane, LaneScalar, Lanes, Real, Sweep, TILE};

/// What a sweep reads about the anchors.
#[derive(Clone, Copy, Debug)]
pub struct SweepAnchors<'a, E, const D: usize> {
    /// The anchors in the embedding of the surface that the query points lie on; at least one, at
    /// most 2^24.
    pub own: &'a [[E; D]],
    /// What is averaged: one list per result, each as long as `own`.
    pub images: &'a [&'a [[E; D]]],
    /// Rows of a matrix Q: Q y is added to the average of the first list.
    pub transport: Option<&'a [[E; D]; D]>,
}

/// Averages whole tiles of query points on the calling thread; call it inside each rayon task.
///
/// A tile holds [`TILE`] points component by component. `input`: 3 D rows of [`TILE`] numbers per
/// tile (y, then the two rows of an orthonormal basis). `mean`: D rows per list of `anchors.images`
/// per tile, list after list. Points that only fill up a tile may be anything finite, zeros too.
///
/// Exact on anchors, finite for any finite input in range, any number of anchors from 1 up. Time
/// O(n D) per point; memory 3 n numbers per lane.
///
/// # Panics
/// If the slices do not hold the same number of whole tiles.
pub fn average_tiles<E: LaneScalar, const D: usize>(
    lanes: Lanes,
    anchors: SweepAnchors<'_, E, D>,
    input: &[E],
    mean: &mut [E],
) {
    let tiles = input.len() / (3 * D * TILE);
    assert!(
        input.len() == tiles * 3 * D * TILE
            && mean.len() == tiles * anchors.images.len() * D * TILE
            && anchors.images.iter().all(|image| image.len() == anchors.own.len()),
        "tiles of {} and {} numbers do not belong together",
        input.len(),
        mean.len()
    );
    if anchors.own.is_empty() || anchors.images.is_empty() {
        mean.fill(E::ZERO);
        return;
    }
    let scratch = vec![E::ZERO; 3 * anchors.own.len() * MAX_LANES];
    lanes.run(AverageTiles { anchors, input, mean, scratch });
}

/// Point `i` of tiles made of rows of `D` components, as a vector.
pub fn point_of<E: Copy, const D: usize>(tiles: &[E], i: usize) -> [E; D] {
    let start = i / TILE * D * TILE + i % TILE;
    std::array::from_fn(|k| tiles[start + k * TILE])
}

struct AverageTiles<'a, E, const D: usize> {
    anchors: SweepAnchors<'a, E, D>,
    input: &'a [E],
    mean: &'a mut [E],
    scratch: Vec<E>,
}

impl<E: LaneScalar, const D: usize> Sweep<E> for AverageTiles<'_, E, D> {
    #[inline(always)]
    fn run<L: Lane<E = E>>(mut self, cpu: L::Cpu) {
        let SweepAnchors { own, images, transport } = self.anchors;
        let scratch = &mut self.scratch[..3 * own.len() * L::N];
        let tiles = self.input.chunks_exact(3 * D * TILE).zip(self.mean.chunks_exact_mut(images.len() * D * TILE));
        for (input, mean) in tiles {
            for at in (0..TILE).step_by(L::N) {
                let near = look::<L, D>(cpu, own, input, at, scratch);
                let multipliers = balance::<L>(cpu, &near, scratch);
                let mut sum = L::num(cpu, 0.0);
                for (set, image) in images.iter().enumerate() {
                    let mut mean_of = [L::num(cpu, 0.0); D];
                    if set == 0 {
                        if let Some(matrix) = transport {
                            mean_of = multiply::<L, D>(cpu, matrix, input, at);
                        }
                        sum = weigh::<L, D>(cpu, &multipliers, image, scratch, &mut mean_of);
                    } else {
                        gather::<L, D>(cpu, image, scratch, &mut mean_of);
                    }
                    let rest = L::num(cpu, 1.0) - sum;
                    let out = &mut mean[set * D * TILE..][..D * TILE];
                    for k in 0..D {
                        let mut nearest = [E::ZERO; MAX_LANES];
                        for lane in 0..L::N {
                            nearest[lane] = image[near.index[lane]][k];
                        }
                        rest.mul_add(L::load(cpu, &nearest), mean_of[k]).store(&mut out[k * TILE + at..]);
                    }
                }
            }
        }
    }
}

/// The nearest anchors of a group of points.
struct Nearest<L> {
    /// Index of the nearest anchor, per lane.
    index: [usize; MAX_LANES],
    /// Its place in the plane.
    p: [L; 2],
    /// (D_k / m)^2.
    a: L,
    /// The second smallest D.
    second: L,
}

/// First pass: D and p of every anchor into `scratch` (three rows of lanes per anchor), and the two
/// smallest D.
#[inline(always)]
fn look<L: Lane, const D: usize>(
    cpu: L::Cpu,
    own: &[[L::E; D]],
    input: &[L::E],
    at: usize,
    scratch: &mut [L::E],
) -> Nearest<L> {
    let zero = L::num(cpu, 0.0);
    let gamma = L::num(cpu, GAMMA);
    let (mut y, mut b0, mut b1) = ([zero; D], [zero; D], [zero; D]);
    for k in 0..D {
        y[k] = L::load(cpu, &input[k * TILE + at..]);
        b0[k] = L::load(cpu, &input[(D + k) * TILE + at..]);
        b1[k] = L::load(cpu, &input[(2 * D + k) * TILE + at..]);
    }
    let huge = L::splat(cpu, L::E::HUGE);
    let one = L::num(cpu, 1.0);
    let (mut best, mut second, mut index, mut counter) = (huge, huge, zero, zero);
    for (anchor, slot) in own.iter().zip(scratch.chunks_exact_mut(3 * L::N)) {
        let (mut square, mut px, mut py) = (zero, zero, zero);
        for k in 0..D {
            let v = L::splat(cpu, anchor[k]) - y[k];
            square = v.mul_add(v, square);
            px = v.mul_add(b0[k], px);
            py = v.mul_add(b1[k], py);
        }
        let within = px.mul_add(px, py * py);
        let d = (square - within).maximum(zero).mul_add(gamma, within);
        second = second.minimum(best.maximum(d));
        index = L::select(d.lt(best), counter, index);
        best = best.minimum(d);
        counter = counter + one;
        d.store(slot);
        px.store(&mut slot[L::N..]);
        py.store(&mut slot[2 * L::N..]);
    }

    let mut of = [L::E::ZERO; MAX_LANES];
    index.store(&mut of);
    let mut near = [0; MAX_LANES];
    let (mut x, mut y) = (of, of);
    for lane in 0..L::N {
        near[lane] = of[lane].to_f64() as usize;
        let slot = &mut scratch[3 * L::N * near[lane]..][..3 * L::N];
        (x[lane], y[lane]) = (slot[L::N + lane], slot[2 * L::N + lane]);
        // Infinitely far: its q becomes 0, which takes it out of the sums over the other anchors.
        slot[lane] = L::E::ONE / L::E::ZERO;
    }
    // Two anchors at the point: a = 0 decides, q only has to be finite.
    let second = second.maximum(L::splat(cpu, L::E::ONE / L::E::HUGE));
    let ratio = best / second;
    Nearest { index: near, p: [L::load(cpu, &x), L::load(cpu, &y)], a: ratio * ratio, second }
}

/// w_j = q_j (p_j . mu + base).
struct Multipliers<L> {
    mu: [L; 2],
    base: L,
}

/// Second pass: q in place of D, the moments, and the 2x2 system (see
/// [`super::solve::Multipliers::solve`]).
#[inline(always)]
fn balance<L: Lane>(cpu: L::Cpu, near: &Nearest<L>, scratch: &mut [L::E]) -> Multipliers<L> {
    let zero = L::num(cpu, 0.0);
    let one = L::num(cpu, 1.0);
    let (mut s0, mut sx, mut sy) = (zero, zero, zero);
    let (mut sxx, mut sxy, mut syy) = (zero, zero, zero);
    for slot in scratch.chunks_exact_mut(3 * L::N) {
        let ratio = near.second / L::load(cpu, slot).maximum(near.second);
        let q = ratio * ratio;
        let x = L::load(cpu, &slot[L::N..]) - near.p[0];
        let y = L::load(cpu, &slot[2 * L::N..]) - near.p[1];
        let (qx, qy) = (q * x, q * y);
        s0 = s0 + q;
        sx = sx + qx;
        sy = sy + qy;
        sxx = qx.mul_add(x, sxx);
        sxy = qx.mul_add(y, sxy);
        syy = qy.mul_add(y, syy);
        q.store(slot);
    }
    let rho = near.a / near.a.mul_add(s0, one);
    let (rx, ry) = (rho * sx, rho * sy);
    let (fx, fy) = (-near.p[0] - rx, -near.p[1] - ry);
    let (mxx, mxy, myy) = (sxx - rx * sx, sxy - rx * sy, syy - ry * sy);
    let trace = mxx + myy;
    let limit = L::splat(cpu, rank_limit::<L::E>());
    let noise = limit * (sxx + syy).maximum(trace);
    let some = noise.maximum(L::splat(cpu, L::E::ONE / L::E::HUGE)).lt(trace);
    let scale = L::select(some, one / trace, zero);
    let (xx, xy, yy) = (mxx * scale, mxy * scale, myy * scale);
    let determinant = xx * yy - xy * xy;
    let regular = (noise * scale).lt(determinant);
    let f = scale / determinant;
    let mut mu = [(yy * fx - xy * fy) * f, (xx * fy - xy * fx) * f];
    mu[0] = L::select(regular, mu[0], (xx * fx + xy * fy) * scale);
    mu[1] = L::select(regular, mu[1], (xy * fx + yy * fy) * scale);
    let t = rho * (one - sx * mu[0] - sy * mu[1]);
    Multipliers { mu, base: t - near.p[0] * mu[0] - near.p[1] * mu[1] }
}

/// Third pass: the weights, kept in place of q, and the average of the first list added to `mean`.
/// Returns the sum of the weights of the anchors other than the nearest.
#[inline(always)]
fn weigh<L: Lane, const D: usize>(
    cpu: L::Cpu,
    multipliers: &Multipliers<L>,
    image: &[[L::E; D]],
    scratch: &mut [L::E],
    mean: &mut [L; D],
) -> L {
    let mut sum = L::num(cpu, 0.0);
    let Multipliers { mu, base } = multipliers;
    for (image, slot) in image.iter().zip(scratch.chunks_exact_mut(3 * L::N)) {
        let (x, y) = (L::load(cpu, &slot[L::N..]), L::load(cpu, &slot[2 * L::N..]));
        let w = L::load(cpu, slot) * x.mul_add(mu[0], y.mul_add(mu[1], *base));
        sum = sum + w;
        for k in 0..D {
            mean[k] = w.mul_add(L::splat(cpu, image[k]), mean[k]);
        }
        w.store(slot);
    }
    sum
}

/// Q y.
#[inline(always)]
fn multiply<L: Lane, const D: usize>(cpu: L::Cpu, matrix: &[[L::E; D]; D], input: &[L::E], at: usize) -> [L; D] {
    let mut product = [L::num(cpu, 0.0); D];
    for k in 0..D {
        let y = L::load(cpu, &input[k * TILE + at..]);
        for r in 0..D {
            product[r] = y.mul_add(L::splat(cpu, matrix[r][k]), product[r]);
        }
    }
    product
}

/// The average of a further list with the weights that [`weigh`] left.
#[inline(always)]
fn gather<L: Lane, const D: usize>(cpu: L::Cpu, image: &[[L::E; D]], scratch: &[L::E], mean: &mut [L; D]) {
    for (image, slot) in image.iter().zip(scratch.chunks_exact(3 * L::N)) {
        let w = L::load(cpu, slot);
        for k in 0..D {
            mean[k] = w.mul_add(L::splat(cpu, image[k]), mean[k]);
        }
    }
}
