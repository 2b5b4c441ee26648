//! Points of a surface and of a picture that belong together.

use glam::DVec2;

use crate::error::{Error, Result};
use crate::geometry::{Frame, Mesh, NONE, SurfacePoint, Topology};

/// Four pairs or more of a point of a surface and one of the picture: `uv[i]` is where `points[i]`
/// lies in the unit square, (0, 0) being the picture's lower left corner and (1, 1) its upper
/// right.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DecalAnchors {
    /// On the surface.
    pub points: Vec<SurfacePoint>,
    /// In the picture; outside the unit square too.
    pub uv: Vec<DVec2>,
}

/// Fewest pairs.
const FEWEST: usize = 4;
/// Points of the picture nearer to one another, in the unit square, or to a line, coincide.
const SAME: f64 = 1e-6;
/// Points of the picture farther out than this many sides of it are a mistake.
const FARTHEST: f64 = 1e3;

impl DecalAnchors {
    /// The corners of the picture at four points, counter-clockwise from its lower left.
    pub fn corners(points: [SurfacePoint; 4]) -> Self {
        Self { points: points.to_vec(), uv: vec![DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y] }
    }

    /// Whether a picture can be laid by these.
    ///
    /// # Errors
    /// [`Error::Input`] naming the anchor: fewer than four; lists of different lengths; a point
    /// that is not on the mesh; numbers that are not finite; anchors on several components; points
    /// of the picture on one line; two anchors at one place of the surface or of the picture.
    pub fn check(&self, mesh: &Mesh, topology: &Topology) -> Result<()> {
        let fail = |what: String, remedy: &str| Err(Error::input(what, remedy));
        let (points, uv) = (&self.points, &self.uv);
        if points.len() != uv.len() {
            let what = format!("{} anchors on {}, {} in the picture", points.len(), mesh.name, uv.len());
            return fail(what, "Give one point of the picture for each anchor, in the same order");
        }
        if points.len() < FEWEST {
            let what = format!("{} anchors are too few for a decal", points.len());
            return fail(what, "Give four or more, for example where the picture's corners shall be");
        }
        for (i, (p, q)) in points.iter().zip(uv).enumerate() {
            if !p.is_valid(mesh, 1e-6) || topology.triangle_component(p.face) == NONE {
                let what = format!("anchor {i} (face {}, {:?}) is no point of {}", p.face, p.barycentric, mesh.name);
                return fail(what, "Put it on a triangle that has an area");
            }
            if !q.is_finite() || q.abs().max_element() > FARTHEST {
                let what = format!("anchor {i} lies at ({}, {}) in the picture", q.x, q.y);
                return fail(what, "The picture is the unit square; anchors are in it or near it");
            }
        }
        let component = |i: usize| topology.triangle_component(points[i].face);
        if let Some(i) = (1..points.len()).find(|&i| component(i) != component(0)) {
            let what = format!("anchors 0 and {i} lie on parts of {} that are not connected", mesh.name);
            return fail(what, "Lay a decal for each part, or weld the parts");
        }
        let frame = Frame::of_mesh(mesh).in_units();
        let at: Vec<_> = points.iter().map(|p| frame.place(p, mesh)).collect();
        let apart = SAME * mesh.mean_edge_length();
        for i in 0..points.len() {
            for j in 0..i {
                let (here, there) = (at[i].distance(at[j]) <= apart, uv[i].distance(uv[j]) <= SAME);
                if here != there {
                    let (one, two) = if here { ("the surface", "the picture") } else { ("the picture", "the surface") };
                    let what = format!(
                        "anchors {j} and {i} are one point of {one} but two of {two}: they contradict each other"
                    );
                    return fail(what, "Move or remove one of them");
                }
            }
        }
        let mean = uv.iter().sum::<DVec2>() / uv.len() as f64;
        let (xx, xy, yy) = uv.iter().fold((0.0, 0.0, 0.0), |(xx, xy, yy), q| {
            let d = *q - mean;
            (xx + d.x * d.x, xy + d.x * d.y, yy + d.y * d.y)
        });
        if !(xx * yy - xy * xy > SAME * (xx + yy) * (xx + yy)) {
            return fail("the anchors lie on one line of the picture".into(), "Spread them over the picture");
        }
        Ok(())
    }
}
