//! Host half of the kernel `average_anchors`: inverse problem fused with the averages.

use crate::engine::{BindingKind, Kernel, Layout, UNIFORM_BLOCK};
use crate::kernel_layout as layout;
use crate::surface::correspondence::{AVERAGE_SCALE, WeightedAverages};

/// Anchors that fit a uniform block: two vectors of R^8 each. With more, a dispatch works on one
/// block at a time.
pub const BLOCK_ANCHORS: usize = UNIFORM_BLOCK as usize / 64;

/// Vectors of R^8 written per point: the average on the source, the average of the target's own
/// anchors, the point.
pub(super) const VECTORS: usize = 3;

/// Parameters of the kernel; twin of the struct in `shaders/average_anchors.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct AverageParams {
    anchors: u32,
    first: u32,
    last: u32,
    transported: u32,
    scale: f32,
    corrected: u32,
    unused0: u32,
    unused1: u32,
    transport: [[f32; 8]; 8],
}

const LAYOUTS: &[Layout] = &[layout!(AverageParams, {
    anchors, first, last, transported, scale, corrected, unused0, unused1, transport
})];

/// Both averages: on the source, and of the target's own anchors for corrections and the round
/// trip. All anchors in one dispatch.
pub(super) static AVERAGE_ANCHORS: Kernel = variant(&[("OWN", 1.0), ("PART", 0.0), ("RECORDS", 0.0)]);
/// Of points in an array, and of records: what a dispatch does.
static VARIANTS: [Variants; 2] = [
    Variants {
        both: variant(&[("OWN", 1.0), ("PART", 0.0), ("RECORDS", 0.0)]),
        once: variant(&[("OWN", 0.0), ("PART", 0.0), ("RECORDS", 0.0)]),
        sums: variant(&[("OWN", 0.0), ("PART", 1.0), ("RECORDS", 0.0)]),
        both_block: variant(&[("OWN", 1.0), ("PART", 2.0), ("RECORDS", 0.0)]),
        once_block: variant(&[("OWN", 0.0), ("PART", 2.0), ("RECORDS", 0.0)]),
    },
    Variants {
        both: variant(&[("OWN", 1.0), ("PART", 0.0), ("RECORDS", 1.0)]),
        once: variant(&[("OWN", 0.0), ("PART", 0.0), ("RECORDS", 1.0)]),
        sums: variant(&[("OWN", 0.0), ("PART", 1.0), ("RECORDS", 1.0)]),
        both_block: variant(&[("OWN", 1.0), ("PART", 2.0), ("RECORDS", 1.0)]),
        once_block: variant(&[("OWN", 0.0), ("PART", 2.0), ("RECORDS", 1.0)]),
    },
];

/// The variants of the kernel.
struct Variants {
    /// Both averages, all anchors in one dispatch.
    both: Kernel,
    /// The average on the source alone.
    once: Kernel,
    /// One block of the first pass over the anchors.
    sums: Kernel,
    /// One block of the second pass, for both averages and for one.
    both_block: Kernel,
    once_block: Kernel,
}

/// The dispatches that average `anchors` anchors, in order: variant of the kernel and block.
pub(super) fn dispatches(anchors: usize, own: bool, records: bool) -> Vec<(&'static Kernel, usize)> {
    let v = &VARIANTS[usize::from(records)];
    let blocks = anchors.div_ceil(BLOCK_ANCHORS);
    if blocks <= 1 {
        return vec![(if own { &v.both } else { &v.once }, 0)];
    }
    let averages = if own { &v.both_block } else { &v.once_block };
    [&v.sums, averages].into_iter().flat_map(|kernel| (0..blocks).map(move |block| (kernel, block))).collect()
}

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
    /// The parameters of a map for one block of its anchors.
    pub fn new(map: &WeightedAverages<f32, 8>, block: usize) -> Self {
        let first = block * BLOCK_ANCHORS;
        let left = map.table.len().saturating_sub(first);
        Self {
            anchors: left.min(BLOCK_ANCHORS) as u32,
            first: first as u32,
            last: u32::from(left <= BLOCK_ANCHORS),
            transported: u32::from(map.transport.is_some()),
            scale: AVERAGE_SCALE as f32,
            corrected: u32::from(!map.corrections.is_empty()),
            unused0: 0,
            unused1: 0,
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
