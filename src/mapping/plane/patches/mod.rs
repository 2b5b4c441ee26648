//! The inverse of a map in small squares of its source, each by a polynomial whose error is
//! bounded: exact pre-images for the price of a few evaluations of the map per square.
//!
//! A quadtree of squares over a rectangle. The map and its derivative are evaluated at nine nodes
//! of each square, which neighbours share, and at four points more: in single precision that keeps
//! points in two parts, where the coarsest squares show that this is enough. A polynomial of degree
//! 5 is fitted to the nodes ([`fit`]) and judged at all of these points. Where the bound of its
//! error is within the tolerance, the map in double precision at the centre, the *anchor* of the
//! square, says how far off the cheap one is, and moves the polynomial there; elsewhere the square
//! is divided. Maps by barycentric
//! coordinates are smooth but at the vertices of the polygon; the size of a square that a
//! polynomial fits shrinks with the distance from these, and one that a vertex lies in or beside is
//! divided whatever it seems. What is left open, some pixels at a vertex and what folds, is for
//! Newton's method on the map itself.
//!
//! Polynomials of neighbours differ by less than the bound; nothing makes them continuous.

mod fit;
mod packed;
mod raster;
mod solve;
#[cfg(test)]
mod tests;

use std::collections::HashMap;

use glam::{DMat2, DVec2, UVec2};
use rayon::prelude::*;

use super::composite::Mapped;
use crate::error::{Error, Result};

#[cfg(test)]
pub(crate) use packed::twins;
pub use packed::{PackedPatches, PatchRecord, TILE_SIDE};
pub use raster::{Found, NOWHERE};
pub use solve::Solved;

/// How often a square may be halved: pictures that are shown a thousand times as large have pixels
/// yet.
const DEPTH: u32 = 14;
/// How much larger the difference of the cheap map from the exact one may be anywhere in a square
/// than at the anchor: roundings of displacements, which are as long all over a square.
const ANCHORED: f64 = 4.0;
/// What part of the tolerance the largest difference at the anchors of the coarsest squares may be
/// for the cheap map to be taken: with [`ANCHORED`] and [`fit::SAFETY`] it would leave too little
/// for the polynomials.
const CHEAP: f64 = 1.0 / 8.0;
/// A vertex of the map this far from the centre of a square, in units of half its side, is beside
/// it; by the larger component.
const BESIDE: f64 = 2.0;

/// What [`Patches`] are made for.
#[derive(Clone, Debug)]
pub struct PatchOptions {
    /// Side of the coarsest squares.
    pub cell: f64,
    /// Most error of a pre-image times the derivative there, in units of the image.
    pub tolerance: f64,
    /// Area of an image that is not worth dividing: about as many pixels as evaluations that takes.
    pub worth: f64,
    /// The part of the image that matters.
    pub canvas: [DVec2; 2],
    /// Places where the map has no derivative, in the source.
    pub vertices: Vec<DVec2>,
    /// Most evaluations, of either kind; no more squares are divided when there are as many.
    pub evaluations: usize,
}

/// A map at many points, with derivatives.
pub trait Maps {
    /// In double precision.
    ///
    /// # Errors
    /// Those of the map.
    fn exact(&self, points: &[DVec2]) -> Result<Vec<Mapped>>;

    /// As nearly as is cheap: how nearly is seen.
    ///
    /// # Errors
    /// Those of the map.
    fn cheap(&self, points: &[DVec2]) -> Result<Vec<Mapped>> {
        self.exact(points)
    }
}

/// How often a map was evaluated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Evaluated {
    /// In double precision.
    pub exact: usize,
    /// As nearly as is cheap.
    pub cheap: usize,
}

/// A square of the source in which the map is one to one, and its inverse.
#[derive(Clone, Debug)]
pub struct Patch {
    /// Centre.
    pub(super) centre: DVec2,
    /// Half the side.
    pub(super) half: f64,
    /// The image of the centre.
    pub(super) image: DVec2,
    /// The inverse of A, see [`Patch::new`].
    pub(super) inverse: DMat2,
    /// The terms of g, by component.
    pub(super) bend: [[f32; fit::BENDS]; 2],
    /// Most that g is in the square, by component.
    pub(super) reach: DVec2,
}

/// A square that no polynomial was bounded in.
#[derive(Clone, Debug)]
pub struct Open {
    centre: DVec2,
    half: f64,
    /// Images of the nodes.
    images: [DVec2; 9],
}

/// A square of the quadtree that was not divided.
#[derive(Clone, Debug)]
pub enum Leaf {
    /// Pre-images in it are exact.
    Bounded(Box<Patch>),
    /// Pre-images in it are starts of Newton's method.
    Open(Box<Open>),
}

impl Leaf {
    /// The point of the source at a place in the square, from -1 to 1.
    pub fn point(&self, at: [f32; 2]) -> DVec2 {
        let (centre, half) = match self {
            Self::Bounded(p) => (p.centre, p.half),
            Self::Open(o) => (o.centre, o.half),
        };
        centre + half * DVec2::from(at.map(f64::from))
    }

    /// Half the side of the square.
    pub fn half(&self) -> f64 {
        match self {
            Self::Bounded(p) => p.half,
            Self::Open(o) => o.half,
        }
    }
}

/// The squares of a rectangle.
#[derive(Clone, Debug)]
pub struct Patches {
    /// Those that were not divided, the coarsest first.
    pub leaves: Vec<Leaf>,
    /// How often the map was evaluated.
    pub evaluations: Evaluated,
}

/// A square of the quadtree, in quarters of the side of the finest.
#[derive(Clone, Copy)]
struct Cell {
    corner: UVec2,
    /// A quarter of the side.
    quarter: u32,
}

impl Cell {
    fn nodes(self) -> [UVec2; 9] {
        let h = 2 * self.quarter;
        std::array::from_fn(|i| self.corner + UVec2::new(i as u32 % 3 * h, i as u32 / 3 * h))
    }

    fn held_out(self) -> [UVec2; 4] {
        let q = self.quarter;
        std::array::from_fn(|i| self.corner + UVec2::new(q + i as u32 % 2 * 2 * q, q + i as u32 / 2 * 2 * q))
    }

    fn centre(self) -> UVec2 {
        self.corner + 2 * self.quarter
    }

    fn quarters(self) -> [Self; 4] {
        let half = 2 * self.quarter;
        std::array::from_fn(|i| Self {
            corner: self.corner + UVec2::new(i as u32 % 2, i as u32 / 2) * half,
            quarter: self.quarter / 2,
        })
    }
}

/// The map at places of the quadtree.
#[derive(Default)]
struct Samples {
    index: HashMap<UVec2, u32>,
    places: Vec<UVec2>,
    values: Vec<Mapped>,
}

impl Samples {
    fn want(&mut self, place: UVec2) {
        let next = self.places.len() as u32;
        if *self.index.entry(place).or_insert(next) == next {
            self.places.push(place);
        }
    }

    fn at<const N: usize>(&self, places: [UVec2; N]) -> [Mapped; N] {
        places.map(|p| self.values[self.index[&p] as usize])
    }
}

/// What becomes of a square.
enum Fate {
    Open,
    /// A polynomial with the bound of its error, if the cheap map is the map.
    Bounded(Box<Patch>, f64),
    Divided,
}

impl Patches {
    /// The squares of the rectangle from `low` to `high`; `map` is called twice for every size of
    /// squares.
    ///
    /// # Errors
    /// Those of `map`; [`Error::Input`] if the rectangle or the options are empty or not finite, or
    /// the coarsest squares alone take more evaluations than allowed.
    pub fn new(low: DVec2, high: DVec2, options: &PatchOptions, map: &impl Maps) -> Result<Self> {
        let size = high - low;
        let across = (size / options.cell).ceil().max(DVec2::ONE);
        let least = (2.0 * across.x + 1.0) * (2.0 * across.y + 1.0) + 4.0 * across.x * across.y;
        if !(size.x > 0.0 && size.y > 0.0 && least <= options.evaluations as f64 && options.tolerance > 0.0) {
            return Err(Error::input(
                format!("squares of {} over {} x {}", options.cell, size.x, size.y),
                format!("Give a rectangle with an area, and squares that take {} evaluations", options.evaluations),
            ));
        }
        // Places count in 32 bits.
        let most = across.max_element() as u32;
        let depth = DEPTH.min((u32::MAX / most).ilog2().saturating_sub(3));
        let quarter = 1_u32 << depth;
        let unit = options.cell / f64::from(4 * quarter);
        let mut vertices: Vec<DVec2> = options.vertices.iter().copied().filter(|v| v.is_finite()).collect();
        vertices.sort_by(|a, b| a.x.total_cmp(&b.x));
        let place = |p: UVec2| low + p.as_dvec2() * unit;
        let square = |cell: &Cell, samples: &Samples| Square {
            centre: place(cell.centre()),
            half: 2.0 * f64::from(cell.quarter) * unit,
            nodes: samples.at(cell.nodes()),
        };
        let mut samples = Samples::default();
        let mut open: Vec<Cell> = (0..across.y as u32)
            .flat_map(|y| (0..across.x as u32).map(move |x| UVec2::new(x, y)))
            .map(|at| Cell { corner: at * 4 * quarter, quarter })
            .collect();
        let mut map = Counted { map, all: Evaluated::default(), exactly: false };
        let centres: Vec<DVec2> = open.iter().map(|c| place(c.centre())).collect();
        map.exactly = !map.is_cheap(&centres, options.tolerance)?;
        let mut leaves = Vec::new();
        while !open.is_empty() {
            for p in open.iter().flat_map(|c| c.nodes().into_iter().chain(c.held_out())) {
                samples.want(p);
            }
            let fresh: Vec<DVec2> = samples.places[samples.values.len()..].iter().map(|p| place(*p)).collect();
            samples.values.extend(map.values(&fresh)?);
            let judge = |cell: &Cell| {
                square(cell, &samples).fate(&samples.at(cell.held_out()), cell.quarter > 1, &vertices, options)
            };
            let fates: Vec<Fate> = open.par_iter().map(judge).collect();
            let bounded = || open.iter().zip(&fates).filter(|(_, f)| matches!(f, Fate::Bounded(..))).map(|(c, _)| *c);
            let centres: Vec<DVec2> = bounded().map(|c| place(c.centre())).collect();
            let off = map.differences(&centres, bounded().map(|c| samples.at([c.centre()])[0].point))?;
            let mut off = off.into_iter();
            // A division takes at most 28 evaluations.
            let mut room = options.evaluations.saturating_sub(map.all.exact + map.all.cheap) / 28;
            let mut divided = Vec::new();
            for (cell, fate) in open.iter().zip(fates) {
                let mut divisible = cell.quarter > 1 && room > 0;
                if let Fate::Bounded(mut patch, error) = fate {
                    let off = off.next().unwrap_or(DVec2::NAN);
                    if error + ANCHORED * off.length() <= options.tolerance {
                        patch.image += off;
                        leaves.push(Leaf::Bounded(patch));
                        continue;
                    }
                    divisible &= square(cell, &samples).area() > options.worth;
                } else {
                    divisible &= matches!(fate, Fate::Divided);
                }
                if divisible {
                    room -= 1;
                    divided.extend(cell.quarters());
                } else {
                    leaves.push(square(cell, &samples).open());
                }
            }
            open = divided;
        }
        Ok(Self { leaves, evaluations: map.all })
    }
}

/// A map whose evaluations are counted.
struct Counted<'a, M> {
    map: &'a M,
    all: Evaluated,
    /// Whether all of them are in double precision.
    exactly: bool,
}

impl<M: Maps> Counted<'_, M> {
    fn values(&mut self, points: &[DVec2]) -> Result<Vec<Mapped>> {
        if self.exactly {
            self.all.exact += points.len();
            return self.map.exact(points);
        }
        self.all.cheap += points.len();
        self.map.cheap(points)
    }

    /// The exact images less the others.
    fn differences(&mut self, points: &[DVec2], images: impl Iterator<Item = DVec2>) -> Result<Vec<DVec2>> {
        if self.exactly || points.is_empty() {
            return Ok(vec![DVec2::ZERO; points.len()]);
        }
        self.all.exact += points.len();
        Ok(self.map.exact(points)?.iter().zip(images).map(|(exact, cheap)| exact.point - cheap).collect())
    }

    /// Whether the cheap map is worth taking, by its difference at some points.
    fn is_cheap(&mut self, points: &[DVec2], tolerance: f64) -> Result<bool> {
        let images: Vec<DVec2> = self.values(points)?.iter().map(|m| m.point).collect();
        let off = self.differences(points, images.into_iter())?;
        // Where it is no number, neither is the other.
        let lengths = off.iter().map(|d| d.length()).filter(|d| d.is_finite());
        Ok(lengths.fold(0.0, f64::max) <= CHEAP * tolerance)
    }
}

/// The smallest and the largest components.
fn bounds(points: &[DVec2; 9]) -> [DVec2; 2] {
    points.iter().fold([points[0]; 2], |[a, b], p| [a.min(*p), b.max(*p)])
}

struct Square {
    centre: DVec2,
    half: f64,
    nodes: [Mapped; 9],
}

impl Square {
    fn open(&self) -> Leaf {
        let images = self.nodes.map(|m| m.point);
        Leaf::Open(Box::new(Open { centre: self.centre, half: self.half, images }))
    }

    /// About the area of the image.
    fn area(&self) -> f64 {
        let images = self.nodes.map(|m| m.point);
        let [low, high] = bounds(&images);
        let across = (images[8] - images[0]).perp_dot(images[6] - images[2]).abs();
        0.5 * across.max((high - low).element_product() * 0.5)
    }

    fn fate(&self, held: &[Mapped; 4], divisible: bool, vertices: &[DVec2], options: &PatchOptions) -> Fate {
        let images = self.nodes.map(|m| m.point);
        let finite = images.iter().all(|p| p.is_finite());
        let patch = |tolerance: f64| Patch::new(self.centre, self.half, &self.nodes, held, tolerance);
        let smooth = finite && !self.is_beside(vertices);
        if let Some((patch, error)) = smooth.then(|| patch(options.tolerance)).flatten() {
            return Fate::Bounded(Box::new(patch), error);
        }
        let [low, high] = bounds(&images);
        let seen = |reach: DVec2| {
            (high + reach).cmpge(options.canvas[0]).all() && (low - reach).cmple(options.canvas[1]).all()
        };
        // Where the map is at all like a polynomial, its image is near those of the nodes.
        let unseen = finite && !seen(high - low) && patch(0.1 * (high - low).length()).is_some();
        let worthless = finite && self.area() <= options.worth;
        // Between what is a number and what is not the border is followed a little.
        let hopeless = !finite && self.half <= options.cell / 16.0;
        if !divisible || hopeless || unseen || worthless { Fate::Open } else { Fate::Divided }
    }

    /// Whether a vertex lies in the square or beside it; `vertices` are in the order of x.
    fn is_beside(&self, vertices: &[DVec2]) -> bool {
        let reach = BESIDE * self.half;
        let first = vertices.partition_point(|v| v.x < self.centre.x - reach);
        let near = vertices[first..].iter().take_while(|v| v.x <= self.centre.x + reach);
        near.into_iter().any(|v| (v.y - self.centre.y).abs() <= reach)
    }
}
