//! The bumpy tube of the standard set of deformations: closed, four times as long as wide,
//! bounding-box diagonal one.
#![allow(dead_code, reason = "tests and benches use different parts")]

use std::f64::consts::TAU;

use barymap::geometry::Mesh;
use glam::{DQuat, DVec3};

/// The tube along the x axis about the origin, with the numbers it was made from.
pub(crate) struct Tube {
    pub(crate) mesh: Mesh,
    around: usize,
    rings: usize,
}

/// Where the far half of the handles goes.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Pose {
    /// Turned about the tube's axis, in degrees.
    Twist(f64),
    /// Carried along an arc of so many degrees whose length is the tube's.
    Bend(f64),
}

impl Tube {
    /// 1,982 vertices.
    pub(crate) fn small() -> Self {
        Self::new(30, 62)
    }

    /// 9,602 vertices.
    pub(crate) fn medium() -> Self {
        Self::new(64, 140)
    }

    /// 51,410 vertices.
    pub(crate) fn large() -> Self {
        Self::new(144, 334)
    }

    /// `rings` rings of `around` vertices, and caps of rings that shrink to a point.
    pub(crate) fn new(around: usize, rings: usize) -> Self {
        let radius =
            |u: f64, z: f64| 0.5 * (1.0 + 0.08 * (3.0 * u).cos() * (2.5 * z).sin() + 0.05 * (5.0 * z + 2.0 * u).sin());
        let mut positions = Vec::new();
        let mut triangles: Vec<[u32; 3]> = Vec::new();
        for j in 0..rings {
            let z = 4.0 * j as f64 / (rings - 1) as f64;
            for i in 0..around {
                let u = TAU * (i as f64 + 0.5 * (j % 2) as f64) / around as f64;
                positions.push(DVec3::new(z - 2.0, radius(u, z) * u.cos(), radius(u, z) * u.sin()));
            }
        }
        let id = |j: usize, i: usize| (j * around + i % around) as u32;
        for j in 0..rings - 1 {
            for i in 0..around {
                let (a, b, c, d) = (id(j, i), id(j, i + 1), id(j + 1, i), id(j + 1, i + 1));
                let even = [[a, c, b], [b, c, d]];
                let odd = [[a, c, d], [a, d, b]];
                triangles.extend(if j % 2 == 0 { even } else { odd });
            }
        }
        for (sign, j) in [(-1.0, 0), (1.0, rings - 1)] {
            let outward = |t: [u32; 3]| if sign < 0.0 { t } else { [t[0], t[2], t[1]] };
            let mut before: Vec<u32> = (0..around).map(|i| id(j, i)).collect();
            let steps = (around as f64 / 6.0).round() as usize;
            for s in 1..=steps {
                let f = 1.0 - s as f64 / steps as f64;
                let n = if s == steps { 1 } else { ((around as f64 * f).round() as usize).max(3) };
                let first = positions.len() as u32;
                for i in 0..n {
                    let u = TAU * (i as f64 / n as f64 + 0.5 * (j % 2) as f64 / around as f64);
                    let r = f * radius(u, 2.0 + 2.0 * sign);
                    positions.push(DVec3::new(sign * (2.1 - 0.1 * f * f), r * u.cos(), r * u.sin()));
                }
                let here: Vec<u32> = (0..n as u32).map(|i| first + i).collect();
                let (a, b) = (before.len(), if n == 1 { 0 } else { n });
                let (mut i, mut k) = (0, 0);
                while i < a || k < b {
                    let along_before = k >= b || (i < a && (i + 1) * b <= (k + 1) * a);
                    if along_before {
                        triangles.push(outward([before[i % a], before[(i + 1) % a], here[k % n]]));
                        i += 1;
                    } else {
                        triangles.push(outward([before[i % a], here[(k + 1) % n], here[k % n]]));
                        k += 1;
                    }
                }
                before = here;
            }
        }
        let (low, high) =
            positions.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(l, h), &p: &DVec3| (l.min(p), h.max(p)));
        let positions = positions.into_iter().map(|p| p / low.distance(high)).collect();
        Self { mesh: Mesh::from_triangles("tube", positions, &triangles).unwrap(), around, rings }
    }

    /// Half the length.
    pub(crate) fn half(&self) -> f64 {
        self.mesh.positions.iter().map(|p| p.x).fold(0.0, f64::max)
    }

    /// All vertices of the first and last 4 % of the length.
    pub(crate) fn caps(&self) -> Vec<u32> {
        let limit = 0.92 * self.half();
        (0..self.mesh.vertex_count() as u32).filter(|&v| self.mesh.positions[v as usize].x.abs() > limit).collect()
    }

    /// Four vertices of the rim at each end.
    pub(crate) fn points(&self) -> Vec<u32> {
        let rim = |j: usize| (0..4).map(move |k| (j * self.around + k * self.around / 4) as u32);
        rim(0).chain(rim(self.rings - 1)).collect()
    }

    /// Where `handles` go.
    pub(crate) fn targets(&self, handles: &[u32], pose: Pose) -> Vec<DVec3> {
        let half = self.half();
        let place = |p: DVec3| match pose {
            _ if p.x < 0.0 => p,
            Pose::Twist(degrees) => DQuat::from_rotation_x(degrees.to_radians()) * p,
            Pose::Bend(degrees) => {
                let angle = degrees.to_radians();
                let r = 2.0 * half / angle;
                let end = DVec3::new(r * angle.sin() - half, r * (1.0 - angle.cos()), 0.0);
                end + DQuat::from_rotation_z(angle) * (p - DVec3::X * half)
            }
        };
        handles.iter().map(|&v| place(self.mesh.positions[v as usize])).collect()
    }
}
