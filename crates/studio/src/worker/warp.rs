//! The thread that warps a picture while its cage is dragged.
//!
//! While a vertex moves, steps are judged at a glance and the picture is made on a lattice; at rest
//! the steps are judged in full, and, where wanted, the Jacobian of every pixel is shown.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::Instant;

use barymap::engine::Engine;
use barymap::mapping::plane::partition::{LivePartition, Partition, PartitionOptions};
use barymap::mapping::plane::{Cage, CompositeMap, SampleOptions, jacobian_min};
use barymap::picture::{Depth, Image};
use barymap::progress::Quiet;
use barymap::tools::warp::pictures::heat_map;
use barymap::tools::warp::{Preview, WarpOptions, warp_picture};
use barymap::{Error, Result};
use glam::{DVec2, UVec2};

use super::desk::rgba;
use super::message::Rgba;
use crate::model::cage::Loop;

/// Longer side of the picture that is dragged, in pixels.
const DRAGGED: f64 = 1280.0;

/// What the window asks for.
#[derive(Clone, Debug)]
pub enum WarpRequest {
    /// A picture.
    Open(PathBuf),
    /// The cage as it is, in pixels of the picture; whether it is dragged, and whether the Jacobian
    /// is shown at rest.
    Cage(Vec<Loop>, bool, bool),
    /// Ends the thread.
    Stop,
}

/// What a map is like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WarpState {
    /// Steps of the composite map.
    pub steps: usize,
    /// The smallest Jacobian of its steps.
    pub minimum: f64,
    /// Where that is on the picture, in pixels.
    pub at: DVec2,
    /// Whether a step folds.
    pub folds: bool,
    /// The smallest Jacobian of a single map; known at rest.
    pub single: Option<f64>,
    /// Whether the steps were judged in full.
    pub settled: bool,
    /// Milliseconds of work for this picture.
    pub milliseconds: f64,
}

/// What the window is told.
#[derive(Clone, Debug)]
pub enum WarpReport {
    /// A picture was read: its file and size, and a smaller one of it.
    Opened(PathBuf, [u32; 2], Arc<Rgba>),
    /// The warped picture.
    Warped(Arc<Rgba>, WarpState),
    /// The Jacobian of every pixel.
    Heat(Arc<Rgba>),
    /// Why there is no warped picture.
    Failed(String),
}

/// The thread as the window sees it.
#[derive(Debug)]
pub struct WarpWorker {
    sender: Sender<WarpRequest>,
    reports: Receiver<WarpReport>,
    thread: Option<JoinHandle<()>>,
}

impl WarpWorker {
    /// Starts the thread; `wake` is called after every report.
    pub fn start(wake: impl Fn() + Send + 'static) -> Self {
        let (sender, requests) = channel();
        let (out, reports) = channel();
        let tell = move |report| {
            // A window that is gone needs no reports.
            _ = out.send(report);
            wake();
        };
        let thread = std::thread::Builder::new().name("warp".into()).spawn(move || run(&requests, &tell));
        Self { sender, reports, thread: thread.ok() }
    }

    /// Asks for something; returns at once.
    pub fn send(&self, request: WarpRequest) {
        // A thread that is gone has reported why.
        _ = self.sender.send(request);
    }

    /// What came since the last time.
    pub fn take(&self) -> Vec<WarpReport> {
        self.reports.try_iter().collect()
    }
}

impl Drop for WarpWorker {
    fn drop(&mut self) {
        self.send(WarpRequest::Stop);
        if let Some(thread) = self.thread.take() {
            // What it panicked with was printed already.
            _ = thread.join();
        }
    }
}

/// A picture in its cage.
#[derive(Default)]
struct Desk {
    image: Option<Image>,
    /// Pixels of the dragged picture for one of the whole.
    scale: f64,
    source: Vec<Vec<DVec2>>,
    live: Option<LivePartition>,
    preview: Option<Preview>,
}

fn run(requests: &Receiver<WarpRequest>, tell: &dyn Fn(WarpReport)) {
    let (engine, mut desk) = (Engine::cpu(), Desk::default());
    // The cage, whether it moves, whether heat is wanted, and whether its rest is done.
    let mut cage: Option<(Vec<Loop>, bool, bool)> = None;
    let mut rested = true;
    loop {
        let first = if rested { requests.recv().ok() } else { requests.try_recv().ok() };
        if rested && first.is_none() {
            return;
        }
        let news: Vec<WarpRequest> = first.into_iter().chain(requests.try_iter()).collect();
        let mut moved = false;
        for request in news {
            match request {
                WarpRequest::Stop => return,
                WarpRequest::Open(path) => match desk.open(&path) {
                    Ok(report) => tell(report),
                    Err(error) => tell(WarpReport::Failed(error.to_string())),
                },
                WarpRequest::Cage(loops, dragged, heat) => {
                    cage = Some((loops, dragged, heat));
                    moved = true;
                }
            }
        }
        let Some((loops, dragged, heat)) = &cage else { continue };
        let result = match (moved, *dragged) {
            (true, _) => desk.drag(&engine, loops).map(|report| report.into_iter().collect()),
            (false, false) if !rested => desk.rest(&engine, loops, *heat),
            _ => Ok(Vec::new()),
        };
        rested = !moved || *dragged;
        match result {
            Ok(reports) => reports.into_iter().for_each(tell),
            Err(error) => {
                tell(WarpReport::Failed(error.to_string()));
                rested = true;
            }
        }
    }
}

impl Desk {
    fn open(&mut self, path: &PathBuf) -> Result<WarpReport> {
        let image = barymap::io::read_image(path)?;
        let size = [image.width, image.height];
        let longer = f64::from(image.width.max(image.height));
        self.scale = (DRAGGED / longer).min(1.0);
        let small = shrunk(&image, self.scale)?;
        let shown = Arc::new(rgba(&small)?);
        (self.image, self.live, self.preview) = (Some(small), None, None);
        Ok(WarpReport::Opened(path.clone(), size, shown))
    }

    /// The cage in pixels of the dragged picture.
    fn cage(&self, loops: &[Loop]) -> Result<Cage> {
        let scaled = |points: &[DVec2]| points.iter().map(|p| *p * self.scale).collect();
        Cage::new(loops.iter().map(|l| scaled(&l.source)).collect(), loops.iter().map(|l| scaled(&l.target)).collect())
    }

    /// The picture under a cage that has changed.
    fn drag(&mut self, engine: &Engine, loops: &[Loop]) -> Result<Option<WarpReport>> {
        let Some(image) = &self.image else { return Ok(None) };
        if loops.is_empty() {
            return Ok(None);
        }
        let begun = Instant::now();
        let cage = self.cage(loops)?;
        let same = cage.source.loops() == self.source.as_slice();
        let live = match self.live.as_mut().filter(|_| same) {
            Some(live) => {
                live.drag(&cage)?;
                live
            }
            None => {
                self.preview = None;
                self.source = cage.source.loops().to_vec();
                self.live.insert(LivePartition::new(engine, &cage, &PartitionOptions::default(), &Quiet)?)
            }
        };
        let map = composite(live.partition())?;
        let preview = match &mut self.preview {
            Some(preview) => {
                preview.drag(engine, &map)?;
                preview
            }
            none => none.insert(Preview::new(engine, image, &map, UVec2::new(image.width, image.height))?),
        };
        let picture = rgba(&preview.frame()?)?;
        let state = state(live.partition(), self.scale, begun);
        Ok(Some(WarpReport::Warped(Arc::new(picture), WarpState { settled: live.is_settled(), ..state })))
    }

    /// The same at rest: judged in full.
    fn rest(&mut self, engine: &Engine, loops: &[Loop], heat: bool) -> Result<Vec<WarpReport>> {
        let Some(image) = &self.image else { return Ok(Vec::new()) };
        let cage = self.cage(loops)?;
        let (Some(live), Some(preview)) = (&mut self.live, &mut self.preview) else { return Ok(Vec::new()) };
        let begun = Instant::now();
        live.settle(engine, &cage, &Quiet)?;
        let map = composite(live.partition())?;
        preview.drag(engine, &map)?;
        let pair = [(cage.source.clone(), cage.target.clone())];
        let single = jacobian_min(engine, map.coordinates(), &pair, &SampleOptions::default())?;
        let picture = rgba(&preview.frame()?)?;
        let single = single.first().map(|m| m.value);
        let state = WarpState { single, settled: true, ..state(live.partition(), self.scale, begun) };
        let mut reports = vec![WarpReport::Warped(Arc::new(picture), state)];
        if heat {
            let options = WarpOptions { jacobian: true, ..WarpOptions::default() };
            let warped = warp_picture(engine, image, &map, &options, &Quiet)?;
            let values = warped.jacobian.unwrap_or_default();
            reports.push(WarpReport::Heat(Arc::new(rgba(&heat_map(&values, image.width)?)?)));
        }
        Ok(reports)
    }
}

fn composite(partition: &Partition) -> Result<CompositeMap> {
    CompositeMap::new(partition.coordinates, partition.polygons.clone())
}

fn state(partition: &Partition, scale: f64, begun: Instant) -> WarpState {
    let smallest = partition.steps.iter().min_by(|a, b| a.minimum.value.total_cmp(&b.minimum.value));
    let at = smallest.filter(|s| s.from == 0.0).map_or(DVec2::NAN, |s| s.minimum.at / scale);
    WarpState {
        steps: partition.steps.len(),
        minimum: smallest.map_or(f64::NAN, |s| s.minimum.value),
        at,
        folds: partition.folds,
        single: None,
        settled: false,
        milliseconds: 1e3 * begun.elapsed().as_secs_f64(),
    }
}

/// A smaller picture in 8 bits: each pixel the mean of those that it covers.
fn shrunk(image: &Image, scale: f64) -> Result<Image> {
    let image = image.converted(4, Depth::U8)?;
    if scale >= 1.0 {
        return Ok(image);
    }
    let size = |n: u32| ((f64::from(n) * scale).round() as u32).max(1);
    let (width, height) = (size(image.width), size(image.height));
    let whole = UVec2::new(image.width, image.height);
    let range = |x: u32, n: u32, m: u32| {
        let at = |x: u32| (u64::from(x) * u64::from(m) / u64::from(n)) as u32;
        at(x)..at(x + 1).max(at(x) + 1).min(m)
    };
    if whole.x == 0 || whole.y == 0 {
        return Err(Error::input("the picture has no pixels", "Open another one"));
    }
    Image::from_fn(width, height, |x, y| {
        let (mut sum, mut count) = ([0_u64; 4], 0);
        for v in range(y, height, whole.y) {
            for u in range(x, width, whole.x) {
                let pixel = image.pixel(u, v);
                (0..4).for_each(|c| sum[c] += u64::from(pixel[c]));
                count += 1;
            }
        }
        sum.map(|s| (s / count.max(1)) as u8)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::cage::{CageDocument, Stage};

    fn desk(folder: &std::path::Path) -> (Desk, CageDocument) {
        let path = folder.join("p.png");
        let image = Image::from_fn(200, 120, |x, y| [x as u8, y as u8, 90, 255]).unwrap();
        barymap::io::write_image(&image, &path).unwrap();
        let mut desk = Desk::default();
        let WarpReport::Opened(_, size, shown) = desk.open(&path).unwrap() else { panic!("not opened") };
        assert_eq!((size, shown.width), ([200, 120], 200));
        let mut document = CageDocument::default();
        document.rectangle([200.0, 120.0], 2);
        (desk, document)
    }

    #[test]
    fn a_cage_that_goes_nowhere_leaves_the_picture() {
        let folder = tempfile::tempdir().unwrap();
        let (mut desk, document) = desk(folder.path());
        let Some(WarpReport::Warped(picture, state)) = desk.drag(&Engine::cpu(), &document.loops).unwrap() else {
            panic!("not warped")
        };
        let at = |x: usize, y: usize| picture.bytes[4 * (200 * y + x)];
        assert!(at(100, 60).abs_diff(100) <= 2 && at(30, 20).abs_diff(30) <= 2);
        assert!(!state.folds && state.minimum > 0.9 && state.steps == 1, "{state:?}");
    }

    #[test]
    fn where_one_map_folds_several_steps_do_not() {
        let folder = tempfile::tempdir().unwrap();
        let (mut desk, mut document) = desk(folder.path());
        desk.drag(&Engine::cpu(), &document.loops).unwrap();
        // The middle of the upper edge far down: a notch.
        document.move_by((0, 1), DVec2::new(0.0, 80.0), Stage::Drag);
        desk.drag(&Engine::cpu(), &document.loops).unwrap();
        let reports = desk.rest(&Engine::cpu(), &document.loops, true).unwrap();
        let [WarpReport::Warped(_, state), WarpReport::Heat(_)] = reports.as_slice() else { panic!("{reports:?}") };
        assert!(state.single.unwrap() <= 0.0 && state.steps > 1, "{state:?}");
        assert!(state.settled && !state.folds && state.minimum > 0.0, "{state:?}");
        // A vertex beyond the opposite edge: the outline crosses itself, in words.
        document.move_by((0, 1), DVec2::new(0.0, 200.0), Stage::Drag);
        let error = desk.drag(&Engine::cpu(), &document.loops).unwrap_err();
        assert!(!error.to_string().is_empty());
        // And back again.
        document.reset();
        assert!(desk.drag(&Engine::cpu(), &document.loops).is_ok());
    }

    #[test]
    fn large_pictures_are_dragged_small() {
        let image = Image::from_fn(300, 100, |x, _| [if x < 150 { 0 } else { 200 }, 0, 0, 255]).unwrap();
        let small = shrunk(&image, 0.1).unwrap();
        assert_eq!((small.width, small.height), (30, 10));
        assert_eq!((small.pixel(3, 3)[0], small.pixel(20, 3)[0]), (0, 200));
    }
}
