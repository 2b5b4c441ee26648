//! A partition that follows its cage while a vertex is dragged: within a frame steps are judged at
//! a glance, starting from the last knots; at rest they are judged as [`partition`] does.

use crate::engine::Engine;
use crate::error::Result;
use crate::progress::{Progress, Quiet};

use super::super::jacobian_min::glance;
use super::steps::Steps;
use super::{
    Cage, Limits, Partition, PartitionKind, PartitionOptions, PathKind, Polygon, Route, check_options, finish,
    partition, partition_with,
};

/// A partition under a cage that is dragged.
///
/// [`LivePartition::drag`] has the time of a frame: limits at vertices are taken in closed form as
/// ever, while edges and the interior are sampled a quarter as finely as by default and searches
/// end at three digits. A binary partition starts from the last knots: steps that fold are halved,
/// and each drag tries to join one pair of halves again. [`LivePartition::settle`] makes what
/// [`partition`] makes.
#[derive(Clone, Debug)]
pub struct LivePartition {
    options: PartitionOptions,
    partition: Partition,
    settled: bool,
    /// Which pair of halves is to be tried next.
    turn: usize,
}

impl LivePartition {
    /// The partition of a cage at rest.
    ///
    /// # Errors
    /// As [`partition`].
    pub fn new(engine: &Engine, cage: &Cage, options: &PartitionOptions, progress: &dyn Progress) -> Result<Self> {
        let partition = partition(engine, cage, options, progress)?;
        Ok(Self { options: *options, partition, settled: true, turn: 0 })
    }

    /// As it is now.
    pub fn partition(&self) -> &Partition {
        &self.partition
    }

    /// Whether the steps have been judged in full since the last drag.
    pub fn is_settled(&self) -> bool {
        self.settled
    }

    /// The cage has changed. Where it has no partition the last one is kept.
    ///
    /// O(steps (n^2 + 1000 n)) for n vertices.
    ///
    /// # Errors
    /// As [`partition`].
    pub fn drag(&mut self, cage: &Cage) -> Result<&Partition> {
        self.partition = match self.followed(cage)? {
            Some(found) => found,
            None => partition_with(&mut self.evaluate(), cage, &self.options, &Quiet)?,
        };
        self.settled = false;
        Ok(&self.partition)
    }

    /// The partition of a cage that rests; whether its knots are other ones than the last drag
    /// left.
    ///
    /// # Errors
    /// As [`partition`].
    pub fn settle(&mut self, engine: &Engine, cage: &Cage, progress: &dyn Progress) -> Result<bool> {
        let found = partition(engine, cage, &self.options, progress)?;
        let moved = found.knots != self.partition.knots || found.path != self.partition.path;
        self.partition = found;
        self.settled = true;
        Ok(moved)
    }

    /// Smallest Jacobians at a glance.
    fn evaluate(&self) -> impl FnMut(&[(Polygon, Polygon)]) -> Result<Vec<super::Minimum>> + use<> {
        let PartitionOptions { coordinates, samples, .. } = self.options;
        move |pairs: &[(Polygon, Polygon)]| glance(coordinates, pairs, &samples)
    }

    /// A binary partition along the last path, with the last knots and what they need; none for
    /// partitions of other kinds, and where that path does not lead to one without folds.
    fn followed(&mut self, cage: &Cage) -> Result<Option<Partition>> {
        let kind = self.partition.path;
        let plain = matches!(kind, PathKind::Intrinsic | PathKind::Linear);
        if self.options.kind != PartitionKind::Binary || !plain || self.partition.folds {
            return Ok(None);
        }
        check_options(cage, &self.options)?;
        self.options.coordinates.check(&cage.source)?;
        self.options.coordinates.check(&cage.target)?;
        let (Ok(nesting), Ok(path)) = (cage.source.nesting(), Route::Plain(kind).path(cage)) else { return Ok(None) };
        let mut evaluate = self.evaluate();
        let mut steps = Steps::new(path.as_ref(), &nesting, self.options.coordinates, &mut evaluate, &Quiet);
        let limits = Limits { eps: self.options.eps, steps: (4.0 / self.options.eps) as usize };
        let joined = joinable(&self.partition.knots, self.turn);
        self.turn = self.turn.wrapping_add(1);
        let Ok(mut knots) = steps.halved(self.partition.knots.clone(), &limits) else { return Ok(None) };
        if let Some([a, middle, b]) = joined
            && knots.windows(3).any(|k| k == [a, middle, b])
            && steps.minima(&[(a, b)]).is_ok_and(|found| found[0].positive())
        {
            knots.retain(|&t| t != middle);
        }
        let Ok(found) = steps.at_knots(knots) else { return Ok(None) };
        if found.folds() {
            return Ok(None);
        }
        Ok(Some(finish(found, path, Vec::new(), self.options.coordinates)))
    }
}

/// Ends and middle of a step that Listing 1 had halved, if neither half was halved again: the one
/// whose turn it is.
fn joinable(knots: &[f64], turn: usize) -> Option<[f64; 3]> {
    let halves = |k: &[f64]| {
        let (first, second) = (k[1] - k[0], k[2] - k[1]);
        // Knots are sums of halves of 1, which are exact.
        first == second && (k[0] / (2.0 * first)).fract() == 0.0
    };
    let all: Vec<[f64; 3]> = knots.windows(3).filter(|k| halves(k)).map(|k| [k[0], k[1], k[2]]).collect();
    all.get(turn % all.len().max(1)).copied()
}

#[cfg(test)]
mod tests {
    use super::super::super::testing::{nested_squares, square};
    use super::*;
    use crate::mapping::plane::SampleOptions;

    fn cage(source: &Polygon, target: &Polygon) -> Cage {
        Cage::new(source.loops().to_vec(), target.loops().to_vec()).unwrap()
    }

    fn options(kind: PartitionKind) -> PartitionOptions {
        PartitionOptions { kind, path: PathKind::Linear, ..PartitionOptions::default() }
    }

    fn folds(partition: &Partition) -> bool {
        let pairs: Vec<(Polygon, Polygon)> =
            partition.polygons.windows(2).map(|w| (w[0].clone(), w[1].clone())).collect();
        let options = SampleOptions { resolution: 512 };
        let coordinates = PartitionOptions::default().coordinates;
        let minima = crate::mapping::plane::jacobian_min(&Engine::reference(), coordinates, &pairs, &options).unwrap();
        minima.iter().any(|m| !m.positive())
    }

    #[test]
    fn a_drag_there_and_back_never_folds_and_leaves_few_steps() {
        let engine = Engine::reference();
        for kind in [PartitionKind::Binary, PartitionKind::Continuous] {
            let at = |t: f64| cage(&square(0.0), &square(t));
            let mut live = LivePartition::new(&engine, &at(0.1), &options(kind), &Quiet).unwrap();
            assert!(live.is_settled() && live.partition().steps.len() == 1);
            let mut most = 0;
            for k in 0..=40 {
                let t = 0.1 + 0.85 * (1.0 - (f64::from(k) / 20.0 - 1.0).abs());
                let found = live.drag(&at(t)).unwrap();
                assert!(!found.folds && !folds(found), "{kind:?} at {t}: {:?}", found.knots);
                most = most.max(found.steps.len());
            }
            assert!(most > 3 && !live.is_settled());
            // Halves that are not needed any more have been joined.
            (0..most).for_each(|_| drop(live.drag(&at(0.1)).unwrap().clone()));
            assert_eq!(live.partition().steps.len(), 1, "{kind:?}: {:?}", live.partition().knots);
        }
    }

    #[test]
    fn at_rest_it_is_the_partition_and_a_glance_finds_the_same_knots() {
        let engine = Engine::reference();
        let end = cage(&nested_squares(0.0), &nested_squares(1.0));
        for kind in [PartitionKind::Binary, PartitionKind::UniformAuto, PartitionKind::Uniform(8)] {
            let options = options(kind);
            let start = cage(&nested_squares(0.0), &nested_squares(0.1));
            let mut live = LivePartition::new(&engine, &start, &options, &Quiet).unwrap();
            live.drag(&end).unwrap();
            let glanced = live.partition().clone();
            let other = live.settle(&engine, &end, &Quiet).unwrap();
            let whole = partition(&engine, &end, &options, &Quiet).unwrap();
            assert!(!other && live.is_settled() && live.partition().knots == whole.knots, "{kind:?}");
            assert!(live.settle(&engine, &start, &Quiet).unwrap() || kind == PartitionKind::Uniform(8));
            for (a, b) in glanced.steps.iter().zip(&whole.steps) {
                // Strides of a glance end at 3e-5, and the minimum is smooth or at a vertex.
                assert!((a.minimum.value - b.minimum.value).abs() < 1e-3, "{a:?} {b:?}");
            }
        }
    }

    #[test]
    fn only_halves_of_one_step_are_joined() {
        assert_eq!(joinable(&[0.0, 0.25, 0.5, 1.0], 0), Some([0.0, 0.25, 0.5]));
        assert_eq!(joinable(&[0.0, 0.5, 0.75, 1.0], 3), Some([0.5, 0.75, 1.0]));
        // A quarter and a half, and the two quarters in the middle, are of different steps.
        assert_eq!(joinable(&[0.0, 0.25, 0.5, 0.75, 1.0], 1), Some([0.5, 0.75, 1.0]));
        assert_eq!(joinable(&[0.0, 1.0], 0), None);
    }

    #[test]
    fn a_cage_without_a_partition_is_an_error_and_the_last_one_stays() {
        let engine = Engine::reference();
        let start = cage(&square(0.0), &square(0.5));
        let mut live = LivePartition::new(&engine, &start, &options(PartitionKind::Binary), &Quiet).unwrap();
        let before = live.partition().knots.clone();
        let mut bad = start.clone();
        let mut loops = bad.target.loops().to_vec();
        loops[0][0].x = f64::NAN;
        bad.target = Polygon::from_loops(loops);
        assert!(live.drag(&bad).is_err());
        assert_eq!(live.partition().knots, before);
    }
}
