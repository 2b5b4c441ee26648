//! The worker's inner loop: a map and a texture that follow the pairs.
//!
//! The order of the work is that of urgency: answers to clicks; pairs that moved, at a coarse size;
//! and when nothing else is wanted, the whole field, the full size, trust, and which pairs are wrong.

use std::time::{Duration, Instant};

use barymap::picture::Image;
use barymap::progress::Progress;
use barymap::surface::Status;
use barymap::surface::correspondence::Method;
use barymap::tools::anchors::{AnchorOptions, contradicted, propose, suggest};
use barymap::tools::inverse_map::inverse_map;
use barymap::tools::transfer::{Layer, LiveTransfer, TransferOptions, coverage};
use barymap::tools::vertex_map::{VertexMap, vertex_map};
use barymap::{Error, Result};

use super::desk::{Owned, rgba};
use super::inbox::{Inbox, Task};
use super::mapper::{FEWEST, Mapper, Moved, anchors, fits};
use super::message::{GuessFrom, PairList, Proposed, Report, Rgba, Shown, Suggested};
use super::progress::Reporter;
use super::{Class, Out};
use crate::model::Side;

/// Texels along a side of the picture during a drag.
const COARSE: u32 = 512;
/// The same where following takes longer than [`SLOW`].
const COARSEST: u32 = 256;
/// A step of a drag that takes longer than this is felt.
const SLOW: Duration = Duration::from_millis(80);
/// Texels that the full size does between two looks at the inbox.
const SLICE: usize = 1 << 15;
/// Bytes that a live transfer may take.
const MEMORY: u64 = 3 << 30;
/// Padding of the live picture: filters look no farther.
const MARGIN: u32 = 4;

/// What is up to date.
struct Live<'a> {
    owned: &'a Owned,
    layers: Vec<Layer<'a>>,
    mapper: Option<Mapper<'a>>,
    method: Method,
    /// The pairs of the map.
    pairs: PairList,
    /// Pairs that no map could be made of: not tried again.
    refused: Option<(PairList, Method)>,
    coarse: Option<LiveTransfer<'a>>,
    coarse_size: u32,
    fine: Option<LiveTransfer<'a>>,
    fine_size: u32,
    /// Triangles that the full size has still to follow, while it is not being made.
    waiting: Vec<u32>,
    settled: bool,
    fine_done: bool,
    checked: bool,
    vertices: Option<VertexMap>,
}

/// Runs until something is wanted that changes what is borrowed, or nothing is left to do. Whether
/// there is more to do.
pub(crate) fn run(owned: &Owned, inbox: &mut Inbox, out: &Out) -> Result<bool> {
    let mut live = Live {
        owned,
        layers: owned.textures.iter().map(|t| t.layer(false)).collect(),
        mapper: None,
        method: inbox.method,
        pairs: Vec::new(),
        refused: None,
        coarse: None,
        coarse_size: COARSE,
        fine: None,
        fine_size: inbox.size,
        waiting: Vec::new(),
        settled: false,
        fine_done: false,
        checked: false,
        vertices: None,
    };
    let mut told = None;
    loop {
        inbox.receive(false);
        if inbox.needs_desk() || needs_embedding(owned, inbox) {
            return Ok(true);
        }
        let done = match live.step(inbox, out, &mut told) {
            Ok(more) => !more,
            // What was cancelled is begun again when nothing else is wanted.
            Err(Error::Cancelled) => inbox.paused,
            Err(error) => {
                out.send(Report::Failed(error.to_string()));
                // It would fail again with the same pairs.
                live.refuse(inbox);
                false
            }
        };
        if done {
            out.send(Report::Idle);
            inbox.receive(true);
        }
    }
}

fn needs_embedding(owned: &Owned, inbox: &Inbox) -> bool {
    let missing = owned.subjects.iter().flatten().any(|s| s.embedding.is_none());
    // Those that cannot be embedded were reported by the outer loop.
    missing && inbox.method.needs_embedding() && !inbox.paused && !owned.is_hopeless()
}

impl<'a> Live<'a> {
    /// Does the most urgent thing; whether there may be more.
    fn step(&mut self, inbox: &mut Inbox, out: &Out, told: &mut Option<String>) -> Result<bool> {
        if let Some(why) = self.missing(inbox) {
            self.mapper = None;
            (self.coarse, self.fine) = (None, None);
            if told.as_ref() != Some(&why) {
                out.send(Report::Nothing(why.clone()));
                *told = Some(why);
            }
            return self.task(inbox, out);
        }
        *told = None;
        if self.method != inbox.method {
            (self.mapper, self.method) = (None, inbox.method);
        }
        let stale = self.mapper.is_none() || self.pairs != inbox.pairs;
        let refused = self.refused.as_ref().is_some_and(|r| r.0 == inbox.pairs && r.1 == inbox.method);
        if stale && !refused {
            self.follow(inbox, out)?;
            return Ok(true);
        }
        if self.task(inbox, out)? {
            return Ok(true);
        }
        if self.mapper.is_none() || inbox.dragging || inbox.paused {
            return Ok(false);
        }
        if !self.settled {
            let settled = {
                let Some(mapper) = &mut self.mapper else { return Ok(false) };
                out.run(Class::Idle, || !inbox.receive(false), || mapper.settle())
            };
            settled?;
            self.settled = true;
            self.update(&Moved::All, inbox, out)?;
            self.trust(out)?;
            return Ok(true);
        }
        if self.fine_size != inbox.size {
            (self.fine, self.fine_size, self.fine_done) = (None, inbox.size, false);
        }
        if !self.fine_done {
            return self.refine(inbox, out).map(|()| true);
        }
        if !self.checked {
            let list = anchors(&self.pairs);
            let owned = self.owned;
            if let Some((source, target)) = owned.shape(Side::Source).zip(owned.shape(Side::Target))
                && source.embedding.is_some()
                && target.embedding.is_some()
            {
                let found = out.run(Class::Idle, || !inbox.receive(false), || contradicted(source, target, &list))?;
                let id = |k: usize| self.pairs.get(k).map(|p| p.0);
                out.send(Report::Wrong(
                    found.outliers.iter().filter_map(|o| id(o.index).map(|id| (id, o.off))).collect(),
                ));
            }
            self.checked = true;
            return Ok(true);
        }
        Ok(false)
    }

    /// Why there can be no result, in words that say what to do next.
    fn missing(&self, inbox: &Inbox) -> Option<String> {
        let [source, target] = &self.owned.subjects;
        let (Some(_), Some(target)) = (source, target) else {
            return Some(match (source, target) {
                (None, None) => "Open the mesh with the texture on the left, the one that gets it on the right".into(),
                (None, _) => "Open the mesh with the texture on the left".into(),
                _ => "Open the mesh that gets the texture on the right".into(),
            });
        };
        if !target.mesh.has_texcoords() {
            return Some("The target has no texture coordinates: tick \"Make texture coordinates\"".into());
        }
        if inbox.method.needs_embedding() && self.owned.subjects.iter().flatten().any(|s| s.embedding.is_none()) {
            return Some("The shapes are not measured yet".into());
        }
        let count = inbox.pairs.len();
        if count < FEWEST {
            let more = FEWEST - count;
            let word = if more == 1 { "pair" } else { "pairs" };
            return Some(format!("{more} more {word} until the first result: click a point left, its partner right"));
        }
        (!fits(self.owned, &inbox.pairs)).then(|| "Some pairs are not on these meshes: delete them".into())
    }

    /// Makes the map of the pairs that are wanted, and the coarse picture.
    fn follow(&mut self, inbox: &mut Inbox, out: &Out) -> Result<()> {
        let begun = Instant::now();
        let (pairs, method) = (inbox.pairs.clone(), inbox.method);
        let made = match &mut self.mapper {
            Some(mapper) => mapper.follow(self.owned, &self.pairs, &pairs, method),
            None => {
                let _reporter = Reporter::new(out, "the first result");
                // From then on pairs are dragged.
                Mapper::new(self.owned, &pairs, method).map(|mapper| {
                    self.mapper = Some(mapper);
                    self.settled = true;
                    Moved::All
                })
            }
        };
        let moved = match made {
            Ok(moved) => moved,
            Err(error) => {
                self.refuse(inbox);
                return Err(error);
            }
        };
        let first = matches!(moved, Moved::All);
        self.settled = first;
        self.pairs = pairs;
        (self.refused, self.vertices) = (None, None);
        (self.fine_done, self.checked) = (false, false);
        self.update(&moved, inbox, out)?;
        if first {
            self.trust(out)?;
        } else if begun.elapsed() > SLOW && self.coarse_size > COARSEST {
            // From here on a smaller picture is dragged.
            (self.coarse, self.coarse_size) = (None, COARSEST);
        }
        Ok(())
    }

    /// Brings the coarse picture up to date and shows it.
    fn update(&mut self, moved: &Moved, inbox: &Inbox, out: &Out) -> Result<()> {
        let (Some(mapper), [Some(source), Some(target)]) = (&self.mapper, &self.owned.subjects) else { return Ok(()) };
        let all = || (0..target.mesh.triangle_count() as u32).collect();
        let triangles: Vec<u32> = match moved {
            Moved::All => all(),
            Moved::These(list) => list.clone(),
        };
        match &mut self.coarse {
            Some(live) => _ = live.update(mapper.map(), &triangles)?,
            None => {
                let options = options(self.coarse_size.min(inbox.size));
                self.coarse =
                    Some(LiveTransfer::new(&source.mesh, &self.layers, &target.mesh, mapper.map(), &options)?);
            }
        }
        self.waiting.extend(&triangles);
        self.vertices = None;
        if let Some(live) = &self.coarse {
            out.send(Report::Shown(shown(live, true, inbox.asked)?));
        }
        Ok(())
    }

    /// Does a slice of the full size; shows it when it is done.
    fn refine(&mut self, inbox: &mut Inbox, out: &Out) -> Result<()> {
        let (Some(mapper), [Some(source), Some(target)]) = (&self.mapper, &self.owned.subjects) else {
            self.fine_done = true;
            return Ok(());
        };
        if self.fine.is_none() {
            let _reporter = Reporter::new(out, "the full size");
            let (layers, options) = (&self.layers, options(self.fine_size));
            let make = || LiveTransfer::new(&source.mesh, layers, &target.mesh, mapper.map(), &options);
            let made = out.run(Class::Idle, || !inbox.receive(false), make)?;
            self.waiting.clear();
            self.fine = Some(made);
        }
        let Some(live) = &mut self.fine else { return Ok(()) };
        self.waiting.sort_unstable();
        self.waiting.dedup();
        let triangles = std::mem::take(&mut self.waiting);
        let followed = live.follow(mapper.map(), &triangles, SLICE)?;
        if followed.left == 0 {
            self.fine_done = true;
            out.send(Report::Shown(shown(live, false, inbox.asked)?));
        }
        Ok(())
    }

    /// Tells how far the map can be trusted.
    fn trust(&mut self, out: &Out) -> Result<()> {
        let ids = self.pairs.iter().map(|p| p.0);
        let left_out = self.mapper.as_ref().map(|m| ids.zip(m.left_out().iter().copied()).collect());
        out.send(Report::LeftOut(left_out.unwrap_or_default()));
        let Some(vertices) = self.vertices()? else { return Ok(()) };
        let trust = |i: &barymap::surface::PackedImage| match i.status() {
            Status::Failed => 0.0,
            Status::Doubtful => 0.5 * i.confidence,
            Status::Valid => i.confidence.max(0.5),
        };
        let list = vertices.images.iter().map(trust).collect();
        out.send(Report::Confidence(std::sync::Arc::new(list)));
        Ok(())
    }

    /// The map of the target's vertices.
    fn vertices(&mut self) -> Result<Option<&VertexMap>> {
        let (Some(mapper), [Some(source), Some(target)]) = (&self.mapper, &self.owned.subjects) else {
            return Ok(None);
        };
        if self.vertices.is_none() {
            let (from, to) = ((&source.mesh, &source.topology), (&target.mesh, &target.topology));
            self.vertices = Some(vertex_map(from, to, mapper.map())?);
        }
        Ok(self.vertices.as_ref())
    }

    /// Gives up on these pairs.
    fn refuse(&mut self, inbox: &Inbox) {
        (self.mapper, self.coarse, self.fine) = (None, None, None);
        self.refused = Some((inbox.pairs.clone(), inbox.method));
    }

    /// Does what was asked for once; whether there was something. A task that fails is told, and
    /// nothing else suffers.
    fn task(&mut self, inbox: &mut Inbox, out: &Out) -> Result<bool> {
        let Some(task) = inbox.tasks.pop_front() else { return Ok(false) };
        match self.carry_out(task, inbox, out) {
            Err(error) if !matches!(error, Error::Cancelled) => {
                out.send(Report::Failed(error.to_string()));
                Ok(true)
            }
            other => other,
        }
    }

    fn carry_out(&mut self, task: Task, inbox: &Inbox, out: &Out) -> Result<bool> {
        let owned = self.owned;
        let (Some(source), Some(target)) = (owned.shape(Side::Source), owned.shape(Side::Target)) else {
            out.send(Report::Failed("Open two meshes first".into()));
            return Ok(true);
        };
        let measured = source.embedding.is_some() && target.embedding.is_some();
        let list = anchors(&inbox.pairs);
        match task {
            Task::Guess(from) => {
                let point = self.guess(&from)?;
                out.send(Report::Guess(from, point));
            }
            Task::ReadPairs(path) => {
                let written = barymap::io::anchors::read_pairs(&path.to_string_lossy())?;
                let [Some(source), Some(target)] = &owned.subjects else { return Ok(true) };
                let found = barymap::desk::find_pairs(&written, source, target)?;
                found.notes.into_iter().for_each(|note| out.send(Report::Note(note)));
                out.send(Report::Read(found.pairs.source.into_iter().zip(found.pairs.target).collect()));
            }
            _ if !measured => {
                // Proposals go by distances along the surface, whatever the method.
                out.send(Report::Failed("This needs the shapes to be measured: choose the method Field first".into()));
            }
            Task::Propose(count) => {
                let reporter = Reporter::new(out, "proposing pairs");
                let options = AnchorOptions { count, ..AnchorOptions::default() };
                let made = out.run(
                    Class::Asked,
                    || true,
                    || propose(source, target, &list, &options, &reporter as &dyn Progress),
                )?;
                let proposed = made.pairs.into_iter().skip(made.given);
                let proposed = proposed.map(|p| Proposed { source: p.source, target: p.target, flagged: p.flagged });
                out.send(Report::Proposed(proposed.collect(), made.notes));
            }
            Task::Suggest(count) => {
                if list.len() < FEWEST {
                    out.send(Report::Failed(format!("Set {FEWEST} pairs first: the next ones depend on them")));
                    return Ok(true);
                }
                let _reporter = Reporter::new(out, "looking where the next pair helps most");
                let found = out.run(Class::Asked, || true, || suggest(source, target, &list, count))?;
                let place = |v: u32| target.topology.vertex_point(v);
                let suggested = found.into_iter().filter_map(|s| {
                    Some(Suggested { target: place(s.vertex)?, guess: s.guess, error: s.expected_error })
                });
                out.send(Report::Suggested(suggested.collect()));
            }
        }
        Ok(true)
    }

    /// Where the map puts the partner of a point.
    fn guess(&mut self, from: &GuessFrom) -> Result<Option<barymap::geometry::SurfacePoint>> {
        self.vertices()?;
        let owned = self.owned;
        let (Some(mapper), Some(vertices)) = (&self.mapper, &self.vertices) else { return Ok(None) };
        let [Some(source), Some(target)] = &owned.subjects else { return Ok(None) };
        match from.side {
            Side::Source => {
                let found = inverse_map(&source.mesh, &target.mesh, mapper.map(), vertices, &[from.point])?;
                Ok(found.first().and_then(|f| f.point.point()))
            }
            Side::Target => {
                let mut images = Vec::new();
                mapper.map().map(&[from.point.into()], &mut images)?;
                Ok(images.first().and_then(|i| i.point()))
            }
        }
    }
}

fn options(size: u32) -> TransferOptions {
    TransferOptions { width: size, height: size, margin: MARGIN, memory: MEMORY, ..TransferOptions::default() }
}

/// The picture of a live transfer, as the window draws it.
fn shown(live: &LiveTransfer<'_>, coarse: bool, asked: Instant) -> Result<Shown> {
    let blank = Image::zeros(1, 1, 4, barymap::picture::Depth::U8)?;
    let picture = rgba(live.layers().next().unwrap_or(&blank))?;
    let covers = live.coverage();
    let count = (covers.width * covers.height) as usize;
    let (mut bytes, mut sums) = (Vec::with_capacity(4 * count), [0_u64; 2]);
    for i in 0..count {
        let value = (255.0 * covers.sample(i)).round() as u8;
        let color: [u8; 4] = match value {
            coverage::VALID => [60, 190, 90, 90],
            coverage::DOUBTFUL => [240, 170, 30, 200],
            _ => [200, 40, 40, 220],
        };
        sums[0] += u64::from(value == coverage::VALID);
        sums[1] += u64::from(value == coverage::VALID || value == coverage::DOUBTFUL);
        bytes.extend(color);
    }
    Ok(Shown {
        picture: std::sync::Arc::new(picture),
        coverage: std::sync::Arc::new(Rgba { width: covers.width, height: covers.height, bytes }),
        valid: sums[0] as f64 / sums[1].max(1) as f64,
        coarse,
        milliseconds: 1e3 * asked.elapsed().as_secs_f64(),
    })
}
