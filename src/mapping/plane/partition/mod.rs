//! Partitions: into which steps the map is cut so that none folds (paper, sections 2.2, 3.1, 4.1,
//! 4.4).

#[cfg(test)]
mod continuity_tests;
mod live;
#[cfg(test)]
mod random_tests;
mod steps;
mod strategy;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use crate::control;
use crate::engine::Engine;
use crate::error::{Error, Result};
use crate::geometry::Polygon;
use crate::progress::Progress;

use super::bounds::{SufficientBound, sufficient_bound};
use super::path::{Base, PathKind, Relaxed, VertexPath, vertex_path};
use super::{Cage, Coordinates, Minimum, SampleOptions, jacobian_min};
pub use live::LivePartition;
pub use steps::Evaluate;
use steps::{Found, Steps};

/// Vertices of all polygons of a partition, at most: bounds the memory of `uniform:M` and of small
/// `eps`.
const MAX_VERTICES: u64 = 1 << 25;
/// Bytes that a vertex of a polygon takes: in the partition, in the map made of it, and where steps
/// are tried.
const BYTES_PER_VERTEX: u64 = 256;
/// Equal steps, at most: a pixel goes through all of them, and ten thousand take minutes.
const MOST_EQUAL_STEPS: u32 = 10_000;
/// Steps of the last path, at most, whatever `eps` is.
const MOST_STEPS: usize = 1024;
/// The last path may be halved down to this part of `eps`: it is slow where it passes thin parts.
const LAST_RESORT: f64 = 1.0 / 65_536.0;
/// The smallest `eps`: a binary partition has at most `2 / eps` steps along a path that `eps`
/// applies to.
const LEAST_EPS: f64 = 1e-4;

/// How the steps are chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PartitionKind {
    /// One step, whether it folds or not.
    Direct,
    /// So many equal steps, whether they fold or not.
    Uniform(u32),
    /// Equal steps, doubled until none folds (section 3.1) or they are shorter than `eps`.
    UniformAuto,
    /// A step that folds is halved (Listing 1) until it is no longer than `eps`.
    Binary,
    /// As binary, with steps that appear and move continuously with the cage (section 4.4): for
    /// interaction and animation.
    Continuous,
}

/// What a partition is to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PartitionOptions {
    /// How the steps are chosen.
    pub kind: PartitionKind,
    /// The path tried first; see [`partition_with`] for the others.
    pub path: PathKind,
    /// Steps no longer than this are not halved any more, 1e-4..=1; along the path of compatible
    /// triangulations, which is tried last and is slow where it passes thin parts, and in
    /// continuous partitions they may be, to a 65,536th of it, and a note says so.
    pub eps: f64,
    /// How finely the minimum of the Jacobian is searched for.
    pub samples: SampleOptions,
    /// The coordinates the steps are made of; every polygon has to have them.
    pub coordinates: Coordinates,
}

impl Default for PartitionOptions {
    fn default() -> Self {
        Self {
            kind: PartitionKind::Binary,
            path: PathKind::Intrinsic,
            eps: 0.01,
            samples: SampleOptions::default(),
            coordinates: Coordinates::default(),
        }
    }
}

/// One step of a partition.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepReport {
    /// Its knots.
    pub from: f64,
    /// The later one.
    pub to: f64,
    /// The smallest Jacobian found.
    pub minimum: Minimum,
}

/// The polygons that a composite map goes through.
#[derive(Clone, Debug)]
pub struct Partition {
    /// One for each knot; the first is the source, the last the target. Each bounds a domain,
    /// nested alike.
    pub polygons: Vec<Polygon>,
    /// From 0 to 1, rising.
    pub knots: Vec<f64>,
    /// Between successive knots.
    pub steps: Vec<StepReport>,
    /// The path that was taken in the end.
    pub path: PathKind,
    /// That path itself, for polygons between the knots.
    pub route: Arc<dyn VertexPath>,
    /// What the user should know: paths that failed, and why.
    pub notes: Vec<String>,
    /// Whether a step folds, as far as was sampled. Such steps are the ones whose minimum is not
    /// positive.
    pub folds: bool,
    /// The coordinates of its steps.
    pub coordinates: Coordinates,
}

impl Partition {
    /// The sufficient conditions of the paper on it, sampled. O(samples n), longer than a partition
    /// of few steps takes.
    pub fn sufficient_bound(&self) -> SufficientBound {
        sufficient_bound(self.coordinates, &self.polygons)
    }
}

/// How far a partition is refined.
struct Limits {
    /// Steps no longer than this are not halved any more.
    eps: f64,
    /// Nor are any once there are so many.
    steps: usize,
}

/// Why a path did not lead to a partition.
enum Stop {
    /// The path is of no use; another may be.
    Path(Error),
    /// Something that no other path mends.
    Fault(Error),
}

/// Finds the steps of a map between the polygons of `cage`; see [`partition_with`].
///
/// # Errors
/// As [`partition_with`] and [`jacobian_min`].
pub fn partition(
    engine: &Engine,
    cage: &Cage,
    options: &PartitionOptions,
    progress: &dyn Progress,
) -> Result<Partition> {
    let mut evaluate =
        |pairs: &[(Polygon, Polygon)]| jacobian_min(engine, options.coordinates, pairs, &options.samples);
    partition_with(&mut evaluate, cage, options, progress)
}

/// Finds the steps, asking `evaluate` for the smallest Jacobian of pairs of polygons: all intervals
/// of one refinement depth in one call.
///
/// Every polygon is checked for simplicity, orientation and nesting before it is used. Where the
/// path has none at a knot, or where a refinement ends with a step that still folds, the next path
/// is tried in the order intrinsic, linear, compatible, and a note says so; the last of them may be
/// halved further than `eps`: see [`PartitionOptions::eps`]. A continuous partition takes the
/// intrinsic or the linear path between relaxed polygons ([`Relaxed`]) and halves steps as far as
/// it needs, since a change of the path is a jump of the map; only where that path has no polygon
/// it takes the compatible one. If refinement fails on all of them, the partition of the first that
/// has one is returned with `folds`. The minimum of an interval is asked for once.
///
/// # Errors
/// [`Error::Option`] for `eps` outside its range or too many steps; [`Error::Numeric`] where no
/// path avoids intersections; what `evaluate` returns.
#[doc(hidden)]
pub fn partition_with(
    evaluate: &mut Evaluate<'_>,
    cage: &Cage,
    options: &PartitionOptions,
    progress: &dyn Progress,
) -> Result<Partition> {
    check_options(cage, options)?;
    options.coordinates.check(&cage.source)?;
    options.coordinates.check(&cage.target)?;
    let nesting =
        cage.source.nesting().map_err(|defect| Error::input(defect.to_string(), "Make the cage by Cage::new"))?;
    let mut notes = Vec::new();
    let mut folded: Option<(Found, Arc<dyn VertexPath>)> = None;
    for route in routes(options) {
        let path = match route.path(cage) {
            Ok(path) => path,
            Err(error) => {
                notes.push(what_of(&error));
                continue;
            }
        };
        let kind = path.kind();
        progress.stage(&format!("partition along the {} path", kind.word()), 0);
        let mut limits = Limits { eps: options.eps, steps: (4.0 / options.eps) as usize };
        if kind == PathKind::Compatible || options.kind == PartitionKind::Continuous {
            limits.eps *= LAST_RESORT;
            limits.steps = limits.steps.max(MOST_STEPS);
        }
        let mut steps = Steps::new(path.as_ref(), &nesting, options.coordinates, evaluate, progress);
        match steps.partition(options.kind, &limits) {
            Ok(found)
                if !found.folds() || matches!(options.kind, PartitionKind::Direct | PartitionKind::Uniform(_)) =>
            {
                notes.extend(note_of(&notes, kind, options, &found));
                return Ok(finish(found, path, notes, options.coordinates));
            }
            Ok(found) => {
                notes.push(describe_fold(&found));
                folded.get_or_insert((found, path));
            }
            Err(Stop::Path(error)) => notes.push(what_of(&error)),
            Err(Stop::Fault(error)) => return Err(error),
        }
    }
    match folded {
        Some((found, path)) => {
            notes.push(format!(
                "no path avoids folds at eps = {}; the {} one is kept. A smaller eps may help, or moving vertices apart",
                options.eps,
                found.path.word()
            ));
            Ok(finish(found, path, notes, options.coordinates))
        }
        None => Err(Error::numeric(
            format!("no path leads from source to target without self-intersections: {}", notes.join("; ")),
            "Bring source and target closer together, or add vertices to the cage",
        )),
    }
}

/// A path to try.
#[derive(Clone, Copy)]
enum Route {
    Plain(PathKind),
    Relaxed(Base),
}

impl Route {
    fn path(self, cage: &Cage) -> Result<Arc<dyn VertexPath>> {
        match self {
            Self::Plain(kind) => vertex_path(cage, kind),
            Self::Relaxed(base) => Ok(Arc::new(Relaxed::new(cage, base)?)),
        }
    }
}

/// The paths to try, in order. A continuous partition keeps to one that is continuous in the cage
/// as long as there is one.
fn routes(options: &PartitionOptions) -> Vec<Route> {
    use PathKind::{Compatible, Intrinsic, Linear};
    let continuous = options.kind == PartitionKind::Continuous;
    let first: Vec<Route> = match options.path {
        Intrinsic if continuous => vec![Route::Relaxed(Base::Intrinsic)],
        Linear if continuous => vec![Route::Relaxed(Base::Linear)],
        Intrinsic => vec![Route::Plain(Intrinsic), Route::Plain(Linear)],
        Linear => vec![Route::Plain(Linear)],
        Compatible => Vec::new(),
        PathKind::Relaxed => vec![Route::Relaxed(Base::Intrinsic)],
    };
    first.into_iter().chain([Route::Plain(Compatible)]).collect()
}

/// The sentence that names the path in the end, where it is not the first one tried or does not
/// keep to what was asked for.
fn note_of(notes: &[String], kind: PathKind, options: &PartitionOptions, found: &Found) -> Option<String> {
    let finer = found.knots.windows(2).any(|knots| knots[1] - knots[0] < options.eps / 2.0);
    let continuous = options.kind == PartitionKind::Continuous;
    match kind {
        PathKind::Compatible if continuous && !notes.is_empty() => Some(
            "the compatible path is used, with steps shorter than eps where it needs them; the map jumps where the cage is moved to or \
             from here"
                .to_owned(),
        ),
        PathKind::Compatible => {
            Some("the compatible path is used, with steps shorter than eps where it needs them".to_owned())
        }
        _ if !notes.is_empty() => Some(format!("the {} path is used", kind.word())),
        PathKind::Relaxed => Some(format!(
            "the path leads through relaxed polygons, since the {} one comes too close to itself{}",
            if options.path == PathKind::Linear { "linear" } else { "intrinsic" },
            if finer { "; some steps are shorter than eps" } else { "" }
        )),
        _ if continuous && finer => {
            Some("some steps are shorter than eps, so that the map stays continuous in the cage".to_owned())
        }
        _ => None,
    }
}

/// The error without its remedy, which speaks of what is being done already.
fn what_of(error: &Error) -> String {
    match error {
        Error::Numeric { what, .. } | Error::Input { what, .. } => what.clone(),
        other => other.to_string(),
    }
}

fn describe_fold(partition: &Found) -> String {
    let folding: Vec<&StepReport> = partition.steps.iter().filter(|step| !step.minimum.positive()).collect();
    folding.first().map_or_else(String::new, |step| {
        format!(
            "along the {} path {} of {} steps still fold, the first from t = {} to {} (smallest Jacobian {:.3e} at ({:.6}, {:.6}))",
            partition.path.word(),
            folding.len(),
            partition.steps.len(),
            step.from,
            step.to,
            step.minimum.value,
            step.minimum.at.x,
            step.minimum.at.y
        )
    })
}

/// With the notes.
fn finish(found: Found, route: Arc<dyn VertexPath>, notes: Vec<String>, coordinates: Coordinates) -> Partition {
    Partition {
        coordinates,
        folds: found.folds(),
        polygons: found.polygons,
        knots: found.knots,
        steps: found.steps,
        path: found.path,
        route,
        notes,
    }
}

fn check_options(cage: &Cage, options: &PartitionOptions) -> Result<()> {
    if !(LEAST_EPS..=1.0).contains(&options.eps) {
        return Err(Error::option("eps", format!("{} is not in {LEAST_EPS}..=1", options.eps), "Take 0.01"));
    }
    let steps = match options.kind {
        PartitionKind::Direct => 1,
        PartitionKind::Uniform(0) => {
            return Err(Error::option("partition", "a uniform partition has no steps", "Give at least 1"));
        }
        PartitionKind::Uniform(steps) if steps > MOST_EQUAL_STEPS => {
            let remedy = format!("Give at most {MOST_EQUAL_STEPS}; binary makes as many as are needed");
            return Err(Error::option("partition", format!("{steps} steps are too many"), remedy));
        }
        PartitionKind::Uniform(steps) => u64::from(steps),
        _ => ((2.0 / options.eps).ceil() as u64).max(MOST_STEPS as u64),
    };
    let vertices = cage.source.vertex_count() as u64;
    if (steps + 1).saturating_mul(vertices) > MAX_VERTICES {
        return Err(Error::option(
            "partition",
            format!("{steps} steps of {vertices} vertices are more than {MAX_VERTICES} vertices in all"),
            "Take fewer steps or a larger eps",
        ));
    }
    if let PartitionKind::Uniform(_) = options.kind {
        let bytes = (steps + 1) * vertices * BYTES_PER_VERTEX;
        control::require(bytes, || format!("a partition of {steps} steps of {vertices} vertices"))?;
    }
    Ok(())
}
