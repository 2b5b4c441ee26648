//! Positions that are too far from a mesh to belong to it.

/// Distances from a mesh, in the diagonal of its bounding box, beyond which a position is a
/// mistake: other units, or another mesh.
pub(crate) const FARTHEST: f64 = 100.0;

/// What to do about a position beyond [`FARTHEST`].
pub(crate) const ELSEWHERE: &str = "Check its units, and that it belongs to this mesh";

/// The words about a position that is `distance` away from a mesh with this diagonal.
pub(crate) fn lies_off(distance: f64, diagonal: f64) -> String {
    format!("lies {distance:.4e} off the mesh, {:.0} times its diagonal", distance / diagonal)
}
