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

use crate::common::flat::{Random, grid, soup};
