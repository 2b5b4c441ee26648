//! The desk: shapes with all that is known of them, pairs found on them, the choice of a method,
//! textures by role and material, and the names of what is written. What a window, a script and the
//! command line share.
//!
//! Data in: files or meshes, anchors as they were written. Data out: a map between two owned
//! [`Subject`]s, and sentences for the user, which the caller shows as it likes. Nothing here
//! prints.
//!
//! ```
//! use barymap::desk::{Choice, Subject, correspond, find_pairs};
//! use barymap::io::anchors::{AnchorList, AnchorPairs, AnchorSpec};
//! use barymap::io::cache::Cache;
//! use barymap::models::shapes::uv_sphere;
//! use barymap::prelude::{Engine, Result};
//! use barymap::progress::Quiet;
//! use barymap::surface::EmbeddingOptions;
//!
//! # fn main() -> Result<()> {
//! // Two shapes; `Subject::open` reads a file.
//! let mut source = Subject::new(uv_sphere(1.0, 24, 16))?;
//! let mut target = Subject::new(uv_sphere(2.0, 24, 16))?;
//! let options = EmbeddingOptions { landmarks: 100, ..EmbeddingOptions::default() };
//! for subject in [&mut source, &mut target] {
//!     subject.embed(&options, &Cache::disabled(), &Quiet)?;
//! }
//!
//! // Pairs, as a person writes them; `io::anchors::read_pairs` reads a file.
//! let list = |name: &str| AnchorList {
//!     path: name.into(),
//!     anchors: [0, 40, 100, 160, 220, 280, 361].map(AnchorSpec::Vertex).to_vec(),
//! };
//! let written = AnchorPairs { source: list("source"), target: list("target") };
//! let found = find_pairs(&written, &source, &target)?;
//!
//! let made = correspond(&Engine::cpu(), &source, &target, &found.pairs, &Choice::default(), &options, &Quiet)?;
//! let mut images = Vec::new();
//! made.map.map(&[found.pairs.target[1].into()], &mut images)?;
//! assert!(images[0].point().is_some());
//! # Ok(())
//! # }
//! ```

mod appearance;
mod layer_reader;
mod method;
mod outputs;
mod pairs;
mod requests;
mod subject;
mod textures;

pub use method::{Choice, Made, correspond};
pub use outputs::{Names, Part, Writer, part_of};
pub use pairs::{Found, FoundPairs, find_pairs};
pub use requests::{own_textures, textures};
pub use subject::Subject;
pub use textures::Textures;
