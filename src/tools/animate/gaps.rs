//! Gaps of markers, closed so that every marker has a position in every frame.
//!
//! Short gaps inside the clip are interpolated. Over long ones, and at the ends, a marker is
//! released: it is put where the markers around it carry it, as if it were fixed to a rigid body
//! together with them, which passes through its last and its next measured position. The set of
//! anchors never changes, so that nothing is rebuilt.

use glam::DVec3;

use crate::encoding::Similarity;
use crate::error::{Error, Result};
use crate::io::motion::Motion;
use crate::words::words;

/// Markers around one that is released which carry it.
const NEIGHBOURS: usize = 6;

/// How short gaps are closed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// On the cubic curve with the velocities at both ends (Hermite).
    #[default]
    Cubic,
    /// On the straight line.
    Linear,
}

words! { Interpolation, "interpolation", "a way to close gaps":
    Cubic => "cubic",
    Linear => "linear",
}

/// How gaps are closed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GapOptions {
    /// Longest gap that is interpolated, in seconds.
    pub longest: f64,
    /// How.
    pub interpolation: Interpolation,
}

impl Default for GapOptions {
    fn default() -> Self {
        Self { longest: 0.2, interpolation: Interpolation::Cubic }
    }
}

/// What was done about the gaps of one marker.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GapReport {
    /// The marker.
    pub name: String,
    /// Frames that were interpolated.
    pub interpolated: usize,
    /// Frames in which it was released.
    pub released: usize,
    /// Frames of its longest gap.
    pub longest: usize,
}

/// Positions of the points numbered `points` in every frame: `result[frame][k]` is that of
/// `points[k]`. Only markers with gaps are reported.
///
/// A marker is carried by the best rigid motion of its up to six nearest markers between its last
/// (and its next) measured frame and the frame in question; between the two it goes over from one
/// to the other. Fewer than three neighbours carry it without turning; where there are none it
/// stays. O(frames * gaps * points).
///
/// # Errors
/// [`Error::Input`] naming a marker that has no position in any frame.
pub fn close_gaps(
    motion: &Motion,
    points: &[usize],
    options: &GapOptions,
) -> Result<(Vec<Vec<DVec3>>, Vec<GapReport>)> {
    let count = motion.frames.len();
    let measured: Vec<Vec<Option<DVec3>>> =
        points.iter().map(|&p| motion.frames.iter().map(|frame| frame[p]).collect()).collect();
    let mut tracks = measured.clone();
    let mut reports = Vec::new();
    let limit = options.longest * motion.rate;
    let mut long: Vec<(usize, Gap)> = Vec::new();
    for (k, track) in tracks.iter_mut().enumerate() {
        let name = &motion.names[points[k]];
        if measured[k].iter().all(Option::is_none) {
            let what = format!("{}: marker {name} has no position in any of the {count} frames", motion.path.display());
            return Err(Error::input(
                what,
                "Leave it out of the binding, or choose a part of the clip where it is seen",
            ));
        }
        let mut report = GapReport { name: name.clone(), interpolated: 0, released: 0, longest: 0 };
        for gap in gaps(&measured[k]) {
            report.longest = report.longest.max(gap.end - gap.start);
            if gap.inside(count) && (gap.end - gap.start) as f64 <= limit {
                report.interpolated += gap.end - gap.start;
                interpolate(&measured[k], track, gap, options.interpolation);
            } else {
                report.released += gap.end - gap.start;
                long.push((k, gap));
            }
        }
        if report.longest > 0 {
            reports.push(report);
        }
    }
    // Neighbours with short gaps count as measured; those that are released themselves do not carry
    // others.
    let known = tracks.clone();
    for (k, gap) in long {
        for f in gap.start..gap.end {
            tracks[k][f] = Some(carried(&known, k, gap, f, count));
        }
    }
    let closed = (0..count).map(|f| tracks.iter().map(|t| t[f].unwrap_or_default()).collect()).collect();
    Ok((closed, reports))
}

/// Frames without a position, from `start` up to, without, `end`.
#[derive(Clone, Copy)]
struct Gap {
    start: usize,
    end: usize,
}

impl Gap {
    /// Whether there are positions on both sides.
    fn inside(self, count: usize) -> bool {
        self.start > 0 && self.end < count
    }
}

fn gaps(track: &[Option<DVec3>]) -> Vec<Gap> {
    let mut gaps: Vec<Gap> = Vec::new();
    for f in (0..track.len()).filter(|&f| track[f].is_none()) {
        match gaps.last_mut() {
            Some(gap) if gap.end == f => gap.end = f + 1,
            _ => gaps.push(Gap { start: f, end: f + 1 }),
        }
    }
    gaps
}

/// Fills a gap with positions on both sides. A velocity is the difference to the next measured
/// frame outwards, if there is one beside it.
fn interpolate(measured: &[Option<DVec3>], track: &mut [Option<DVec3>], gap: Gap, how: Interpolation) {
    let (Some(a), Some(b)) = (measured[gap.start - 1], measured[gap.end]) else { return };
    let length = (gap.end - gap.start + 1) as f64;
    let before = gap.start.checked_sub(2).and_then(|f| measured[f]).map_or((b - a) / length, |p| a - p);
    let after = measured.get(gap.end + 1).copied().flatten().map_or((b - a) / length, |p| p - b);
    for f in gap.start..gap.end {
        let t = (f + 1 - gap.start) as f64 / length;
        track[f] = Some(match how {
            Interpolation::Linear => a.lerp(b, t),
            Interpolation::Cubic => {
                let s = 1.0 - t;
                a * (s * s * (1.0 + 2.0 * t)) + b * (t * t * (1.0 + 2.0 * s)) + before * (length * t * s * s)
                    - after * (length * t * t * s)
            }
        });
    }
}

/// Where the others carry marker `k` in frame `f` of one of its gaps.
fn carried(known: &[Vec<Option<DVec3>>], k: usize, gap: Gap, f: usize, count: usize) -> DVec3 {
    let from = |reference: usize| {
        let at = known[k][reference].unwrap_or_default();
        let mut around: Vec<(DVec3, DVec3)> =
            known.iter().filter_map(|track| Some((track[reference]?, track[f]?))).collect();
        around.sort_by(|a, b| a.0.distance_squared(at).total_cmp(&b.0.distance_squared(at)));
        around.truncate(NEIGHBOURS);
        if around.len() < 3 {
            let shift: DVec3 = around.iter().map(|(a, b)| *b - *a).sum();
            return at + shift / around.len().max(1) as f64;
        }
        // The rotation and the shift of the fit; bodies do not grow.
        let fit = Similarity::fit(&around);
        let n = around.len() as f64;
        let (a, b) = around.iter().fold((DVec3::ZERO, DVec3::ZERO), |m, p| (m.0 + p.0 / n, m.1 + p.1 / n));
        fit.rotation * (at - a) + b
    };
    match (gap.start.checked_sub(1), Some(gap.end).filter(|&end| end < count)) {
        (Some(last), Some(next)) => {
            let t = (f - last) as f64 / (next - last) as f64;
            from(last).lerp(from(next), t * t * (3.0 - 2.0 * t))
        }
        (Some(only), None) | (None, Some(only)) => from(only),
        (None, None) => DVec3::ZERO,
    }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use glam::DQuat;

    use super::*;

    fn motion(tracks: &[Vec<Option<DVec3>>], rate: f64) -> Motion {
        let frames = (0..tracks[0].len()).map(|f| tracks.iter().map(|t| t[f]).collect()).collect();
        Motion {
            path: PathBuf::from("clip"),
            names: (0..tracks.len()).map(|k| format!("M{k}")).collect(),
            rate,
            frames,
            metres_per_unit: None,
            skeleton: None,
            warnings: Vec::new(),
        }
    }

    #[test]
    fn short_gaps_follow_the_curve() {
        // A cubic in time is reproduced but for the velocities, which are differences; a straight
        // line exactly.
        let line = |f: usize| DVec3::new(f as f64, 2.0 * f as f64, 1.0);
        let curve = |f: usize| DVec3::new((0.1 * f as f64).sin(), 0.0, 0.0);
        let with_gap = |at: &dyn Fn(usize) -> DVec3| -> Vec<Option<DVec3>> {
            (0..30).map(|f| (!(10..15).contains(&f)).then(|| at(f))).collect()
        };
        let clip = motion(&[with_gap(&line), with_gap(&curve)], 100.0);
        for how in [Interpolation::Linear, Interpolation::Cubic] {
            let options = GapOptions { longest: 0.05, interpolation: how };
            let (closed, reports) = close_gaps(&clip, &[0, 1], &options).unwrap();
            assert_eq!(reports[0], GapReport { name: "M0".into(), interpolated: 5, released: 0, longest: 5 });
            let off = |k: usize, at: &dyn Fn(usize) -> DVec3| {
                (0..30).map(|f| closed[f][k].distance(at(f))).fold(0.0, f64::max)
            };
            assert!(off(0, &line) < 1e-12);
            assert!(off(1, &curve) < if how == Interpolation::Cubic { 0.01 } else { 0.05 }, "{}", off(1, &curve));
            if how == Interpolation::Linear {
                assert!(off(1, &curve) > 0.01, "the bound tells the curves apart");
            }
        }
    }

    #[test]
    fn long_gaps_and_ends_are_carried_by_a_rigid_body_exactly() {
        // Eight corners of a cube that turns and travels; one is not seen for most of the time, one
        // not at the beginning.
        let corner = |k: usize| DVec3::new((k & 1) as f64, (k >> 1 & 1) as f64, (k >> 2) as f64);
        let at = |k: usize, f: usize| {
            DQuat::from_rotation_z(0.1 * f as f64) * DQuat::from_rotation_x(0.07 * f as f64) * corner(k)
                + DVec3::X * 0.3 * f as f64
        };
        let seen = |k: usize, f: usize| !((k == 3 && (5..35).contains(&f)) || (k == 6 && f < 12));
        let tracks: Vec<Vec<Option<DVec3>>> =
            (0..8).map(|k| (0..40).map(|f| seen(k, f).then(|| at(k, f))).collect()).collect();
        let points: Vec<usize> = (0..8).collect();
        let (closed, reports) = close_gaps(&motion(&tracks, 100.0), &points, &GapOptions::default()).unwrap();
        for f in 0..40 {
            for k in 0..8 {
                assert!(closed[f][k].distance(at(k, f)) < 1e-9, "marker {k} in frame {f}");
            }
        }
        assert_eq!((reports[0].released, reports[1].released, reports.len()), (30, 12, 2));
        // Alone, a marker stays where it was seen last.
        let (alone, _) = close_gaps(&motion(&tracks[6..7], 100.0), &[0], &GapOptions::default()).unwrap();
        assert_eq!(alone[0][0], at(6, 12));
    }

    #[test]
    fn markers_that_are_never_seen_are_named() {
        let clip = motion(&[vec![Some(DVec3::X); 4], vec![None; 4]], 100.0);
        let message = close_gaps(&clip, &[0, 1], &GapOptions::default()).unwrap_err().to_string();
        assert!(message.contains("M1") && message.contains("clip"), "{message}");
        assert!(close_gaps(&clip, &[0], &GapOptions::default()).unwrap().1.is_empty());
    }
}
