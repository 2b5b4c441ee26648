//! What a flat chart cannot tell: at a crease the chord through three images can face against the surface although they lie the right way round in the chart. Points are moved one at a time until it does not.

use glam::{DVec2, DVec3};

/// Sweeps at most.
const SWEEPS: usize = 12;
/// Directions in which a point is tried.
const DIRECTIONS: usize = 8;
/// How far, in parts of the mean distance of its neighbours.
const STEPS: [f64; 5] = [0.6, 0.3, 0.15, 0.07, 0.03];
/// Sweeps in which points return, and how much of the way they try.
const RETURNS: usize = 4;
const PARTS: [f64; 4] = [1.0, 0.7, 0.4, 0.15];
/// Cosine between an image and the surface that is enough.
const ENOUGH: f64 = 0.1;

/// An image: its place and the normal of the surface there.
pub(super) type Image = (DVec3, DVec3);

/// Twice the normal of an image and the sum of the surface's normals at its corners.
pub(super) fn facing(images: [Image; 3]) -> (DVec3, DVec3) {
    let [a, b, c] = images;
    ((b.0 - a.0).cross(c.0 - a.0), a.1 + b.1 + c.1)
}

/// One triangle's part in what is to be lowered: how far it is from facing as the surface does, and much more where it faces against it, in space or in the chart.
fn penalty(points: [DVec2; 3], images: [Image; 3], sign: f64) -> f64 {
    let (n, m) = facing(images);
    let cosine = sign * n.normalize_or_zero().dot(m.normalize_or_zero());
    let flat = (points[1] - points[0]).perp_dot(points[2] - points[0]) <= 0.0;
    f64::from(u8::from(cosine <= 0.0)) + f64::from(u8::from(flat)) + (ENOUGH - cosine).max(0.0)
}

/// Triangles of a chart over points whose images on the surface count.
pub(super) struct Lifted<'a, F: Fn(DVec2) -> Option<Image>> {
    pub(super) triangles: &'a [[u32; 3]],
    pub(super) free: &'a [u32],
    /// -1 for a mirror image, whose triangles are given the other way round.
    pub(super) sign: f64,
    /// The image of a place in the chart.
    pub(super) lift: F,
}

impl<F: Fn(DVec2) -> Option<Image>> Lifted<'_, F> {
    fn fans(&self, count: usize) -> Vec<Vec<usize>> {
        let mut fans = vec![Vec::new(); count];
        for (i, t) in self.triangles.iter().enumerate() {
            t.iter().for_each(|&v| fans[v as usize].push(i));
        }
        fans
    }

    fn penalty(&self, i: usize, points: &[DVec2], images: &[Image]) -> f64 {
        let t = self.triangles[i].map(|v| v as usize);
        penalty(t.map(|v| points[v]), t.map(|v| images[v]), self.sign)
    }

    /// Lets every free point return towards `from` as far as no penalty rises: what a patch need not lose it keeps.
    pub(super) fn give_back(&self, points: &mut [DVec2], from: &[DVec2]) {
        let Some(mut images) = points.iter().map(|&p| (self.lift)(p)).collect::<Option<Vec<Image>>>() else { return };
        let fans = self.fans(points.len());
        for _ in 0..RETURNS {
            for &v in self.free {
                let v = v as usize;
                let around = |points: &[DVec2], images: &[Image]| fans[v].iter().map(|&i| self.penalty(i, points, images)).sum::<f64>();
                let limit = around(points, &images);
                let (here, image) = (points[v], images[v]);
                for part in PARTS {
                    let to = here.lerp(from[v], part);
                    let Some(there) = (self.lift)(to) else { continue };
                    (points[v], images[v]) = (to, there);
                    if around(points, &images) <= limit {
                        break;
                    }
                    (points[v], images[v]) = (here, image);
                }
            }
        }
    }

    /// Moves free points while that lowers the penalties of the triangles around them.
    pub(super) fn set_upright(&self, points: &mut [DVec2]) {
        let Some(mut images) = points.iter().map(|&p| (self.lift)(p)).collect::<Option<Vec<Image>>>() else { return };
        let (triangles, free, lift) = (self.triangles, self.free, &self.lift);
        let fans = self.fans(points.len());
        let at = |points: &[DVec2], images: &[Image], i: usize| self.penalty(i, points, images);
    for sweep in 0..SWEEPS {
        let mut near = vec![false; points.len()];
        let bad: Vec<usize> = (0..triangles.len()).filter(|&i| at(points, &images, i) > ENOUGH).collect();
        if bad.is_empty() {
            return;
        }
        for &v in bad.iter().flat_map(|&i| &triangles[i]) {
            for &w in fans[v as usize].iter().flat_map(|&i| &triangles[i]) {
                near[w as usize] = true;
            }
        }
        let mut moved = false;
        for &v in free.iter().filter(|&&v| near[v as usize]) {
            let v = v as usize;
            let around = |points: &[DVec2], images: &[Image]| fans[v].iter().map(|&i| at(points, images, i)).sum::<f64>();
            let mut least = around(points, &images);
            if least == 0.0 {
                continue;
            }
            let (from, image) = (points[v], images[v]);
            let reach = fans[v]
                .iter()
                .flat_map(|&i| triangles[i])
                .map(|w| points[w as usize].distance(from))
                .sum::<f64>()
                / (2 * fans[v].len()) as f64;
            let mut best = (from, image);
            for step in STEPS {
                for k in 0..DIRECTIONS {
                    // Other directions in the next sweep.
                    let angle = (k as f64 + 0.382 * sweep as f64) * std::f64::consts::TAU / DIRECTIONS as f64;
                    let to = from + DVec2::from_angle(angle) * (step * reach);
                    let Some(there) = lift(to) else { continue };
                    (points[v], images[v]) = (to, there);
                    let now = around(points, &images);
                    if now < least - 1e-9 {
                        (least, best) = (now, (to, there));
                        moved = true;
                    }
                }
            }
            (points[v], images[v]) = best;
        }
        if !moved {
            return;
        }
    }
}
}
