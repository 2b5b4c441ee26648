//! Outlines through a map: vertices, and as many points between them as the bend of the image asks
//! for.

use glam::DVec2;

use crate::error::Result;

/// Most times that a segment is halved.
const DEPTH: u32 = 16;
/// Points added to all outlines together, at most; where they run out, the rest is as it is.
const MOST_POINTS: usize = 1 << 24;

/// A connected line that starts at a point and goes on in segments, as the readers of files know
/// it.
pub trait Curve {
    /// Number of segments; a point has none.
    fn segments(&self) -> usize;
    /// The point of segment `index` at `t`, from 0 to 1. Index 0 at 0 is the start, also where
    /// there are no segments.
    fn at(&self, index: usize, t: f64) -> DVec2;
}

/// A vertex of the image of a curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MappedVertex {
    /// Where it is.
    pub point: DVec2,
    /// Segment of the curve and place on it that it comes from.
    pub from: (usize, f64),
}

/// Segment and place on it, and the image there.
type Sample = ((usize, f64), Option<DVec2>);

/// A piece of a segment with the images of its ends.
struct Piece {
    curve: usize,
    segment: usize,
    ends: [f64; 2],
    images: [Option<DVec2>; 2],
    depth: u32,
}

/// The images of `curves` under `map`, which takes many points at once: the start of each and the
/// end of each of its segments, and between them so many points that the straight lines through the
/// images stay within `tolerance` of the curves' images (none, if it is `None`). A curve with a
/// point that has no image has none.
///
/// Pieces are halved in the middle of their parameter, so that a segment and its reverse get the
/// same points, and neighbours that share a border keep sharing it.
///
/// # Errors
/// Those of `map`.
pub fn map_curves(
    curves: &[&dyn Curve],
    tolerance: Option<f64>,
    mut map: impl FnMut(&[DVec2]) -> Result<Vec<Option<DVec2>>>,
) -> Result<Vec<Option<Vec<MappedVertex>>>> {
    let mut corners = Vec::new();
    for curve in curves {
        corners.push(curve.at(0, 0.0));
        corners.extend((0..curve.segments()).map(|i| curve.at(i, 1.0)));
    }
    let images = map(&corners)?;
    // Parameter and image of the points of each curve, sorted at the end.
    let mut found: Vec<Vec<Sample>> = Vec::with_capacity(curves.len());
    let mut open = Vec::new();
    let mut first = 0;
    for (k, curve) in curves.iter().enumerate() {
        let n = curve.segments();
        let own = &images[first..=first + n];
        first += n + 1;
        let mut points = vec![((0, 0.0), own[0])];
        points.extend((0..n).map(|i| ((i, 1.0), own[i + 1])));
        found.push(points);
        if tolerance.is_some() {
            let piece =
                |i: usize| Piece { curve: k, segment: i, ends: [0.0, 1.0], images: [own[i], own[i + 1]], depth: 0 };
            open.extend((0..n).map(piece));
        }
    }
    let tolerance = tolerance.unwrap_or(0.0);
    let mut added = 0;
    while !open.is_empty() && added < MOST_POINTS {
        // Quarters as well as the middle: a wave may cross its chord there.
        let place = |p: &Piece, t: f64| p.ends[0] + (p.ends[1] - p.ends[0]) * t;
        let points: Vec<DVec2> =
            open.iter().flat_map(|p| [0.25, 0.5, 0.75].map(|t| curves[p.curve].at(p.segment, place(p, t)))).collect();
        let images = map(&points)?;
        let mut next = Vec::new();
        for (piece, inner) in open.iter().zip(images.chunks_exact(3)) {
            let ([Some(a), Some(b)], [Some(u), Some(v), Some(w)]) = (piece.images, inner) else {
                // What has no image now has none in the end.
                found[piece.curve].push(((piece.segment, place(piece, 0.5)), None));
                continue;
            };
            if piece.depth == DEPTH || [u, v, w].into_iter().all(|p| distance(*p, a, b) <= tolerance) {
                continue;
            }
            let middle = place(piece, 0.5);
            found[piece.curve].push(((piece.segment, middle), Some(*v)));
            added += 1;
            let half = |ends, images| Piece { ends, images, depth: piece.depth + 1, ..*piece };
            next.push(half([piece.ends[0], middle], [Some(a), Some(*v)]));
            next.push(half([middle, piece.ends[1]], [Some(*v), Some(b)]));
        }
        open = next;
    }
    let whole = |mut points: Vec<Sample>| -> Option<Vec<MappedVertex>> {
        points.sort_by(|(a, _), (b, _)| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        points
            .into_iter()
            .map(|(from, image)| Some(MappedVertex { point: image.filter(|p| p.is_finite())?, from }))
            .collect()
    };
    Ok(found.into_iter().map(whole).collect())
}

/// Distance of `p` from the segment from `a` to `b`.
fn distance(p: DVec2, a: DVec2, b: DVec2) -> f64 {
    let along = b - a;
    let t = ((p - a).dot(along) / along.length_squared()).clamp(0.0, 1.0);
    // Without a length there is no direction, and t is not a number.
    if t.is_nan() { p.distance(a) } else { p.distance(a + along * t) }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Chain(Vec<DVec2>);

    impl Curve for Chain {
        fn segments(&self) -> usize {
            self.0.len() - 1
        }

        fn at(&self, index: usize, t: f64) -> DVec2 {
            if self.segments() == 0 { self.0[0] } else { self.0[index].lerp(self.0[index + 1], t) }
        }
    }

    fn bend(points: &[DVec2]) -> Result<Vec<Option<DVec2>>> {
        Ok(points.iter().map(|p| (p.x < 100.0).then(|| DVec2::new(p.x, p.y + p.x * p.x))).collect())
    }

    #[test]
    fn straight_images_get_no_points_and_bent_ones_enough() {
        let chain = Chain(vec![DVec2::ZERO, DVec2::new(0.0, 5.0), DVec2::new(4.0, 5.0)]);
        for tolerance in [0.5, 0.01, 1e-4] {
            let image = map_curves(&[&chain], Some(tolerance), bend).unwrap().remove(0).unwrap();
            assert_eq!(image.iter().filter(|v| v.from.0 == 0).count(), 2, "a straight line stays two points");
            for pair in image.windows(2) {
                assert!(pair[0].from.0 < pair[1].from.0 || pair[0].from.1 < pair[1].from.1);
                let (a, b) = (pair[0].point, pair[1].point);
                for k in 0..=20 {
                    let x = a.x + (b.x - a.x) * f64::from(k) / 20.0;
                    let p = if pair[1].from.0 == 0 { a } else { DVec2::new(x, 5.0 + x * x) };
                    assert!(distance(p, a, b) <= tolerance * 1.2);
                }
            }
            assert!((image.len() as f64) < 8.0 / tolerance.sqrt(), "{}", image.len());
        }
        assert_eq!(map_curves(&[&chain], None, bend).unwrap()[0].as_ref().unwrap().len(), 3);
    }

    #[test]
    fn a_border_and_its_reverse_get_the_same_points() {
        let forth = Chain(vec![DVec2::new(0.3, 0.0), DVec2::new(3.7, 1.1)]);
        let back = Chain(vec![forth.0[1], forth.0[0]]);
        let images = map_curves(&[&forth, &back], Some(1e-3), bend).unwrap();
        let points = |i: usize| images[i].as_ref().unwrap().iter().map(|v| v.point).collect::<Vec<_>>();
        let mut reversed = points(1);
        reversed.reverse();
        assert_eq!(points(0).len(), reversed.len());
        assert!(points(0).iter().zip(&reversed).all(|(a, b)| a.distance(*b) < 1e-12));
    }

    #[test]
    fn points_without_an_image_take_the_curve_with_them() {
        let good = Chain(vec![DVec2::ZERO]);
        let bad = Chain(vec![DVec2::ZERO, DVec2::new(200.0, 0.0)]);
        let through = Chain(vec![DVec2::ZERO, DVec2::new(99.0, 0.0)]);
        let holes = |points: &[DVec2]| Ok(points.iter().map(|p| (p.x < 30.0 || p.x > 98.0).then_some(*p)).collect());
        let images = map_curves(&[&good, &bad, &through], Some(0.1), holes).unwrap();
        assert!(images[0].as_ref().is_some_and(|v| v.len() == 1) && images[2].is_none());
        assert!(map_curves(&[&bad], Some(0.1), bend).unwrap()[0].is_none());
    }

    #[test]
    fn wild_maps_end() {
        let chain = Chain(vec![DVec2::ZERO, DVec2::X]);
        let noise =
            |points: &[DVec2]| Ok(points.iter().map(|p| Some(*p + DVec2::new(0.0, (p.x * 1e7).sin()))).collect());
        let image = map_curves(&[&chain], Some(1e-9), noise).unwrap().remove(0).unwrap();
        assert!(image.len() <= (1 << DEPTH) + 1);
    }
}
