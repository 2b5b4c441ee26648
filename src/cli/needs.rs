//! What commands take, for each vertex of a mesh or beside a piece of work, so that what is too
//! large is refused before it begins.
//!
//! The bytes are those of the largest of three meshes (28,388, 49,999 and 75,002 vertices), measured
//! as the peak of the process less what the program takes, and rounded up: docs/commands.md,
//! "Memory and threads".

use crate::cli::common::Common;
use crate::geometry::Mesh;
use crate::{Error, Result, control};

/// Work whose memory grows with the vertices.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Need {
    /// What is made, as messages begin.
    what: &'static str,
    /// Bytes for each vertex.
    vertex: u64,
    /// Bytes for each vertex of each frame that is kept until the end.
    frame: u64,
}

/// A mesh posed by handles: its hierarchy and the decoder.
pub(crate) const DEFORM: Need = Need { what: "a pose", vertex: 3300, frame: 0 };
/// As [`DEFORM`], and a group of frames that are finished abreast. A frame is kept as it is stored,
/// with its normals' change.
pub(crate) const ANIMATE: Need = Need { what: "the motion", vertex: 7900, frame: 40 };
/// Texture coordinates.
pub(crate) const UNWRAP: Need = Need { what: "charts", vertex: 1300, frame: 0 };
/// Ends of a morph, without anything between.
pub(crate) const ENDS: Need = Need { what: "a blend", vertex: 1500, frame: 40 };
/// In-betweens: a direct factorisation of the whole mesh.
pub(crate) const MORPH: Need = Need { what: "in-betweens", vertex: 7400, frame: 40 };

/// Bytes that a relaxed map takes for each vertex of its source and its target.
const FIELD: [u64; 2] = [2000, 9000];

/// Fails if a relaxed map from `target` to `source` takes more than is allowed.
///
/// # Errors
/// [`crate::Error::Memory`].
pub(crate) fn check_field(source: &Mesh, target: &Mesh) -> Result<()> {
    let [from, to] = [source, target].map(|mesh| mesh.vertex_count() as u64);
    let bytes = (FIELD[0].saturating_mul(from)).saturating_add(FIELD[1].saturating_mul(to));
    control::require(bytes, || {
        format!("the map from {} with {to} vertices to {} with {from}", target.name, source.name)
    })
}

impl Need {
    /// Fails if the work on `mesh`, with `frames` kept, takes more than is allowed.
    ///
    /// # Errors
    /// [`crate::Error::Memory`].
    pub(crate) fn check(self, mesh: &Mesh, frames: usize) -> Result<()> {
        let vertices = mesh.vertex_count() as u64;
        let each = self.frame.saturating_mul(frames as u64).saturating_add(self.vertex);
        let kept = if frames > 0 { format!(" in {frames} frames") } else { String::new() };
        let what = || format!("{} of {} with {vertices} vertices{kept}", self.what, mesh.name);
        control::require(each.saturating_mul(vertices), what)
    }
}

/// Does a piece of work with the memory that is left of the limit, where it may be refused before
/// it begins: then the error counts all that the process would have.
pub(crate) fn with_what_is_left<T>(common: &Common, room: Room, work: impl FnOnce(u64) -> Result<T>) -> Result<T> {
    let left = control::left().saturating_add(room.there).saturating_sub(room.after);
    work(left).map_err(|error| match error {
        Error::Memory { what, required, allowed } if allowed == left => {
            let used = common.memory.saturating_sub(left);
            Error::Memory { what, required: required.saturating_add(used), allowed: common.memory }
        }
        error => error,
    })
}

/// What a piece of work shares the memory with.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Room {
    /// Bytes in use that the work counts as its own.
    pub(crate) there: u64,
    /// Bytes that are made of its result while the result is there.
    pub(crate) after: u64,
}
