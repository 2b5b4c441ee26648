//! Band after band of a transfer: all of it on the host's initiative, or left to a device from
//! which the host takes what its own layers need.

use std::ops::Range;

use super::band::Window;
use super::coordinates;
use super::fill::Fill;
use super::footprint::Footprint;
use super::gpu::{Resident, Sampler};
use super::lookup::Lookup;
use super::output::{Output, Scratch};
use super::plan::Plan;
use super::tally::Tally;
use super::{TransferOptions, TransferStats};
use crate::control;
use crate::error::Result;
use crate::picture::Image;
use crate::progress::Progress;
use crate::tools::stopwatch::Stopwatch;

/// What bands are made of, and what becomes of them.
pub(super) struct Bands<'b, 'a> {
    pub(super) options: &'b TransferOptions,
    pub(super) plan: &'b Plan,
    pub(super) lookups: &'b [Lookup<'a>],
    pub(super) coarse: &'b mut Window<'a>,
    pub(super) fine: Option<&'b mut Window<'a>>,
    pub(super) outputs: &'b mut [Output<'a>],
    pub(super) sampler: Option<&'b mut Sampler<'a>>,
    pub(super) stmap: Option<&'b mut Image>,
    pub(super) covers: &'b mut [u8],
    pub(super) watch: &'b mut Stopwatch,
    pub(super) progress: &'b dyn Progress,
    pub(super) scratch: Scratch,
}

impl Bands<'_, '_> {
    /// The rows of each band.
    fn all(&self) -> Vec<Range<usize>> {
        let (rows, height) = (self.plan.rows, self.options.height as usize);
        (0..height).step_by(rows).map(|start| start..(start + rows).min(height)).collect()
    }

    /// Everything by the host, which hands single stages to a device. Gives counts.
    pub(super) fn on_host(mut self) -> Result<TransferStats> {
        let width = self.options.width as usize;
        let mut tally = Tally::default();
        let all = self.all();
        for rows in &all {
            control::check()?;
            self.coarse.advance(rows, self.watch)?;
            self.color(rows, |_| true)?;
            let band = &mut self.covers[rows.start * width..rows.end * width];
            let shown: Vec<(&[Footprint], &[u32])> = (self.outputs.iter())
                .map(|o| (self.scratch.footprints[o.lookup].as_slice(), o.texture_of.as_slice()))
                .collect();
            tally.add(rows, self.coarse, &shown, band);
            self.watch.lap("coverage");
            self.progress.advance((rows.len() * width) as u64);
        }
        Ok(TransferStats { bands: all.len() as u64, ..tally.stats() })
    }

    /// Everything by a device, but for layers that do not stay there. Gives counts.
    pub(super) fn on_device(mut self, resident: &mut Resident<'_, '_>) -> Result<TransferStats> {
        let (width, height) = (self.options.width as usize, self.options.height as usize);
        let all = self.all();
        let faces = self.lookups.first().map_or(0, |l| l.table.len());
        let next = |rows: &Range<usize>| (rows.end + 1).min(height);
        resident.begin(next(&all[0]), self.coarse.atlas(), self.plan.most_entries, self.watch)?;
        for (k, rows) in all.iter().enumerate() {
            control::check()?;
            let (found, seen) = resident.collect(&mut staying(self.outputs), faces)?;
            self.watch.lap("wait");
            resident.color(rows, &found, self.watch)?;
            if let Some(rows) = all.get(k + 1) {
                resident.begin(next(rows), self.coarse.atlas(), self.plan.most_entries, self.watch)?;
            }
            // The device goes on meanwhile.
            if let Some(seen) = seen {
                self.coarse.take(rows, seen);
                self.color(rows, |o| !o.stays())?;
            }
            self.progress.advance((rows.len() * width) as u64);
        }
        let sums = resident.finish(&mut staying(self.outputs), self.covers, self.watch)?;
        let mut tally = Tally::default();
        tally.add_sums(&sums);
        Ok(TransferStats { bands: all.len() as u64, ..tally.stats() })
    }

    /// The colours of a band whose texels and images are at hand, of layers that are `wanted`; its
    /// holes and places in the source's texture, of all.
    fn color(&mut self, rows: &Range<usize>, wanted: impl Fn(&Output<'_>) -> bool) -> Result<()> {
        let options = self.options;
        for (k, footprints) in self.scratch.footprints.iter_mut().enumerate() {
            if self.outputs.iter().any(|o| o.lookup == k && wanted(o)) {
                self.coarse.footprints(rows, &self.lookups[k].table, footprints);
            }
        }
        self.watch.lap("footprint");
        if let Some(fine) = &mut self.fine {
            let k = options.supersample as usize;
            let fine_rows = rows.start * k..rows.end * k;
            fine.advance(&fine_rows, self.watch)?;
            for (lookup, footprints) in self.lookups.iter().zip(&mut self.scratch.fine_footprints) {
                fine.footprints(&fine_rows, &lookup.table, footprints);
            }
            self.watch.lap("footprint");
        }
        for output in self.outputs.iter_mut() {
            control::check()?;
            if wanted(output) {
                let sampler = self.sampler.as_deref_mut();
                output.sample(rows, self.coarse, self.fine.as_deref(), &mut self.scratch, options, sampler)?;
            }
            if options.fill != Fill::None {
                let (texture_of, table) = (&output.texture_of, &self.lookups[output.lookup].table);
                let height = options.height as usize;
                output.holes.collect(rows, height, self.coarse, table, texture_of, options.fill_doubtful);
            }
        }
        self.watch.lap("sample_texture");
        if let (Some(stmap), Some(lookup)) = (&mut self.stmap, self.lookups.iter().find(|l| l.has_pictures())) {
            coordinates::write(stmap, rows, self.coarse, lookup);
        }
        Ok(())
    }
}

/// The pictures of layers that stay on the device.
fn staying<'o>(outputs: &'o mut [Output<'_>]) -> Vec<&'o mut Image> {
    outputs.iter_mut().filter(|o| o.stays()).map(|o| &mut o.image).collect()
}
