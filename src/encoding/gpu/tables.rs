//! What the kernels read about rings, and the structs they share with the host.

use crate::encoding::{Encoding, Stencils};
use crate::engine::{Buffer, Gpu, Layout, Table};
use crate::error::Result;
use crate::geometry::NONE;
use crate::kernel_layout as layout;

/// Which vertices a dispatch works on; twin of the struct in `shaders/lib/derivative.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, bytemuck::Pod, bytemuck::Zeroable)]
pub struct EncodingParams {
    pub(super) frames: u32,
    pub(super) vertices: u32,
    pub(super) rows: u32,
    pub(super) base: u32,
}

/// What the derivative of a row needs; twin of the struct in `shaders/lib/derivative.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, bytemuck::Pod, bytemuck::Zeroable)]
pub struct RowDerivative {
    normal: [f32; 3],
    inverse_length: f32,
    g: [f32; 3],
    offset: f32,
    h: [f32; 3],
    unused: f32,
}

/// What the derivative of a row needs of a slot; twin of the struct in
/// `shaders/lib/derivative.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, bytemuck::Pod, bytemuck::Zeroable)]
pub struct SlotDerivative {
    z: [f32; 3],
    w: f32,
    chord: [f32; 3],
    neighbour: u32,
}

/// A row's entry of a vector, and what the transposed product takes from it; twin of the struct in
/// `shaders/lib/derivative.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, bytemuck::Pod, bytemuck::Zeroable)]
pub struct RowProduct {
    pub(super) value: [f32; 3],
    along: f32,
    curl: [f32; 3],
    unused0: f32,
    mean: [f32; 3],
    unused1: f32,
}

impl RowProduct {
    /// The product of the entry `y` with a row of the derivative `d`, as the kernels form it.
    pub(super) fn new(y: [f32; 3], d: &RowDerivative) -> Self {
        use crate::encoding::vector::{add_scaled, dot, scale};
        let along = dot(d.normal, y);
        let c = add_scaled(scale(y, d.offset), d.h, -along);
        let curl = scale(add_scaled(c, d.normal, -dot(d.normal, c)), d.inverse_length);
        Self { value: y, along, curl, unused0: 0.0, mean: add_scaled(y, d.g, along), unused1: 0.0 }
    }
}

/// Layouts of the structs above.
pub(super) const PARAMS: Layout = layout!(EncodingParams, { frames, vertices, rows, base });
pub(super) const ROW_DERIVATIVE: Layout = layout!(RowDerivative, { normal, inverse_length, g, offset, h, unused });
pub(super) const SLOT_DERIVATIVE: Layout = layout!(SlotDerivative, { z, w, chord, neighbour });
pub(super) const ROW_PRODUCT: Layout = layout!(RowProduct, { value, along, curl, unused0, mean, unused1 });

/// Rings and coefficients on a device.
#[derive(Debug)]
pub(super) struct RingTables {
    pub(super) rows: Table,
    pub(super) slots: Table,
    /// Neighbours of the largest ring.
    pub(super) longest: usize,
}

impl RingTables {
    pub(super) fn new(gpu: &Gpu, stencils: &Stencils, encoding: &Encoding<f64>) -> Result<Self> {
        let row = |r: usize| [stencils.start[r], stencils.start[r + 1] - stencils.start[r], stencils.vertex[r], 0];
        let rows: Vec<[u32; 4]> = (0..stencils.row_count()).map(row).collect();
        let slot = |s: usize| {
            let bits = |x: f64| (x as f32).to_bits();
            [stencils.neighbour[s], stencils.slot_row[s], bits(encoding.w[s]), bits(encoding.b[s])]
        };
        let slots: Vec<[u32; 4]> = (0..stencils.neighbour.len()).map(slot).collect();
        let longest = rows.iter().map(|r| r[1] as usize).max().unwrap_or(0);
        Ok(Self { rows: gpu.table("rings", &rows)?, slots: gpu.table("slots", &slots)?, longest })
    }
}

/// The way from a vertex to the slots that name it.
#[derive(Debug)]
pub(super) struct IncomingTables {
    pub(super) vertices: Table,
    pub(super) incoming: Buffer<[u32; 2]>,
    /// Slots that name the most named vertex.
    pub(super) most: usize,
}

impl IncomingTables {
    pub(super) fn new(gpu: &Gpu, stencils: &Stencils) -> Result<Self> {
        let vertex = |v: usize| {
            let first = stencils.incoming_start[v];
            [first, stencils.incoming_start[v + 1] - first, stencils.row_of[v], 0]
        };
        debug_assert_eq!(NONE, u32::MAX, "the kernels know no other mark");
        let vertices: Vec<[u32; 4]> = (0..stencils.vertex_count()).map(vertex).collect();
        let incoming: Vec<[u32; 2]> = stencils.incoming.iter().map(|&s| [s, stencils.slot_row[s as usize]]).collect();
        let most = vertices.iter().map(|v| v[1] as usize).max().unwrap_or(0);
        Ok(Self { vertices: gpu.table("vertices", &vertices)?, incoming: gpu.upload("incoming", &incoming)?, most })
    }
}
