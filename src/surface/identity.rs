//! The map of a mesh onto itself.

use super::{AnchorPairs, PackedImage, PackedPoint, PointMap, Status};
use crate::geometry::Mesh;

/// Every point is its own image.
#[derive(Clone, Copy, Debug, Default)]
pub struct IdentityMap;

impl IdentityMap {
    /// Whether the map from `target` to `source` by these anchors is the identity: the same
    /// triangles with the same vertices at the same positions, and anchors that are each their own
    /// partner. Texture coordinates may differ. Weighted averages take each point to itself then,
    /// up to rounding (Panozzo et al. 2013, section 3: the forward problem undoes the inverse one).
    /// O(triangles + anchors).
    pub fn fits(source: &Mesh, target: &Mesh, anchors: &AnchorPairs) -> bool {
        anchors.source == anchors.target
            && source.positions == target.positions
            && source.triangle_count() == target.triangle_count()
            && (0..source.triangle_count()).all(|t| source.triangle(t) == target.triangle(t))
    }
}

impl PointMap for IdentityMap {
    fn map(&self, points: &[PackedPoint], images: &mut Vec<PackedImage>) -> crate::Result<()> {
        images.clear();
        images.extend(points.iter().map(|p| PackedImage {
            face: p.face,
            b0: p.b0,
            b1: p.b1,
            confidence: 1.0,
            status: Status::Valid as u32,
        }));
        Ok(())
    }
}
