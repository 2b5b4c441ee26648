//! Where the Jacobian of a step is looked at: pixel centres inside its polygon, and points of its
//! edges.

use std::ops::Range;

use rayon::prelude::*;

use super::outline::Outline;

/// A row of neighbouring pixels whose centres lie in the polygon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Run {
    /// Pixel row, from the lowest up.
    pub(super) row: u32,
    /// First pixel.
    pub(super) first: u32,
    /// Number of pixels.
    pub(super) count: u32,
}

/// A grid of square pixels over the bounding box of a polygon, in its local coordinates.
#[derive(Clone, Debug)]
pub(super) struct Raster {
    /// Lower left corner.
    pub(super) origin: [f64; 2],
    /// Side of a pixel.
    pub(super) pixel: f64,
    /// The pixels inside, row by row.
    pub(super) runs: Vec<Run>,
}

impl Raster {
    /// The raster with `resolution` pixels along the longer side. Inside is what an odd number of
    /// edges encloses.
    pub(super) fn new(outline: &Outline<f64>, resolution: u32) -> Self {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for v in &outline.vertices {
            for axis in 0..2 {
                low[axis] = low[axis].min(v[axis]);
                high[axis] = high[axis].max(v[axis]);
            }
        }
        let (width, height) = (high[0] - low[0], high[1] - low[1]);
        let pixel = width.max(height) / f64::from(resolution.max(1));
        if !(pixel > 0.0 && pixel.is_finite()) {
            return Self { origin: [0.0; 2], pixel: 0.0, runs: Vec::new() };
        }
        let rows = ((height / pixel).ceil() as u32).min(resolution);
        let runs = (0..rows)
            .into_par_iter()
            .flat_map_iter(|row| {
                let y = low[1] + (f64::from(row) + 0.5) * pixel;
                let crossings = crossings(outline, y);
                let between = move |ends: &[f64]| {
                    // Centres from the first crossing to the second.
                    let first = ((ends[0] - low[0]) / pixel - 0.5).ceil().max(0.0);
                    let last = ((ends[1] - low[0]) / pixel - 0.5).floor();
                    Run { row, first: first as u32, count: (last - first + 1.0).max(0.0) as u32 }
                };
                crossings.chunks_exact(2).map(between).filter(|run| run.count > 0).collect::<Vec<_>>()
            })
            .collect();
        Self { origin: low, pixel, runs }
    }

    /// The runs, cut into pieces of at most `most` pixels that are as equal as may be.
    pub(super) fn pieces(&self, most: u32) -> Vec<Run> {
        let cut = |run: &Run| {
            let Run { row, first, count } = *run;
            let parts = count.div_ceil(most);
            let start = move |k: u32| (u64::from(count) * u64::from(k) / u64::from(parts)) as u32;
            (0..parts).map(move |k| Run { row, first: first + start(k), count: start(k + 1) - start(k) })
        };
        self.runs.iter().flat_map(cut).collect()
    }

    /// The centre of pixel `column` of a row.
    pub(super) fn centre(&self, row: u32, column: u32) -> [f64; 2] {
        let at = |axis: usize, i: u32| self.origin[axis] + (f64::from(i) + 0.5) * self.pixel;
        [at(0, column), at(1, row)]
    }
}

/// Where the horizontal line at `y` crosses edges, in order.
fn crossings(outline: &Outline<f64>, y: f64) -> Vec<f64> {
    let mut x: Vec<f64> = outline
        .edges()
        .filter_map(|(i, k)| {
            let (a, b) = (outline.vertices[i], outline.vertices[k]);
            // Half open, so that a vertex on the line counts once.
            ((a[1] <= y) != (b[1] <= y)).then(|| a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]))
        })
        .collect();
    x.sort_unstable_by(f64::total_cmp);
    x
}

/// Whether `p` is inside.
pub(super) fn contains(outline: &Outline<f64>, p: [f64; 2]) -> bool {
    let right = outline.edges().filter(|&(i, k)| {
        let (a, b) = (outline.vertices[i], outline.vertices[k]);
        (a[1] <= p[1]) != (b[1] <= p[1]) && a[0] + (p[1] - a[1]) / (b[1] - a[1]) * (b[0] - a[0]) > p[0]
    });
    right.count() % 2 == 1
}

/// Samples on the edges.
#[derive(Clone, Debug)]
pub(super) struct EdgeSamples {
    /// Samples of an edge, as fractions of its length, denser towards the ends where the map
    /// changes fastest.
    pub(super) fractions: Vec<f64>,
}

impl EdgeSamples {
    /// Samples for a polygon of `n` vertices: independent of any resolution, fewer on each of many
    /// edges, at most `most` and at least 8.
    pub(super) fn new(n: usize, most: usize) -> Self {
        let count = (8192 / n.max(1)).clamp(8, most.max(8));
        let at = |i: usize| 0.5 - 0.5 * (std::f64::consts::PI * (i as f64 + 0.5) / count as f64).cos();
        Self { fractions: (0..count).map(at).collect() }
    }

    /// The fractions around sample `i`: where a minimum near it lies. The ends stay off the
    /// vertices.
    pub(super) fn around(&self, i: usize) -> Range<f64> {
        let near = 1e-9;
        let low = if i == 0 { near } else { self.fractions[i - 1] };
        let high = self.fractions.get(i + 1).copied().unwrap_or(1.0 - near);
        low..high
    }
}

/// The point at a fraction of the edge from vertex `i` to `k`, from its nearer end.
pub(super) fn on_edge(outline: &Outline<f64>, i: usize, k: usize, fraction: f64) -> [f64; 2] {
    let (a, b) = (outline.vertices[i], outline.vertices[k]);
    std::array::from_fn(|axis| {
        let along = b[axis] - a[axis];
        if fraction <= 0.5 { a[axis] + fraction * along } else { b[axis] - (1.0 - fraction) * along }
    })
}
