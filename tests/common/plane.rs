//! Maps in the plane in single precision against double precision on the same rounded input: cases,
//! points and the comparison.
#![allow(dead_code, reason = "each test binary uses a part of this")]

use barymap::engine::Engine;
use barymap::geometry::Polygon;
use barymap::mapping::plane::{Coordinates, Frame, Step, map_points, map_points_with_derivatives};
use barymap::models::polygons::{self, PolygonPair, star};
use glam::DVec2;

/// A step in single precision, and the truth about it.
pub(crate) struct Case {
    pub(crate) name: String,
    pub(crate) step: Step<f32>,
    pub(crate) truth: Step<f64>,
    /// The polygon it starts from, in local coordinates, as rounded.
    pub(crate) polygon: Polygon,
    /// How many times as long an edge becomes, at most.
    pub(crate) stretch: f64,
}

impl Case {
    /// The step of a pair whose coordinates are multiplied by `size` and moved by `offset`.
    pub(crate) fn new(name: &str, pair: &PolygonPair, size: f64, offset: DVec2) -> Self {
        let placed = |polygon: &Polygon| {
            Polygon::from_loops(
                polygon.loops().iter().map(|ring| ring.iter().map(|v| *v * size + offset).collect()).collect(),
            )
        };
        let (from, to) = (placed(&pair.source), placed(&pair.target));
        let scale = Frame::common_scale([&from, &to]);
        let step = Step::<f32>::new(Coordinates::MeanValue, &from, &to, scale);
        let frame = Frame::of(&from, scale);
        let rounded = |v: &DVec2| DVec2::from(frame.local::<f32>(*v).map(f64::from));
        let polygon = Polygon::from_loops(from.loops().iter().map(|ring| ring.iter().map(rounded).collect()).collect());
        let edges = |polygon: &Polygon| -> Vec<f64> {
            let vertices: Vec<DVec2> = polygon.vertices().collect();
            polygon.corners().map(|c| vertices[c.index].distance(vertices[c.after])).collect()
        };
        let stretch = edges(&to).iter().zip(edges(&from)).map(|(to, from)| to / from).fold(0.0, f64::max);
        Self { name: format!("{name} x {size:e}"), truth: step.cast(), step, polygon, stretch }
    }

    /// Length of the diagonal of the polygon's bounding box.
    pub(crate) fn diameter(&self) -> f64 {
        self.polygon.size()
    }

    /// Vertices.
    pub(crate) fn count(&self) -> usize {
        self.polygon.vertex_count()
    }
}

fn pair(source: Vec<Vec<DVec2>>, target: Vec<Vec<DVec2>>) -> PolygonPair {
    PolygonPair { source: Polygon::from_loops(source), target: Polygon::from_loops(target) }
}

/// A star with notches of a depth to the regular polygon.
pub(crate) fn notched(n: usize, depth: f64) -> PolygonPair {
    let ring = |radii: &[f64]| vec![star(n, radii, 0.1, DVec2::splat(0.5))];
    pair(ring(&[0.45, 0.45 - depth]), ring(&[0.40]))
}

/// With deep notches.
pub(crate) fn to_regular(n: usize) -> PolygonPair {
    notched(n, 0.15)
}

/// Pairs of 3 to 4,096 vertices, with and without reflex vertices and holes.
pub(crate) fn pairs() -> Vec<(String, PolygonPair)> {
    let nested = polygons::nested_squares();
    let quarter = nested.source.loops().iter().zip(nested.target.loops());
    let quarter = quarter.map(|(a, b)| a.iter().zip(b).map(|(v, w)| v.lerp(*w, 0.25)).collect()).collect();
    let triangle = |x: f64| vec![vec![DVec2::ZERO, DVec2::new(1.0, 0.1), DVec2::new(x, 0.8)]];
    let mut all = vec![
        ("triangle".to_string(), pair(triangle(0.3), triangle(0.9))),
        ("square corner".to_string(), polygons::square_corner(0.3)),
        ("folded corner".to_string(), polygons::square_corner(0.7)),
        ("nested squares".to_string(), PolygonPair { target: Polygon::from_loops(quarter), ..nested }),
        ("inverted star".to_string(), polygons::inverted_star()),
        ("twisted star".to_string(), polygons::twisted_star()),
        ("hexagons".to_string(), polygons::convex_witness()),
    ];
    all.extend([8, 64, 512].map(|n| (format!("regular {n}"), to_regular(n))));
    all
}

/// Points of a polygon by where they lie.
pub(crate) struct Points {
    /// Inside, among them points on edges, at vertices and 1e-7 of the size away from both.
    pub(crate) inside: Vec<[f32; 2]>,
    /// How many of them, at the end, are the vertices in order.
    pub(crate) vertices: usize,
}

fn contains(polygon: &Polygon, p: DVec2) -> bool {
    let mut inside = false;
    for ring in polygon.loops() {
        for (i, a) in ring.iter().enumerate() {
            let b = ring[(i + 1) % ring.len()];
            inside ^= (a.y <= p.y) != (b.y <= p.y) && a.x + (p.y - a.y) / (b.y - a.y) * (b.x - a.x) > p.x;
        }
    }
    inside
}

/// A raster of `side` x `side` inside the polygon, and what lies on and next to its edges and
/// vertices.
pub(crate) fn points(case: &Case, side: usize) -> Points {
    let (low, high) = case.polygon.bounds();
    let mut all: Vec<DVec2> = (0..side * side)
        .map(|i| low + (high - low) * (DVec2::new((i % side) as f64, (i / side) as f64) + 0.5) / side as f64)
        .collect();
    let vertices: Vec<DVec2> = case.polygon.vertices().collect();
    let size = case.diameter();
    let every = (vertices.len() / 64).max(1);
    for corner in case.polygon.corners().step_by(every) {
        let (a, b) = (vertices[corner.index], vertices[corner.after]);
        let normal = (b - a).normalize_or_zero().perp();
        for along in [0.5, 0.25, 0.001, 0.999] {
            all.push(a.lerp(b, along));
            for away in [1e-7, 1e-6, 1e-5, 1e-4, 1e-3] {
                all.push(a.lerp(b, along) + normal * away * size);
            }
        }
        for direction in 0..16 {
            let angle = DVec2::from_angle(std::f64::consts::TAU * f64::from(direction) / 16.0);
            all.extend([1e-7, 1e-5, 1e-3].map(|away| a + angle * away * size));
        }
    }
    let on_edge = |p: DVec2| {
        case.polygon.corners().any(|c| {
            let (a, b) = (vertices[c.index], vertices[c.after]);
            let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
            (a.lerp(b, t) - p).length() < 1e-7 * size
        })
    };
    let rounded = |p: DVec2| [p.x as f32, p.y as f32];
    let mut inside: Vec<[f32; 2]> = all
        .into_iter()
        .map(rounded)
        .filter(|p| {
            let p = DVec2::from(p.map(f64::from));
            contains(&case.polygon, p) || on_edge(p)
        })
        .collect();
    inside.extend(vertices.iter().map(|v| rounded(*v)));
    Points { inside, vertices: vertices.len() }
}

/// What a back end made of points.
pub(crate) struct Mapped {
    pub(crate) images: Vec<[f32; 2]>,
    pub(crate) derivatives: Vec<[[f32; 2]; 2]>,
}

/// Through one step on `engine`.
pub(crate) fn mapped(engine: &Engine, step: &Step<f32>, points: &[[f32; 2]]) -> Mapped {
    let mut images = points.to_vec();
    let mut derivatives = vec![[[f32::NAN; 2]; 2]; points.len()];
    map_points_with_derivatives(engine, std::slice::from_ref(step), &mut images, &mut derivatives).unwrap();
    let mut alone = points.to_vec();
    map_points(engine, std::slice::from_ref(step), &mut alone).unwrap();
    // Two forms of one map, each exact to a few roundings.
    for (i, (a, b)) in alone.iter().zip(&images).enumerate() {
        let off = (a[0] - b[0]).abs().max((a[1] - b[1]).abs());
        let allowed = 1e-6 * (1.0 + points[i][0].abs().max(points[i][1].abs()));
        assert!(off <= allowed, "point {i}: {a:?} without derivatives, {b:?} with them");
    }
    Mapped { images, derivatives }
}

/// Largest errors: of images, relative to the diameter; of Jacobians, relative to what is accepted.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Worst {
    pub(crate) image: f64,
    pub(crate) jacobian: f64,
}

/// Half a unit in the last place of 1 in single precision.
const ROUNDING: f64 = 5.960_464_477_539_063e-8;

/// The error of a Jacobian in single precision that is accepted.
///
/// Up to 64 vertices 5e-6 max(1, |J|), beyond that in proportion to their number n: where edges are
/// 1 / n of the size, the place of a point between them, and with it the derivative, is known to n
/// roundings of the size (the sums add little to that, since they are taken by blocks: at 512
/// vertices 1.4e-5 is found where 4e-5 is accepted, at 4,096 deep notches 1.9e-4 where 3.2e-4 is).
///
/// Edges that are stretched several times are the exception: the derivative is as large next to
/// them, and a determinant that cancels keeps a few roundings of the squares of its entries.
/// Between the stored hexagons, which have one that becomes eight times as long, these sum to 190;
/// rounding the exact entries to single precision alone costs 6.9e-6, more than the 5e-6 that
/// others keep, and all roundings together 1.6e-5: no form of the same entries can do better.
pub(crate) fn jacobian_tolerance(case: &Case, derivative: &[[f64; 2]; 2], jacobian: f64) -> f64 {
    let square: f64 = derivative.iter().flatten().map(|d| d * d).sum();
    let entries = if case.stretch > 4.0 { 3.0 * ROUNDING * square } else { 0.0 };
    5e-6 * (case.count() as f64 / 64.0).max(1.0) * jacobian.abs().max(1.0) + entries
}

/// The largest errors of `mapped` at `points`; `None` if something is not finite.
pub(crate) fn worst(case: &Case, points: &[[f32; 2]], mapped: &Mapped) -> Option<Worst> {
    let mut worst = Worst::default();
    for ((p, q), d) in points.iter().zip(&mapped.images).zip(&mapped.derivatives) {
        let truth = case.truth.evaluate(p.map(f64::from));
        let (q, d) = (q.map(f64::from), d.map(|row| row.map(f64::from)));
        let image = (q[0] - truth.point[0]).hypot(q[1] - truth.point[1]) / case.diameter();
        let jacobian = d[0][0] * d[1][1] - d[0][1] * d[1][0];
        let accepted = jacobian_tolerance(case, &truth.derivative, truth.jacobian);
        let error = (jacobian - truth.jacobian).abs() / accepted;
        if !(image.is_finite() && error.is_finite()) {
            return None;
        }
        worst.image = worst.image.max(image);
        worst.jacobian = worst.jacobian.max(error);
    }
    Some(worst)
}

/// Says what is wrong with `mapped`, if anything: images to 1e-6 of the diameter, Jacobians to
/// [`jacobian_tolerance`], vertices exactly on their images.
pub(crate) fn fault(case: &Case, points: &Points, mapped: &Mapped) -> Option<String> {
    let Some(worst) = worst(case, &points.inside, mapped) else { return Some(format!("{}: not finite", case.name)) };
    if worst.image > 1e-6 || worst.jacobian > 1.0 {
        return Some(format!("{}: {worst:?}", case.name));
    }
    let first = points.inside.len() - points.vertices;
    for i in 0..points.vertices {
        let image = case.step.map(points.inside[first + i]);
        if mapped.images[first + i] != image {
            return Some(format!("{}: vertex {i} is at {:?}, not {image:?}", case.name, mapped.images[first + i]));
        }
    }
    None
}

/// Points at distances of 0.75 to 10 diameters from the centre.
pub(crate) fn far_points(case: &Case) -> Vec<[f32; 2]> {
    let distances = [0.75, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0];
    let at = |i: usize| {
        let distance = distances[i % distances.len()] * case.diameter();
        DVec2::from_angle(i as f64 * 2.4) * distance
    };
    (0..700).map(at).map(|p| [p.x as f32, p.y as f32]).collect()
}

/// Says what is wrong outside, at distance R from a polygon of diameter h: images to the larger of
/// 1e-6 and 2e-7 (R / h)^2 of the diameter, times how many times R the map moves the point if that
/// is more than 1: the error is one of the weights, which the displacement multiplies.
///
/// 1e-6 because weights of single precision do not give less near the polygon: seen from outside,
/// the angles have both signs, and their sum cancels to (h / R)^2 while each has its own roundings.
/// With sums in double precision over the same weights, errors relative to 2e-7 (R / h)^2 stay what
/// they are: 3.9 at 0.3 to 0.5 h, 1.9 at 0.75 to 1 h and 0.9 at 1.5 to 2 h of the triangle (5.6,
/// 2.7 and 1.5 of the hexagons), where all in single precision has 4.6, 1.8 and 1.1 (9.6, 3.0 and
/// 1.7).
pub(crate) fn far_fault(case: &Case, points: &[[f32; 2]], images: &[[f32; 2]]) -> Option<String> {
    let h = case.diameter();
    for (p, q) in points.iter().zip(images) {
        let p = DVec2::from(p.map(f64::from));
        let truth = DVec2::from(case.truth.map(p.into()));
        let r = p.length();
        let accepted = (2e-7 * (r / h).powi(2)).max(1e-6) * ((truth - p).length() / r).max(1.0);
        let error = (DVec2::from(q.map(f64::from)) - truth).length() / h;
        // Not-a-number is not accepted either.
        if !(error <= accepted) {
            return Some(format!("{}: {error:e} at distance {}", case.name, r / h));
        }
    }
    None
}

/// Everything that has to hold on `engine` for the pairs of [`pairs`] at three sizes; every other
/// result is spoilt once, and must be refused.
pub(crate) fn check_accuracy(engine: &Engine) {
    for (name, pair) in pairs() {
        for size in [1e-3, 1.0, 1e6] {
            let case = Case::new(&name, &pair, size, DVec2::new(0.37, -1.3) * size);
            let points = points(&case, if case.count() > 100 { 16 } else { 48 });
            let mut found = mapped(engine, &case.step, &points.inside);
            assert_eq!(fault(&case, &points, &found), None);
            let far = far_points(&case);
            let mut images = far.clone();
            map_points(engine, std::slice::from_ref(&case.step), &mut images).unwrap();
            assert_eq!(far_fault(&case, &far, &images), None);

            images[321][1] += 1e-4;
            assert!(far_fault(&case, &far, &images).is_some(), "{name}: an image beside its place passes");
            let count = points.inside.len();
            let kept = found.images[count - 1];
            found.images[count - 1][0] += 1e-7;
            assert!(fault(&case, &points, &found).is_some(), "{name}: a vertex beside its image passes");
            found.images[count - 1] = kept;
            let kept = found.derivatives[7];
            found.derivatives[7][0][0] *= -1.0;
            assert!(fault(&case, &points, &found).is_some(), "{name}: a wrong sign passes");
            found.derivatives[7] = kept;
            found.derivatives[11][1][0] = f32::NAN;
            assert!(fault(&case, &points, &found).is_some(), "{name}: what is not a number passes");
        }
    }
}

/// Many steps of a linear path from a star with notches to the regular polygon.
pub(crate) fn path(n: usize, steps: usize) -> Vec<Polygon> {
    let pair = to_regular(n);
    let at = |k: usize| {
        let t = k as f64 / steps as f64;
        let loops = pair.source.loops().iter().zip(pair.target.loops());
        Polygon::from_loops(loops.map(|(a, b)| a.iter().zip(b).map(|(v, w)| v.lerp(*w, t)).collect()).collect())
    };
    (0..=steps).map(at).collect()
}

/// Largest distance, in polygons' diameters, between a composite of `steps` steps on `engine` and
/// in double precision.
pub(crate) fn drift(engine: &Engine, n: usize, steps: usize) -> f64 {
    let polygons = path(n, steps);
    let scale = Frame::common_scale(&polygons);
    let chain: Vec<Step<f32>> =
        polygons.windows(2).map(|p| Step::new(Coordinates::MeanValue, &p[0], &p[1], scale)).collect();
    let exact: Vec<Step<f64>> =
        polygons.windows(2).map(|p| Step::new(Coordinates::MeanValue, &p[0], &p[1], scale)).collect();
    let side = 12;
    let (low, high) = polygons[0].bounds();
    let frame = Frame::of(&polygons[0], scale);
    let start: Vec<[f32; 2]> = (0..side * side)
        .map(|i| low + (high - low) * (DVec2::new((i % side) as f64, (i / side) as f64) + 0.5) / side as f64)
        .filter(|p| contains(&polygons[0], *p))
        .map(|p| frame.local(p))
        .collect();
    let mut images = start.clone();
    map_points(engine, &chain, &mut images).unwrap();
    let size = polygons[0].size() * scale;
    let distance = |(p, q): (&[f32; 2], &[f32; 2])| {
        let truth = exact.iter().fold(p.map(f64::from), |p, step| step.map(p));
        (DVec2::from(truth) - DVec2::from(q.map(f64::from))).length() / size
    };
    start.iter().zip(&images).map(distance).fold(0.0, f64::max)
}
