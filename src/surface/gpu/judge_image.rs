//! Host half of the kernel `judge_image`, and its reference: whether the image of a texel's point
//! can be trusted.
//!
//! The verdict is that of [`HostMap::judge`](super::HostMap::judge), and of what the map is wrapped
//! in ([`Doubts`]), in single precision. A confidence is `1 / (1 + r^2)`, `r` being a residual, a
//! drift or a round trip over the value at which it is one half. Three roundings of `r` and two of
//! the rest are within [`JUDGE_ROUNDING`]: what is nearer than that to the threshold is left to the
//! reference, and beyond it both decide alike.

use bytemuck::{Pod, Zeroable};

use super::project_phong::Projected;
use crate::engine::{BindingKind, Kernel, Layout};
use crate::geometry::NONE;
use crate::kernel_layout as layout;
use crate::surface::correspondence::{DOUBT, Vouching};
use crate::surface::packed::{Doubts, PackedImage, PackedPoint, Status};
use crate::surface::project::Found;

/// What a confidence may be off by in single precision: `|d/dr 1 / (1 + r^2)| r <= 1/2` times the
/// relative error of `r` (a weighted sum of three drifts whose weights are rounded, a division),
/// and the roundings of the quotient.
pub const JUDGE_ROUNDING: f32 = 8.0 * f32::EPSILON;

/// Drifts beyond this are no different: their squares stay finite in single precision.
const LARGEST_DRIFT: f64 = 1e12;

/// Parameters of the kernel; twin of the struct in `shaders/judge_image.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct JudgeParams {
    unit: f32,
    residual: f32,
    drift: f32,
    round_trip: f32,
    threshold: f32,
    doubt: f32,
    guard: f32,
    slack: f32,
    faces: u32,
    evidence: u32,
    returns: u32,
    margin: f32,
}

const LAYOUTS: &[Layout] = &[
    layout!(JudgeParams, {
        unit, residual, drift, round_trip, threshold, doubt, guard, slack, faces, evidence, returns, margin
    }),
    layout!(Projected, { face, b0, b1, distance_squared, found }),
    layout!(PackedImage, { face, b0, b1, confidence, status }),
];

pub(super) static JUDGE_IMAGE: Kernel = Kernel {
    name: "judge_image",
    source: include_str!("../../../shaders/judge_image.wgsl"),
    bindings: &[
        BindingKind::Uniform(size_of::<JudgeParams>() as u64),
        BindingKind::Read,
        BindingKind::Read,
        BindingKind::Read,
        BindingKind::Write,
        BindingKind::Table,
    ],
    layouts: LAYOUTS,
    items: 1,
    constants: &[],
};

impl JudgeParams {
    /// The parameters of a map, with a second projection or without.
    pub fn new(v: &Vouching, returns: bool) -> Self {
        Self {
            unit: v.unit as f32,
            residual: v.trust.residual as f32,
            drift: v.trust.drift as f32,
            round_trip: v.trust.round_trip as f32,
            threshold: v.trust.threshold as f32,
            doubt: DOUBT,
            guard: v.guard.map_or(f32::MAX, |g| (g * g) as f32),
            slack: PackedImage::SLACK,
            faces: v.faces as u32,
            evidence: u32::from(v.evidence),
            returns: u32::from(returns),
            margin: JUDGE_ROUNDING,
        }
    }
}

/// What is known of a triangle of the target: the drift at its corners, and its doubts.
pub(super) fn vouch_record(drift: [f64; 3], doubts: u32) -> [u32; 4] {
    let [a, b, c] = drift.map(|d| (d.min(LARGEST_DRIFT) as f32).to_bits());
    [a, b, c, doubts]
}

/// The image of `point` from its projection, and from the second one where there is one. `vouch` is
/// the record of the point's triangle.
pub fn judge_image(
    params: &JudgeParams,
    point: PackedPoint,
    forward: &Projected,
    back: Option<&Projected>,
    vouch: [u32; 4],
) -> PackedImage {
    if point.face == NONE {
        return PackedImage::NOWHERE;
    }
    let missing = |p: &Projected| [Found::Nothing as u32, Projected::LEFT].contains(&(p.found & Projected::HOW));
    if missing(forward) || !(forward.distance_squared <= params.guard) || back.is_some_and(missing) {
        return PackedImage { status: PackedImage::LEFT, ..PackedImage::NOWHERE };
    }
    let x = [point.b0, point.b1, 1.0 - point.b0 - point.b1];
    let falling = |x: f32, half: f32| {
        let r = x / half;
        1.0 / (1.0 + r * r)
    };
    let mut confidence = 1.0_f32;
    if params.evidence == 1 {
        let drift = (0..3).map(|k| x[k] * f32::from_bits(vouch[k])).sum::<f32>().max(0.0);
        let residual = forward.distance_squared.sqrt() * params.unit;
        confidence = falling(residual, params.residual).min(falling(drift, params.drift));
        if let Some(back) = back {
            confidence = confidence.min(falling(back.distance_squared.sqrt(), params.round_trip));
        }
    }
    let mut status = if confidence >= params.threshold { Status::Valid } else { Status::Doubtful };
    let corner = (0..3).any(|k| x[k] == 1.0 && vouch[3] & (Doubts::TURNED << (k + 1)) != 0);
    if vouch[3] & Doubts::TURNED != 0 || corner {
        confidence = confidence.min(params.doubt);
        status = Status::Doubtful;
    }
    if (confidence - params.threshold).abs() <= params.margin {
        return PackedImage { status: PackedImage::LEFT, ..PackedImage::NOWHERE };
    }
    let Projected { face, b0, b1, .. } = *forward;
    PackedImage { face, b0, b1, confidence, status: status as u32 }.checked(params.faces as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::shapes::Random;
    use crate::surface::correspondence::{Evidence, Trust};

    fn vouching() -> Vouching {
        Vouching { evidence: true, unit: 0.013, trust: Trust::default(), guard: Some(0.5), faces: 40 }
    }

    fn projected(random: &mut Random, distance: f64) -> Projected {
        let (b0, b1) = (random.unit() * 0.5, random.unit() * 0.5);
        let found = 1 + (random.unit() * 2.0) as u32;
        Projected {
            face: (random.unit() * 40.0) as u32,
            b0: b0 as f32,
            b1: b1 as f32,
            distance_squared: (distance * random.unit()) as f32,
            found,
        }
    }

    /// The verdict in double precision.
    fn expected(point: PackedPoint, forward: &Projected, back: Option<&Projected>, drift: [f64; 3]) -> (f64, Status) {
        let x = point.unpack().barycentric;
        let drift: f64 = x.iter().zip(drift).filter(|(x, _)| **x != 0.0).map(|(x, d)| x * d).sum();
        let v = vouching();
        let found = if forward.found == 1 { Found::Walk } else { Found::Search };
        let residual = f64::from(forward.distance_squared).sqrt() * v.unit;
        let round_trip = back.map(|b| f64::from(b.distance_squared).sqrt());
        v.trust.judge(&Evidence { residual, drift: drift.max(0.0), round_trip, found })
    }

    #[test]
    fn confidences_are_those_of_double_precision_within_their_rounding() {
        let mut random = Random::new(5);
        let (mut valid, mut doubtful) = (0, 0);
        for i in 0..20_000 {
            let b0 = [0.0, 1.0, random.unit()][i % 3];
            let point = PackedPoint { face: 3, b0: b0 as f32, b1: ((1.0 - b0) * random.unit()) as f32 };
            let drift = [0; 3].map(|_| 0.03 * random.unit());
            let forward = projected(&mut random, 0.25);
            let back = (i % 2 == 0).then(|| projected(&mut random, 2.0));
            let params = JudgeParams::new(&vouching(), back.is_some());
            let image = judge_image(&params, point, &forward, back.as_ref(), vouch_record(drift, 0));
            let (confidence, status) = expected(point, &forward, back.as_ref(), drift);
            if image.status == PackedImage::LEFT {
                assert!((confidence - 0.5).abs() <= 2.0 * f64::from(JUDGE_ROUNDING), "{confidence}");
                continue;
            }
            let apart = (f64::from(image.confidence) - confidence).abs();
            assert!(apart <= f64::from(JUDGE_ROUNDING), "{confidence}: {image:?}");
            assert_eq!(image.status(), status, "{confidence}");
            valid += u32::from(status == Status::Valid);
            doubtful += u32::from(status == Status::Doubtful);
        }
        assert!(valid > 1000 && doubtful > 1000);
    }

    #[test]
    fn what_is_left_turned_over_or_beside_the_source_is_told() {
        let mut random = Random::new(6);
        let params = JudgeParams::new(&vouching(), false);
        let good = Projected { distance_squared: 1e-4, ..projected(&mut random, 0.0) };
        let point = PackedPoint { face: 3, b0: 0.0, b1: 1.0 };
        let judge =
            |forward: &Projected, bits: u32| judge_image(&params, point, forward, None, vouch_record([1e-4; 3], bits));
        assert_eq!(judge(&good, 0).status(), Status::Valid);
        for left in [
            Projected { found: Projected::LEFT, ..good },
            Projected { found: Found::Nothing as u32, ..good },
            Projected { distance_squared: 0.26, ..good },
            Projected { distance_squared: f32::NAN, ..good },
        ] {
            assert_eq!(judge(&left, 0).status, PackedImage::LEFT, "{left:?}");
        }
        assert_eq!(judge(&good, Doubts::TURNED).status(), Status::Doubtful);
        assert_eq!(judge(&good, Doubts::TURNED << 2).status(), Status::Doubtful, "corner 1 is touched");
        assert_eq!(judge(&good, Doubts::TURNED << 1).status(), Status::Valid, "the point is not corner 0");
        assert_eq!(judge(&Projected { face: 40, ..good }, 0), PackedImage::NOWHERE);
        assert_eq!(judge(&Projected { b0: -0.02, ..good }, 0), PackedImage::NOWHERE);
        let nowhere = PackedPoint::NOWHERE;
        assert_eq!(judge_image(&params, nowhere, &good, None, vouch_record([0.0; 3], 0)), PackedImage::NOWHERE);
        // Nobody vouches where the expected error is infinite.
        let endless = vouch_record([f64::INFINITY; 3], 0);
        assert_eq!(judge_image(&params, point, &good, None, endless).status(), Status::Doubtful);
    }
}
