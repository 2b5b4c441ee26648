//! Texture transfer: exact coverage, padding and mip chains; footprints; whole transfers through
//! simple maps.

mod atlas;
mod cases;
mod filter;
mod kinds;
mod live;
mod pictures;
mod real;
mod seams;
mod whole;

use barymap::picture::Filter;

use crate::common::flat::{Random, grid, soup};

/// All filters.
const FILTERS: [Filter; 7] = [
    Filter::Ewa,
    Filter::Anisotropic,
    Filter::Trilinear,
    Filter::Bilinear,
    Filter::Nearest,
    Filter::Lanczos,
    Filter::Lanczos4,
];
