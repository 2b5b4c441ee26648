//! Vertex paths: how the source polygon becomes the target (paper, sections 2.2 and 3.1).
//!
//! A path gives a polygon for every `t` in 0..1, the source at 0 and the target at 1. Only the
//! polygons a partition uses need to be simple; each of them is checked ([`polygon_at`]). Three
//! paths are known, in the order in which they are tried; a fourth, [`Relaxed`], makes the first
//! two continuous in the polygons.

mod clearance;
mod compatible;
mod intrinsic;
mod linear;
mod placement;
mod relaxation;
mod relaxed;

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::geometry::polygon::Nesting;
use crate::geometry::{Defect, Polygon};
use crate::mapping::plane::Cage;
use crate::words::words;

pub use compatible::Compatible;
pub use intrinsic::Intrinsic;
pub use linear::Linear;
#[doc(hidden)]
pub use relaxed::{Base, Relaxed};

/// Which path the vertices take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PathKind {
    /// Turning angles and edge lengths go linearly (Sederberg et al. 1993): turns stay turns.
    Intrinsic,
    /// Every vertex goes straight.
    Linear,
    /// Convex combinations in compatible triangulations (Gotsman, Surazhsky 2001): never intersects
    /// itself.
    Compatible,
    /// The intrinsic or the linear path between a source and a target that are relaxed as far as it
    /// needs: continuous in both.
    Relaxed,
}

words! { PathKind, "path", "a path":
    Intrinsic => "intrinsic",
    Linear => "linear",
    Compatible => "compatible",
    Relaxed => "relaxed",
}

/// A continuous path from a source polygon (t = 0) to a target (t = 1).
pub trait VertexPath: std::fmt::Debug + Send + Sync {
    /// The polygon at `t` in 0..=1, not checked. At 0 and 1 exactly the ends.
    ///
    /// # Errors
    /// Where the path has no polygon at `t`; the message says why.
    fn polygon(&self, t: f64) -> Result<Polygon>;

    /// Which path it is.
    fn kind(&self) -> PathKind;
}

/// The path of this kind between the polygons of `cage`.
///
/// # Errors
/// As [`Compatible::new`] and [`Relaxed::new`]; the others always are.
#[doc(hidden)]
pub fn vertex_path(cage: &Cage, kind: PathKind) -> Result<Arc<dyn VertexPath>> {
    Ok(match kind {
        PathKind::Intrinsic => Arc::new(Intrinsic::new(cage)),
        PathKind::Linear => Arc::new(Linear::new(cage)),
        PathKind::Compatible => Arc::new(Compatible::new(cage)?),
        PathKind::Relaxed => Arc::new(Relaxed::new(cage, Base::Intrinsic)?),
    })
}

/// The polygon of `path` at `t`, if it bounds a domain nested as `nesting` says.
///
/// # Errors
/// [`Error::Numeric`] that names `t` and the defect.
#[doc(hidden)]
pub fn polygon_at(path: &dyn VertexPath, t: f64, nesting: &Nesting) -> Result<Polygon> {
    let polygon = path.polygon(t)?;
    let at = |what: String| {
        Error::numeric(
            format!("the {} path fails at t = {t}: {what}", path.kind().word()),
            "Take another path, or bring source and target closer together",
        )
    };
    let found = polygon.nesting().map_err(|defect| at(defect.to_string()))?;
    if found != *nesting {
        return Err(at("its loops are nested differently".to_owned()));
    }
    match (0..polygon.loops().len()).find(|&ring| !polygon.well_oriented(nesting, ring)) {
        Some(ring) => Err(at(Defect::Orientation { ring, depth: nesting.depths[ring] }.to_string())),
        None => Ok(polygon),
    }
}
