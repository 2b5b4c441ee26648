//! Surface points as kernels and texel loops hold them.

use bytemuck::{Pod, Zeroable};

use crate::engine::{Batch, Binding, Buffer, Gpu};
use crate::error::Result;
use crate::geometry::{NONE, SurfacePoint};

/// A surface point in 12 bytes: the third barycentric coordinate is what is left to one.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct PackedPoint {
    /// Triangle, or [`NONE`].
    pub face: u32,
    /// Barycentric coordinate of corner 0.
    pub b0: f32,
    /// Barycentric coordinate of corner 1.
    pub b1: f32,
}

/// Where a point of the target went on the source.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct PackedImage {
    /// Triangle of the source, or [`NONE`] where nothing was found.
    pub face: u32,
    /// Barycentric coordinate of corner 0.
    pub b0: f32,
    /// Barycentric coordinate of corner 1.
    pub b1: f32,
    /// Confidence in 0..1.
    pub confidence: f32,
    /// A [`Status`] as a number.
    pub status: u32,
}

/// How far a correspondence can be trusted at a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u32)]
pub enum Status {
    /// Nothing usable was found; a geometry, if any, is the best guess.
    Failed = 0,
    /// Found, but the checks of the method do not vouch for it.
    Doubtful = 1,
    /// Found, and the checks agree.
    Valid = 2,
}

impl Status {
    /// The status a kernel wrote; unknown numbers count as failed.
    pub fn from_u32(x: u32) -> Self {
        match x {
            2 => Self::Valid,
            1 => Self::Doubtful,
            _ => Self::Failed,
        }
    }

    /// The word used in files and reports.
    pub fn word(self) -> &'static str {
        match self {
            Self::Failed => "failed",
            Self::Doubtful => "doubtful",
            Self::Valid => "valid",
        }
    }
}

impl PackedPoint {
    /// No point.
    pub const NOWHERE: Self = Self { face: NONE, b0: 0.0, b1: 0.0 };

    /// The point with its three coordinates in double precision.
    pub fn unpack(self) -> SurfacePoint {
        let (b0, b1) = (f64::from(self.b0), f64::from(self.b1));
        SurfacePoint::new(self.face, [b0, b1, 1.0 - b0 - b1])
    }
}

impl From<SurfacePoint> for PackedPoint {
    fn from(p: SurfacePoint) -> Self {
        Self { face: p.face, b0: p.barycentric[0] as f32, b1: p.barycentric[1] as f32 }
    }
}

impl PackedImage {
    /// Nothing was found.
    pub const NOWHERE: Self = Self { face: NONE, b0: 0.0, b1: 0.0, confidence: 0.0, status: Status::Failed as u32 };
    /// Barycentric coordinates may leave the triangle by this much, as a map's rounding.
    pub const SLACK: f32 = 1e-2;
    /// In place of a [`Status`]: kernels left the point to the reference.
    pub const LEFT: u32 = 3;

    /// The point with its three coordinates in double precision; `None` where nothing was found.
    pub fn point(self) -> Option<SurfacePoint> {
        (self.face != NONE).then(|| PackedPoint { face: self.face, b0: self.b0, b1: self.b1 }.unpack())
    }

    /// The image if it lies on a source of `faces` triangles; else nothing was found.
    pub fn checked(self, faces: usize) -> Self {
        let inside = [self.b0, self.b1, 1.0 - self.b0 - self.b1].iter().all(|b| *b >= -Self::SLACK);
        if inside && (self.face as usize) < faces { self } else { Self::NOWHERE }
    }

    /// The status.
    pub fn status(self) -> Status {
        Status::from_u32(self.status)
    }
}

/// A map from points of the target mesh to points of the source mesh.
pub trait PointMap: Sync {
    /// Maps `points` of the target; `images` is cleared and gets one entry per point, in order.
    ///
    /// # Errors
    /// If a point is not on the target, or the device fails.
    fn map(&self, points: &[PackedPoint], images: &mut Vec<PackedImage>) -> Result<()>;

    /// The same map where points and images stay on a device; `None` where the host takes part in
    /// every point.
    fn resident(&self) -> Option<&dyn ResidentMap> {
        None
    }

    /// Points so far that kernels handed back to the CPU; `None` where no kernel runs.
    fn handed_back(&self) -> Option<u64> {
        None
    }

    /// What the method `field` chose; `None` for other methods.
    fn field(&self) -> Option<&super::field::FieldReport> {
        None
    }
}

/// What speaks against points of the target whatever their evidence: bits for each of its
/// triangles.
#[derive(Clone, Copy)]
pub struct Doubts<'a>(pub &'a (dyn Fn(u32) -> u32 + Sync));

impl std::fmt::Debug for Doubts<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Doubts")
    }
}

impl Doubts<'_> {
    /// Nothing does.
    pub const NONE: Self = Self(&|_| 0);
    /// The triangle is turned over. The three bits above it say so of its corners alone.
    pub const TURNED: u32 = 1;
}

/// A map on a device whose points lie there, and whose images stay there.
pub trait ResidentMap: Sync {
    /// The device; `None` where the map has come to work on the host.
    fn gpu(&self) -> Option<&Gpu>;

    /// The map of `points` to `images`. A point is a record of four words: a [`PackedPoint`] (none
    /// where its triangle is [`NONE`]) and the place of its image.
    ///
    /// # Errors
    /// [`Error::Memory`](crate::Error::Memory), [`Error::Capability`](crate::Error::Capability) or
    /// [`Error::Device`](crate::Error::Device) if its buffers do not fit.
    fn bind(&self, points: Binding<'_>, images: &Buffer<PackedImage>, doubts: Doubts<'_>) -> Result<Box<dyn MapStage>>;

    /// Maps points that the kernels left; `images` is cleared and gets one entry per point.
    ///
    /// # Errors
    /// As [`PointMap::map`].
    fn finish(&self, points: &[PackedPoint], images: &mut Vec<PackedImage>) -> Result<()>;
}

/// A [`ResidentMap`] with its points and images.
pub trait MapStage {
    /// Points that one call records at most.
    fn capacity(&self) -> usize;

    /// Records the map of the first `count` points. What kernels left has the status
    /// [`PackedImage::LEFT`] and no triangle.
    ///
    /// # Errors
    /// [`Error::Device`](crate::Error::Device).
    fn record(&self, batch: &mut Batch<'_>, count: usize) -> Result<()>;
}
