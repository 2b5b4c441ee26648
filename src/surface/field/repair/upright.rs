//! What a flat chart cannot tell: at a crease the chord through three images can face against the
//! surface although they lie the right way round in the chart. Points are moved until it does not,
//! by what is tried, since the surface is not smooth there.

use glam::{DVec2, DVec3};

/// Sweeps at most.
const SWEEPS: usize = 12;
/// Directions in which a point is tried.
const DIRECTIONS: usize = 8;
/// How far, in parts of the mean distance of its neighbours.
const STEPS: [f64; 6] = [1.5, 0.6, 0.3, 0.15, 0.07, 0.03];
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

/// One triangle's part in what is to be lowered: how far it is from facing as the surface does, and
/// much more where it faces against it, in space or in the chart.
fn penalty(points: [DVec2; 3], images: [Image; 3], flat: bool) -> f64 {
    let (n, m) = facing(images);
    let cosine = n.normalize_or_zero().dot(m.normalize_or_zero());
    let flat = flat && (points[1] - points[0]).perp_dot(points[2] - points[0]) <= 0.0;
    f64::from(u8::from(cosine <= 0.0)) + f64::from(u8::from(flat)) + (ENOUGH - cosine).max(0.0)
}

/// Triangles of a chart over points whose images on the surface count.
pub(super) struct Lifted<'a, F: Fn(DVec2) -> Option<Image>> {
    pub(super) triangles: &'a [[u32; 3]],
    pub(super) free: &'a [u32],
    /// Whether triangles must face up in the chart, too.
    pub(super) flat: bool,
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
        penalty(t.map(|v| points[v]), t.map(|v| images[v]), self.flat)
    }

    /// Lets every free point return towards `from` as far as no penalty rises: what a patch need
    /// not lose it keeps.
    pub(super) fn give_back(&self, points: &mut [DVec2], from: &[DVec2]) {
        let Some(mut images) = points.iter().map(|&p| (self.lift)(p)).collect::<Option<Vec<Image>>>() else { return };
        let fans = self.fans(points.len());
        for _ in 0..RETURNS {
            for &v in self.free {
                let v = v as usize;
                let around = |points: &[DVec2], images: &[Image]| {
                    fans[v].iter().map(|&i| self.penalty(i, points, images)).sum::<f64>()
                };
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

    /// Moves free points while that lowers the penalties of the triangles around them: one at a
    /// time, and together those of a bad triangle or around one of its corners where no single move
    /// helps.
    pub(super) fn set_upright(&self, points: &mut [DVec2]) {
        let Some(mut images) = points.iter().map(|&p| (self.lift)(p)).collect::<Option<Vec<Image>>>() else { return };
        let fans = self.fans(points.len());
        let mut may_move = vec![false; points.len()];
        self.free.iter().for_each(|&v| may_move[v as usize] = true);
        // Points that a triangle of the fan of one of `of` has.
        let near = |of: &[u32]| {
            let mut near: Vec<u32> = of
                .iter()
                .flat_map(|&v| &fans[v as usize])
                .flat_map(|&i| self.triangles[i])
                .filter(|&v| may_move[v as usize])
                .collect();
            near.sort_unstable();
            near.dedup();
            near
        };
        for sweep in 0..SWEEPS {
            let bad: Vec<usize> =
                (0..self.triangles.len()).filter(|&i| self.penalty(i, points, &images) > 0.0).collect();
            let mut corners: Vec<u32> = bad.iter().flat_map(|&i| self.triangles[i]).collect();
            corners.sort_unstable();
            corners.dedup();
            let mut moved = false;
            for v in near(&corners) {
                moved |= self.move_together(&[v], &fans, sweep, points, &mut images);
            }
            if moved {
                continue;
            }
            for &i in &bad {
                if self.penalty(i, points, &images) <= 1.0 {
                    continue;
                }
                let [a, b, c] = self.triangles[i];
                let together = [
                    vec![a, b],
                    vec![b, c],
                    vec![c, a],
                    vec![a, b, c],
                    near(&[a]),
                    near(&[b]),
                    near(&[c]),
                    near(&[a, b, c]),
                ];
                for mut group in together {
                    group.retain(|&v| may_move[v as usize]);
                    if group.len() > 1 {
                        moved |= self.move_together(&group, &fans, sweep, points, &mut images);
                    }
                }
            }
            if !moved {
                return;
            }
        }
    }

    /// The best of some shifts of a few points, if one lowers the penalties of the triangles around
    /// them.
    fn move_together(
        &self,
        group: &[u32],
        fans: &[Vec<usize>],
        sweep: usize,
        points: &mut [DVec2],
        images: &mut [Image],
    ) -> bool {
        let mut fan: Vec<usize> = group.iter().flat_map(|&v| fans[v as usize].iter().copied()).collect();
        fan.sort_unstable();
        fan.dedup();
        let around =
            |points: &[DVec2], images: &[Image]| fan.iter().map(|&i| self.penalty(i, points, images)).sum::<f64>();
        let mut least = around(points, images);
        if least == 0.0 {
            return false;
        }
        let sides = fan.iter().flat_map(|&i| [0, 1, 2].map(|k| (self.triangles[i][k], self.triangles[i][(k + 1) % 3])));
        let reach =
            sides.map(|(a, b)| points[a as usize].distance(points[b as usize])).sum::<f64>() / (3 * fan.len()) as f64;
        let from: Vec<(DVec2, Image)> = group.iter().map(|&v| (points[v as usize], images[v as usize])).collect();
        let mut best = from.clone();
        for step in STEPS {
            for k in 0..DIRECTIONS {
                // Other directions in the next sweep.
                let angle = (k as f64 + 0.382 * sweep as f64) * std::f64::consts::TAU / DIRECTIONS as f64;
                let shift = DVec2::from_angle(angle) * (step * reach);
                let Some(there) =
                    from.iter().map(|f| Some((f.0 + shift, (self.lift)(f.0 + shift)?))).collect::<Option<Vec<_>>>()
                else {
                    continue;
                };
                set(group, &there, points, images);
                let now = around(points, images);
                if now < least - 1e-9 {
                    (least, best) = (now, there);
                }
            }
        }
        set(group, &best, points, images);
        best != from
    }
}

fn set(group: &[u32], to: &[(DVec2, Image)], points: &mut [DVec2], images: &mut [Image]) {
    for (&v, &(p, image)) in group.iter().zip(to) {
        (points[v as usize], images[v as usize]) = (p, image);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A chart folded along the y axis: what is right of it goes down steeply.
    fn roof(q: DVec2) -> Option<Image> {
        let (down, n) = if q.x > 0.0 { (-3.0, DVec3::new(3.0, 0.0, 1.0)) } else { (0.0, DVec3::Z) };
        Some((DVec3::new(q.x, q.y, down * q.x), n.normalize()))
    }

    #[test]
    fn a_triangle_that_faces_as_its_surface_has_no_penalty() {
        let points = [DVec2::ZERO, DVec2::X, DVec2::Y].map(|p| p - DVec2::new(3.0, 0.0));
        let images = points.map(|p| roof(p).unwrap());
        assert_eq!(penalty(points, images, true), 0.0);
        let (points, images) = ([points[0], points[2], points[1]], [images[0], images[2], images[1]]);
        // The other way round it is wrong in space, and in the chart if that counts.
        let wrong = penalty(points, images, false);
        assert!(wrong > 1.0 && penalty(points, images, true) == wrong + 1.0);
    }

    #[test]
    fn a_turned_fan_is_set_upright_and_goes_back_no_farther_than_that() {
        // A hexagon around a point that was pushed out of it.
        let mut points: Vec<DVec2> =
            (0..6).map(|k| DVec2::from_angle(f64::from(k) * std::f64::consts::FRAC_PI_3)).collect();
        points.push(DVec2::new(1.3, 0.2));
        let from = points.clone();
        let triangles: Vec<[u32; 3]> = (0..6).map(|k| [k, (k + 1) % 6, 6]).collect();
        let on = Lifted { triangles: &triangles, free: &[6], flat: true, lift: roof };
        let all = |points: &[DVec2]| {
            let images: Vec<Image> = points.iter().map(|&p| roof(p).unwrap()).collect();
            (0..6).map(|i| on.penalty(i, points, &images)).sum::<f64>()
        };
        assert!(all(&points) > 1.0);
        on.set_upright(&mut points);
        assert_eq!(all(&points), 0.0);
        assert_eq!(points[..6], from[..6]);
        // From the middle it comes nearer to where it was, still right.
        points[6] = DVec2::ZERO;
        on.give_back(&mut points, &from);
        assert!(all(&points) == 0.0 && points[6].distance(from[6]) < 1.0, "{:?}", points[6]);
    }
}
