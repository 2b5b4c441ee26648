//! Host halves of the kernels that work on one stage: residuals, the derivative, and products with
//! it.

use std::sync::Arc;

use super::WORK;
use super::gradients::{SOLVE_VERTEX, SolveVertex};
use super::tables::{
    EncodingParams, IncomingTables, PARAMS, ROW_DERIVATIVE, ROW_PRODUCT, RingTables, RowDerivative, RowProduct,
    SLOT_DERIVATIVE, SlotDerivative,
};
use crate::encoding::{Encoding, Stencils, V3};
use crate::engine::{Batch, BindGroup, Binding, BindingKind, Buffer, Gpu, Kernel, Pipeline, UniformBlocks};
use crate::error::Result;

const PARAMS_BINDING: BindingKind = BindingKind::Uniform(size_of::<EncodingParams>() as u64);

pub(super) static ENCODING_RESIDUAL: Kernel = residual(&[("DERIVATIVE", 0.0)]);
static ENCODING_RESIDUAL_DERIVATIVE: Kernel = residual(&[("DERIVATIVE", 1.0)]);

const fn residual(constants: &'static [(&'static str, f64)]) -> Kernel {
    Kernel {
        name: "encoding_residual",
        source: include_str!("../../../shaders/encoding_residual.wgsl"),
        bindings: &[
            PARAMS_BINDING,
            BindingKind::Table,
            BindingKind::Table,
            BindingKind::Read,
            BindingKind::Write,
            BindingKind::Write,
            BindingKind::Write,
        ],
        layouts: &[PARAMS, ROW_PRODUCT, ROW_DERIVATIVE, SLOT_DERIVATIVE],
        items: 1,
        constants,
    }
}

pub(super) static ENCODING_APPLY: Kernel = Kernel {
    name: "encoding_apply",
    source: include_str!("../../../shaders/encoding_apply.wgsl"),
    bindings: &[BindingKind::Table, BindingKind::Read, BindingKind::Read, BindingKind::Read, BindingKind::Write],
    layouts: &[ROW_PRODUCT, ROW_DERIVATIVE, SLOT_DERIVATIVE],
    items: 1,
    constants: &[],
};

pub(super) static ENCODING_APPLY_TRANSPOSE: Kernel = Kernel {
    name: "encoding_apply_transpose",
    source: include_str!("../../../shaders/encoding_apply_transpose.wgsl"),
    bindings: &[BindingKind::Table, BindingKind::Read, BindingKind::Read, BindingKind::Read, BindingKind::Write],
    layouts: &[ROW_PRODUCT, SLOT_DERIVATIVE],
    items: 1,
    constants: &[],
};

pub(super) static ENCODING_DIAGONAL: Kernel = Kernel {
    name: "encoding_diagonal",
    source: include_str!("../../../shaders/encoding_diagonal.wgsl"),
    bindings: &[BindingKind::Table, BindingKind::Read, BindingKind::Read, BindingKind::Read, BindingKind::Write],
    layouts: &[ROW_DERIVATIVE, SLOT_DERIVATIVE, SOLVE_VERTEX],
    items: 1,
    constants: &[],
};

/// A kernel with what it is bound to.
#[derive(Debug)]
pub(super) struct Bound {
    pipeline: Arc<Pipeline>,
    group: BindGroup,
}

impl Bound {
    pub(super) fn new(gpu: &Gpu, kernel: &'static Kernel, bindings: &[Binding<'_>]) -> Result<Self> {
        let pipeline = gpu.pipeline(kernel)?;
        let group = gpu.bind(&pipeline, bindings)?;
        Ok(Self { pipeline, group })
    }

    /// Records a dispatch over the items from `first` to `end`.
    pub(super) fn record(&self, batch: &mut Batch<'_>, first: usize, end: usize) -> Result<()> {
        batch.dispatch_range(&self.pipeline, &self.group, first as u32, (end - first) as u32)
    }
}

/// Rings of one stage on a device, with the kernels bound to them. The vertices before `held` do
/// not move.
#[derive(Debug)]
pub struct StageKernels {
    pub(super) held: usize,
    pub(super) vertices: usize,
    pub(super) row_count: usize,
    /// Slots read by a pass over all rows or all vertices.
    pub(super) work: u64,
    pub(super) positions: Buffer<[f32; 4]>,
    pub(super) products: Buffer<RowProduct>,
    /// x of a product with I - dF.
    pub(super) direction: Buffer<[f32; 4]>,
    /// The result of a product with the transpose.
    pub(super) product: Buffer<[f32; 4]>,
    pub(super) solve: Buffer<SolveVertex>,
    pub(super) rings: RingTables,
    pub(super) linearise: Bound,
    pub(super) apply: Bound,
    pub(super) transpose: Bound,
    pub(super) diagonal: Bound,
    row_derivatives: Buffer<RowDerivative>,
    pub(super) unused: (Buffer<RowDerivative>, Buffer<SlotDerivative>),
    _incoming: IncomingTables,
    _slot_derivatives: Buffer<SlotDerivative>,
    _params: UniformBlocks<EncodingParams>,
}

impl StageKernels {
    /// Uploads `stencils` and their coefficients.
    ///
    /// # Errors
    /// [`Error::Capability`](crate::Error::Capability) or [`Error::Memory`](crate::Error::Memory)
    /// if the device cannot hold them, [`Error::Device`](crate::Error::Device) if it fails.
    pub fn new(gpu: &Gpu, stencils: &Stencils, encoding: &Encoding<f64>, held: usize) -> Result<Self> {
        let (vertices, row_count, slots) = (stencils.vertex_count(), stencils.row_count(), stencils.neighbour.len());
        let rings = RingTables::new(gpu, stencils, encoding)?;
        let incoming = IncomingTables::new(gpu, stencils)?;
        gpu.capabilities().check_loops(ENCODING_RESIDUAL.name, 3 * rings.longest as u64)?;
        gpu.capabilities().check_loops(ENCODING_APPLY_TRANSPOSE.name, incoming.most as u64)?;
        let params = gpu.uniform("encoding", &parameters(1, vertices, row_count))?;
        let positions = gpu.buffer("positions", vertices.max(1))?;
        let products = gpu.buffer("products", row_count.max(1))?;
        let direction = gpu.buffer("direction", vertices.max(1))?;
        let product = gpu.buffer("product", vertices.max(1))?;
        let solve = gpu.buffer("solve", vertices.max(1))?;
        let row_derivatives = gpu.buffer("row derivatives", row_count.max(1))?;
        let slot_derivatives: Buffer<SlotDerivative> = gpu.buffer("slot derivatives", slots.max(1))?;
        let (rows, d, s) = (rings.rows.bind(), row_derivatives.bind(), slot_derivatives.bind());
        let (named, at) = (incoming.vertices.bind(), incoming.incoming.bind());
        let (x, y) = (direction.bind(), products.bind());
        let into =
            [params.bind(0), rows.clone(), rings.slots.bind(), positions.bind(), y.clone(), d.clone(), s.clone()];
        Ok(Self {
            linearise: Bound::new(gpu, &ENCODING_RESIDUAL_DERIVATIVE, &into)?,
            apply: Bound::new(gpu, &ENCODING_APPLY, &[rows, d.clone(), s.clone(), x, y.clone()])?,
            transpose: Bound::new(
                gpu,
                &ENCODING_APPLY_TRANSPOSE,
                &[named.clone(), at.clone(), s.clone(), y, product.bind()],
            )?,
            diagonal: Bound::new(gpu, &ENCODING_DIAGONAL, &[named, at, d, s, solve.bind()])?,
            held,
            vertices,
            row_count,
            work: slots as u64 + row_count as u64,
            positions,
            products,
            direction,
            product,
            solve,
            row_derivatives,
            unused: (gpu.buffer("none", 1)?, gpu.buffer("none", 1)?),
            rings,
            _incoming: incoming,
            _slot_derivatives: slot_derivatives,
            _params: params,
        })
    }

    /// V - F of every row at `positions`; keeps the derivative there for the products.
    ///
    /// # Errors
    /// [`Error::Device`](crate::Error::Device) if the device fails or there is not a position a
    /// vertex.
    pub fn linearise(&self, gpu: &Gpu, positions: &[V3<f32>]) -> Result<Vec<V3<f32>>> {
        self.put(gpu, &self.positions, positions)?;
        self.run(gpu, &self.linearise, 0, self.row_count)?;
        self.rows(gpu)
    }

    /// V - F of every row of several shapes, each as long as the stage has vertices, one after the
    /// other.
    ///
    /// # Errors
    /// As [`StageKernels::linearise`].
    pub fn residuals(&self, gpu: &Gpu, shapes: &[V3<f32>]) -> Result<Vec<V3<f32>>> {
        let frames = shapes.len().checked_div(self.vertices).unwrap_or(0);
        if frames * self.vertices != shapes.len() {
            return Err(super::fault("positions that make no whole number of shapes"));
        }
        let trial = Trial::new(gpu, self, frames)?;
        gpu.write(&trial.positions, 0, &padded(shapes))?;
        self.run(gpu, &trial.residual, 0, frames * self.row_count)?;
        Ok(gpu.read(&trial.products, 0..frames * self.row_count)?.iter().map(|p| p.value).collect())
    }

    /// (I - dF) x for every row, at the positions of [`StageKernels::linearise`].
    ///
    /// # Errors
    /// As [`StageKernels::linearise`].
    pub fn apply(&self, gpu: &Gpu, x: &[V3<f32>]) -> Result<Vec<V3<f32>>> {
        self.put(gpu, &self.direction, x)?;
        self.run(gpu, &self.apply, 0, self.row_count)?;
        self.rows(gpu)
    }

    /// The transpose of I - dF times `y`, zero for held vertices, at the positions of
    /// [`StageKernels::linearise`]. What the kernels before it leave for a row is formed on the
    /// host.
    ///
    /// # Errors
    /// As [`StageKernels::linearise`].
    pub fn apply_transpose(&self, gpu: &Gpu, y: &[V3<f32>]) -> Result<Vec<V3<f32>>> {
        let derivatives = gpu.read(&self.row_derivatives, 0..self.row_count)?;
        let products: Vec<RowProduct> = y.iter().zip(&derivatives).map(|(&y, d)| RowProduct::new(y, d)).collect();
        gpu.write(&self.products, 0, &products)?;
        self.run(gpu, &self.transpose, self.held, self.vertices)?;
        let mut result = vec![[0.0; 3]; self.held];
        result.extend(gpu.read(&self.product, self.held..self.vertices)?.iter().map(|&[x, y, z, _]| [x, y, z]));
        Ok(result)
    }

    /// One over the diagonal of the Gauss-Newton matrix, for the free vertices; zero for held ones.
    ///
    /// # Errors
    /// As [`StageKernels::linearise`].
    pub fn inverse_diagonal(&self, gpu: &Gpu) -> Result<Vec<V3<f32>>> {
        self.run(gpu, &self.diagonal, self.held, self.vertices)?;
        let solve = gpu.read(&self.solve, self.held..self.vertices)?;
        let mut result = vec![[0.0; 3]; self.held];
        result.extend(solve.iter().map(|s| s.inverse_diagonal));
        Ok(result)
    }

    fn put(&self, gpu: &Gpu, into: &Buffer<[f32; 4]>, values: &[V3<f32>]) -> Result<()> {
        if values.len() != self.vertices {
            return Err(super::fault("not one vector a vertex"));
        }
        gpu.write(into, 0, &padded(values))
    }

    fn rows(&self, gpu: &Gpu) -> Result<Vec<V3<f32>>> {
        Ok(gpu.read(&self.products, 0..self.row_count)?.iter().map(|p| p.value).collect())
    }

    /// A pass over items, in submissions of limited work.
    fn run(&self, gpu: &Gpu, bound: &Bound, first: usize, end: usize) -> Result<()> {
        let per_item = self.work.div_ceil(self.row_count.max(1) as u64).max(1);
        let most = (WORK / per_item).max(1) as usize;
        for from in (first..end).step_by(most) {
            let mut batch = gpu.batch()?;
            bound.record(&mut batch, from, end.min(from + most))?;
            gpu.wait(&batch.submit()?)?;
        }
        Ok(())
    }
}

pub(super) fn padded(values: &[V3<f32>]) -> Vec<[f32; 4]> {
    values.iter().map(|&[x, y, z]| [x, y, z, 0.0]).collect()
}

pub(super) fn parameters(frames: usize, vertices: usize, rows: usize) -> EncodingParams {
    EncodingParams { frames: frames as u32, vertices: vertices as u32, rows: rows as u32, base: 0 }
}

/// Shapes whose residuals are wanted without derivative.
#[derive(Debug)]
pub(super) struct Trial {
    pub(super) positions: Buffer<[f32; 4]>,
    pub(super) products: Buffer<RowProduct>,
    pub(super) residual: Bound,
    pub(super) params: UniformBlocks<EncodingParams>,
}

impl Trial {
    pub(super) fn new(gpu: &Gpu, stage: &StageKernels, frames: usize) -> Result<Self> {
        let items = stage.row_count.max(stage.vertices) as u64 * frames as u64;
        if u32::try_from(items * 3).is_err() {
            return Err(super::fault("more shapes than 32 bits can number"));
        }
        let params = gpu.uniform("shapes", &parameters(frames, stage.vertices, stage.row_count))?;
        let positions = gpu.buffer("shapes", frames * stage.vertices)?;
        let products = gpu.buffer("residuals", (frames * stage.row_count).max(1))?;
        let bindings = [
            params.bind(0),
            stage.rings.rows.bind(),
            stage.rings.slots.bind(),
            positions.bind(),
            products.bind(),
            stage.unused.0.bind(),
            stage.unused.1.bind(),
        ];
        let residual = Bound::new(gpu, &ENCODING_RESIDUAL, &bindings)?;
        Ok(Self { positions, products, residual, params })
    }
}
