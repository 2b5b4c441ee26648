//! The anchors of one mesh, from a file of its own or from one side of pairs.

use std::path::Path;

use crate::Result;
use crate::io::anchors::{AnchorList, read_pairs, read_single};
use crate::words::words;

/// Whose anchors of a file are meant.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(crate) struct OfPairs {
    /// Which mesh of pairs of anchors this is: the source if not given
    #[arg(long, value_enum, requires = "anchors")]
    side: Option<Side>,
}

/// A mesh of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Side {
    Source,
    Target,
}

words! { Side, "side", "a mesh of a pair":
    Source => "source",
    Target => "target",
}

impl OfPairs {
    /// The anchors of a file for one mesh, or of one side of pairs.
    ///
    /// # Errors
    /// As [`read_pairs`].
    pub(crate) fn read(self, path: &Path) -> Result<AnchorList> {
        if self.side.is_none()
            && let Ok(single) = read_single(path)
        {
            return Ok(single);
        }
        let pairs = read_pairs(&path.to_string_lossy())?;
        Ok(if self.side == Some(Side::Target) { pairs.target } else { pairs.source })
    }
}
