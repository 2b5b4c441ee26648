//! Host half of the kernel `average_anchors`: inverse problem fused with the averages.

use crate::engine::{BindingKind, Kernel, Layout, UNIFORM_BLOCK};
use crate::kernel_layout as layout;
use crate::surface::correspondence::{AVERAGE_SCALE, WeightedAverages};

/// Anchors that fit the kernel's uniform block: two vectors of R^8 each.
pub const MOST_ANCHORS: usize = UNIFORM_BLOCK as usize / 64;

/// Vectors of R^8 written per point: the average on the source, the average of the target's own anchors, the point.
pub(super) const VECTORS: usize = 3;

/// Parameters of the kernel; twin of the struct in `shaders/average_anchors.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct AverageParams {
    anchors: u32,
    transported: u32,
    scale: f32,
    corrected: u32,
    transport: [[f32; 8]; 8],
}

const LAYOUTS: &[Layout] = &[layout!(AverageParams, { anchors, transported, scale, corrected, transport })];

/// Both averages: on the source, and of the target's own anchors for corrections and the round trip.
pub(super) static AVERAGE_ANCHORS: Kernel = variant(&[("OWN", 1.0)]);

/// The average on the source alone.
pub(super) static AVERAGE_ANCHORS_ONCE: Kernel = variant(&[("OWN", 0.0)]);

const fn variant(constants: &'static [(&'static str, f64)]) -> Kernel {
    Kernel {
        name: "average_anchors",
        source: include_str!("../../../shaders/average_anchors.wgsl"),
        bindings: &[
            BindingKind::Uniform(size_of::<AverageParams>() as u64),
            BindingKind::Uniform(UNIFORM_BLOCK),
            BindingKind::Read,
            BindingKind::Write,
            BindingKind::Table,
            BindingKind::Table,
            BindingKind::Table,
        ],
        layouts: LAYOUTS,
        items: 2,
        constants,
    }
}

impl AverageParams {
    /// The parameters of a map.
    pub(super) fn new(map: &WeightedAverages<f32, 8>) -> Self {
        Self {
            anchors: map.table.len() as u32,
            transported: u32::from(map.transport.is_some()),
            scale: AVERAGE_SCALE as f32,
            corrected: u32::from(!map.corrections.is_empty()),
            transport: map.transport.unwrap_or_default(),
        }
    }
}

/// The anchors as the kernel reads them: point and what is averaged, in turn.
pub(super) fn anchor_block(map: &WeightedAverages<f32, 8>) -> Vec<[f32; 8]> {
    map.table.own.iter().zip(&map.table.image).flat_map(|(a, b)| [*a, *b]).collect()
}

/// What a vertex adds to the averages near it; three texels.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub(super) struct CorrectionRecord {
    d: [f32; 8],
    residual: f32,
    unused: [f32; 3],
}

/// The corrections of all vertices of the target.
pub(super) fn correction_records(map: &WeightedAverages<f32, 8>) -> Vec<CorrectionRecord> {
    map.corrections.iter().map(|c| CorrectionRecord { d: c.d, residual: c.residual, unused: [0.0; 3] }).collect()
}
