//! Shapes and characters made by code, so that tests, examples and the demonstration need no files.
//!
//! The characters are Catmull-Clark surfaces of one control cage with different measures and poses,
//! cut into triangles independently. Corresponding points have the same parameters on the cage, so
//! the true correspondence is known everywhere.

mod atlas;
mod body;
mod cage;
mod cast;
mod character;
mod outfit;
mod paint;
mod pair;
pub mod polygons;
mod sampling;
pub mod shapes;
mod subdivision;
mod walk;

pub use character::Character;
#[doc(hidden)]
pub use outfit::{Dressed, Outfit, dressed};
#[doc(hidden)]
pub use pair::ModelPair;
pub use pair::{character_pair, stout, strider};
#[doc(hidden)]
pub use subdivision::Parameter;
pub use walk::Walker;
