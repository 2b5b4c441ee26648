//! Host half of the kernel `warp_image`; its reference is
//! [`warp_image`](crate::tools::warp::gather::warp_image).
//!
//! What the pixels of a band see of each level of the pyramid is decoded on the host and sent to
//! the device, so that pictures may be larger than its memory and have any depth.

use bytemuck::{Pod, Zeroable};
use rayon::prelude::*;

use crate::engine::{BindingKind, Gpu, Kernel, Layout};
use crate::error::Result;
use crate::kernel_layout as layout;
use crate::picture::Filter;
use crate::picture::ellipse::Ellipse;
use crate::tools::warp::band::Band;
use crate::tools::warp::footprint::Seen;
use crate::tools::warp::gather::Extent;
use crate::tools::warp::interpolate::{Bilinear, Interpolation, Lanczos};
use crate::tools::warp::pyramid::{Pyramid, Texel, Window};

/// Levels that the kernel knows; a picture of 2^31 pixels a side has as many.
const MOST_LEVELS: usize = 32;
/// Texels sent for one band at most: 64 MiB.
const MOST_TEXELS: usize = 1 << 22;
/// Iterations of an invocation at most: an ellipse of 150 rows of 150 texels, for its neighbours as
/// well.
const ITERATIONS: u64 = 150 * 150 + 64;

/// Where the window of a level is.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct WindowPlace {
    /// Its first texel in the level.
    pub origin: [i32; 2],
    /// Its place in the buffer.
    pub start: u32,
    /// Length of its rows.
    pub stride: u32,
}

/// A footprint as the kernel reads it, with the number of its block.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
struct Preimage {
    at: [f32; 2],
    dx: [f32; 2],
    dy: [f32; 2],
    cover: f32,
    block: u32,
}

/// Parameters of the kernel.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct WarpParams {
    levels: u32,
    most: f32,
    unused_0: u32,
    unused_1: u32,
    windows: [WindowPlace; MOST_LEVELS],
}

const LAYOUTS: &[Layout] = &[
    layout!(WarpParams, { levels, most, unused_0, unused_1, windows }),
    layout!(WindowPlace, { origin, start, stride }),
    layout!(Preimage, { at, dx, dy, cover, block }),
];

const fn kernel(constants: &'static [(&'static str, f64)]) -> Kernel {
    Kernel {
        name: "warp_image",
        source: include_str!("../../../../shaders/warp_image.wgsl"),
        bindings: &[
            BindingKind::Uniform(size_of::<WarpParams>() as u64),
            BindingKind::Read,
            BindingKind::Read,
            BindingKind::Read,
            BindingKind::Write,
        ],
        layouts: LAYOUTS,
        items: 1,
        constants,
    }
}

static BILINEAR: Kernel = kernel(&[("FILTER", 0.0)]);
static LANCZOS: Kernel = kernel(&[("FILTER", 1.0)]);
static EWA: Kernel = kernel(&[("FILTER", 2.0)]);

/// The kernels of this module.
pub(super) const KERNELS: &[&Kernel] = &[&BILINEAR, &LANCZOS, &EWA];

/// The colours of pixels whose pre-images have a cover, as
/// [`Band::gather`](crate::tools::warp::band::Band::gather) has them; the others are left as they
/// are.
///
/// `bases` has one entry for each block of the band. Returns `false`, with nothing done, if what
/// the pixels see does not fit the device at once: where a map takes neighbours to places far
/// apart; and for [`Filter::Lanczos4`], which is not in the kernel.
///
/// # Errors
/// [`Error::Memory`](crate::Error::Memory), [`Error::Capability`](crate::Error::Capability) or
/// [`Error::Device`](crate::Error::Device).
pub fn warp_image(
    gpu: &Gpu,
    pyramid: &Pyramid<'_>,
    filter: Filter,
    band: Band,
    bases: &[[i32; 2]],
    seen: Seen<'_>,
    colors: &mut [Texel],
) -> Result<bool> {
    let kernel = match filter {
        Filter::Bilinear => &BILINEAR,
        Filter::Lanczos => &LANCZOS,
        Filter::Ewa => &EWA,
        Filter::Anisotropic | Filter::Trilinear | Filter::Nearest | Filter::Lanczos4 => return Ok(false),
    };
    if !ends(gpu, filter) {
        return Ok(false);
    }
    let preimages = preimages(band, seen);
    let extents = extents(pyramid, filter, bases, &preimages);
    let sizes = extents.map(|e| e.size());
    let total: usize = sizes.iter().map(|s| s[0].saturating_mul(s[1])).fold(0, usize::saturating_add);
    if total as u64 > (MOST_TEXELS as u64).min(gpu.capabilities().max_elements::<Texel>()) {
        return Ok(false);
    }
    if total == 0 {
        return Ok(true);
    }
    let mut params = WarpParams {
        levels: pyramid.levels(),
        most: (1u64 << pyramid.levels().min(32)) as f32,
        unused_0: 0,
        unused_1: 0,
        windows: [WindowPlace::default(); MOST_LEVELS],
    };
    let mut texels = Vec::with_capacity(total);
    let mut window = Window::default();
    for (level, (extent, size)) in extents.iter().zip(sizes).enumerate() {
        if size[0] * size[1] > 0 {
            params.windows[level] =
                WindowPlace { origin: extent.low, start: texels.len() as u32, stride: size[0] as u32 };
            pyramid.read(level as u32, extent.low, size, &mut window);
            texels.extend_from_slice(&window.texels);
        }
    }
    let pipeline = gpu.pipeline(kernel)?;
    let params = gpu.uniform("warp parameters", &params)?;
    let seen = gpu.upload("pre-images", &preimages)?;
    let bases = gpu.upload("bases", bases)?;
    let texels = gpu.upload("texels", &texels)?;
    let out = gpu.upload("colours", colors)?;
    let group = gpu.bind(&pipeline, &[params.bind(0), seen.bind(), bases.bind(), texels.bind(), out.bind()])?;
    gpu.run(&pipeline, &group, preimages.len(), |_| {})?;
    colors.copy_from_slice(&gpu.read(&out, 0..colors.len())?);
    Ok(true)
}

/// Whether the loops of `filter` end on `gpu` where they should.
pub(super) fn ends(gpu: &Gpu, filter: Filter) -> bool {
    let able = gpu.capabilities();
    filter != Filter::Ewa || !able.truncates_loops || u64::from(able.loop_budget) >= ITERATIONS
}

/// How far a filter reads in a window.
fn reach<I: for<'t> Interpolation<&'t [Texel]>>() -> i32 {
    I::REACH
}

/// The pixels of a band, block after block, as the kernel reads them.
fn preimages(band: Band, seen: Seen<'_>) -> Vec<Preimage> {
    let mut preimages = Vec::with_capacity(seen.len());
    for (block, place) in (0u32..).zip(band.places()) {
        preimages.extend((place.start..place.start + place.width * place.height).map(|i| {
            let [dx, dy] = seen.derivative(i);
            Preimage { at: seen.place(i), dx, dy, cover: seen.cover()[i], block }
        }));
    }
    preimages
}

/// What the pixels read of each level, in its texels.
fn extents(pyramid: &Pyramid<'_>, filter: Filter, bases: &[[i32; 2]], preimages: &[Preimage]) -> [Extent; MOST_LEVELS] {
    let none = || [Extent::EMPTY; MOST_LEVELS];
    let add = |mut all: [Extent; MOST_LEVELS], p: &Preimage| {
        let Some(base) = bases.get(p.block as usize).filter(|_| p.cover > 0.0) else { return all };
        let mut join = |level: u32, e: Extent| {
            let shift = base.map(|b| b >> level);
            let moved = |v: [i32; 2]| [v[0].saturating_add(shift[0]), v[1].saturating_add(shift[1])];
            all[level as usize].join(&Extent { low: moved(e.low), high: moved(e.high) });
        };
        let at = p.at;
        let around = |reach: i32| Extent::around(at, [reach; 2]);
        match filter {
            Filter::Bilinear => join(0, around(reach::<Bilinear>())),
            Filter::Lanczos => join(0, around(reach::<Lanczos<6>>())),
            // The kernel has none of these.
            Filter::Anisotropic | Filter::Trilinear | Filter::Nearest | Filter::Lanczos4 => {}
            Filter::Ewa => {
                let e = Ellipse::new(p.dx, p.dy, pyramid.levels());
                if e.share < 1.0 {
                    join(0, around(reach::<Lanczos<6>>()));
                }
                if e.share > 0.0 {
                    let scale = 1.0 / (1u64 << e.level) as f32;
                    join(e.level, Extent::of_ellipse(at.map(|v| v * scale), &e));
                }
            }
        }
        all
    };
    let both = |mut a: [Extent; MOST_LEVELS], b: [Extent; MOST_LEVELS]| {
        a.iter_mut().zip(&b).for_each(|(a, b)| a.join(b));
        a
    };
    // Smallest and largest numbers do not depend on the order.
    preimages.par_iter().fold(none, add).reduce(none, both)
}

/// The constants of the kernel that are these of Rust.
#[cfg(test)]
pub(super) fn twins() -> Vec<crate::twins::Twin> {
    use crate::tools::warp::footprint::FARTHEST;
    crate::twins::of("warp_image", [("MOST_LEVELS", MOST_LEVELS as f64), ("FARTHEST", FARTHEST.into())])
}
