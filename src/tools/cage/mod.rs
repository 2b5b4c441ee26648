//! Models deformed by cages: composite mean value mappings in space (Schneider, Hormann, Floater
//! 2013, section 4.5).
//!
//! The cage's vertices take a path from the source to the target, straight or by mean-value
//! encoding ([`Encoded`]), the map is cut into steps that do not fold as far as is sampled, and the
//! model goes through them.

mod encoded;

use glam::DVec3;

use crate::encoding::Connectivity;
use crate::engine::Engine;
use crate::error::{Error, Result};
use crate::geometry::{Frame, Mesh};
use crate::mapping::space::{Cage, CompositeMap, Linear, Partition, PartitionOptions, VertexPath, partition};
use crate::progress::Progress;
use crate::tools::deform::normals::turn_normals;
use crate::words::words;

pub use encoded::Encoded;

/// Which path the vertices of the cage take.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PathKind {
    /// By mean-value encoding: what turns between source and target turns on the way.
    #[default]
    Encoded,
    /// Every vertex goes straight.
    Linear,
}

words! { PathKind, "path", "a path":
    Encoded => "encoded",
    Linear => "linear",
}

/// What is to be done to a model.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CageOptions {
    /// The path of the cage's vertices.
    pub path: PathKind,
    /// How the map is cut into steps.
    pub partition: PartitionOptions,
    /// From the target cage back to the source, exactly.
    pub inverse: bool,
}

/// Vertices of the model that the cage it comes from does not enclose.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Outside {
    /// How many there are. The map goes on outside the cage; nothing is claimed of it there.
    pub vertices: usize,
    /// How many of them the map turns over: the Jacobian of the whole map is not positive.
    pub folded: usize,
}

/// A model that went through a cage.
#[derive(Clone, Debug)]
pub struct Caged {
    /// A position for every vertex of the model; `None` where the inverse found none.
    pub positions: Vec<Option<DVec3>>,
    /// The steps.
    pub partition: Partition,
    /// Name of the path.
    pub path: String,
    /// Vertices outside the cage that the model comes from.
    pub outside: Outside,
    /// Vertices inside it that left the other cage: none where nothing folds, but for rounding on
    /// faces.
    pub escaped: usize,
    /// Vertices inside it where the Jacobian of the whole map is not positive; counted for the
    /// inverse, whose pre-images no step was tested at.
    pub folded: usize,
    /// What is odd but no error, a sentence each.
    pub notes: Vec<String>,
}

impl Caged {
    /// `sampled` where no step folds at a sample, no polyhedron intersects itself and no vertex
    /// inside is turned over; else `failed`.
    pub fn bijective(&self) -> &'static str {
        let sound = !self.partition.folds() && self.partition.intersections.is_empty() && self.folded == 0;
        if sound { "sampled" } else { "failed" }
    }
}

/// Takes the points of a model through the map of a cage.
///
/// Points outside the source are mapped by the same coordinates and counted. O(steps x points x
/// faces).
///
/// # Errors
/// [`Error::Input`] for a point that is not finite; as [`partition`](partition()) and
/// [`CompositeMap::forward_points`].
pub fn map_by_cage(
    engine: &Engine,
    model: &[DVec3],
    cage: &Cage,
    options: &CageOptions,
    progress: &dyn Progress,
) -> Result<Caged> {
    if let Some(v) = model.iter().position(|p| !p.is_finite()) {
        let what = format!("vertex {v} of the model is not finite");
        return Err(Error::input(what, "Export the model again"));
    }
    // Everything about a vertex of the source: far from the origin polyhedra on the way would
    // round.
    let origin = Frame::of(cage.source.iter().copied()).origin;
    let local = |points: &[DVec3]| -> Vec<DVec3> { points.iter().map(|p| *p - origin).collect() };
    let near = Cage { triangles: cage.triangles.clone(), source: local(&cage.source), target: local(&cage.target) };
    let mut caged = near_origin(engine, &local(model), &near, options, progress)?;
    caged.positions.iter_mut().flatten().for_each(|p| *p += origin);
    caged.partition.polyhedra.iter_mut().flatten().for_each(|p| *p += origin);
    caged.partition.steps.iter_mut().for_each(|s| s.minimum.at += origin);
    Ok(caged)
}

fn near_origin(
    engine: &Engine,
    model: &[DVec3],
    cage: &Cage,
    options: &CageOptions,
    progress: &dyn Progress,
) -> Result<Caged> {
    let mut notes = Vec::new();
    let path: Box<dyn VertexPath> = match options.path {
        PathKind::Linear => Box::new(Linear::new(cage)),
        PathKind::Encoded => match Encoded::new(cage) {
            Ok(path) => {
                notes.extend(path.notes.iter().cloned());
                Box::new(path)
            }
            Err(Error::Cancelled) => return Err(Error::Cancelled),
            Err(error) => {
                notes.push(format!("the cage has no path by encoding ({error}); the linear path is taken"));
                Box::new(Linear::new(cage))
            }
        },
    };
    // Those outside are not tested: the map may fold there.
    let ends = CompositeMap::new(cage.triangles.clone(), vec![cage.source.clone(), cage.target.clone()])?;
    let within = ends.inside(usize::from(options.inverse), model);
    let enclosed = |points: &[DVec3]| -> Vec<DVec3> {
        points.iter().zip(&within).filter(|(_, inside)| **inside).map(|(&p, _)| p).collect()
    };
    let tested = if options.inverse { Vec::new() } else { enclosed(model) };
    let partition = partition(engine, cage, path.as_ref(), &tested, &options.partition, progress)?;
    let map = CompositeMap::new(cage.triangles.clone(), partition.polyhedra.clone())?;
    progress.stage("points", 0);
    let mut caged = Caged {
        positions: Vec::new(),
        partition,
        path: path.name().to_owned(),
        outside: Outside { vertices: within.iter().filter(|inside| !**inside).count(), folded: 0 },
        escaped: 0,
        folded: 0,
        notes,
    };
    if options.inverse {
        let found = map.inverse(model);
        for (m, inside) in found.iter().zip(&within) {
            let turned = m.is_some_and(|m| !(m.jacobian() > 0.0));
            *(if *inside { &mut caged.folded } else { &mut caged.outside.folded }) += usize::from(turned);
        }
        caged.positions = found.into_iter().map(|m| m.map(|m| m.point)).collect();
    } else {
        let beyond: Vec<DVec3> = model.iter().zip(&within).filter(|(_, inside)| !**inside).map(|(&p, _)| p).collect();
        caged.outside.folded = map.forward(&beyond).iter().filter(|m| !(m.jacobian() > 0.0)).count();
        caged.positions = map.forward_points(engine, model)?.into_iter().map(Some).collect();
    }
    let images: Vec<DVec3> =
        caged.positions.iter().zip(&within).filter(|(_, inside)| **inside).filter_map(|(p, _)| *p).collect();
    let kept = ends.inside(usize::from(!options.inverse), &images);
    caged.escaped = kept.iter().filter(|inside| !**inside).count();
    Ok(caged)
}

/// Gives `mesh` its new positions, and turns its normals as the surface around their vertices has
/// turned.
///
/// # Errors
/// [`Error::Input`] for another number of positions.
pub fn pose(mesh: &mut Mesh, mut positions: Vec<DVec3>) -> Result<()> {
    if positions.len() != mesh.vertex_count() {
        let what = format!("{} positions for {} vertices", positions.len(), mesh.vertex_count());
        return Err(Error::input(what, "Give one for every vertex"));
    }
    mesh.close_junctions(&mut positions, |_| false);
    let rest = std::mem::replace(&mut mesh.positions, positions);
    turn_normals(mesh, &Connectivity::new(mesh), &rest);
    Ok(())
}
