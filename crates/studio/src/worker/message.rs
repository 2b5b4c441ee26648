//! What the window asks for, and what it is told.

use std::path::PathBuf;
use std::sync::Arc;

use barymap::geometry::{ClosestPoints, Mesh, SurfacePoint, UpAxis};
use barymap::surface::correspondence::Method;
use barymap::tools::anchors::MirrorPlane;

use super::soup::Soup;
use crate::model::Side;
use crate::model::bvh::Bvh;

/// Complete pairs: id, source, target.
pub type PairList = Vec<(u64, SurfacePoint, SurfacePoint)>;

/// Pairs of points, without ids.
pub type PlainPairs = Vec<(SurfacePoint, SurfacePoint)>;

/// Where a guess starts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GuessFrom {
    /// The pair that it is for.
    pub id: u64,
    /// The side that has the point.
    pub side: Side,
    /// The point.
    pub point: SurfacePoint,
}

/// What the window asks for.
#[derive(Clone, Debug)]
pub enum Request {
    /// A mesh.
    Open(Side, PathBuf),
    /// A picture for the source; its own ones if none.
    Texture(Option<PathBuf>),
    /// Whether the target gets new texture coordinates.
    Unwrap(bool),
    /// The pairs as they are now, and whether one of them is being dragged.
    Pairs(PairList, bool),
    /// How points are carried.
    Method(Method),
    /// Texels along a side of the picture at rest.
    Size(u32),
    /// Where the map puts the partner of a point.
    Guess(GuessFrom),
    /// Pairs proposed, so many in all.
    Propose(usize),
    /// Where the next pairs would help most.
    Suggest(usize),
    /// Pairs from a file of the command line.
    ReadPairs(PathBuf),
    /// Ends what is going on.
    Cancel,
    /// Ends the thread.
    Stop,
}

/// A shape, as the window needs it.
pub struct OpenedShape {
    /// The file.
    pub path: PathBuf,
    /// The mesh.
    pub mesh: Mesh,
    /// For picking.
    pub bvh: Bvh,
    /// For points that are moved onto the surface.
    pub closest: ClosestPoints,
    /// The axis that points up, as far as the shape says.
    pub up: UpAxis,
    /// Whether it has texture coordinates.
    pub has_texcoords: bool,
}

impl std::fmt::Debug for OpenedShape {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("OpenedShape").field("path", &self.path).finish_non_exhaustive()
    }
}

/// A picture of 8 bits, RGBA, rows from the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rgba {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Four bytes a pixel.
    pub bytes: Vec<u8>,
}

/// A shape to be drawn.
#[derive(Clone, Debug)]
pub struct Drawn {
    /// Its triangles.
    pub soup: Arc<Soup>,
    /// The pictures that its parts name.
    pub pictures: Vec<Arc<Rgba>>,
    /// Colours of vertices, where it has no pictures.
    pub colors: Option<Vec<[u8; 4]>>,
}

/// The transferred texture.
#[derive(Clone, Debug)]
pub struct Shown {
    /// The texture.
    pub picture: Arc<Rgba>,
    /// What can be trusted of it, as a picture to lay over it.
    pub coverage: Arc<Rgba>,
    /// The part of the coloured texels that the map vouches for.
    pub valid: f64,
    /// Whether it is only for the time of a drag.
    pub coarse: bool,
    /// Milliseconds from the request to here.
    pub milliseconds: f64,
}

/// How far the map trusts each vertex of the target, 0 to 1.
pub type Confidence = Vec<f32>;

/// For each pair, by id, how far the others would miss it, over the square root of the area.
pub type LeftOut = Vec<(u64, f64)>;

/// A pair that the program proposes.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposed {
    /// On the source.
    pub source: SurfacePoint,
    /// On the target.
    pub target: SurfacePoint,
    /// Why it is doubtful, if it is.
    pub flagged: Option<String>,
}

/// A place where a pair would help.
#[derive(Clone, Debug, PartialEq)]
pub struct Suggested {
    /// On the target.
    pub target: SurfacePoint,
    /// Where the map sends it now.
    pub guess: Option<SurfacePoint>,
    /// The error expected there, over the square root of the area.
    pub error: f64,
}

/// What the window is told.
#[derive(Debug)]
pub enum Report {
    /// A mesh was read.
    Opened(Side, Arc<OpenedShape>),
    /// How it looks.
    Drawn(Side, Drawn),
    /// The plane about which it is its own mirror image, if it is.
    Mirror(Side, Option<MirrorPlane>),
    /// A transferred texture.
    Shown(Shown),
    /// There is no transferred texture any more, and why, if something is missing.
    Nothing(String),
    /// How far vertices of the target can be trusted.
    Confidence(Arc<Confidence>),
    /// Errors of pairs left out.
    LeftOut(LeftOut),
    /// Ids of pairs that the others contradict, and by how much.
    Wrong(LeftOut),
    /// The partner of a point.
    Guess(GuessFrom, Option<SurfacePoint>),
    /// Pairs proposed, and what there is to say.
    Proposed(Vec<Proposed>, Vec<String>),
    /// Places for the next pairs.
    Suggested(Vec<Suggested>),
    /// Pairs that a file has.
    Read(PlainPairs),
    /// Work goes on: its name, and how much of how much is done (0 where that is not known).
    Busy(String, u64, u64),
    /// Nothing goes on.
    Idle,
    /// A mesh could not be opened, in words with what to do.
    Unopened(Side, PathBuf, String),
    /// A picture could not be used as texture, in words with what to do: the source has its own.
    NoTexture(PathBuf, String),
    /// Something that the user should know.
    Note(String),
    /// Something failed, in words with what to do.
    Failed(String),
}
