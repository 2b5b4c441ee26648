//! What speaks for the image of a point, and the verdict (paper, section 4.4).

use crate::surface::packed::Status;
use crate::surface::project::Found;

/// Evidence about the image of one point; lengths are fractions of the square root of the area of
/// the surface they are measured on.
#[derive(Clone, Copy, Debug)]
pub struct Evidence {
    /// `|ybar - image|`: how far the average lies off the source. Where the two surfaces and their
    /// anchors agree it is near zero; where the anchors do not determine the map, or another part
    /// of the surface comes near, it is large.
    pub residual: f64,
    /// Error to be expected from what anchors show that are left out, grown with the distance from
    /// the nearest.
    pub drift: f64,
    /// Inverse then forward on the target with its own anchors: distance from the start, in mean
    /// edges. Infinite where nothing was found; `None` where the residual is carried over, because
    /// the round trip is then the identity by construction.
    pub round_trip: Option<f64>,
    /// How the image was found.
    pub found: Found,
}

/// The scales of confidence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trust {
    /// Residual at which confidence is one half.
    pub residual: f64,
    /// Expected drift at which confidence is one half.
    pub drift: f64,
    /// Round trip distance, in mean edges, at which confidence is one half.
    pub round_trip: f64,
    /// Confidence below which a point is doubtful.
    pub threshold: f64,
}

/// What a map's images are judged by.
#[derive(Clone, Copy, Debug)]
pub struct Vouching {
    /// Whether evidence is gathered; else what was found is valid.
    pub evidence: bool,
    /// Mean edge of the source over the square root of its area.
    pub unit: f64,
    /// The scales.
    pub trust: Trust,
    /// Distance, in edges, beyond which the reference looks at a projection closer.
    pub guard: Option<f64>,
    /// Triangles of the source.
    pub faces: usize,
}

impl Default for Trust {
    /// Calibrated on pairs with known truth and 80 to 93 anchors (docs/measurements.md, "What tells
    /// wrong from right"): where a residual above 0.05 is found a quarter to all of the points are
    /// off by more than 0.05 of the square root of the area; where a drift of more than 0.016 is
    /// expected, a tenth to a half of the area is off by more than 0.02, several times as much as
    /// elsewhere.
    fn default() -> Self {
        Self { residual: 0.04, drift: 0.0161, round_trip: 1.0, threshold: 0.5 }
    }
}

impl Trust {
    /// Confidence in 0..1 and the status.
    pub fn judge(&self, e: &Evidence) -> (f64, Status) {
        if e.found == Found::Nothing {
            return (0.0, Status::Failed);
        }
        let falling = |x: f64, half: f64| 1.0 / (1.0 + (x / half) * (x / half));
        let confidence = e
            .round_trip
            .map_or(1.0, |d| falling(d, self.round_trip))
            .min(falling(e.residual, self.residual))
            .min(falling(e.drift, self.drift));
        (confidence, if confidence >= self.threshold { Status::Valid } else { Status::Doubtful })
    }

    /// The verdict where no evidence is gathered: what was found is valid.
    pub fn unchecked(found: Found) -> (f64, Status) {
        match found {
            Found::Nothing => (0.0, Status::Failed),
            _ => (1.0, Status::Valid),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_kind_of_evidence_can_condemn() {
        let trust = Trust::default();
        let good = Evidence { residual: 0.001, drift: 0.001, round_trip: Some(0.01), found: Found::Walk };
        assert_eq!(trust.judge(&good).1, Status::Valid);
        assert_eq!(trust.judge(&Evidence { residual: 0.06, ..good }).1, Status::Doubtful);
        assert_eq!(trust.judge(&Evidence { drift: 0.02, ..good }).1, Status::Doubtful);
        assert_eq!(trust.judge(&Evidence { round_trip: Some(2.0), ..good }).1, Status::Doubtful);
        assert_eq!(trust.judge(&Evidence { round_trip: Some(f64::INFINITY), ..good }), (0.0, Status::Doubtful));
        assert_eq!(trust.judge(&Evidence { found: Found::Nothing, ..good }), (0.0, Status::Failed));
        assert!(trust.judge(&Evidence { residual: 0.01, ..good }).0 < trust.judge(&good).0);
    }
}
