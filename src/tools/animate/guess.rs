//! A binding without a file: the clip is laid onto the mesh by iterated closest points, then each
//! marker takes the vertex nearest to it, and each bone takes vertices around it.
//!
//! Iterated closest points (Besl, McKay 1992) finds the nearest minimum only. It begins at the
//! height and place of the bounding boxes from eight headings, with y or z up on either side, and
//! the best end is taken. Points are paired both ways, each point of the clip with the mesh and
//! each sample of the mesh with the clip: one way alone, a small clip hides inside the body. Both
//! sides are thinned to evenly spread samples first, and a tenth of the pairs, those farthest
//! apart, have no say (markers on stalks, strays).

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::binding::{Binding, Bond, Reference, reference_point};
use super::bones::around_bones;
use super::facing::Facing;
use super::settle::{normals, onto_surface};
use crate::encoding::Similarity;
use crate::error::{Error, Result};
use crate::geometry::{Frame, Mesh};
use crate::io::motion::{Motion, Segment};

/// Most steps of the iteration.
const STEPS: usize = 60;
/// How far the size may go from that of the heights: arms may be held differently, the height
/// hardly.
const GROWTH: f64 = 1.1;
/// An end that faces as the mesh does is taken if its error (a mean square) is at most so many
/// times the best one's.
const WORSE: f64 = 4.0;
/// Ends whose errors are that near are told to be alike.
const ALIKE: f64 = 1.5;
/// Headings tried for each way up.
const HEADINGS: usize = 8;
/// Samples of the mesh and of the clip.
const MESH_SAMPLES: usize = 400;
const CLIP_SAMPLES: usize = 150;
/// Points taken along the longest side of a skeleton.
const BONE_SAMPLES: f64 = 40.0;
/// Markers farther from the surface than this part of the mesh's diagonal are left out.
const FAR: f64 = 0.06;
/// Bones shorter than this part of the diagonal (fingers, eyes) are taken together.
const SHORT: f64 = 0.04;

/// Binds the points of `motion` to `mesh` by the shape of the `reference` pose alone.
///
/// The performer must stand in it much as the mesh does; left and right are told by shape only. The
/// residuals tell how well it went: look at them, and at the picture. Markers without a name of
/// their own (`*17`), with a gap in the reference frame or far from the surface are left out, with
/// a warning. O(points * vertices).
///
/// # Errors
/// [`Error::Input`] if fewer than four markers or two bones can be bound; [`Error::Mesh`] without
/// vertices.
pub fn guess(motion: &Motion, mesh: &Mesh, reference: Reference) -> Result<Binding> {
    let used = used_vertices(mesh);
    if used.len() < 4 {
        return Err(Error::mesh(&mesh.name, "there are no faces to bind to", "Use a mesh with faces"));
    }
    // The fit is to the mesh in its frame until it is found.
    let frame = Frame::of(used.iter().map(|&v| mesh.positions[v as usize]));
    let vertices: Vec<DVec3> = used.iter().map(|&v| frame.local(mesh.positions[v as usize])).collect();
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
    let clip = match &motion.skeleton {
        None => points.iter().map(|p| p.1).collect(),
        Some(skeleton) => along_bones(motion, &skeleton.segments, reference)?,
    };
    let mut warnings = Vec::new();
    let samples = spread_out(&vertices, MESH_SAMPLES);
    let ends = laid_on(&spread_out(&clip, CLIP_SAMPLES), &samples);
    let size = diagonal(&vertices);
    let mut fit = facing(&ends, &Facing::new(motion, &points), &vertices, size, &mut warnings);
    if motion.skeleton.is_none() {
        // Joints lie inside the body; markers on it.
        let normals = normals(mesh, &used);
        fit = onto_surface(&clip, &vertices, &normals, fit, [FAR * size, GROWTH]);
    }
    let bonds = match &motion.skeleton {
        None => around_markers(motion, &points, &used, &vertices, &fit, FAR * size, &mut warnings),
        Some(_) => around_bones(motion, reference, &used, &vertices, &fit, SHORT * size)?,
    };
    if bonds.len() < 4 {
        let what = format!("{}: only {} points of the clip come near the mesh", motion.path.display(), bonds.len());
        return Err(Error::input(what, "Name the vertices of the markers in a file"));
    }
    let fit = Similarity { scale: fit.scale / frame.scale, shift: frame.world(fit.shift), ..fit };
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

/// Points along the bones, evenly by length: joints crowd in hands and faces.
fn along_bones(motion: &Motion, segments: &[Segment], reference: Reference) -> Result<Vec<DVec3>> {
    let ends: Vec<(DVec3, DVec3)> = segments
        .iter()
        .map(|s| Ok((reference_point(motion, reference, s.from)?, reference_point(motion, reference, s.to)?)))
        .collect::<Result<_>>()?;
    let all: Vec<DVec3> = ends.iter().flat_map(|e| [e.0, e.1]).collect();
    let spacing = diagonal(&all) / BONE_SAMPLES;
    let mut points = Vec::new();
    for (a, b) in ends {
        let steps = if spacing > 0.0 { (a.distance(b) / spacing).ceil().clamp(1.0, BONE_SAMPLES) } else { 1.0 };
        points.extend((0..=steps as usize).map(|k| a.lerp(b, k as f64 / steps)));
    }
    Ok(points)
}

/// At most `most` of the points, each as far as possible from those before it.
pub(super) fn spread_out(points: &[DVec3], most: usize) -> Vec<DVec3> {
    let mut distance = vec![f64::INFINITY; points.len()];
    let mut chosen: Vec<DVec3> = Vec::new();
    let mut next = 0;
    while chosen.len() < most.min(points.len()) && distance[next] > 0.0 {
        let p = points[next];
        chosen.push(p);
        next = 0;
        for (k, q) in points.iter().enumerate() {
            distance[k] = distance[k].min(q.distance_squared(p));
            if distance[k] > distance[next] {
                next = k;
            }
        }
    }
    chosen
}

/// Rotations with y or z up before and after, at all headings; beside each the way up after it.
fn turns() -> Vec<(DMat3, DVec3)> {
    // From z up to y up.
    let tip = DMat3::from_rotation_x(-std::f64::consts::FRAC_PI_2);
    let heading = |k: usize| DMat3::from_rotation_y(std::f64::consts::TAU * k as f64 / HEADINGS as f64);
    let ways = [
        (DMat3::IDENTITY, DMat3::IDENTITY),
        (tip, DMat3::IDENTITY),
        (DMat3::IDENTITY, tip.transpose()),
        (tip, tip.transpose()),
    ];
    ways.iter()
        .flat_map(|(before, after)| (0..HEADINGS).map(move |k| (*after * heading(k) * *before, *after * DVec3::Y)))
        .collect()
}

/// An end of the iteration: its error (a mean square), the similarity, and the way up of the mesh
/// that it was begun with.
type End = (f64, Similarity, DVec3);

/// The similarities that lay the clip onto the vertices, best first.
fn laid_on(clip: &[DVec3], vertices: &[DVec3]) -> Vec<End> {
    let one = |(turn, up): &(DMat3, DVec3)| {
        let (error, fit) = closest_points(clip, vertices, turn, *up);
        (error, fit, *up)
    };
    let mut ends: Vec<End> = turns().par_iter().map(one).collect();
    ends.sort_by(|a, b| a.0.total_cmp(&b.0));
    ends
}

/// The best of the ends that face as the mesh does, where that can be told and costs not too much;
/// and a word where it mattered.
fn facing(ends: &[End], facing: &Facing, vertices: &[DVec3], size: f64, warnings: &mut Vec<String>) -> Similarity {
    let (best, fit, _) = ends[0];
    let rms = |error: f64| 100.0 * (0.5 * error).sqrt() / size;
    let told = |end: &End| facing.agrees(&end.1.rotation, vertices, end.2);
    // Turned by more than a right angle against it.
    let apart = |end: &&End| {
        let turn = (end.1.rotation.transpose() * fit.rotation).to_cols_array_2d();
        (0..3).map(|k| turn[k][k]).sum::<f64>() < 1.0
    };
    let other = ends.iter().find(apart);
    match told(&ends[0]) {
        Some(true) => fit,
        Some(false) => match ends.iter().find(|end| told(end) == Some(true) && end.0 < WORSE * best) {
            Some(end) => {
                warnings.push(format!(
                    "by shape alone the clip would lie on the mesh back to front ({:.1} % of its size between them); by names, toes and walk it lies \
                     as it does now ({:.1} %)",
                    rms(best),
                    rms(end.0)
                ));
                end.1
            }
            None => {
                warnings.push(
                    "names, toes and walk say that the clip lies on the mesh back to front: look at the picture".into(),
                );
                fit
            }
        },
        None => {
            if let Some(other) = other.filter(|end| end.0 < ALIKE * best) {
                warnings.push(format!(
                    "the clip lies on the mesh almost as well another way round ({:.1} and {:.1} % of its size between them): look at the picture",
                    rms(best),
                    rms(other.0)
                ));
            }
            fit
        }
    }
}

/// The pairs of each of `from` with the nearest of `to`, without the tenth that is farthest apart,
/// and the mean of their squared distances.
fn pairs(from: &[DVec3], to: &[DVec3]) -> (f64, Vec<(usize, usize)>) {
    let mut pairs: Vec<(f64, usize, usize)> = from
        .iter()
        .enumerate()
        .map(|(i, p)| {
            let near = to.iter().enumerate().map(|(j, q)| (p.distance_squared(*q), j));
            let (distance, j) = near.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((0.0, 0));
            (distance, i, j)
        })
        .collect();
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    pairs.truncate((pairs.len() * 9).div_ceil(10));
    let mean = pairs.iter().map(|p| p.0).sum::<f64>() / pairs.len().max(1) as f64;
    (mean, pairs.into_iter().map(|p| (p.1, p.2)).collect())
}

fn closest_points(clip: &[DVec3], vertices: &[DVec3], turn: &DMat3, up: DVec3) -> (f64, Similarity) {
    let turned: Vec<DVec3> = clip.iter().map(|p| *turn * *p).collect();
    let ((a, b), (c, d)) = (bounds(&turned), bounds(vertices));
    let scale = (d - c).dot(up).abs() / (b - a).dot(up).abs().max(1e-6 * a.distance(b)).max(f64::MIN_POSITIVE);
    let mut fit = Similarity { rotation: *turn, scale, shift: (c + d - (a + b) * scale) * 0.5 };
    let mut best = (f64::INFINITY, fit);
    for _ in 0..STEPS {
        let placed: Vec<DVec3> = clip.iter().map(|p| fit.apply(*p)).collect();
        let (there, out) = pairs(&placed, vertices);
        let (back, home) = pairs(vertices, &placed);
        let error = there + back;
        let slow = !(error < best.0 * (1.0 - 1e-5));
        if error < best.0 {
            best = (error, fit);
        }
        if slow {
            break;
        }
        // A point of the clip meets the mean of the samples that chose it and of the one it chose.
        let mut sums = vec![(DVec3::ZERO, 0.0); clip.len()];
        for (p, v) in out.into_iter().chain(home.into_iter().map(|(v, p)| (p, v))) {
            sums[p].0 += vertices[v];
            sums[p].1 += 1.0;
        }
        let met: Vec<(DVec3, DVec3)> =
            clip.iter().zip(&sums).filter(|(_, s)| s.1 > 0.0).map(|(p, s)| (*p, s.0 / s.1)).collect();
        let mut next = Similarity::fit(&met);
        let allowed = next.scale.clamp(scale / GROWTH, scale * GROWTH);
        // The same centre at the size that is allowed.
        let centre = met.iter().fold(DVec3::ZERO, |s, p| s + p.0) / met.len().max(1) as f64;
        next.shift += next.rotation * centre * (next.scale - allowed);
        next.scale = allowed;
        fit = next;
    }
    best
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
        // Markers lie on their vertices: each finds its own.
        let right = binding.bonds.iter().filter(|b| chosen[b.point] == b.vertex as usize).count();
        assert!(right >= 36, "{right} of 40, rms {}", binding.rms());
        assert!(binding.rms() < 1e-6 * diagonal(&mesh.positions), "{}", binding.rms());
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
    fn turns_are_rotations_and_distinct() {
        let turns = turns();
        assert_eq!(turns.len(), 4 * HEADINGS);
        for (k, (a, up)) in turns.iter().enumerate() {
            assert!((a.determinant() - 1.0).abs() < 1e-12 && (up.y + up.z - 1.0).abs() < 1e-12);
            assert!(turns[..k].iter().all(|(b, way)| !a.abs_diff_eq(*b, 1e-6) || !up.abs_diff_eq(*way, 1e-6)));
        }
    }

    #[test]
    fn samples_spread() {
        let line: Vec<DVec3> = (0..101).map(|k| DVec3::X * f64::from(k).powi(2)).collect();
        let chosen = spread_out(&line, 3);
        assert_eq!((chosen[0].x, chosen[1].x), (0.0, 10000.0));
        assert!((chosen[2].x - 5000.0).abs() < 200.0);
        assert_eq!(spread_out(&[DVec3::X; 5], 3).len(), 1);
    }
}
