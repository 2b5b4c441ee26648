//! Writing a moving mesh as GLB: morph targets, and an animation of their weights.

use std::path::Path;

use glam::{DQuat, DVec3, Quat, Vec3};
use serde_json::{Value, json};

use super::gltf_components::{Components, normal_change};
use super::gltf_parts::{ARRAY, FLOAT, Parts, UNSIGNED_INT};
use super::gltf_scene::GltfScene;
use super::gltf_split::{Split, SplitVertex, vertex_normals};
use super::gltf_write::{GlbMaterial, glb_with};
use super::output;
use crate::geometry::Mesh;
use crate::{Error, Result};

/// How frames become morph targets.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum MorphForm {
    /// [`MorphForm::Frames`] up to 64 frames and 48 MiB, else [`MorphForm::Components`] with 2e-4
    /// of the mesh's diagonal.
    #[default]
    Auto,
    /// Every frame is a target; between two frames the vertices go straight from one to the other.
    /// The file grows by 24 bytes a vertex and frame (less where few vertices move) and 4 bytes a
    /// pair of frames.
    Frames,
    /// Frames are weighted sums of few targets, as many as are needed to bring every vertex of
    /// every frame within `tolerance` (in the mesh's units) of its place. The file grows by 24
    /// bytes a vertex and target and 4 bytes a frame and target.
    Components {
        /// Largest distance of a vertex from its place.
        tolerance: f64,
    },
}

/// Frames of a mesh over time.
#[derive(Clone, Copy, Debug)]
pub struct GlbAnimation<'a> {
    /// Its name in the file.
    pub name: &'a str,
    /// When each frame is shown, in seconds: not negative, each later than the one before.
    pub times: &'a [f32],
    /// For each frame a position for each vertex of the mesh, in the mesh's units and axes.
    pub frames: &'a [Vec<Vec3>],
    /// Where each frame's shape is put as a whole, `x -> rotation x + shift`; empty to leave all
    /// frames where they are. What a rigid motion explains need not be told by targets.
    pub placements: &'a [(DQuat, DVec3)],
    /// How the frames are stored.
    pub form: MorphForm,
}

/// What was written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GlbAnimationReport {
    /// Morph targets.
    pub targets: usize,
    /// Whether they are components rather than frames.
    pub components: bool,
    /// Largest distance of a vertex from its place in any frame, in the mesh's units.
    pub largest_error: f64,
    /// Size of the file.
    pub bytes: usize,
}

/// Frames up to which [`MorphForm::Auto`] stores each.
const FEW: usize = 64;
/// Bytes up to which it does so.
const SMALL: usize = 48 << 20;
/// Tolerance it takes otherwise, of the diagonal of the mesh.
const TOLERANCE: f64 = 2e-4;
/// Bytes of a vertex in a target: position and normal.
const VERTEX: usize = 24;

/// Writes `mesh` and its animation as a binary glTF 2.0 file, as [`super::write_glb`] does without
/// one; the mesh itself is the shape at rest.
///
/// The file is made in memory: about twice its size, and for [`MorphForm::Components`] 48 bytes a
/// vertex and target, are needed besides the frames.
///
/// # Errors
/// As [`super::write_glb`]; [`Error::Input`] for frames that do not fit the mesh, its times or one
/// another, or are not finite.
pub fn write_animated_glb(
    path: impl AsRef<Path>,
    mesh: &Mesh,
    materials: &[GlbMaterial],
    animation: &GlbAnimation<'_>,
) -> Result<GlbAnimationReport> {
    let (bytes, report) = animated_glb_bytes(mesh, materials, animation)?;
    output::write_bytes(path, &bytes)?;
    Ok(report)
}

/// The bytes [`write_animated_glb`] writes.
///
/// # Errors
/// As [`write_animated_glb`].
pub fn animated_glb_bytes(
    mesh: &Mesh,
    materials: &[GlbMaterial],
    animation: &GlbAnimation<'_>,
) -> Result<(Vec<u8>, GlbAnimationReport)> {
    let (targets, components) = morph_targets(mesh, animation)?;
    let rest = vertex_normals(mesh, &mesh.positions);
    let write = |split: &Split, out: &mut Parts| {
        let all = targets.shapes.iter().zip(&targets.normals);
        let target = |(shape, normals): (&Vec<Vec3>, &Vec<Vec3>)| {
            // Joined vertices move with the one that stands for them.
            let moved = |v: &SplitVertex| shape[mesh.representative(v.vertex) as usize];
            let turned = |v: &SplitVertex| {
                let r = mesh.representative(v.vertex) as usize;
                turned(v.normal, rest[r].as_vec3(), normals[r])
            };
            let (shape, normals): (Vec<_>, Vec<_>) = split.vertices.iter().map(|v| (moved(v), turned(v))).unzip();
            json!({"POSITION": displacements(&shape, true, out), "NORMAL": displacements(&normals, false, out)})
        };
        Ok(all.map(target).collect())
    };
    let finish = |root: &mut Value, out: &mut Parts| channels(animation, &targets, root, out);
    let bytes = glb_with(mesh, materials, write, finish)?;
    let report = GlbAnimationReport {
        targets: targets.shapes.len(),
        components,
        largest_error: targets.error,
        bytes: bytes.len(),
    };
    Ok((bytes, report))
}

/// The bytes of the file that `mesh` was read from, with the animation added: the meshes get morph
/// targets behind those that they have, and all else stays. Also what the user should know of it.
///
/// Placements become part of the shapes: the mesh may hang on any nodes and joints.
///
/// # Errors
/// As [`write_animated_glb`]; [`Error::Mesh`] for another mesh, [`Error::Format`] for damage.
pub fn animated_scene_bytes(
    scene: &GltfScene,
    mesh: &Mesh,
    animation: &GlbAnimation<'_>,
) -> Result<(Vec<u8>, Vec<String>, GlbAnimationReport)> {
    check(mesh, animation)?;
    let placed = |(frame, (turn, shift)): (&Vec<Vec3>, &(DQuat, DVec3))| -> Vec<Vec3> {
        frame.iter().map(|p| (*turn * p.as_dvec3() + *shift).as_vec3()).collect()
    };
    let frames: Vec<Vec<Vec3>> = animation.frames.iter().zip(animation.placements).map(placed).collect();
    let animation = match animation.placements {
        [] => *animation,
        _ => GlbAnimation { frames: &frames, placements: &[], ..*animation },
    };
    let (targets, components) = morph_targets(mesh, &animation)?;
    let mut edit = scene.edit();
    edit.frames(mesh, &animation, &targets)?;
    let (bytes, notes) = edit.finish()?;
    let report = GlbAnimationReport {
        targets: targets.shapes.len(),
        components,
        largest_error: targets.error,
        bytes: bytes.len(),
    };
    Ok((bytes, notes, report))
}

/// The frames as morph targets, and whether they are components.
fn morph_targets(mesh: &Mesh, animation: &GlbAnimation<'_>) -> Result<(Components, bool)> {
    check(mesh, animation)?;
    let (n, count) = (mesh.vertex_count(), animation.frames.len());
    let few = count <= FEW && count.saturating_mul(n).saturating_mul(VERTEX) <= SMALL;
    let diagonal = mesh.bounds().map_or(0.0, |(low, high)| low.distance(high));
    let tolerance = match animation.form {
        MorphForm::Frames => None,
        MorphForm::Auto if few => None,
        MorphForm::Auto => Some(TOLERANCE * diagonal),
        MorphForm::Components { tolerance } => Some(tolerance),
    };
    let targets = match tolerance {
        Some(tolerance) => {
            let most = u32::MAX as usize / (VERTEX * n.max(1));
            let components = Components::new(mesh, animation.frames, tolerance, most);
            if components.shapes.len() == most && most < count && components.error > tolerance {
                return Err(too_large(mesh, most + 1, "Use a larger tolerance or a part of the clip"));
            }
            components
        }
        None if count.saturating_mul(n).saturating_mul(VERTEX) > u32::MAX as usize => {
            return Err(too_large(mesh, count, "Store components instead of frames, or use fewer frames"));
        }
        None => every_frame(mesh, animation.frames),
    };
    Ok((targets, tolerance.is_some()))
}

/// The change of a corner's `normal` where the smooth one of its vertex changes from `rest` by
/// `change`: both turn by the same least rotation.
pub(super) fn turned(normal: Vec3, rest: Vec3, change: Vec3) -> Vec3 {
    let after = (rest + change).try_normalize();
    match after.filter(|_| normal.distance_squared(rest) > 1e-10) {
        Some(after) => Quat::from_rotation_arc(rest, after) * normal - normal,
        None => change,
    }
}

fn too_large(mesh: &Mesh, targets: usize, remedy: &str) -> Error {
    let what = format!("{targets} morph targets of {} vertices exceed the format's 4 GiB", mesh.vertex_count());
    Error::mesh(&mesh.name, what, remedy)
}

fn check(mesh: &Mesh, animation: &GlbAnimation<'_>) -> Result<()> {
    let (times, frames) = (animation.times, animation.frames);
    if frames.is_empty() || times.len() != frames.len() {
        let what = format!("{} frames with {} times", frames.len(), times.len());
        return Err(Error::input(what, "Give at least one frame, and a time for each"));
    }
    if !animation.placements.is_empty() && animation.placements.len() != frames.len() {
        let what = format!("{} frames with {} placements", frames.len(), animation.placements.len());
        return Err(Error::input(what, "Give a placement for each frame, or none"));
    }
    if let Some(f) = (0..times.len()).find(|&f| {
        let before = if f == 0 { 0.0 } else { times[f - 1] };
        !(times[f] >= before) || !times[f].is_finite() || (f > 0 && times[f] == before)
    }) {
        let what = format!("frame {f} is at {} seconds, not after the one before", times[f]);
        return Err(Error::input(
            what,
            "Give times in order; beyond about a day single precision cannot tell frames apart",
        ));
    }
    for (f, frame) in frames.iter().enumerate() {
        if frame.len() != mesh.vertex_count() {
            let what = format!("frame {f} has {} vertices, {} has {}", frame.len(), mesh.name, mesh.vertex_count());
            return Err(Error::input(what, "Give frames of the same mesh"));
        }
        if let Some(v) = frame.iter().position(|p| !p.is_finite()) {
            let what = format!("vertex {v} of frame {f} does not fit single precision");
            return Err(Error::input(what, "Scale the mesh or correct the frame"));
        }
    }
    if animation.placements.iter().any(|(q, t)| !q.is_normalized() || !t.as_vec3().is_finite()) {
        return Err(Error::input("a placement is no rigid motion", "Give unit quaternions and finite shifts"));
    }
    Ok(())
}

/// Each frame a target of its own.
fn every_frame(mesh: &Mesh, frames: &[Vec<Vec3>]) -> Components {
    let rest = vertex_normals(mesh, &mesh.positions);
    let single = |of: Vec<DVec3>| of.into_iter().map(|d| d.as_vec3()).collect::<Vec<_>>();
    // From the rest position as it is written, so that rest plus displacement is the frame.
    let shape = |f: &Vec<Vec3>| mesh.positions.iter().zip(f).map(|(r, p)| *p - r.as_vec3()).collect::<Vec<_>>();
    let shapes: Vec<Vec<Vec3>> = frames.iter().map(shape).collect();
    let off = |(f, s): (&Vec<Vec3>, &Vec<Vec3>)| {
        let distance = |((p, d), r): ((&Vec3, &Vec3), &DVec3)| (r.as_vec3() + *d).distance(*p);
        f.iter().zip(s).zip(&mesh.positions).map(distance).fold(0.0, f32::max)
    };
    let error = frames.iter().zip(&shapes).map(off).fold(0.0, f32::max);
    let mut weights = vec![vec![0.0; frames.len()]; frames.len()];
    for (f, row) in weights.iter_mut().enumerate() {
        row[f] = 1.0;
    }
    let normals = frames.iter().map(|f| single(normal_change(mesh, &rest, f))).collect();
    Components { shapes, normals, weights, error: f64::from(error) }
}

/// An accessor of displacements.
fn displacements(values: &[Vec3], bounds: bool, out: &mut Parts) -> usize {
    let accessor = displacement_accessor(values, bounds, &mut |bytes, target| out.view(bytes, target));
    out.accessors.push(accessor);
    out.accessors.len() - 1
}

/// The description of an accessor of displacements, sparse where that is smaller; `view` makes the
/// buffer views.
pub(super) fn displacement_accessor(
    values: &[Vec3],
    bounds: bool,
    view: &mut dyn FnMut(&[u8], Option<u32>) -> usize,
) -> Value {
    let mut moved: Vec<u32> = (0..values.len() as u32).filter(|&v| values[v as usize] != Vec3::ZERO).collect();
    if moved.is_empty() {
        // One zero at vertex 0: not all readers take an accessor that refers to nothing.
        moved.push(0);
    }
    let mut accessor = json!({"componentType": FLOAT, "count": values.len(), "type": "VEC3"});
    let bytes = |picked: &mut dyn Iterator<Item = Vec3>| -> Vec<u8> {
        picked.flat_map(|p| p.to_array()).flat_map(f32::to_le_bytes).collect()
    };
    if 4 * moved.len() >= 3 * values.len() {
        accessor["bufferView"] = view(&bytes(&mut values.iter().copied()), Some(ARRAY)).into();
    } else {
        let indices: Vec<u8> = moved.iter().flat_map(|v| v.to_le_bytes()).collect();
        let indices = view(&indices, None);
        let picked = view(&bytes(&mut moved.iter().map(|&v| values[v as usize])), None);
        accessor["sparse"] = json!({
            "count": moved.len(),
            "indices": {"bufferView": indices, "componentType": UNSIGNED_INT},
            "values": {"bufferView": picked},
        });
    }
    if bounds {
        let low = values.iter().copied().reduce(Vec3::min).unwrap_or_default();
        let high = values.iter().copied().reduce(Vec3::max).unwrap_or_default();
        accessor["min"] = json!(low.to_array());
        accessor["max"] = json!(high.to_array());
    }
    accessor
}

/// The animation itself.
fn channels(animation: &GlbAnimation<'_>, targets: &Components, root: &mut Value, out: &mut Parts) {
    let mut table = |values: Vec<f32>, width: usize, shape: &str, bounds: Option<(f32, f32)>| {
        let bytes: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
        let view = out.view(&bytes, None);
        let mut accessor =
            json!({"bufferView": view, "componentType": FLOAT, "count": values.len() / width, "type": shape});
        if let Some((low, high)) = bounds {
            accessor["min"] = json!([low]);
            accessor["max"] = json!([high]);
        }
        out.accessors.push(accessor);
        out.accessors.len() - 1
    };
    let (first, last) = (animation.times[0], animation.times[animation.times.len() - 1]);
    let times = table(animation.times.to_vec(), 1, "SCALAR", Some((first, last)));
    let (mut samplers, mut tracks) = (Vec::new(), Vec::new());
    let mut track = |path: &str, output: usize| {
        tracks.push(json!({"sampler": samplers.len(), "target": {"node": 0, "path": path}}));
        samplers.push(json!({"input": times, "output": output, "interpolation": "LINEAR"}));
    };
    let count = targets.shapes.len();
    if count > 0 {
        track("weights", table(targets.weights.concat(), 1, "SCALAR", None));
        root["meshes"][0]["weights"] = json!(vec![0.0; count]);
        let names: Vec<String> = (0..count).map(|k| format!("shape_{k}")).collect();
        root["meshes"][0]["extras"] = json!({"targetNames": names});
    }
    if !animation.placements.is_empty() {
        // A mesh far from the origin is written around it: q (x + o) + t = o + q x + (q o + t - o).
        let origin = set_apart(root);
        let around = |(q, t): &(DQuat, DVec3)| (*q * origin - origin + *t).as_vec3().to_array();
        let shifts = animation.placements.iter().flat_map(around).collect();
        track("translation", table(shifts, 3, "VEC3", None));
        let mut before = DQuat::IDENTITY;
        let mut turns = Vec::with_capacity(4 * animation.placements.len());
        for (q, _) in animation.placements {
            // Of the two signs the one that goes the short way.
            let q = if q.dot(before) < 0.0 { -*q } else { *q };
            turns.extend(q.as_quat().normalize().to_array());
            before = q;
        }
        track("rotation", table(turns, 4, "VEC4", None));
    }
    if !tracks.is_empty() {
        root["animations"] = json!([{"name": animation.name, "channels": tracks, "samplers": samplers}]);
    }
}

/// Gives the offset of the mesh's node to a node above it, so that the node itself may be animated;
/// the offset.
fn set_apart(root: &mut Value) -> DVec3 {
    let offset = root["nodes"][0].as_object_mut().and_then(|n| n.remove("translation"));
    let Some(offset) = offset else { return DVec3::ZERO };
    let part = |k: usize| offset[k].as_f64().unwrap_or(0.0);
    let origin = DVec3::new(part(0), part(1), part(2));
    root["nodes"] = json!([root["nodes"][0], {"children": [0], "translation": offset}]);
    root["scenes"][0]["nodes"] = json!([1]);
    origin
}

#[cfg(test)]
#[path = "gltf_animation_tests.rs"]
mod tests;
