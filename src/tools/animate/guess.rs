//! A binding without a file: the clip is laid onto the mesh by iterated closest points, then each marker takes the vertex nearest to it, and each bone
//! takes vertices around it.
//!
//! Iterated closest points (Besl, McKay 1992) finds the nearest minimum only: it begins from all 24 ways to turn axes into axes, at the size and
//! place of the bounding boxes, and the best end is taken. A tenth of the points, those farthest off, have no say (markers on stalks, strays).

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::binding::{Binding, Bond, Reference, reference_point};
use crate::encoding::Similarity;
use crate::error::{Error, Result};
use crate::geometry::Mesh;
use crate::io::motion::Motion;

/// Steps of the iteration; it converges in fewer.
const STEPS: usize = 40;
/// How far the size may go from that of the bounding boxes.
const GROWTH: f64 = 1.3;
/// Markers farther from the surface than this part of the mesh's diagonal are left out.
const FAR: f64 = 0.06;
/// Bones shorter than this part of the diagonal (fingers, eyes) take no vertices.
const SHORT: f64 = 0.04;
/// Where along a bone vertices are taken, and how many around it at each place.
const ALONG: [f64; 2] = [0.25, 0.75];
const AROUND: usize = 4;

/// Binds the points of `motion` to `mesh` by the shape of the `reference` pose alone.
///
/// The performer must stand in it much as the mesh does; left and right are told by shape only. The residuals tell how well it went: look at them, and at
/// the picture. Markers without a name of their own (`*17`), with a gap in the reference frame or far from the surface are left out, with a warning.
/// O(points * vertices).
///
/// # Errors
/// [`Error::Input`] if fewer than four markers or two bones can be bound; [`Error::Mesh`] without vertices.
pub fn guess(motion: &Motion, mesh: &Mesh, reference: Reference) -> Result<Binding> {
    let used = used_vertices(mesh);
    if used.len() < 4 {
        return Err(Error::mesh(&mesh.name, "there are no faces to bind to", "Use a mesh with faces"));
    }
    let vertices: Vec<DVec3> = used.iter().map(|&v| mesh.positions[v as usize]).collect();
    let named = |k: &usize| !motion.names[*k].starts_with('*');
    let points: Vec<(usize, DVec3)> = (0..motion.point_count())
        .filter(named)
        .filter_map(|k| Some((k, reference_point(motion, reference, k).ok()?)))
        .collect();
    if points.len() < 4 {
        // Also tells of a reference that does not exist.
        reference_point(motion, reference, 0)?;
        let what = format!("{}: {} markers are seen in the reference pose", motion.path.display(), points.len());
        return Err(Error::input(what, "Choose a frame in which at least four are seen"));
    }
    let clip: Vec<DVec3> = points.iter().map(|p| p.1).collect();
    let fit = laid_on(&clip, &vertices);
    let size = diagonal(&vertices);
    let mut warnings = Vec::new();
    let bonds = match &motion.skeleton {
        None => around_markers(motion, &points, &used, &vertices, &fit, FAR * size, &mut warnings),
        Some(_) => around_bones(motion, reference, &used, &vertices, &fit, SHORT * size)?,
    };
    if bonds.len() < 4 {
        let what = format!("{}: only {} points of the clip come near the mesh", motion.path.display(), bonds.len());
        return Err(Error::input(what, "Name the vertices of the markers in a file"));
    }
    let mut binding = Binding::fitted(motion, mesh, bonds, fit, reference)?;
    binding.warnings.extend(warnings);
    Ok(binding)
}

fn used_vertices(mesh: &Mesh) -> Vec<u32> {
    let mut used = vec![false; mesh.vertex_count()];
    for t in 0..mesh.triangle_count() {
        mesh.triangle(t).iter().for_each(|&v| used[v as usize] = mesh.positions[v as usize].is_finite());
    }
    (0..mesh.vertex_count() as u32).filter(|&v| used[v as usize]).collect()
}

fn bounds(points: &[DVec3]) -> (DVec3, DVec3) {
    points.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), p| (l.min(*p), h.max(*p)))
}

fn diagonal(points: &[DVec3]) -> f64 {
    let (low, high) = bounds(points);
    low.distance(high)
}

/// The 24 rotations that take axes to axes.
fn turns() -> Vec<DMat3> {
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    let mut turns = Vec::new();
    for i in 0..3 {
        for j in (0..3).filter(|&j| j != i) {
            for (a, b) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
                let (x, y) = (axes[i] * a, axes[j] * b);
                turns.push(DMat3::from_cols(x, y, x.cross(y)));
            }
        }
    }
    turns
}

/// The similarity that lays the clip onto the vertices best.
fn laid_on(clip: &[DVec3], vertices: &[DVec3]) -> Similarity {
    let ends: Vec<(f64, Similarity)> = turns().par_iter().map(|turn| closest_points(clip, vertices, turn)).collect();
    let mut best = ends[0];
    for end in ends {
        if end.0 < best.0 {
            best = end;
        }
    }
    best.1
}

fn closest_points(clip: &[DVec3], vertices: &[DVec3], turn: &DMat3) -> (f64, Similarity) {
    let turned: Vec<DVec3> = clip.iter().map(|p| *turn * *p).collect();
    let ((a, b), (c, d)) = (bounds(&turned), bounds(vertices));
    let scale = d.distance(c) / b.distance(a).max(f64::MIN_POSITIVE);
    let mut fit = Similarity { rotation: *turn, scale, shift: (c + d - (a + b) * scale) * 0.5 };
    let mut error = f64::INFINITY;
    for _ in 0..STEPS {
        let mut pairs: Vec<(f64, DVec3, DVec3)> = clip
            .iter()
            .map(|p| {
                let at = fit.apply(*p);
                let near = vertices.iter().map(|v| (v.distance_squared(at), *v));
                let (distance, v) = near.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((0.0, at));
                (distance, *p, v)
            })
            .collect();
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        pairs.truncate((pairs.len() * 9).div_ceil(10));
        let now = pairs.iter().map(|p| p.0).sum::<f64>() / pairs.len() as f64;
        let size = fit.scale;
        if !(now < error * (1.0 - 1e-4)) {
            break;
        }
        error = now;
        let pairs: Vec<(DVec3, DVec3)> = pairs.into_iter().map(|p| (p.1, p.2)).collect();
        let mut next = Similarity::fit(&pairs);
        let allowed = next.scale.clamp(scale / GROWTH, scale * GROWTH).clamp(0.95 * size, 1.05 * size);
        // The same centre with the size that is allowed.
        let centre = pairs.iter().fold(DVec3::ZERO, |s, p| s + p.0) / pairs.len() as f64;
        next.shift += next.rotation * centre * (next.scale - allowed);
        next.scale = allowed;
        fit = next;
    }
    // A small clip is near to everything: the distance counts in the clip's own size.
    (error / (fit.scale * fit.scale), fit)
}

/// The vertex nearest to each marker, each vertex once.
fn around_markers(
    motion: &Motion,
    points: &[(usize, DVec3)],
    used: &[u32],
    vertices: &[DVec3],
    fit: &Similarity,
    far: f64,
    warnings: &mut Vec<String>,
) -> Vec<Bond> {
    let (mut bonds, mut left_out) = (Vec::<Bond>::new(), Vec::new());
    for &(point, p) in points {
        let at = fit.apply(p);
        let near = vertices.iter().enumerate().map(|(k, v)| (v.distance(at), k));
        let Some((distance, k)) = near.min_by(|a, b| a.0.total_cmp(&b.0)) else { continue };
        if distance <= far && bonds.iter().all(|b| b.vertex != used[k]) {
            bonds.push(Bond { vertex: used[k], point });
        } else {
            left_out.push(motion.names[point].as_str());
        }
    }
    if !left_out.is_empty() {
        left_out.truncate(12);
        warnings.push(format!(
            "markers away from the surface or at one place with another were left out: {}",
            left_out.join(", ")
        ));
    }
    bonds
}

/// Vertices around the bones: at two places along each, four around it. Each vertex belongs to the bone it is nearest to.
fn around_bones(
    motion: &Motion,
    reference: Reference,
    used: &[u32],
    vertices: &[DVec3],
    fit: &Similarity,
    short: f64,
) -> Result<Vec<Bond>> {
    let Some(skeleton) = &motion.skeleton else { return Ok(Vec::new()) };
    let mut bones = Vec::new();
    for segment in &skeleton.segments {
        let a = fit.apply(reference_point(motion, reference, segment.from)?);
        let b = fit.apply(reference_point(motion, reference, segment.to)?);
        if a.distance(b) >= short {
            bones.push((segment.follows, a, b));
        }
    }
    let distance = |p: DVec3, a: DVec3, b: DVec3| {
        let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
        p.distance(a.lerp(b, t))
    };
    let owner: Vec<usize> = vertices
        .par_iter()
        .map(|p| {
            let all = bones.iter().enumerate().map(|(k, (_, a, b))| (distance(*p, *a, *b), k));
            all.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(0, |x| x.1)
        })
        .collect();
    let mut bonds: Vec<Bond> = Vec::new();
    for (bone, &(follows, a, b)) in bones.iter().enumerate() {
        let axis = (b - a).normalize();
        let side = axis.any_orthonormal_vector();
        let other = axis.cross(side);
        for along in ALONG {
            for k in 0..AROUND {
                let angle = std::f64::consts::TAU * (k as f64 + 2.0 * along) / AROUND as f64;
                let ray = side * angle.cos() + other * angle.sin();
                let centre = a.lerp(b, along);
                // How far a vertex is from the half line out of the bone.
                let off = |p: DVec3| {
                    let d = p - centre;
                    let out = d.dot(ray);
                    if out > 0.0 { (d - ray * out).length() } else { f64::INFINITY }
                };
                let own =
                    (0..vertices.len()).filter(|&v| owner[v] == bone && bonds.iter().all(|b| b.vertex != used[v]));
                let best = own.map(|v| (off(vertices[v]), v)).min_by(|a, b| a.0.total_cmp(&b.0));
                if let Some((_, v)) = best.filter(|best| best.0 < 0.2 * a.distance(b)) {
                    bonds.push(Bond { vertex: used[v], point: follows });
                }
            }
        }
    }
    Ok(bonds)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::strider;

    #[test]
    fn markers_find_their_vertices_in_other_units_and_axes() {
        let mesh = strider().mesh;
        let to_clip = Similarity {
            rotation: DMat3::from_rotation_x(1.7) * DMat3::from_rotation_z(0.15),
            scale: 900.0,
            shift: DVec3::new(9.0, 5.0, 3000.0),
        };
        let chosen: Vec<usize> = (0..40).map(|k| mesh.vertex_count() * k / 40).collect();
        let frame: Vec<Option<DVec3>> = chosen.iter().map(|&v| Some(to_clip.apply(mesh.positions[v]))).collect();
        let mut motion = Motion {
            path: "clip".into(),
            names: (0..40).map(|k| format!("M{k}")).collect(),
            rate: 100.0,
            frames: vec![frame],
            metres_per_unit: None,
            skeleton: None,
            warnings: Vec::new(),
        };
        let binding = guess(&motion, &mesh, Reference::Frame(0)).unwrap();
        let right = binding.bonds.iter().filter(|b| chosen[b.point] == b.vertex as usize).count();
        assert!(right >= 36, "{right} of 40, rms {}", binding.rms());
        // One marker far away and one without a name are left out.
        motion.frames[0][3] = Some(to_clip.apply(mesh.bounds().unwrap().1 * 1.5));
        motion.names[4] = "*4".into();
        let binding = guess(&motion, &mesh, Reference::Frame(0)).unwrap();
        assert!(binding.bonds.iter().all(|b| b.point != 3 && b.point != 4));
        assert!(binding.warnings.iter().any(|w| w.contains("M3")), "{:?}", binding.warnings);
        assert!(guess(&motion, &mesh, Reference::Frame(1)).is_err());
        motion.frames[0].iter_mut().skip(3).for_each(|p| *p = None);
        assert!(guess(&motion, &mesh, Reference::Frame(0)).unwrap_err().to_string().contains("3 markers"));
    }

    #[test]
    fn there_are_24_turns_and_no_mirror() {
        let turns = turns();
        assert_eq!(turns.len(), 24);
        assert!(turns.iter().all(|t| (t.determinant() - 1.0).abs() < 1e-12));
    }
}
