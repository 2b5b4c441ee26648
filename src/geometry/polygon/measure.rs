//! Areas and barycentres.

use glam::DVec2;

use super::Polygon;

/// Twice the signed area of a loop and its first moments times six, about `origin`.
fn moments(ring: &[DVec2], origin: DVec2) -> (f64, DVec2) {
    let n = ring.len();
    (0..n).fold((0.0, DVec2::ZERO), |(area, moment), i| {
        let (a, b) = (ring[i] - origin, ring[(i + 1) % n] - origin);
        let cross = a.perp_dot(b);
        (area + cross, moment + (a + b) * cross)
    })
}

/// Signed area of a loop: positive where it runs anticlockwise (y up).
pub fn signed_area(ring: &[DVec2]) -> f64 {
    // A vertex as the origin keeps the digits of small loops far from 0.
    ring.first().map_or(0.0, |&origin| moments(ring, origin).0 / 2.0)
}

/// Centre of gravity of the area a loop bounds; the mean of the vertices where that area is 0.
pub fn barycentre(ring: &[DVec2]) -> DVec2 {
    let Some(&origin) = ring.first() else { return DVec2::ZERO };
    let (area, moment) = moments(ring, origin);
    let centre = origin + moment / (3.0 * area);
    if centre.is_finite() { centre } else { ring.iter().sum::<DVec2>() / ring.len() as f64 }
}

impl Polygon {
    /// Area of the domain: the sum of the signed areas of the loops, holes counting negative.
    pub fn area(&self) -> f64 {
        self.loops.iter().map(|ring| signed_area(ring)).sum()
    }

    /// Centre of gravity of the domain; the mean of the vertices where its area is 0.
    pub fn barycentre(&self) -> DVec2 {
        let Some(origin) = self.vertices().next() else { return DVec2::ZERO };
        let (area, moment) = self
            .loops
            .iter()
            .map(|ring| moments(ring, origin))
            .fold((0.0, DVec2::ZERO), |(a, m), (b, n)| (a + b, m + n));
        let centre = origin + moment / (3.0 * area);
        if centre.is_finite() { centre } else { self.vertices().sum::<DVec2>() / self.vertex_count() as f64 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(centre: DVec2, half: f64) -> Vec<DVec2> {
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| centre + DVec2::new(x, y) * half).to_vec()
    }

    #[test]
    fn holes_count_negative() {
        let mut hole = square(DVec2::new(0.5, 0.0), 0.25);
        hole.reverse();
        let polygon = Polygon::from_loops(vec![square(DVec2::ZERO, 1.0), hole]);
        assert!((polygon.area() - 3.75).abs() < 1e-14);
        // The hole takes 1/4 at x = 1/2 away from 4 at x = 0.
        assert!((polygon.barycentre() - DVec2::new(-0.125 / 3.75, 0.0)).length() < 1e-14);
    }

    #[test]
    fn digits_survive_an_offset() {
        let ring = square(DVec2::new(1e9, -1e9), 0.5);
        assert_eq!(signed_area(&ring), 1.0);
        assert_eq!(barycentre(&ring), DVec2::new(1e9, -1e9));
    }

    #[test]
    fn no_area_means_the_mean() {
        let ring = [DVec2::ZERO, DVec2::X, DVec2::X * 2.0];
        assert_eq!(barycentre(&ring), DVec2::X);
    }
}
