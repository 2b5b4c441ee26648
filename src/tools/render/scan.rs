//! Which rows of samples hold a sample of a triangle, and where.
//!
//! The box around a needle is nearly empty, and most of the rows that it crosses hold none of its
//! samples. Rows are passed over eight at a time in single precision, with the rounding added to
//! the span; what a row holds is decided in double precision.

use std::ops::Range;

use glam::DVec2;

/// Slack of spans in parts of the largest coordinate: a few times the rounding of an interpolation
/// in double precision, far below a sample.
const SLACK: f64 = 1e-12;

/// Rounding of [`Course::rows_that_may_hold`] in parts of the largest coordinate `L`. The middle is
/// `m + k d` with `|m| <= L + 1/2`, `|k d| <= 2 L`: three roundings of numbers (2^-24 each: `m`,
/// `d`, the product) and that of the sum add up to less than 8 L 2^-24, and so do those of half the
/// width; adding and taking away [`TO_WHOLE`] is exact but for the choice at halves.
const SINGLE_SLACK: f64 = 16.0 / (1u32 << 24) as f64;

/// Added and taken away again, it leaves the nearest whole number: between 2^23 and 2^24 floats are
/// whole. A conversion takes several times as long. Where coordinates are too large for it, from
/// 2^22 on, [`SINGLE_SLACK`] exceeds one, and every row may hold a sample.
const TO_WHOLE: f32 = 1.5 * (1u32 << 23) as f32;

/// Rows that are looked at together.
const LANES: usize = 8;

/// The courses of a triangle's sides from row to row.
pub(super) struct Scan {
    /// From the lowest to the highest row.
    p: [DVec2; 3],
    /// Steps along x per row: of the side from the first corner to the last, from the first to the
    /// second, from the second to the last.
    steps: [f64; 3],
    /// The largest coordinate.
    largest: f64,
}

impl Scan {
    pub(super) fn new(mut p: [DVec2; 3]) -> Self {
        for (i, j) in [(0, 1), (1, 2), (0, 1)] {
            if p[j].y < p[i].y {
                p.swap(i, j);
            }
        }
        // A side within a row is met at its end points alone.
        let step = |a: DVec2, b: DVec2| if b.y > a.y { (b.x - a.x) / (b.y - a.y) } else { 0.0 };
        let largest = p.iter().map(|p| p.abs().max_element()).fold(0.0, f64::max);
        Self { p, steps: [step(p[0], p[2]), step(p[0], p[1]), step(p[1], p[2])], largest }
    }

    /// First and last place that the triangle may own in the row at `y`, which meets it; wider than
    /// it by more than rounding.
    pub(super) fn span(&self, y: f64) -> (f64, f64) {
        let [a, b, _] = self.p;
        let through = a.x + (y - a.y) * self.steps[0];
        let around = if y < b.y { a.x + (y - a.y) * self.steps[1] } else { b.x + (y - b.y) * self.steps[2] };
        let (left, right) = if through < around { (through, around) } else { (around, through) };
        let slack = SLACK * self.largest;
        (left - slack, right + slack)
    }

    /// The courses through the rows from `y0` to `y1`, which all meet the triangle: down to its
    /// middle corner, and from there on.
    pub(super) fn courses(&self, y0: usize, y1: usize) -> [Course; 2] {
        // The first row whose samples are not above the middle corner.
        let bend = at_or_above(self.p[1].y - 0.5).clamp(y0, y1 + 1);
        [self.course(y0..bend, 0, 1), self.course(bend..y1 + 1, 1, 2)]
    }

    /// The course through some rows between the longest side and `side`, which begins at `corner`.
    fn course(&self, rows: Range<usize>, corner: usize, side: usize) -> Course {
        let y = rows.start as f64 + 0.5;
        let through = self.p[0].x + (y - self.p[0].y) * self.steps[0];
        let around = self.p[corner].x + (y - self.p[corner].y) * self.steps[side];
        Course {
            rows,
            middle: (0.5 * (through + around) - 0.5) as f32,
            middle_step: (0.5 * (self.steps[0] + self.steps[side])) as f32,
            half: (0.5 * (around - through)) as f32,
            half_step: (0.5 * (self.steps[side] - self.steps[0])) as f32,
            slack: (SINGLE_SLACK * (self.largest + 1.0)) as f32,
        }
    }
}

/// The first whole number that is not below `x`, nor below zero: `ceil` is a call where the
/// processor's least features are assumed.
pub(super) fn at_or_above(x: f64) -> usize {
    let whole = x as usize;
    whole.saturating_add(usize::from((whole as f64) < x))
}

/// The span of a triangle in a row and its change from row to row, between two of its corners.
pub(super) struct Course {
    rows: Range<usize>,
    /// Its middle, less half a sample.
    middle: f32,
    middle_step: f32,
    /// Half of its width, negative where the longest side is on its right.
    half: f32,
    half_step: f32,
    slack: f32,
}

impl Course {
    /// Rows that may hold a sample, by eights.
    pub(super) fn groups(&self) -> impl Iterator<Item = Rows> + '_ {
        self.rows.clone().step_by(LANES).map(|y| {
            let some = (self.rows.end - y).min(LANES);
            let all = (1 << some) - 1;
            // A few rows are not worth looking ahead.
            let bits = if some < LANES / 2 { all } else { self.rows_that_may_hold((y - self.rows.start) as f32) & all };
            Rows { y, bits }
        })
    }

    /// A bit for each of the rows from `first` on, counted from the row of the course's start: set
    /// where the span may reach a centre of a sample.
    #[inline]
    fn rows_that_may_hold(&self, first: f32) -> u32 {
        let mut bits = 0;
        for k in 0..LANES {
            let row = first + k as f32;
            let middle = self.middle + row * self.middle_step;
            let half = (self.half + row * self.half_step).abs() + self.slack;
            let nearest = (middle + TO_WHOLE) - TO_WHOLE;
            // What is not finite may hold one.
            let empty = (middle - nearest).abs() > half;
            bits |= if empty { 0 } else { 1 << k };
        }
        bits
    }
}

/// Rows from `y` on, one for each bit that is set.
pub(super) struct Rows {
    y: usize,
    bits: u32,
}

impl Iterator for Rows {
    type Item = usize;

    #[inline]
    fn next(&mut self) -> Option<usize> {
        let k = self.bits.trailing_zeros();
        self.bits &= self.bits.wrapping_sub(1);
        (k < u32::BITS).then_some(self.y + k as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(scan: &Scan, y0: usize, y1: usize) -> Vec<usize> {
        scan.courses(y0, y1).iter().flat_map(|course| course.groups().flatten().collect::<Vec<_>>()).collect()
    }

    /// Rows of `scan` from `y0` to `y1` whose exact span holds a centre of a sample.
    fn exact(scan: &Scan, y0: usize, y1: usize) -> Vec<usize> {
        let holds = |y: &usize| {
            let (left, right) = scan.span(*y as f64 + 0.5);
            (left - 0.5).ceil() <= right - 0.5
        };
        (y0..=y1).filter(holds).collect()
    }

    #[test]
    fn no_row_with_a_sample_is_passed_over_and_few_others_are_not() {
        let (mut all, mut held, mut kept, mut courses) = (0, 0, 0, 0);
        for size in [10.0, 1500.0, 60_000.0] {
            for k in 0..600 {
                let angle = f64::from(k) / 600.0 * std::f64::consts::TAU;
                let middle = DVec2::splat(0.5 * size) + DVec2::new(0.0, 0.5 * f64::from(k % 2));
                let tip = middle + 0.49 * size * DVec2::from_angle(angle);
                let side = DVec2::from_angle(angle + 1.5) * [1e-3, 0.05, 0.9][k as usize % 3];
                let p = [middle, tip, tip + side];
                let low = p.iter().map(|p| p.y).fold(f64::INFINITY, f64::min);
                let high = p.iter().map(|p| p.y).fold(f64::NEG_INFINITY, f64::max);
                let (y0, y1) = ((low - 0.5).ceil() as usize, (high - 0.5).floor() as usize);
                if y0 > y1 {
                    continue;
                }
                let scan = Scan::new(p);
                let seen = rows(&scan, y0, y1);
                let expected = exact(&scan, y0, y1);
                assert!(seen.is_sorted(), "needle {k} of {size}");
                assert!(expected.iter().all(|y| seen.binary_search(y).is_ok()), "needle {k} of {size}");
                assert!(seen.iter().all(|y| (y0..=y1).contains(y)));
                if size < 1e4 {
                    all += y1 + 1 - y0;
                    held += expected.len();
                    kept += seen.len();
                    courses += 2;
                }
            }
        }
        // A row is kept in vain where a centre is within the slack of the span, 0.0015 samples at
        // 1,500: twice that in a row. The last three of a course are not looked at.
        assert!(kept - held <= all / 200 + 3 * courses, "{kept} kept of {all}, {held} hold a sample");
        assert!(held < all / 2);
    }

    #[test]
    fn where_single_precision_ends_every_row_may_hold_a_sample() {
        for size in [1e7, 1e30, 1e39, 1e200] {
            let p = [DVec2::new(-size, 0.0), DVec2::new(size, 3.0), DVec2::new(size, 9.0)];
            assert_eq!(rows(&Scan::new(p), 0, 8), (0..9).collect::<Vec<_>>(), "{size}");
        }
    }
}
