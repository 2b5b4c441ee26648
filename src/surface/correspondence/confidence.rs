//! What speaks for the image of a point, and the verdict (paper, section 4.4).

use crate::surface::packed::Status;
use crate::surface::project::Found;

/// Evidence about the image of one point; lengths in mean edges of the surface they are measured on.
#[derive(Clone, Copy, Debug)]
pub struct Evidence {
    /// Inverse then forward on the target with its own anchors: distance from the start. Infinite where nothing was found.
    pub round_trip: f64,
    /// `|y - sum w_i a_i|`: how far the anchors' average lies off the target.
    pub own_residual: f64,
    /// `|ybar - image|`: how far the average lies off the source.
    pub residual: f64,
    /// How the image was found.
    pub found: Found,
}

/// The scale of confidence and the threshold of validity.
#[derive(Clone, Copy, Debug)]
pub struct Trust {
    /// Confidence below which a point is doubtful.
    pub threshold: f64,
}

impl Default for Trust {
    fn default() -> Self {
        Self { threshold: 0.5 }
    }
}

impl Trust {
    /// Confidence in 0..1 and the status.
    pub fn judge(&self, e: &Evidence) -> (f64, Status) {
        let confidence = 1.0 / (1.0 + e.round_trip);
        let status = match e.found {
            Found::Nothing => Status::Failed,
            _ if confidence >= self.threshold => Status::Valid,
            _ => Status::Doubtful,
        };
        (if status == Status::Failed { 0.0 } else { confidence }, status)
    }

    /// The verdict where no evidence is gathered: what was found is valid.
    pub fn unchecked(found: Found) -> (f64, Status) {
        match found {
            Found::Nothing => (0.0, Status::Failed),
            _ => (1.0, Status::Valid),
        }
    }
}
