//! What the studio has and does, without a window.

pub mod bvh;
pub mod cage;
pub mod camera;
pub mod color;
pub mod command;
pub mod document;
pub mod history;
pub mod pairs;
pub mod project;
pub mod recovery;

/// One of the two shapes of a transfer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Side {
    /// The shape with the texture, on the left.
    Source,
    /// The shape that receives it, on the right.
    Target,
}

impl Side {
    /// Both, from left to right.
    pub const BOTH: [Self; 2] = [Self::Source, Self::Target];

    /// The other one.
    pub fn other(self) -> Self {
        match self {
            Self::Source => Self::Target,
            Self::Target => Self::Source,
        }
    }

    /// 0 for the source, 1 for the target.
    pub fn index(self) -> usize {
        self as usize
    }

    /// The word for users.
    pub fn word(self) -> &'static str {
        match self {
            Self::Source => "source",
            Self::Target => "target",
        }
    }
}
