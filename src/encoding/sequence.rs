//! Many frames of one mesh, smooth in time and cheap.
//!
//! One coarse stage of the hierarchy is followed through the clip, frame after frame (`track`):
//! there the shape in the large is decided, and there alone a frame depends on the one before.
//! Everything finer is a function of that stage: vertex splits and a fixed number of steps of
//! conjugate gradients on each finer stage, which take away the roughness that splits leave. So
//! frames are finished in parallel, whatever the number of threads, and nothing can jump between
//! parts of a clip.

use std::ops::Range;

use rayon::prelude::*;

use super::abreast::{Abreast, LARGEST, Part, WIDTH, Workspace};
use super::cascade::springs;
use super::decode::split_level;
use super::hierarchy::Stage;
use super::solver::{Method, StageSolver, Stop};
use super::track::Tracker;
use super::{Decoder, Hierarchy, V3};
use crate::control;
use crate::error::{Error, Result};

/// How far the frames of a sequence are minimised.
///
/// On a walking body of 12,600 vertices with 40 markers, G is 1.43 times that of
/// [`super::Quality::DEFAULT`] with the default, 10 times with the preview.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SequenceQuality {
    /// The finest stage with at most so many free vertices is followed from frame to frame.
    pub tracked: usize,
    /// Steps of conjugate gradients on each stage between it and the whole mesh.
    pub middle: usize,
    /// Steps of conjugate gradients on the whole mesh.
    pub fine: usize,
    /// Stiffness of the edges' lengths as in [`super::Quality`].
    pub stiffness: f64,
}

impl SequenceQuality {
    /// Vertex splits from the stage that is followed.
    pub const PREVIEW: Self = Self { tracked: 2000, middle: 0, fine: 0, stiffness: 0.0 };
    /// A hundred frames a second of a body of 13,000 vertices on two cores.
    pub const DEFAULT: Self = Self { middle: 20, fine: 10, ..Self::PREVIEW };
}

/// One frame of the held vertices.
#[derive(Clone, Debug)]
pub struct Frame<'a> {
    /// Positions in the hierarchy's order.
    pub held: &'a [V3<f64>],
    /// Scale of the similarity that takes the held vertices there from rest.
    pub scale: f64,
}

/// A frame that was made.
#[derive(Clone, Debug)]
pub struct Played {
    /// Positions of all vertices in the hierarchy's numbering.
    pub positions: Vec<V3<f64>>,
    /// G of the stage that was followed.
    pub value: f64,
    /// Whether that stage was found anew, because this is the first frame or the one before did not
    /// lead here.
    pub anew: bool,
}

/// Memory of a group, a vertex: what is worked with (`abreast`), and its frames before and after.
const GROUP_BYTES: u64 = 3400 + 3 * 24 * WIDTH as u64;
/// Most groups of frames that are finished at once: one thread follows the coarse stage meanwhile,
/// and more groups than these would wait for it.
const MOST_GROUPS: usize = 4;
/// Decrease of G in the second step above which the stage has not arrived.
const ARRIVED: f64 = 0.05;
/// G over its usual value that makes one look for a better minimum; the usual value at most doubles
/// from frame to frame.
const GROWTH: f64 = 4.0;
/// G of the tracked stage, per vertex, that is nothing to worry about.
const HARMLESS: f64 = 1e-10;
/// Most Gauss-Newton iterations on a stage where the step from the frame before does not arrive.
const ITERATIONS: usize = 30;

impl Decoder {
    /// Decodes `frames` in order and hands those numbered `wanted` to `sink`, which may end the
    /// work with an error. `start` is as in [`Decoder::decode`], for each frame.
    ///
    /// A frame whose held vertices are where they were gives the shape of the frame before, bit for
    /// bit. Wanted frames are those of a run that wants all, bit for bit: of frames before them the
    /// coarse stage is followed, which takes a third of the time of a whole frame.
    ///
    /// # Errors
    /// As [`Decoder::decode`], and what `sink` returns.
    pub fn play(
        &self,
        frames: &[Frame<'_>],
        wanted: Range<usize>,
        start: impl Fn(usize, usize, V3<f64>) -> V3<f64> + Sync,
        quality: &SequenceQuality,
        mut sink: impl FnMut(usize, Played) -> Result<()>,
    ) -> Result<()> {
        let frames = &frames[..wanted.end.min(frames.len())];
        frames.iter().try_for_each(|frame| self.check(frame.held))?;
        // The last frame that moved among those that are not wanted.
        let mut skipped: Option<Found> = None;
        let mut coarse = Coarse::new(self, quality);
        let tracked = coarse.tracked;
        let size = self.hierarchy().order.len();
        let finer = tracked + 1 < self.hierarchy().stages.len();
        let abreast =
            (finer && quality.stiffness == 0.0 && size <= LARGEST).then(|| Abreast::new(self.hierarchy(), tracked + 1));
        let length = WIDTH * groups(size);
        let mut blocks = frames.chunks(length).enumerate();
        let mut waiting: Option<(usize, &[Frame<'_>], Vec<Found>)> = None;
        let mut before: Option<Played> = None;
        let here = control::current();
        loop {
            // While one block is finished, the next one is followed.
            let finish = || {
                let (k, block, found) = waiting.take()?;
                Some((k, here.within(|| self.finish(abreast.as_ref(), tracked, block, found, quality))))
            };
            let follow = || {
                let (k, block) = blocks.next()?;
                let one = |(i, frame)| {
                    here.check()?;
                    let f = k * length + i;
                    let found = coarse.follow(frame, |v, p| start(f, v, p))?;
                    if f >= wanted.start {
                        let before = skipped.take();
                        return Ok(if let Found::Still = found { before.unwrap_or(found) } else { found });
                    }
                    if let Found::Moved { .. } = found {
                        skipped = Some(found);
                    }
                    Ok(Found::Still)
                };
                let found: Result<Vec<Found>> = block.iter().enumerate().map(one).collect();
                Some(found.map(|found| (k, block, found)))
            };
            let (done, followed) = rayon::join(finish, follow);
            if let Some((k, done)) = done {
                for (i, played) in done?.into_iter().enumerate() {
                    // Nothing moved: the frame before. There is none where no frame is wanted yet.
                    let played = played.or_else(|| before.clone());
                    let Some(played) = played else { continue };
                    before = Some(played.clone());
                    sink(k * length + i, played)?;
                }
            }
            match followed {
                Some(found) => waiting = Some(found?),
                None => return Ok(()),
            }
        }
    }

    /// The finer stages of a block of frames, in parallel; none where nothing moved.
    fn finish(
        &self,
        abreast: Option<&Abreast<'_>>,
        tracked: usize,
        block: &[Frame<'_>],
        found: Vec<Found>,
        quality: &SequenceQuality,
    ) -> Result<Vec<Option<Played>>> {
        let here = control::current();
        let (mut parts, mut played) = (Vec::new(), Vec::new());
        for (frame, found) in block.iter().zip(found) {
            played.push(match found {
                Found::Still => None,
                Found::Moved { positions, value, anew } => {
                    parts.push(Part { frame, positions });
                    Some(Played { positions: Vec::new(), value, anew })
                }
            });
        }
        match abreast {
            Some(abreast) => parts
                .par_chunks_mut(WIDTH)
                .map_init(Workspace::default, |work, group| here.within(|| abreast.finish(work, group, quality)))
                .collect::<Result<()>>()?,
            None => parts
                .par_iter_mut()
                .map_init(StageSolver::default, |solver, part| {
                    here.check()?;
                    self.finish_one(tracked, solver, part, quality)
                })
                .collect::<Result<()>>()?,
        }
        for (played, part) in played.iter_mut().flatten().zip(parts) {
            if part.positions.iter().flatten().any(|x| !x.is_finite()) {
                return Err(no_shape());
            }
            played.positions = part.positions;
        }
        Ok(played)
    }

    /// The finer stages of one frame.
    fn finish_one(
        &self,
        tracked: usize,
        solver: &mut StageSolver,
        part: &mut Part<'_, '_>,
        quality: &SequenceQuality,
    ) -> Result<()> {
        let h = self.hierarchy();
        let Part { frame, positions } = part;
        positions.resize(h.order.len(), [0.0; 3]);
        for (k, stage) in h.stages.iter().enumerate().skip(tracked + 1) {
            split(h, stage, positions);
            let steps = if k + 1 == h.stages.len() { quality.fine } else { quality.middle };
            if steps > 0 {
                let springs = springs(stage, self.rest(), frame.scale, quality.stiffness);
                let stop = Stop { iterations: 1, decrease: 0.0 };
                let (stencils, encoding) = (&stage.stencils, &stage.encoding);
                let positions = &mut positions[..stage.vertices];
                let method = Method::Gradients(steps);
                solver.minimise(stencils, encoding, springs.as_ref(), h.held, method, stop, positions)?;
            }
        }
        Ok(())
    }
}

/// Groups of frames that are finished at once, of a mesh of so many vertices: what memory allows.
fn groups(vertices: usize) -> usize {
    let bytes = (vertices as u64).saturating_mul(GROUP_BYTES).max(1);
    let room = usize::try_from(control::left() / 2 / bytes).unwrap_or(usize::MAX);
    rayon::current_num_threads().clamp(2, MOST_GROUPS).min(room).max(1)
}

fn no_shape() -> Error {
    Error::numeric("no finite shape was found for a frame", "Leave out markers that jump, or bind others")
}

fn split(h: &Hierarchy, stage: &Stage, positions: &mut [V3<f64>]) {
    for level in stage.levels.clone() {
        let rows = h.level_start[level] as usize..h.level_start[level + 1] as usize;
        split_level(&h.splits, &h.split_encoding, rows, positions);
    }
}

/// A frame of the stage that is followed.
enum Found {
    /// The held vertices are where they were.
    Still,
    Moved {
        positions: Vec<V3<f64>>,
        value: f64,
        anew: bool,
    },
}

/// The stage that is followed, and those before it, from which a lost frame is found.
struct Coarse<'a> {
    decoder: &'a Decoder,
    quality: SequenceQuality,
    tracked: usize,
    tracker: Option<Tracker>,
    solvers: Vec<StageSolver>,
    /// Positions in the frame before.
    last: Option<Vec<V3<f64>>>,
    /// What G has been lately.
    usual: f64,
}

impl<'a> Coarse<'a> {
    fn new(decoder: &'a Decoder, quality: &SequenceQuality) -> Self {
        let h = decoder.hierarchy();
        let fits = |s: &Stage| s.vertices - h.held <= quality.tracked;
        let tracked = h.stages.iter().rposition(fits).unwrap_or(0);
        let solvers = (0..=tracked).map(|_| StageSolver::default()).collect();
        Self { decoder, quality: *quality, tracked, tracker: None, solvers, last: None, usual: 0.0 }
    }

    fn follow(&mut self, frame: &Frame<'_>, start: impl Fn(usize, V3<f64>) -> V3<f64>) -> Result<Found> {
        let h = self.decoder.hierarchy();
        let stage = &h.stages[self.tracked];
        let mut kept = None;
        if let Some(mut x) = self.last.take() {
            if x[..h.held] == *frame.held {
                self.last = Some(x);
                return Ok(Found::Still);
            }
            let springs = self.springs(self.tracked, frame.scale);
            let tracker = match &mut self.tracker {
                Some(tracker) => tracker,
                None => self.tracker.insert(Tracker::new(stage, h.held)?),
            };
            let now = tracker.step(stage, springs.as_ref(), frame.held, &mut x)?;
            let mut value = now.value;
            if now.decrease > ARRIVED {
                value = self.converge(self.tracked, frame.scale, &mut x)?;
            }
            let usual = self.usual.max(HARMLESS * stage.vertices as f64);
            self.usual = value.min(2.0 * usual);
            if value <= GROWTH * usual {
                self.last = Some(x.clone());
                return Ok(Found::Moved { positions: x, value, anew: false });
            }
            kept = Some((x, value));
        }
        // The first frame, or one after a jump.
        let mut x = vec![[0.0; 3]; stage.vertices];
        x[..h.held].copy_from_slice(frame.held);
        for v in h.held..h.base {
            x[v] = start(v, self.decoder.rest()[v]);
        }
        let mut value = 0.0;
        for k in 0..=self.tracked {
            split(h, &h.stages[k], &mut x);
            value = self.converge(k, frame.scale, &mut x[..h.stages[k].vertices])?;
        }
        let first = kept.is_none();
        // To stay near the frame before is worth something.
        let (x, value, anew) = match kept {
            Some((kept, g)) if !(value < 0.5 * g) => (kept, g, false),
            _ => (x, value, true),
        };
        if !value.is_finite() {
            return Err(no_shape());
        }
        if first {
            self.usual = value;
        }
        self.last = Some(x.clone());
        Ok(Found::Moved { positions: x, value, anew })
    }

    fn springs(&self, k: usize, scale: f64) -> Option<super::springs::Springs> {
        springs(&self.decoder.hierarchy().stages[k], self.decoder.rest(), scale, self.quality.stiffness)
    }

    /// Gauss-Newton with line search, as for single frames.
    fn converge(&mut self, k: usize, scale: f64, x: &mut [V3<f64>]) -> Result<f64> {
        let h = self.decoder.hierarchy();
        let stage = &h.stages[k];
        let springs = self.springs(k, scale);
        let stop = Stop { iterations: ITERATIONS, decrease: 1e-3 };
        let (stencils, encoding) = (&stage.stencils, &stage.encoding);
        let solved = self.solvers[k].minimise(stencils, encoding, springs.as_ref(), h.held, Method::Direct, stop, x)?;
        Ok(solved.after)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::encoding::decode::{encoding_residual, energy};
    use crate::encoding::{Connectivity, HierarchyOptions, Quality};
    use crate::models::Walker;

    const COUNT: usize = 48;
    /// Frames to the border of two blocks.
    const BLOCK: usize = 2 * WIDTH;

    /// A walking body of some 3,400 vertices, every 85th of which is held, and `frames` of it at 30
    /// a second, the arms coming down in the first half.
    fn walking() -> (Decoder, Vec<Vec<V3<f64>>>) {
        let walker = Walker::new(0.026);
        let (low, high) = walker.mesh.bounds().unwrap();
        let size = low.distance(high);
        let local = |p: Vec<glam::DVec3>| -> Vec<V3<f64>> { p.iter().map(|p| (*p / size).to_array()).collect() };
        let rest = local(walker.mesh.positions.clone());
        let held: Vec<u32> = (0..rest.len() as u32).step_by(85).collect();
        let options = HierarchyOptions { stages: vec![100, 400, 1500] };
        let h = Hierarchy::new(&Connectivity::new(&walker.mesh), &rest, &held, &options).unwrap();
        let frames = (0..COUNT)
            .map(|f| {
                let shape = local(walker.positions(f as f64 / 30.0, (f as f64 / 24.0).min(1.0)));
                h.order[..h.held].iter().map(|&v| shape[v as usize]).collect()
            })
            .collect();
        (Decoder::new(h, &rest), frames)
    }

    fn play(decoder: &Decoder, frames: &[Vec<V3<f64>>], quality: &SequenceQuality) -> Vec<Played> {
        let list: Vec<Frame<'_>> = frames.iter().map(|held| Frame { held, scale: 1.0 }).collect();
        let mut out = Vec::new();
        let keep = |f: usize, played: Played| {
            assert_eq!(f, out.len());
            out.push(played);
            Ok(())
        };
        decoder.play(&list, 0..list.len(), |_, _, p| p, quality, keep).unwrap();
        out
    }

    fn value(decoder: &Decoder, positions: &[V3<f64>]) -> f64 {
        let stage = decoder.hierarchy().stages.last().unwrap();
        let mut residual = vec![[0.0; 3]; stage.stencils.row_count()];
        encoding_residual(&stage.stencils, &stage.encoding, positions, &mut residual);
        energy(&residual)
    }

    #[test]
    fn a_walk_is_near_the_minimum_smooth_and_the_same_on_any_number_of_threads() {
        let (mut decoder, mut frames) = walking();
        // Standing still for three frames across the border of two blocks.
        for f in BLOCK..BLOCK + 3 {
            frames[f] = frames[BLOCK - 1].clone();
        }
        let played = play(&decoder, &frames, &SequenceQuality::DEFAULT);
        assert!(played.iter().enumerate().all(|(f, p)| p.anew == (f == 0)));
        for f in BLOCK..BLOCK + 3 {
            assert!(played[f].positions == played[BLOCK - 1].positions, "no jitter in frame {f}");
        }
        let mut worst = 0.0_f64;
        for f in [5, 20, 31, 40, COUNT - 1] {
            let (single, _) = decoder.decode(&frames[f], |_, p| p, 1.0, &Quality::DEFAULT, true).unwrap();
            worst = worst.max(value(&decoder, &played[f].positions) / value(&decoder, &single));
        }
        println!("G over that of single frames: {worst}");
        assert!(worst < 1.6, "{worst}");
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| play(&decoder, &frames, &SequenceQuality::DEFAULT))
        };
        for other in [on(1), on(3)] {
            assert!(other.iter().zip(&played).all(|(a, b)| a.positions == b.positions));
        }
    }

    #[test]
    fn a_part_is_that_of_the_whole() {
        let (decoder, mut frames) = walking();
        // The first wanted frame stands still, too.
        frames[20] = frames[18].clone();
        frames[19] = frames[18].clone();
        let whole = play(&decoder, &frames, &SequenceQuality::DEFAULT);
        let list: Vec<Frame<'_>> = frames.iter().map(|held| Frame { held, scale: 1.0 }).collect();
        for part in [20..23, BLOCK + 1..BLOCK + 3, 0..2, 46..99, 10..10] {
            let mut seen = Vec::new();
            let keep = |f: usize, played: Played| {
                assert!(played.positions == whole[f].positions, "frame {f} of {part:?}");
                seen.push(f);
                Ok(())
            };
            decoder.play(&list, part.clone(), |_, _, p| p, &SequenceQuality::DEFAULT, keep).unwrap();
            assert!(seen.iter().copied().eq(part.start..part.end.min(COUNT)), "{seen:?}");
        }
    }

    #[test]
    fn nothing_jumps_at_the_borders_of_blocks() {
        let (decoder, frames) = walking();
        let played = play(&decoder, &frames, &SequenceQuality::DEFAULT);
        // The largest second difference of any vertex, about each frame.
        let bend = |f: usize| {
            let [a, b, c] = [f - 1, f, f + 1].map(|f| &played[f].positions);
            let one = |v: usize| (0..3).map(|k| (a[v][k] - 2.0 * b[v][k] + c[v][k]).powi(2)).sum::<f64>().sqrt();
            (0..a.len()).map(one).fold(0.0, f64::max)
        };
        let all: Vec<f64> = (25..COUNT - 1).map(bend).collect();
        let border = bend(BLOCK - 1).max(bend(BLOCK));
        let within = all.iter().copied().fold(0.0, f64::max);
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        println!("at the border {border:e}, largest {within:e}, mean {mean:e}");
        assert!(border < 2.0 * mean && within < 3.0 * mean);
    }

    #[test]
    fn a_jump_is_found_anew_and_wrong_frames_are_told() {
        let (decoder, mut frames) = walking();
        frames.drain(6..40);
        let clean = play(&decoder, &frames, &SequenceQuality::PREVIEW);
        // Two held vertices change places for one frame, as mislabelled markers do.
        frames[3].swap(0, 30);
        let played = play(&decoder, &frames, &SequenceQuality::PREVIEW);
        assert!(played.iter().all(|p| p.positions.iter().flatten().all(|x| x.is_finite())));
        let [before, after] = [&clean, &played].map(|p| value(&decoder, &p[5].positions));
        assert!(after < 1.5 * before, "the shape recovers: {before:e}, {after:e}");
        assert!(value(&decoder, &played[3].positions) > 10.0 * before, "the swap is seen");
        frames[1][2][0] = f64::NAN;
        let list: Vec<Frame<'_>> = frames.iter().map(|held| Frame { held, scale: 1.0 }).collect();
        assert!(decoder.play(&list, 0..list.len(), |_, _, p| p, &SequenceQuality::PREVIEW, |_, _| Ok(())).is_err());
    }
}
