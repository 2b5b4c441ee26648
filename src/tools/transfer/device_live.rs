//! A transfer on a device that follows its map.

use super::bins::Atlas;
use super::driver::check;
use super::gpu::{LiveDevice, LiveFrame, Resident, Stages, Work};
use super::layer::{Layer, blank};
use super::live::{by_triangle, can_follow};
use super::lookup::lookups;
use super::output::Output;
use super::plan::Plan;
use super::pyramids::Pyramids;
use super::tables::target_triangles;
use super::tally::HOLE;
use super::{TransferOptions, coverage};
use crate::engine::{Batch, CommandEncoder, Engine, Gpu, Submission, TextureView};
use crate::error::{Error, Result};
use crate::geometry::{Mesh, NONE};
use crate::picture::{Image, Pixels};
use crate::surface::PointMap;
use crate::tools::stopwatch::Stopwatch;

/// A [`LiveTransfer`](super::LiveTransfer) whose texels, images and pictures stay on a device, and
/// are shown from there.
///
/// An edit goes up as the list of its texels, and as what changed of the map
/// ([`DeviceMap::follow`](crate::surface::gpu::DeviceMap::follow)). A frame does as much of it as
/// its budget allows, in commands of the caller: nothing is submitted, waited for or allocated. The
/// few points that kernels leave come to the host after the frame and are finished in a later one.
/// When a frame says that nothing is left, pictures and coverage are, byte for byte, those of
/// [`transfer_on`](super::transfer_on) with the map as it is.
///
/// Colours of pictures only; no supersampling, filling or ST-map.
pub struct DeviceLiveTransfer<'a> {
    gpu: &'a Gpu,
    options: TransferOptions,
    live: LiveDevice<'a>,
    /// Blank pictures of the right formats.
    images: Vec<Image>,
    starts: Vec<usize>,
    members: Vec<u32>,
}

impl std::fmt::Debug for DeviceLiveTransfer<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("DeviceLiveTransfer").field("options", &self.options).finish_non_exhaustive()
    }
}

impl<'a> DeviceLiveTransfer<'a> {
    /// Makes the whole transfer on the device of `engine`, which may be borrowed. `map` works there
    /// ([`correspondence_on`](crate::surface::gpu::correspondence_on),
    /// [`DeviceMap`](crate::surface::gpu::DeviceMap)).
    ///
    /// # Errors
    /// As [`transfer_on`](super::transfer_on), and for options, kinds of layers and maps that
    /// cannot follow, or whole pictures that do not fit the device.
    pub fn new(
        engine: &'a Engine,
        source: &Mesh,
        layers: &[Layer<'_>],
        target: &Mesh,
        map: &dyn PointMap,
        options: &TransferOptions,
    ) -> Result<Self> {
        check(source, layers, target, options)?;
        can_follow(layers, options)?;
        let unable = || Error::input("the stages of this transfer do not all run on the device", "Use LiveTransfer");
        let stages = Stages::new(engine, layers, map, options);
        let (Some(gpu), Some(on_device), true) = (engine.gpu(), map.resident(), stages.keep_whole(engine)) else {
            return Err(unable());
        };
        let plan = Plan::new(source, layers, target, options, &stages)?;
        let pyramids = Pyramids::new(engine);
        let (lookups, lookup_of) = lookups(source, layers)?;
        let [lookup] = lookups.as_slice() else {
            let what = "the pictures of the layers lie on the source in different ways";
            return Err(Error::input(what, "Make a live transfer for each of them"));
        };
        let (w, h) = (options.width, options.height);
        let atlas = Atlas::new(target, w, h, options.region, options.material, plan.most_triangles)?;
        let triangles = target_triangles(target, source, w, h)?;
        let output = |(l, &k)| Output::new(l, source, k, options, None, &pyramids);
        let outputs = layers.iter().zip(&lookup_of).map(output).collect::<Result<Vec<_>>>()?;
        if !outputs.iter().all(Output::stays) {
            return Err(unable());
        }
        let shown = |o: &Output<'_>| o.texture_of.iter().map(|t| *t != NONE).collect::<Vec<_>>();
        if outputs.iter().any(|o| shown(o) != shown(&outputs[0])) {
            let what = "some triangles of the source have pictures in a part of the layers";
            return Err(Error::input(what, "Make a live transfer for each layer"));
        }
        let height = h as usize;
        let shows = |t: usize, o: &Output<'_>| o.texture_of[t] != NONE && lookup.table[t].chart != NONE;
        let work = Work {
            size: [w as usize, height],
            band: height,
            lookups: vec![lookup.table.as_slice()],
            target: &triangles,
            colored: (0..lookup.table.len()).map(|t| outputs.iter().any(|o| shows(t, o))).collect(),
            mirrored: false,
            lists: 3,
        };
        let plates = outputs.iter().map(|o| o.plate(gpu, &pyramids, options.background)).collect::<Result<_>>()?;
        let mut resident = Resident::new(gpu, on_device, &work, plates, &atlas, options, true)?;
        let mut watch = Stopwatch::on(engine);
        resident.begin(height, &atlas, plan.most_entries, &mut watch)?;
        let (found, _) = resident.collect(&mut [], lookup.table.len())?;
        resident.color(&(0..height), &found, &mut watch)?;
        let blanks = |o: &Output<'_>| blank(1, 1, o.image.channels, o.image.depth(), options.background);
        let backgrounds = outputs.iter().map(blanks).collect::<Result<Vec<_>>>()?;
        let (live, texels) = LiveDevice::new(resident, &backgrounds, lookup.table.len())?;
        let (starts, members) = by_triangle(&texels, target.triangle_count());
        let images = outputs.into_iter().map(|o| o.image).collect();
        Ok(Self { gpu, options: options.clone(), live, images, starts, members })
    }

    /// The map has changed in these triangles of the target: frames will follow.
    ///
    /// # Errors
    /// If there is no such triangle; then nothing has changed.
    pub fn update(&mut self, triangles: &[u32]) -> Result<()> {
        let count = self.starts.len() - 1;
        if let Some(t) = triangles.iter().find(|t| **t as usize >= count) {
            let remedy = "Name triangles of the target";
            return Err(Error::input(format!("there is no triangle {t}, only {count}"), remedy));
        }
        let of = |t: &u32| &self.members[self.starts[*t as usize]..self.starts[*t as usize + 1]];
        self.live.map_again(triangles.iter().flat_map(of).copied());
        Ok(())
    }

    /// Adds a frame to commands of the caller, who submits them before the next is added: of what
    /// updates left about `budget` texels. `map` is the one that this was made with.
    ///
    /// # Errors
    /// [`Error::Device`] if the device is lost or refuses, and those of the map.
    pub fn frame(&mut self, map: &dyn PointMap, budget: usize, encoder: &mut CommandEncoder) -> Result<LiveFrame> {
        let mut batch = self.gpu.batch_into(encoder)?;
        let frame = self.record(map, budget, &mut batch)?;
        batch.encode()?;
        Ok(frame)
    }

    /// A frame in commands of its own, which are submitted and not waited for.
    ///
    /// # Errors
    /// As [`DeviceLiveTransfer::frame`].
    pub fn draw(&mut self, map: &dyn PointMap, budget: usize) -> Result<(LiveFrame, Submission)> {
        let mut batch = self.gpu.batch()?;
        let frame = self.record(map, budget, &mut batch)?;
        Ok((frame, batch.submit()?))
    }

    fn record(&mut self, map: &dyn PointMap, budget: usize, batch: &mut Batch<'_>) -> Result<LiveFrame> {
        let Some(map) = map.resident() else {
            return Err(Error::input("the map does not work on the device", "Give the one of the beginning"));
        };
        self.live.record(map, batch, budget)
    }

    /// One picture per layer, to draw it: RGBA of 8 bits, alpha straight. They are the same in
    /// every frame.
    pub fn views(&self) -> impl ExactSizeIterator<Item = &TextureView> {
        self.live.canvases().map(|c| c.view())
    }

    /// Pictures and coverage after everything submitted, brought to the host.
    ///
    /// # Errors
    /// [`Error::Device`] if the device is lost or does not answer in time.
    pub fn read(&self) -> Result<(Vec<Image>, Image)> {
        let mut images = self.images.clone();
        let mut covers = self.live.read(&mut images)?;
        covers.iter_mut().filter(|c| **c == HOLE).for_each(|c| *c = coverage::NOTHING);
        let pixels = Pixels::U8(covers);
        Ok((images, Image { width: self.options.width, height: self.options.height, channels: 1, pixels }))
    }
}
