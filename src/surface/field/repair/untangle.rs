//! Triangles of a planar patch turned the right way by moving its free vertices: a mapping without
//! foldovers.
//!
//! The energy is that of Garanzha et al. 2021 (Foldover-free maps in 50 lines of code): `T / (2
//! chi) + (D^2 + 1) / (2 chi)`, T and D the squared norm and the determinant of the map from a
//! triangle's shape to its place, `chi = (D + sqrt(eps^2 + D^2)) / 2` in place of D, so that turned
//! triangles have an energy, too; eps falls as they become fewer.

use glam::DVec2;

/// Sweeps at most.
const SWEEPS: usize = 120;
/// Sweeps more once no triangle is turned: shapes even out.
const SMOOTHING: usize = 6;
/// Sweeps of averages.
const AVERAGES: usize = 60;
/// Halvings of a step that does not lower the energy.
const HALVINGS: usize = 10;
/// A triangle thinner than this (height over base) counts as one so thick: others need not suffer
/// for its shape.
const THINNEST: f64 = 0.1;

/// Gradients of the barycentric coordinates of a triangle in its shape, and its area.
#[derive(Clone, Copy, Debug)]
struct Shape {
    gradients: [DVec2; 3],
    area: f64,
}

/// The shape of a triangle by the squared lengths of the sides opposite to its corners, scaled;
/// `None` if two corners coincide.
fn shape(squared: [f64; 3], scale: f64) -> Option<Shape> {
    // From the first corner to the second along x.
    let base = squared[2].sqrt() * scale;
    let x = 0.5 * (squared[2] + squared[1] - squared[0]) / squared[2].sqrt() * scale;
    let height = (squared[1] * scale * scale - x * x).max(0.0).sqrt();
    let longest = squared.into_iter().fold(0.0, f64::max).sqrt() * scale;
    if !(base > 1e-6 * longest && longest.is_finite()) {
        return None;
    }
    let height = height.max(THINNEST * longest * longest / base);
    let (b, c) = (DVec2::new(base, 0.0), DVec2::new(x, height));
    let double = b.perp_dot(c);
    let gradients = [(c - b).perp() / double, -c.perp() / double, b.perp() / double];
    Some(Shape { gradients, area: 0.5 * double })
}

/// A planar patch: triangles over points, the free ones of which may move.
#[derive(Debug)]
pub(super) struct Patch<'a> {
    /// Corners of the triangles.
    pub(super) triangles: &'a [[u32; 3]],
    /// Squared lengths of the sides opposite to their corners, as they are on the target.
    pub(super) sides: &'a [[f64; 3]],
    /// Points that may move.
    pub(super) free: &'a [u32],
}

impl Patch<'_> {
    /// Moves the free points until no triangle is turned, or refuses: where the rim itself encloses
    /// no area no place of them is right. Says whether all triangles face up.
    pub(super) fn untangle(&self, points: &mut [DVec2]) -> bool {
        let doubled = |p: &[DVec2], t: [u32; 3]| {
            let [a, b, c] = t.map(|v| p[v as usize]);
            (b - a).perp_dot(c - a)
        };
        // What the rim encloses does not depend on the points inside.
        let area: f64 = 0.5 * self.triangles.iter().map(|&t| doubled(points, t)).sum::<f64>();
        let own: f64 = self.sides.iter().filter_map(|&s| shape(s, 1.0)).map(|s| s.area).sum();
        if !(area > 0.0 && own > 0.0 && area.is_finite()) {
            return false;
        }
        let scale = (area / own).sqrt();
        let shapes: Vec<Option<Shape>> = self.sides.iter().map(|&s| shape(s, scale)).collect();
        let mut fans = vec![Vec::new(); points.len()];
        for (i, t) in self.triangles.iter().enumerate().filter(|(i, _)| shapes[*i].is_some()) {
            t.iter().for_each(|&v| fans[v as usize].push(i));
        }
        let mut smoothing = 0;
        for _ in 0..SWEEPS {
            let least = self
                .triangles
                .iter()
                .zip(&shapes)
                .filter_map(|(&t, s)| Some(0.5 * doubled(points, t) / s.as_ref()?.area))
                .fold(f64::INFINITY, f64::min);
            if least > 0.0 {
                smoothing += 1;
                if smoothing > SMOOTHING {
                    break;
                }
            }
            let eps = (1e-6 + 0.04 * least.min(0.0).powi(2)).sqrt();
            for &v in self.free {
                self.move_vertex(v, &fans[v as usize], &shapes, eps, points);
            }
        }
        self.triangles.iter().all(|&t| doubled(points, t) > 0.0)
    }

    /// Free points at the averages of their neighbours (Tutte), to begin elsewhere.
    pub(super) fn average(&self, points: &mut [DVec2]) {
        let mut around = vec![Vec::new(); points.len()];
        for t in self.triangles {
            for k in 0..3 {
                around[t[k] as usize].extend([t[(k + 1) % 3] as usize, t[(k + 2) % 3] as usize]);
            }
        }
        for _ in 0..AVERAGES {
            for &v in self.free {
                let around = &around[v as usize];
                points[v as usize] = around.iter().map(|&w| points[w]).sum::<DVec2>() / around.len().max(1) as f64;
            }
        }
    }

    /// A step of Newton's method for one point, the positive part of the second derivative in place
    /// of the whole, halved until the energy falls.
    fn move_vertex(&self, v: u32, fan: &[usize], shapes: &[Option<Shape>], eps: f64, points: &mut [DVec2]) {
        let start = points[v as usize];
        let (mut energy, mut gradient) = (0.0, DVec2::ZERO);
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for &i in fan {
            let (t, Some(s)) = (self.triangles[i], &shapes[i]) else { continue };
            let k = t.iter().position(|&w| w == v).unwrap_or(0);
            let m = Measured::new(t.map(|w| points[w as usize]), s, eps);
            let g = s.gradients[k];
            // Derivatives of the squared norm and of the determinant; the second one of the former
            // is 2 |g|^2.
            let norm = 2.0 * (m.columns[0] * g.x + m.columns[1] * g.y);
            let turn =
                DVec2::new(g.x * m.columns[1].y - g.y * m.columns[0].y, g.y * m.columns[0].x - g.x * m.columns[1].x);
            let top = 0.5 * (m.norm + m.determinant * m.determinant + 1.0);
            let dtop = 0.5 * norm + m.determinant * turn;
            energy += s.area * top / m.chi;
            gradient += s.area * (dtop / m.chi - top * m.slope / (m.chi * m.chi) * turn);
            let round = s.area * g.length_squared() / m.chi;
            let along = s.area * (1.0 / m.chi + 2.0 * top * m.slope * m.slope / (m.chi * m.chi * m.chi));
            xx += round + along * turn.x * turn.x;
            xy += along * turn.x * turn.y;
            yy += round + along * turn.y * turn.y;
        }
        let determinant = xx * yy - xy * xy;
        if !(determinant > 0.0 && energy.is_finite()) {
            return;
        }
        let mut step = DVec2::new(xy * gradient.y - yy * gradient.x, xy * gradient.x - xx * gradient.y) / determinant;
        for _ in 0..HALVINGS {
            points[v as usize] = start + step;
            let now: f64 = fan
                .iter()
                .map(|&i| {
                    let Some(s) = &shapes[i] else { return 0.0 };
                    let m = Measured::new(self.triangles[i].map(|w| points[w as usize]), s, eps);
                    s.area * 0.5 * (m.norm + m.determinant * m.determinant + 1.0) / m.chi
                })
                .sum();
            if now < energy {
                return;
            }
            step *= 0.5;
        }
        points[v as usize] = start;
    }
}

/// The map of one triangle.
struct Measured {
    columns: [DVec2; 2],
    norm: f64,
    determinant: f64,
    chi: f64,
    /// Derivative of chi by the determinant.
    slope: f64,
}

impl Measured {
    fn new(p: [DVec2; 3], s: &Shape, eps: f64) -> Self {
        let [a, b, c] = s.gradients;
        let columns = [p[0] * a.x + p[1] * b.x + p[2] * c.x, p[0] * a.y + p[1] * b.y + p[2] * c.y];
        let norm = columns[0].length_squared() + columns[1].length_squared();
        let determinant = columns[0].perp_dot(columns[1]);
        let root = (eps * eps + determinant * determinant).sqrt();
        // Without cancellation.
        let chi = if determinant > 0.0 { 0.5 * (determinant + root) } else { 0.5 * eps * eps / (root - determinant) };
        Self { columns, norm, determinant, chi, slope: chi / root }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::shapes::{Diagonal, Random, plane_grid};

    /// Triangles, sides, points, and the points inside.
    type Grid = (Vec<[u32; 3]>, Vec<[f64; 3]>, Vec<DVec2>, Vec<u32>);

    /// A square of 8 by 8 cells.
    fn grid() -> Grid {
        let mesh = plane_grid(8, 8, 1.0, 1.0, Diagonal::Forward);
        let centre = mesh.positions.iter().copied().sum::<glam::DVec3>() / mesh.vertex_count() as f64;
        let triangles = mesh.triangles();
        let first = mesh.triangle_area_normal(0).normalize();
        let across = (mesh.positions[1] - mesh.positions[0]).normalize();
        let up = first.cross(across);
        let points: Vec<DVec2> =
            mesh.positions.iter().map(|&p| DVec2::new((p - centre).dot(across), (p - centre).dot(up))).collect();
        let sides = triangles
            .iter()
            .map(|t| {
                [0, 1, 2].map(|k| points[t[(k + 1) % 3] as usize].distance_squared(points[t[(k + 2) % 3] as usize]))
            })
            .collect();
        let inside = |p: &DVec2| p.abs().max_element() < 0.49;
        let free = (0..points.len() as u32).filter(|&v| inside(&points[v as usize])).collect();
        (triangles, sides, points, free)
    }

    fn turned(triangles: &[[u32; 3]], p: &[DVec2]) -> usize {
        let up = |t: &&[u32; 3]| {
            let [a, b, c] = t.map(|v| p[v as usize]);
            (b - a).perp_dot(c - a) > 0.0
        };
        triangles.len() - triangles.iter().filter(up).count()
    }

    #[test]
    fn a_scrambled_grid_is_untangled_and_its_rim_stays() {
        let (triangles, sides, right, free) = grid();
        let mut random = Random::new(3);
        for _ in 0..5 {
            let mut points = right.clone();
            free.iter().for_each(|&v| points[v as usize] += 0.3 * DVec2::new(random.signed(), random.signed()));
            assert!(turned(&triangles, &points) > 20);
            let patch = Patch { triangles: &triangles, sides: &sides, free: &free };
            assert!(patch.untangle(&mut points));
            assert_eq!(turned(&triangles, &points), 0);
            for v in (0..points.len()).filter(|v| !free.contains(&(*v as u32))) {
                assert_eq!(points[v], right[v]);
            }
        }
    }

    #[test]
    fn what_is_right_in_shape_stays() {
        let (triangles, sides, right, free) = grid();
        let mut points = right.clone();
        assert!(Patch { triangles: &triangles, sides: &sides, free: &free }.untangle(&mut points));
        assert!(points.iter().zip(&right).all(|(a, b)| a.distance(*b) < 1e-6));
    }

    #[test]
    fn a_rim_turned_over_is_refused() {
        let (triangles, sides, right, free) = grid();
        let mut points: Vec<DVec2> = right.iter().map(|p| DVec2::new(-p.x, p.y)).collect();
        assert!(!Patch { triangles: &triangles, sides: &sides, free: &free }.untangle(&mut points));
        // One fold of the rim is, too: no place inside makes the triangle at that corner right.
        let mut points = right.clone();
        let corner = (0..points.len()).find(|&v| points[v].abs().min_element() > 0.49).unwrap();
        points[corner] = -points[corner];
        assert!(!Patch { triangles: &triangles, sides: &sides, free: &free }.untangle(&mut points));
    }

    #[test]
    fn triangles_without_shape_do_not_stop_it() {
        let (mut triangles, mut sides, right, free) = grid();
        triangles.push([0, 1, 1]);
        sides.push([0.0, 1.0, 1.0]);
        let mut points = right;
        points[free[0] as usize] = DVec2::new(f64::NAN, 0.0);
        assert!(!Patch { triangles: &triangles, sides: &sides, free: &free }.untangle(&mut points));
    }
}
