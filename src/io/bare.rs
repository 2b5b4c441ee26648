//! What `io` has in a build without the feature `files`: the cache and what it is made of.

pub mod cache;
mod open;
pub mod output;

pub use cache::{Cache, CacheKey};
