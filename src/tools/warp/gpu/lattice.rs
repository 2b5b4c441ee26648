//! Host halves of the kernels `paint_lattice`, `paint_wide` and `show_lattice`: a picture under the
//! triangles of a lattice, drawn where a window shows it.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};

use crate::engine::{
    Batch, BindGroup, BindingKind, Buffer, Canvas, Engine, GROUP, Gpu, Kernel, Layout, Pipeline, Pyramid, Table,
    UniformBlocks,
};
use crate::error::{Error, Result};
use crate::kernel_layout as layout;
use crate::mapping::plane::{Lattice, MappedNodes, Mapping};

/// Twin of the struct in `shaders/lib/lattice.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
struct LatticeParams {
    origin: [f32; 2],
    pixels: f32,
    count: u32,
    size: [u32; 2],
    picture: [f32; 2],
}

const LAYOUTS: &[Layout] = &[layout!(LatticeParams, { origin, pixels, count, size, picture })];
const PARAMS: BindingKind = BindingKind::Uniform(size_of::<LatticeParams>() as u64);

pub(super) static PAINT_LATTICE: Kernel = Kernel {
    name: "paint_lattice",
    source: include_str!("../../../../shaders/paint_lattice.wgsl"),
    bindings: &[PARAMS, BindingKind::Table, BindingKind::Read, BindingKind::Write, BindingKind::Write],
    layouts: LAYOUTS,
    items: 1,
    constants: &[],
};

pub(super) static PAINT_WIDE: Kernel = Kernel {
    name: "paint_wide",
    source: include_str!("../../../../shaders/paint_wide.wgsl"),
    bindings: &[PARAMS, BindingKind::Table, BindingKind::Read, BindingKind::Write, BindingKind::Read],
    layouts: LAYOUTS,
    items: 1,
    constants: &[],
};

pub(super) static SHOW_LATTICE: Kernel = Kernel {
    name: "show_lattice",
    source: include_str!("../../../../shaders/show_lattice.wgsl"),
    bindings: &[
        PARAMS,
        BindingKind::Table,
        BindingKind::Read,
        BindingKind::Read,
        BindingKind::Table,
        BindingKind::Canvas,
    ],
    layouts: LAYOUTS,
    items: 1,
    constants: &[],
};

/// Coordinates from which on pixels are not told apart in single precision; 2^24.
#[cfg(test)]
const FAR: f32 = 16_777_216.0;

/// Columns, and rows, of a triangle that one invocation paints, at most: a loop over all of its
/// pixels is then short on every device.
#[cfg(test)]
const NARROW: u32 = 64;

/// Rows of the tiles that larger triangles are painted by; their columns are [`GROUP`].
const TILE_ROWS: u32 = 16;

/// Triangles of the list that a dispatch looks through. A tile that all of them reach makes
/// `WIDE * TILE_ROWS + WIDE / GROUP` passes of loops, fewer than the 65,535 that every device has.
const WIDE: u32 = 3072;

/// Dispatches that share a bind group.
const SPANS: usize = 16;

/// A doubled area is a difference of two products, whose factors are differences themselves: each
/// factor is off by one rounding of 2^-24, and by those of the images it comes from, a few times as
/// many. At 2^-20 of the sum of the products all of it may be rounding, and the middle of the
/// triangle is shown: off by no more than the triangle's size in the picture.
#[cfg(test)]
const THIN: f32 = 9.536_743e-7;

/// What the kernels read about a triangle: nodes, the place of the first in the picture, and the
/// way from there to the others.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct TriangleRecord {
    nodes: [u32; 4],
    first: [f32; 2],
    ways: [[f32; 2]; 2],
    unused: [f32; 2],
}

/// The device that has all stages of a preview.
///
/// # Errors
/// [`Error::Capability`] if there is none, or a stage is to stay on the host.
pub(in crate::tools::warp) fn device(engine: &Engine) -> Result<&Gpu> {
    let stages = [&PAINT_LATTICE, &PAINT_WIDE, &SHOW_LATTICE];
    let able = stages.iter().all(|k| engine.gpu_for(k.name).is_some());
    let missing = || Error::Capability { limit: "devices that draw a preview".into(), required: 1, actual: 0 };
    engine.gpu().filter(|_| able).ok_or_else(missing)
}

/// A picture under a lattice, and the canvas it is drawn on.
#[derive(Debug)]
pub(in crate::tools::warp) struct Painter {
    paint: Arc<Pipeline>,
    wide: Arc<Pipeline>,
    show: Arc<Pipeline>,
    /// By which of the two buffers the images are in.
    turns: [Groups; 2],
    params: UniformBlocks<LatticeParams>,
    owners: Buffer<u32>,
    list: Buffer<u32>,
    count: u32,
    picture: [u32; 2],
    canvas: Canvas,
    _triangles: Table,
    _texels: Pyramid,
}

/// The bind groups over one buffer of images.
#[derive(Debug)]
struct Groups {
    paint: BindGroup,
    wide: Vec<BindGroup>,
    show: BindGroup,
}

impl Painter {
    /// Puts the triangles of `lattice`, and `texels` of a bordered picture of `picture` columns and
    /// rows, on the device; `canvas` is what is drawn.
    ///
    /// # Errors
    /// [`Error::Capability`] or [`Error::Memory`]
    /// where it does not fit, [`Error::Device`].
    pub(in crate::tools::warp) fn new(
        gpu: &Gpu,
        lattice: &Lattice,
        nodes: &MappedNodes,
        texels: &[u32],
        picture: [u32; 2],
        canvas: [u32; 2],
    ) -> Result<Self> {
        let record = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| lattice.points[i as usize]);
            TriangleRecord {
                nodes: [t[0], t[1], t[2], 0],
                first: a.as_vec2().to_array(),
                ways: [b, c].map(|p| (p - a).as_vec2().to_array()),
                unused: [0.0; 2],
            }
        };
        let records: Vec<TriangleRecord> = lattice.triangles.iter().map(record).collect();
        let triangles = gpu.table("triangles of a lattice", &records)?;
        let stride = picture[0] as usize + 2;
        let texels = gpu.pyramid::<u32>("picture of a preview", 1, picture.map(|n| n + 2), 1, |_, y, row| {
            row.copy_from_slice(&texels[y as usize * stride..][..stride]);
        })?;
        let params = gpu.uniform("lattice parameters", &LatticeParams::default())?;
        let owners = gpu.buffer("owners of pixels", canvas[0] as usize * canvas[1] as usize)?;
        let list = gpu.buffer("wide triangles", records.len() + 1)?;
        let canvas = gpu.canvas("preview", canvas)?;
        let (paint, wide) = (gpu.pipeline(&PAINT_LATTICE)?, gpu.pipeline(&PAINT_WIDE)?);
        let show = gpu.pipeline(&SHOW_LATTICE)?;
        let groups = |turn: usize| -> Result<Groups> {
            let images = nodes.images(turn);
            let first = [params.bind(0), triangles.bind(), images.bind(), owners.bind(), list.bind()];
            let dispatches = records.len().div_ceil(WIDE as usize);
            let shown = [params.bind(0), triangles.bind(), images.bind(), owners.bind(), texels.bind(), canvas.bind()];
            Ok(Groups {
                paint: gpu.bind(&paint, &first)?,
                wide: (0..dispatches.div_ceil(SPANS)).map(|_| gpu.bind(&wide, &first)).collect::<Result<_>>()?,
                show: gpu.bind(&show, &shown)?,
            })
        };
        Ok(Self {
            turns: [groups(0)?, groups(1)?],
            paint,
            wide,
            show,
            params,
            owners,
            list,
            count: records.len() as u32,
            picture,
            canvas,
            _triangles: triangles,
            _texels: texels,
        })
    }

    /// Adds the drawing of the canvas from the images where they are.
    ///
    /// # Errors
    /// [`Error::Device`] if the device fails.
    pub(in crate::tools::warp) fn record(&self, gpu: &Gpu, batch: &mut Batch<'_>, images: Mapping) -> Result<()> {
        let [columns, rows] = self.canvas.size();
        let params = LatticeParams {
            origin: images.frame.origin().as_vec2().to_array(),
            pixels: images.frame.scale.recip() as f32,
            count: self.count,
            size: [columns, rows],
            picture: self.picture.map(|n| n as f32),
        };
        gpu.write_uniform(&self.params, &[params])?;
        let groups = &self.turns[images.turn & 1];
        batch.clear(&self.owners);
        batch.clear(&self.list);
        batch.dispatch(&self.paint, &groups.paint, self.count as usize)?;
        let tiles = columns.div_ceil(GROUP) * rows.div_ceil(TILE_ROWS);
        for (k, first) in (0..self.count).step_by(WIDE as usize).enumerate() {
            let end = self.count.min(first + WIDE);
            batch.dispatch_each_group(&self.wide, &groups.wide[k / SPANS], first, end, tiles)?;
        }
        batch.dispatch_rows(&self.show, &groups.show, 0..rows, columns, 0)
    }

    /// What is drawn.
    pub(in crate::tools::warp) fn canvas(&self) -> &Canvas {
        &self.canvas
    }
}

/// The constants of the shaders that are these of Rust.
#[cfg(test)]
pub(super) fn twins() -> Vec<crate::twins::Twin> {
    use crate::twins::of;
    [
        of("lib/lattice", [("FAR", FAR.into())]),
        of("paint_lattice", [("NARROW", NARROW.into())]),
        of("paint_wide", [("TILE_ROWS", TILE_ROWS.into())]),
        of("show_lattice", [("THIN", THIN.into())]),
    ]
    .concat()
}
