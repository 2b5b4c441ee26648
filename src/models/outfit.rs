//! Characters as from another pack: a body in clothes, with horns or a tail, of few polygons, whose
//! true correspondence with the naked body is known.
//!
//! Every piece is the body's own surface pushed outwards, so each vertex stays the vertex that it
//! was; simplification keeps some of the vertices where they are. What a layer of cloth hides has
//! no surface of its own, as in most low-polygon characters.

use glam::DVec3;

use crate::error::{Error, Result};
use crate::geometry::simplify::{SimplifyOptions, simplify};
use crate::geometry::{Mesh, Topology};
use crate::surface::quality::vertex_normals;

/// What is worn and how it is cut. Lengths are shares of the body's height (its size along y).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outfit {
    /// Thickness of a coat from the hips to the shoulders, with sharp hems.
    pub coat: f64,
    /// Depth of folds in the coat.
    pub folds: f64,
    /// Height of a collar that stands off the neck.
    pub collar: f64,
    /// Thickness of boots.
    pub boots: f64,
    /// Depth of goggles on the face.
    pub goggles: f64,
    /// Length of two horns.
    pub horns: f64,
    /// Length of a tail.
    pub tail: f64,
    /// How much wider the body is: across y, over its own width, less one.
    pub wider: f64,
    /// Vertices that are left; 0 for all.
    pub vertices: usize,
}

/// A body in an outfit.
#[derive(Clone, Debug)]
pub struct Dressed {
    /// The character.
    pub mesh: Mesh,
    /// For each of its vertices the vertex of the body.
    pub truth: Vec<u32>,
}

/// One between `low` and `high`, zero outside, with hems of `hem`.
fn band(x: f64, low: f64, high: f64, hem: f64) -> f64 {
    ((x - low) / hem).clamp(0.0, 1.0).min(((high - x) / hem).clamp(0.0, 1.0))
}

/// Where a hem goes from nothing to its whole thickness.
const HEM: f64 = 0.006;
/// Half the width of a horn or tail at its root.
const ROOT: f64 = 0.03;

/// Dresses `body`, which stands along y and looks along z.
///
/// # Errors
/// [`Error::Input`] for a body without height.
pub fn dressed(body: &Mesh, outfit: &Outfit) -> Result<Dressed> {
    let topology = Topology::new(body);
    let normals = vertex_normals(body, &topology);
    let Some((low, high)) = body.bounds().filter(|(low, high)| high.y > low.y) else {
        return Err(Error::input("the body has no height", "Give one that stands along y"));
    };
    let (height, middle) = (high.y - low.y, 0.5 * (low + high));
    let share = |p: DVec3| (p.y - low.y) / height;
    let used: Vec<usize> =
        (0..body.vertex_count()).filter(|&v| !topology.vertex_triangles(v as u32).is_empty()).collect();
    let most = |value: &dyn Fn(DVec3) -> f64| -> DVec3 {
        let best = used.iter().max_by(|a, b| value(body.positions[**a]).total_cmp(&value(body.positions[**b])));
        best.map_or(middle, |&v| body.positions[v])
    };
    let roots = [
        (most(&|p| p.y + 0.5 * p.x), DVec3::new(0.3, 1.0, 0.0), outfit.horns),
        (most(&|p| p.y - 0.5 * p.x), DVec3::new(-0.3, 1.0, 0.0), outfit.horns),
        (
            most(&|p| if (0.45..0.55).contains(&share(p)) { -p.z } else { f64::NEG_INFINITY }),
            DVec3::new(0.0, 0.3, -1.0),
            outfit.tail,
        ),
    ];
    let place = |v: usize| -> DVec3 {
        let (p, n) = (body.positions[v], normals[v]);
        let h = share(p);
        let coat = band(h, 0.43, 0.82, HEM);
        let around = (p.z - middle.z).atan2(p.x - middle.x);
        let fold = 0.5 * outfit.folds * (1.0 + (140.0 * h + 6.0 * around).sin());
        let face = band(h, 0.91, 0.94, HEM) * f64::from(u8::from(n.z > 0.5));
        let push = coat * (outfit.coat + fold)
            + band(h, 0.83, 0.86, HEM) * outfit.collar
            + band(h, -1.0, 0.13, HEM) * outfit.boots
            + face * outfit.goggles;
        let wide = DVec3::new(p.x - middle.x, 0.0, p.z - middle.z) * outfit.wider;
        let mut q = p + wide + n * push * height;
        for (root, direction, length) in roots {
            let t = (1.0 - p.distance(root) / (ROOT * height)).max(0.0);
            q += direction.normalize() * (length * height * t * t);
        }
        q
    };
    let positions: Vec<DVec3> = (0..body.vertex_count()).map(place).collect();
    let triangles: Vec<[u32; 3]> =
        topology.triangles.iter().zip(&topology.usable).filter(|(_, u)| **u).map(|(t, _)| *t).collect();
    let vertices = if outfit.vertices == 0 { usize::MAX } else { outfit.vertices };
    let kept = simplify(&positions, &triangles, &SimplifyOptions { vertices, longest_edge: f64::INFINITY })?;
    let mut number = vec![0; positions.len()];
    kept.vertices.iter().zip(0..).for_each(|(&v, k)| number[v as usize] = k);
    let triangles: Vec<[u32; 3]> = kept.triangles.iter().map(|t| t.map(|v| number[v as usize])).collect();
    let places = kept.vertices.iter().map(|&v| positions[v as usize]).collect();
    Ok(Dressed { mesh: Mesh::of_triangles("dressed", places, &triangles), truth: kept.vertices })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::Walker;

    #[test]
    fn an_outfit_pushes_outwards_and_keeps_vertices() {
        let body = Walker::new(0.03).mesh;
        let plain = dressed(&body, &Outfit::default()).unwrap();
        assert_eq!(plain.mesh.positions, body.positions);
        let outfit = Outfit { coat: 0.02, boots: 0.01, horns: 0.1, tail: 0.2, vertices: 1500, ..Outfit::default() };
        let worn = dressed(&body, &outfit).unwrap();
        assert_eq!((worn.mesh.vertex_count(), worn.truth.len()), (1500, 1500));
        let (low, high) = body.bounds().unwrap();
        let height = high.y - low.y;
        let moved = |h: std::ops::Range<f64>| -> Vec<f64> {
            let at = |v: u32| body.positions[v as usize];
            let each = worn.truth.iter().zip(&worn.mesh.positions);
            let inside = each.filter(|(v, _)| h.contains(&((at(**v).y - low.y) / height)));
            inside.map(|(v, p)| p.distance(at(*v)) / height).collect()
        };
        assert!(moved(0.6..0.75).iter().all(|d| (d - 0.02).abs() < 1e-9));
        assert!(moved(0.2..0.4).iter().all(|d| *d == 0.0));
        assert!(moved(0.0..0.1).iter().all(|d| (d - 0.01).abs() < 1e-9));
        let longest = moved(0.9..1.1).into_iter().fold(0.0, f64::max);
        assert!((0.09..0.11).contains(&longest), "a horn of {longest}");
        assert!(dressed(&Mesh::default(), &outfit).is_err());
    }
}
