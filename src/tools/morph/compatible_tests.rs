use super::*;
use crate::models::shapes::{icosphere, lobed_sphere};
use crate::surface::{PackedImage, PackedPoint};

/// Radially onto a mesh, moved by `shift`; nowhere from some faces.
struct Radial<'a> {
    own: &'a Mesh,
    closest: crate::geometry::ClosestPoints,
    shift: Box<dyn Fn(DVec3) -> DVec3 + Sync>,
    without: std::ops::Range<u32>,
}

impl PointMap for Radial<'_> {
    fn map(&self, points: &[PackedPoint], images: &mut Vec<PackedImage>) -> Result<()> {
        images.clear();
        images.extend(points.iter().map(|p| {
            let q = (self.shift)(p.unpack().position(self.own));
            let (on, _) = self.closest.nearest(q).unwrap();
            if self.without.contains(&p.face) {
                return PackedImage::NOWHERE;
            }
            let b = PackedPoint::from(on);
            PackedImage { face: b.face, b0: b.b0, b1: b.b1, confidence: 1.0, status: Status::Valid as u32 }
        }));
        Ok(())
    }
}

fn run(shift: impl Fn(DVec3) -> DVec3 + Sync + 'static, without: std::ops::Range<u32>) -> (Mesh, Result<Compatible>) {
    let (a, b) = (icosphere(1.0, 3), lobed_sphere(4, 0.25));
    let (around_a, around_b) = (Topology::new(&a), Topology::new(&b));
    let closest = crate::geometry::ClosestPoints::new(&b, &around_b);
    let map = Radial { own: &a, closest, shift: Box::new(shift), without };
    let made = compatible_mesh((&a, &around_a), (&b, &around_b), &map, &[]);
    (a, made)
}

#[test]
fn a_good_map_is_left_alone() {
    let (a, made) = run(|p| p, 0..0);
    let made = made.unwrap();
    assert_eq!(made.mesh.triangles(), a.triangles());
    let r = made.report;
    assert!(r.bad_before == 0 && r.bad == 0 && r.moved == 0 && r.filled == 0 && r.off < 1e-6, "{r:?}");
    assert!(r.stretch_all > 0.8 && r.long_edges == 0);
}

#[test]
fn folds_are_mended_and_holes_filled() {
    // Around one pole the map turns the surface by half a turn, all at once: a ring of folds.
    let twist = |p: DVec3| if p.y > 0.9 { DVec3::new(-p.x, p.y, -p.z) } else { p };
    let r = run(twist, 0..0).1.unwrap().report;
    assert!(r.bad_before > 10 && r.bad == 0 && r.moved > 0, "{r:?}");
    let (a, made) = run(|p| p, 100..160);
    let made = made.unwrap();
    assert!(made.report.filled > 5 && made.report.bad == 0, "{:?}", made.report);
    let length = |m: &Mesh| m.positions.iter().map(|p| p.length()).fold(f64::INFINITY, f64::min);
    assert!(length(&made.mesh) > 0.5 * length(&a));
    // Nothing at all is an error.
    assert!(run(|p| p, 0..u32::MAX).1.is_err());
}
