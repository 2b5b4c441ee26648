//! Host half of the kernel `average_stencils`, and averages of surface points on a device, step by
//! step between two buffers.

use bytemuck::{Pod, Zeroable};

use super::map::{device, obstacle};
use super::project_phong::{ProjectParams, Projected};
use super::tables::SurfaceTables;
use super::tile::{Points, Projection};
use crate::engine::{BindGroup, BindingKind, Buffer, Engine, Gpu, Kernel, Layout, ReadbackRing, Table};
use crate::error::Result;
use crate::geometry::SurfacePoint;
use crate::kernel_layout as layout;
use crate::surface::stencils::Stencils;
use crate::surface::{PackedPoint, PhongSurface};

/// Rows and points that a device takes at once.
pub const MOST_ROWS: usize = 1 << 20;
/// Steps that are on their way at once.
const AHEAD: usize = 4;

/// Parameters of the kernel; twin of the struct in `shaders/average_stencils.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct StencilParams {
    words: u32,
    unused0: u32,
    unused1: u32,
    unused2: u32,
}

const LAYOUTS: &[Layout] = &[layout!(StencilParams, { words, unused0, unused1, unused2 })];

pub(super) static AVERAGE_STENCILS: Kernel = Kernel {
    name: "average_stencils",
    source: concat!(include_str!("../../../shaders/average_stencils.wgsl"), "//#import lib/vector8\n"),
    bindings: &[
        BindingKind::Uniform(size_of::<StencilParams>() as u64),
        BindingKind::Read,
        BindingKind::Read,
        BindingKind::Write,
        BindingKind::Table,
        BindingKind::Table,
    ],
    layouts: LAYOUTS,
    items: 1,
    constants: &[],
};

/// A surface in R^8 on a device, for averages of points on it.
#[derive(Debug)]
pub struct DeviceStencils {
    engine: Engine,
    tables: SurfaceTables,
    starts: Table,
}

/// What is averaged in one go.
#[derive(Clone, Copy)]
struct Work<'a> {
    rows: &'a Buffer<u32>,
    count: usize,
}

impl DeviceStencils {
    /// Why the kernels cannot do this work on `engine`; `None` if they can.
    pub fn obstacle(engine: &Engine, dimension: usize) -> Option<String> {
        let other = dimension != 8;
        obstacle(engine, AVERAGE_STENCILS.name, dimension)
            .or_else(|| other.then(|| format!("the kernels work in 8 dimensions, the embedding has {dimension}")))
    }

    /// Puts a surface on the device of `engine`.
    ///
    /// # Errors
    /// [`Error::Input`](crate::Error::Input) if there is an obstacle;
    /// [`Error::Memory`](crate::Error::Memory), [`Error::Capability`](crate::Error::Capability) or
    /// [`Error::Device`](crate::Error::Device) if it does not fit.
    pub fn new(engine: &Engine, surface: &PhongSurface<f32, 8>) -> Result<Self> {
        let gpu = device(engine, AVERAGE_STENCILS.name)?;
        let tables = SurfaceTables::new(gpu, "surface", surface)?;
        // A search begins in the triangle of a point itself.
        let starts: Vec<[u32; 4]> =
            surface.triangles.iter().zip(0..).map(|(t, face)| [t.v[0], t.v[1], t.v[2], face]).collect();
        let starts = gpu.table("starts", &starts)?;
        Ok(Self { engine: engine.clone(), tables, starts })
    }

    /// `steps` times the averages of all rows, each step of the points that the one before made:
    /// the points after each step. `begin` is a point near each row's average, where its searches
    /// start. With more than one step there are as many rows as points. What the kernels leave, and
    /// what lies beyond a boundary, is found by `rest` from the points before and the row.
    ///
    /// The steps go back and forth between two buffers; the host only looks at what was left. In
    /// single precision: within about 1e-5 mean edges of
    /// [`Forward::averages`](crate::surface::forward::Forward::averages) where both take the same
    /// of several projections.
    ///
    /// # Errors
    /// [`Error::Memory`](crate::Error::Memory), [`Error::Capability`](crate::Error::Capability) or
    /// [`Error::Device`](crate::Error::Device) from the device.
    pub fn steps(
        &self,
        points: &[SurfacePoint],
        rows: &Stencils,
        begin: &[SurfacePoint],
        steps: usize,
        rest: &(dyn Fn(&[SurfacePoint], usize) -> SurfacePoint + Sync),
    ) -> Result<Vec<Vec<SurfacePoint>>> {
        let gpu = device(&self.engine, AVERAGE_STENCILS.name)?;
        let n = rows.len();
        if n == 0 || steps == 0 {
            return Ok(vec![Vec::new(); steps]);
        }
        let (table, longest) = packed(rows);
        gpu.capabilities().check_loops(AVERAGE_STENCILS.name, longest as u64 + 1)?;
        let pack = |p: &[SurfacePoint]| -> Vec<PackedPoint> { p.iter().map(|p| PackedPoint::from(*p)).collect() };
        let first = gpu.upload("points", &pack(points))?;
        let begin = gpu.upload("begin", &pack(begin))?;
        let rows_buffer = gpu.upload("rows", &table)?;
        let averages = gpu.buffer::<[f32; 8]>("averages", n)?;
        let params = || ProjectParams::new::<8>(gpu.capabilities(), &self.tables, 1, [0, 0]);
        let side =
            || Projection::new::<8, _>(gpu, n, params()?, &averages, &Points::Own(&begin), &self.tables, &self.starts);
        let sides = [side()?, side()?];
        let work = Work { rows: &rows_buffer, count: n };
        let from_host = self.bind(gpu, &first, work, &averages)?;
        let from_side =
            [self.bind(gpu, &sides[0].results, work, &averages)?, self.bind(gpu, &sides[1].results, work, &averages)?];
        let pipeline = gpu.pipeline(&AVERAGE_STENCILS)?;
        let mut ring = ReadbackRing::<Projected>::new(gpu, "averages", AHEAD, n)?;
        let mut all: Vec<Vec<SurfacePoint>> = Vec::with_capacity(steps);
        let mut sent = 0;
        while all.len() < steps {
            while sent < steps && sent < all.len() + AHEAD {
                let mut batch = gpu.batch()?;
                let group = if sent == 0 { &from_host } else { &from_side[(sent + 1) % 2] };
                batch.dispatch(&pipeline, &group.0, n)?;
                sides[sent % 2].record(&mut batch, n)?;
                ring.push(batch, &sides[sent % 2].results, 0..n)?;
                sent += 1;
            }
            let found = ring.pop()?.unwrap_or_default();
            let done = all.len();
            let before = all.last().map_or(points, |p| p);
            let left: Vec<usize> = (0..n).filter(|&r| found[r].projection().is_none()).collect();
            let mut now: Vec<SurfacePoint> = found.iter().map(unpack).collect();
            for &r in &left {
                now[r] = rest(before, r);
            }
            if !left.is_empty() && done + 1 < steps {
                // What was sent after it took what is not there: once more, from the mended step
                // on.
                while ring.pop()?.is_some() {}
                let mended: Vec<Projected> = now.iter().map(|p| Projected::of(PackedPoint::from(*p))).collect();
                gpu.write(&sides[done % 2].results, 0, &mended)?;
                sent = done + 1;
            }
            all.push(now);
        }
        Ok(all)
    }

    fn bind<T: Pod>(
        &self,
        gpu: &Gpu,
        points: &Buffer<T>,
        work: Work<'_>,
        averages: &Buffer<[f32; 8]>,
    ) -> Result<(BindGroup, crate::engine::UniformBlocks<StencilParams>)> {
        let words = (size_of::<T>() / 4) as u32;
        let params = gpu.uniform("stencil parameters", &StencilParams { words, unused0: 0, unused1: 0, unused2: 0 })?;
        debug_assert!(work.count <= averages.len());
        let pipeline = gpu.pipeline(&AVERAGE_STENCILS)?;
        let bindings = [
            params.bind(0),
            points.bind(),
            work.rows.bind(),
            averages.bind(),
            self.tables.vertices.bind(),
            self.tables.triangles.bind(),
        ];
        Ok((gpu.bind(&pipeline, &bindings)?, params))
    }
}

/// The rows as the kernel reads them, and the most entries of one. A row's own point comes last,
/// unless it alone is the average or has no weight.
fn packed(rows: &Stencils) -> (Vec<u32>, usize) {
    let n = rows.len();
    let mut table = vec![0u32; n + 1];
    let mut longest = 0;
    for r in 0..n {
        table[r] = table.len() as u32;
        let (own, entries, weights) = rows.row(r);
        let rest = 1.0 - weights.iter().sum::<f64>();
        for (i, w) in entries.iter().zip(weights) {
            table.extend([*i, (*w as f32).to_bits()]);
        }
        if entries.is_empty() || rest.abs() > 1e-12 {
            table.extend([own, (rest as f32).to_bits()]);
        }
        longest = longest.max(entries.len() + 1);
    }
    table[n] = table.len() as u32;
    (table, longest)
}

fn unpack(p: &Projected) -> SurfacePoint {
    let (a, b) = (f64::from(p.b0), f64::from(p.b1));
    let x = [a, b, 1.0 - a - b].map(|x| x.max(0.0));
    let sum: f64 = x.iter().sum();
    SurfacePoint::new(p.face, x.map(|x| x / sum))
}
