//! Straight-line sweeps written once for scalars and SIMD lanes.
//!
//! A sweep is a struct of slices that implements [`Sweep`]: its `run` is generic over [`Lane`] and
//! reads like scalar code. [`Lanes`] picks the widest instructions of the processor at run time.
//! Three rules keep it fast: `#[inline(always)]` on every generic function a sweep calls (what is
//! not inlined loses the processor's features and becomes tens of times slower); [`Lanes::run`]
//! inside each rayon task, never rayon inside a sweep; data in tiles of [`TILE`] items, component
//! by component, so that no remainder code is needed.

use std::ops::{Add, Div, Mul, Neg, Sub};

use super::Real;

/// Items in a tile: a multiple of every lane count.
pub const TILE: usize = 64;

/// The most lanes there are (AVX-512, single precision).
pub const MAX_LANES: usize = 16;

/// One number, or several that are worked on in step.
pub trait Lane:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// Proof that the processor has the instructions: `()` for scalars.
    type Cpu: Copy + Send + Sync;
    /// The scalar.
    type E: LaneScalar;
    /// The outcome of a comparison, lane by lane.
    type Mask: Copy;
    /// Number of lanes; divides [`TILE`], at most [`MAX_LANES`].
    const N: usize;

    /// `x` in every lane.
    fn splat(cpu: Self::Cpu, x: Self::E) -> Self;
    /// A literal in every lane.
    #[inline(always)]
    fn num(cpu: Self::Cpu, x: f64) -> Self {
        Self::splat(cpu, Self::E::of(x))
    }
    /// The first `N` of `s`.
    fn load(cpu: Self::Cpu, s: &[Self::E]) -> Self;
    /// Into the first `N` of `s`.
    fn store(self, s: &mut [Self::E]);
    /// `self * b + c`, rounded once where the processor does so.
    fn mul_add(self, b: Self, c: Self) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;
    /// Absolute value.
    fn abs(self) -> Self;
    /// The smaller; `b` if `self` is not smaller.
    fn minimum(self, b: Self) -> Self;
    /// The larger; `b` if `self` is not larger.
    fn maximum(self, b: Self) -> Self;
    /// Whether `self` < `b`.
    fn lt(self, b: Self) -> Self::Mask;
    /// `a` where `mask`, else `b`.
    fn select(mask: Self::Mask, a: Self, b: Self) -> Self;
    /// Whether `mask` holds in some lane.
    fn any(cpu: Self::Cpu, mask: Self::Mask) -> bool;
}

/// A loop over tiles, written for any [`Lane`] of scalar `E`.
pub trait Sweep<E> {
    /// Does the work. Mark the implementation `#[inline(always)]`.
    fn run<L: Lane<E = E>>(self, cpu: L::Cpu);
}

/// A scalar that sweeps run on.
pub trait LaneScalar: Real {
    /// Runs `sweep` on the instructions of `lanes`.
    fn run<W: Sweep<Self>>(lanes: Lanes, sweep: W);
}

/// The instructions that sweeps use. Make it once and copy it.
#[derive(Clone, Copy, Debug)]
pub struct Lanes(Option<pulp::Arch>);

impl Lanes {
    /// The widest instructions of this processor.
    pub fn detect() -> Self {
        Self(Some(pulp::Arch::new()))
    }

    /// One number at a time, multiplication and addition rounded apart: the same results on every
    /// processor.
    pub fn scalar() -> Self {
        Self(None)
    }

    /// What a report calls it.
    pub fn name(self) -> String {
        match self.0 {
            None => "scalar".into(),
            Some(arch) => {
                let debug = format!("{arch:?}");
                debug.split(['(', '{', ' ']).next().unwrap_or("lanes").to_lowercase()
            }
        }
    }

    /// Runs `sweep` on the calling thread.
    pub fn run<E: LaneScalar, W: Sweep<E>>(self, sweep: W) {
        E::run(self, sweep);
    }
}

impl Default for Lanes {
    fn default() -> Self {
        Self::detect()
    }
}

/// A sweep as pulp calls it.
struct OnPulp<W>(W);

/// Lanes of `f32`.
#[derive(Clone, Copy)]
struct F32s<S: pulp::Simd> {
    simd: S,
    v: S::f32s,
}

/// Lanes of `f64`.
#[derive(Clone, Copy)]
struct F64s<S: pulp::Simd> {
    simd: S,
    v: S::f64s,
}

/// The scalar instance, and the dispatch, of one element type.
macro_rules! scalar {
    ($t:ident) => {
        impl Lane for $t {
            type Cpu = ();
            type E = $t;
            type Mask = bool;
            const N: usize = 1;
            #[inline(always)]
            fn splat((): (), x: $t) -> Self {
                x
            }
            #[inline(always)]
            fn load((): (), s: &[$t]) -> Self {
                s[0]
            }
            #[inline(always)]
            fn store(self, s: &mut [$t]) {
                s[0] = self;
            }
            #[inline(always)]
            fn mul_add(self, b: Self, c: Self) -> Self {
                // The fused form is a call into the C library where the build does not assume FMA.
                self * b + c
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                <$t>::sqrt(self)
            }
            #[inline(always)]
            fn abs(self) -> Self {
                <$t>::abs(self)
            }
            #[inline(always)]
            fn minimum(self, b: Self) -> Self {
                Real::minimum(self, b)
            }
            #[inline(always)]
            fn maximum(self, b: Self) -> Self {
                Real::maximum(self, b)
            }
            #[inline(always)]
            fn lt(self, b: Self) -> bool {
                self < b
            }
            #[inline(always)]
            fn select(mask: bool, a: Self, b: Self) -> Self {
                if mask { a } else { b }
            }
            #[inline(always)]
            fn any((): (), mask: bool) -> bool {
                mask
            }
        }

        impl LaneScalar for $t {
            fn run<W: Sweep<Self>>(lanes: Lanes, sweep: W) {
                match lanes.0 {
                    Some(arch) => arch.dispatch(OnPulp::<Only<$t, W>>(Only(sweep, std::marker::PhantomData))),
                    None => sweep.run::<$t>(()),
                }
            }
        }
    };
}

/// Says for which element type pulp is to run a sweep.
struct Only<E, W>(W, std::marker::PhantomData<E>);

/// The lanes of one element type, from the names of pulp's operations on it.
macro_rules! lanes {
    ($lane:ident, $e:ident, $v:ident, $mask:ident, $splat:ident, $add:ident, $sub:ident, $mul:ident, $div:ident,
     $fma:ident, $sqrt:ident, $abs:ident, $min:ident, $max:ident, $lt:ident, $select:ident, $first_true:ident) => {
        impl<S: pulp::Simd> Add for $lane<S> {
            type Output = Self;
            #[inline(always)]
            fn add(self, b: Self) -> Self {
                Self { simd: self.simd, v: self.simd.$add(self.v, b.v) }
            }
        }
        impl<S: pulp::Simd> Sub for $lane<S> {
            type Output = Self;
            #[inline(always)]
            fn sub(self, b: Self) -> Self {
                Self { simd: self.simd, v: self.simd.$sub(self.v, b.v) }
            }
        }
        impl<S: pulp::Simd> Mul for $lane<S> {
            type Output = Self;
            #[inline(always)]
            fn mul(self, b: Self) -> Self {
                Self { simd: self.simd, v: self.simd.$mul(self.v, b.v) }
            }
        }
        impl<S: pulp::Simd> Div for $lane<S> {
            type Output = Self;
            #[inline(always)]
            fn div(self, b: Self) -> Self {
                Self { simd: self.simd, v: self.simd.$div(self.v, b.v) }
            }
        }
        impl<S: pulp::Simd> Neg for $lane<S> {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                Self { simd: self.simd, v: self.simd.$sub(self.simd.$splat(0.0), self.v) }
            }
        }

        impl<S: pulp::Simd> Lane for $lane<S> {
            type Cpu = S;
            type E = $e;
            type Mask = S::$mask;
            const N: usize = size_of::<S::$v>() / size_of::<$e>();
            #[inline(always)]
            fn splat(simd: S, x: $e) -> Self {
                Self { simd, v: simd.$splat(x) }
            }
            #[inline(always)]
            fn load(simd: S, s: &[$e]) -> Self {
                Self { simd, v: bytemuck::pod_read_unaligned(bytemuck::cast_slice(&s[..Self::N])) }
            }
            #[inline(always)]
            fn store(self, s: &mut [$e]) {
                bytemuck::cast_slice_mut(&mut s[..Self::N]).copy_from_slice(bytemuck::bytes_of(&self.v));
            }
            #[inline(always)]
            fn mul_add(self, b: Self, c: Self) -> Self {
                Self { simd: self.simd, v: self.simd.$fma(self.v, b.v, c.v) }
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                Self { simd: self.simd, v: self.simd.$sqrt(self.v) }
            }
            #[inline(always)]
            fn abs(self) -> Self {
                Self { simd: self.simd, v: self.simd.$abs(self.v) }
            }
            #[inline(always)]
            fn minimum(self, b: Self) -> Self {
                Self { simd: self.simd, v: self.simd.$min(self.v, b.v) }
            }
            #[inline(always)]
            fn maximum(self, b: Self) -> Self {
                Self { simd: self.simd, v: self.simd.$max(self.v, b.v) }
            }
            #[inline(always)]
            fn lt(self, b: Self) -> S::$mask {
                self.simd.$lt(self.v, b.v)
            }
            #[inline(always)]
            fn select(mask: S::$mask, a: Self, b: Self) -> Self {
                Self { simd: a.simd, v: a.simd.$select(mask, a.v, b.v) }
            }
            #[inline(always)]
            fn any(simd: S, mask: S::$mask) -> bool {
                // The number of lanes if there is none.
                simd.$first_true(mask) < Self::N
            }
        }

        impl<W: Sweep<$e>> pulp::WithSimd for OnPulp<Only<$e, W>> {
            type Output = ();
            #[inline(always)]
            fn with_simd<S: pulp::Simd>(self, simd: S) {
                self.0.0.run::<$lane<S>>(simd);
            }
        }
    };
}

scalar!(f32);
scalar!(f64);
lanes!(
    F32s,
    f32,
    f32s,
    m32s,
    splat_f32s,
    add_f32s,
    sub_f32s,
    mul_f32s,
    div_f32s,
    mul_add_e_f32s,
    sqrt_f32s,
    abs_f32s,
    min_f32s,
    max_f32s,
    less_than_f32s,
    select_f32s,
    first_true_m32s
);
lanes!(
    F64s,
    f64,
    f64s,
    m64s,
    splat_f64s,
    add_f64s,
    sub_f64s,
    mul_f64s,
    div_f64s,
    mul_add_e_f64s,
    sqrt_f64s,
    abs_f64s,
    min_f64s,
    max_f64s,
    less_than_f64s,
    select_f64s,
    first_true_m64s
);

#[cfg(test)]
mod tests {
    use super::*;

    /// Every operation once, so that a wrong name in the table above shows.
    struct Each<'a, E>(&'a [E], &'a [E], &'a mut [Vec<E>]);

    impl<E: LaneScalar> Sweep<E> for Each<'_, E> {
        #[inline(always)]
        fn run<L: Lane<E = E>>(self, cpu: L::Cpu) {
            for i in (0..TILE).step_by(L::N) {
                let (a, b) = (L::load(cpu, &self.0[i..]), L::load(cpu, &self.1[i..]));
                let c = L::num(cpu, 0.25);
                let results = [
                    a + b,
                    a - b,
                    a * b,
                    a / b,
                    -a,
                    a.mul_add(b, c),
                    b.sqrt(),
                    a.abs(),
                    a.minimum(b),
                    a.maximum(b),
                    L::select(a.lt(b), c, L::splat(cpu, E::ONE)),
                ];
                let below = (i..i + L::N).any(|k| self.0[k] < self.1[k]);
                assert_eq!(L::any(cpu, a.lt(b)), below, "lanes from {i}");
                assert!(!L::any(cpu, a.lt(a)));
                for (result, out) in results.into_iter().zip(&mut *self.2) {
                    result.store(&mut out[i..]);
                }
            }
        }
    }

    fn check<E: LaneScalar>() {
        let a: Vec<E> = (0..TILE).map(|i| E::of(i as f64 * 0.5 - 7.25)).collect();
        let b: Vec<E> = (0..TILE).map(|i| E::of((i * i % 19) as f64 * 0.75 + 0.5)).collect();
        for lanes in [Lanes::scalar(), Lanes::detect()] {
            let mut out = vec![vec![E::ZERO; TILE]; 11];
            lanes.run(Each(&a, &b, &mut out));
            for i in 0..TILE {
                let (x, y) = (a[i].to_f64(), b[i].to_f64());
                let select = if x < y { 0.25 } else { 1.0 };
                let expected =
                    [x + y, x - y, x * y, x / y, -x, x * y + 0.25, y.sqrt(), x.abs(), x.min(y), x.max(y), select]
                        .map(E::of);
                // All exact here but quotient and root, which are correctly rounded everywhere.
                assert_eq!(std::array::from_fn(|k| out[k][i]), expected, "item {i} on {}", lanes.name());
            }
        }
    }

    #[test]
    fn every_operation_on_every_lane() {
        check::<f32>();
        check::<f64>();
    }
}
