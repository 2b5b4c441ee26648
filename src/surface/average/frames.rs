//! Query points for the sweep: from surface points to embedded points and orthonormal bases of
//! their planes.

use super::orthonormalise;
use crate::engine::lane::MAX_LANES;
use crate::engine::{Lane, LaneScalar, Lanes, Real, Sweep, TILE};
use crate::surface::{PackedPoint, PhongSurface};

/// Fills tiles for [`super::average_tiles`]: y and the orthonormalised Psi of every point, 3 D rows
/// of [`TILE`] numbers per tile.
///
/// `input` is resized to whole tiles, with zeros behind the last point. A point whose face is not
/// one of the surface becomes the origin with some orthonormal basis. The same as
/// `orthonormalise(triangle.psi(x))` up to rounding: Psi is evaluated point by point (its gathers
/// would not profit from lanes), the basis then in lanes. Time O(D) per point.
pub fn frame_tiles<E: LaneScalar, const D: usize>(
    lanes: Lanes,
    surface: &PhongSurface<E, D>,
    points: &[PackedPoint],
    input: &mut Vec<E>,
) {
    input.clear();
    input.resize(points.len().div_ceil(TILE) * 3 * D * TILE, E::ZERO);
    lanes.run(FrameTiles { surface, points, input });
}

struct FrameTiles<'a, E, const D: usize> {
    surface: &'a PhongSurface<E, D>,
    points: &'a [PackedPoint],
    input: &'a mut [E],
}

impl<E: LaneScalar, const D: usize> Sweep<E> for FrameTiles<'_, E, D> {
    #[inline(always)]
    fn run<L: Lane<E = E>>(self, cpu: L::Cpu) {
        // Point by point first: the compiler vectorises along the D components only where they are
        // stored together.
        let mut rows = vec![[[E::ZERO; D]; 3]; TILE];
        for (points, tile) in self.points.chunks(TILE).zip(self.input.chunks_exact_mut(3 * D * TILE)) {
            for (point, row) in points.iter().zip(&mut rows) {
                if point.face as usize >= self.surface.triangles.len() {
                    *row = [[E::ZERO; D]; 3];
                    continue;
                }
                let (b0, b1) = (E::of(f64::from(point.b0)), E::of(f64::from(point.b1)));
                let x = [b0, b1, E::ONE - b0 - b1];
                let triangle = self.surface.triangle(point.face);
                row[0] = triangle.point(&x);
                [row[1], row[2]] = triangle.psi(&x);
            }
            for (i, row) in rows[..points.len()].iter().enumerate() {
                for k in 0..D {
                    tile[k * TILE + i] = row[0][k];
                    tile[(D + k) * TILE + i] = row[1][k];
                    tile[(2 * D + k) * TILE + i] = row[2][k];
                }
            }
            for at in (0..TILE).step_by(L::N) {
                make_orthonormal::<L, D>(cpu, &mut tile[D * TILE..], at, points.len());
            }
        }
    }
}

/// [`orthonormalise`] on the two rows of a group of points; of the tile's points, only the first
/// `count` are real.
#[inline(always)]
fn make_orthonormal<L: Lane, const D: usize>(cpu: L::Cpu, psi: &mut [L::E], at: usize, count: usize) {
    let zero = L::num(cpu, 0.0);
    let one = L::num(cpu, 1.0);
    let (mut b0, mut b1) = ([zero; D], [zero; D]);
    let (mut s0, mut s1) = (zero, zero);
    for k in 0..D {
        b0[k] = L::load(cpu, &psi[k * TILE + at..]);
        b1[k] = L::load(cpu, &psi[(D + k) * TILE + at..]);
        s0 = b0[k].mul_add(b0[k], s0);
        s1 = b1[k].mul_add(b1[k], s1);
    }
    let inverse = one / s0.sqrt();
    for b in &mut b0 {
        *b = *b * inverse;
    }
    let mut rest = zero;
    // Twice, so that the result is orthogonal to rounding at any angle.
    for _ in 0..2 {
        let mut along = zero;
        for k in 0..D {
            along = b0[k].mul_add(b1[k], along);
        }
        rest = zero;
        for k in 0..D {
            b1[k] = (-along).mul_add(b0[k], b1[k]);
            rest = b1[k].mul_add(b1[k], rest);
        }
    }
    let inverse = one / rest.sqrt();

    // Planes that two nearly parallel rows leave undetermined, or vanishing rows, are rare: one by
    // one.
    let tiny = L::splat(cpu, L::E::ONE / L::E::HUGE);
    let sound = (L::num(cpu, 1e-6) * s1).maximum(tiny).lt(rest);
    let mut flags = [L::E::ZERO; MAX_LANES];
    L::select(sound, L::select(tiny.lt(s0), one, zero), zero).store(&mut flags);
    let mut mended = [None; MAX_LANES];
    for lane in 0..L::N {
        if flags[lane] < L::E::ONE && at + lane < count {
            let row = |r: usize| -> [L::E; D] { std::array::from_fn(|k| psi[(r * D + k) * TILE + at + lane]) };
            mended[lane] = Some(orthonormalise([row(0), row(1)]));
        }
    }
    for k in 0..D {
        b0[k].store(&mut psi[k * TILE + at..]);
        (b1[k] * inverse).store(&mut psi[(D + k) * TILE + at..]);
    }
    for lane in 0..L::N {
        if flags[lane] < L::E::ONE {
            let basis = mended[lane].unwrap_or([[L::E::ZERO; D]; 2]);
            for k in 0..D {
                psi[k * TILE + at + lane] = basis[0][k];
                psi[(D + k) * TILE + at + lane] = basis[1][k];
            }
        }
    }
}
