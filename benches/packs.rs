//! Shapes as from different packs: a naked body, and another one in clothes, of few polygons, with
//! horns or a tail, whose true correspondence is known.
//!
//! `BARYMAP_DATA=... cargo bench --bench packs [-- PAIR]`. Anchors by farthest points, each off by
//! up to half a per cent of the square root of the area, as set by eye. Errors times 1000 are means
//! over the target's vertices of the distance to the truth, over the square root of the source's
//! area; flipped is the share of the target's area that is turned over; of what is claimed valid,
//! `off` is the share off by more than 0.02 and 0.05. Constants were chosen on the first pairs;
//! those called `judge` judge them.

mod support;

use std::path::Path;

use barymap::geometry::{Mesh, SurfacePoint, Texcoords};
use barymap::models::shapes::Random;
use barymap::models::{Outfit, dressed};
use barymap::surface::correspondence::{CorrespondenceOptions, Method, correspondence};
use barymap::surface::field::{FieldOptions, FieldPair, Relaxation};
use barymap::surface::{AnchorPairs, PointMap, Status};
use barymap::tools::vertex_map::vertex_map;
use glam::DVec3;
use support::{Result, Surface, data, once};

/// Numbers of anchors.
const ANCHORS: [usize; 2] = [16, 54];
/// What anchors are off by, at most, over the square root of the area.
const SLOPPY: f64 = 0.005;

/// Low polygon, coat, boots, collar, goggles.
const CLOTHED: Outfit = Outfit {
    coat: 0.018,
    folds: 0.0,
    collar: 0.03,
    boots: 0.014,
    goggles: 0.015,
    horns: 0.0,
    tail: 0.0,
    wider: 0.0,
    vertices: 1500,
};
/// Of the first pairs, the body that is dressed, and how.
const PAIRS: [(&str, &str, &str, Outfit); 6] = [
    ("clothed woman to man", "gt/smpl_same/man.obj", "gt/smpl_same/woman.obj", CLOTHED),
    (
        "bulky man with folds and horns to woman",
        "textured/human_female/human_female.obj",
        "textured/human_male/human_male.obj",
        Outfit { folds: 0.012, wider: 0.3, horns: 0.09, goggles: 0.0, vertices: 3000, ..CLOTHED },
    ),
    (
        "thin fox with tail to fox",
        "gt/fox_same/fox_run.obj",
        "gt/fox_same/fox_rest.obj",
        Outfit { wider: -0.25, tail: 0.2, horns: 0.1, vertices: 1500, ..NONE },
    ),
    (
        "judge: clothed man to woman, the other way",
        "textured/human_female/human_female.obj",
        "textured/human_male/human_male.obj",
        Outfit { coat: 0.025, ..CLOTHED },
    ),
    (
        "judge: folded man with tail to woman",
        "gt/smpl_same/woman.obj",
        "gt/smpl_same/man.obj",
        Outfit { folds: 0.015, tail: 0.2, goggles: 0.0, vertices: 2500, ..CLOTHED },
    ),
    (
        "judge: bulky fox to another",
        "gt/fox_same/fox_survey.obj",
        "gt/fox_same/fox_rest.obj",
        Outfit { wider: 0.4, coat: 0.03, vertices: 2000, ..NONE },
    ),
];
const NONE: Outfit = Outfit {
    coat: 0.0,
    folds: 0.0,
    collar: 0.0,
    boots: 0.0,
    goggles: 0.0,
    horns: 0.0,
    tail: 0.0,
    wider: 0.0,
    vertices: 0,
};

/// What is compared.
enum How {
    Method(Method, Option<bool>),
    Field(Relaxation),
}

const METHODS: [(&str, How); 9] = [
    ("field", How::Method(Method::Field, None)),
    ("field, planes", How::Field(Relaxation::Planes)),
    ("field, planes alone", How::Field(Relaxation::PlanesAlone)),
    ("field, points", How::Field(Relaxation::Points)),
    ("field, points alone", How::Field(Relaxation::PointsAlone)),
    ("field, not relaxed", How::Field(Relaxation::Off)),
    ("rbf", How::Method(Method::Rbf, Some(false))),
    ("rbf, relaxed", How::Method(Method::Rbf, Some(true))),
    ("transport", How::Method(Method::Transport, None)),
];

impl How {
    fn map(&self, s: &Surface, t: &Surface, anchors: &AnchorPairs) -> Result<Box<dyn PointMap>> {
        match *self {
            Self::Method(method, relax) => {
                let options = CorrespondenceOptions { method, relax, ..CorrespondenceOptions::default() };
                Ok(correspondence(s.shape(), t.shape(), anchors, &options)?)
            }
            Self::Field(relaxation) => {
                let options = FieldOptions { relaxation: Some(relaxation), keep_all: true, ..FieldOptions::default() };
                let pair = FieldPair::<8>::new(s.shape(), t.shape())?;
                Ok(Box::new(pair.field::<f32, 12>(anchors, &options)?))
            }
        }
    }
}

fn main() -> Result<()> {
    let Some(data) = data() else { return Ok(()) };
    let filter = std::env::args().skip(1).find(|a| !a.starts_with('-')).unwrap_or_default();
    println!(
        "| pair | anchors | method | mean | p95 | flipped % | valid % | off % | expected median, p95; truth below p95 % | CPU s / 2 |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for (name, source, target, outfit) in PAIRS.iter().filter(|p| p.0.contains(&filter)) {
        pair(&data, name, source, target, outfit)?;
    }
    halves(&data, &filter)
}

/// Sources cut in half, across or along, with anchors on what is left; the target is whole.
const HALVES: [(&str, &str, &str, DVec3); 4] = [
    ("SMPL, upper half", "gt/smpl_same/man.obj", "gt/smpl_same/woman.obj", DVec3::Y),
    ("fox, front half", "gt/fox_same/fox_run.obj", "gt/fox_same/fox_rest.obj", DVec3::Z),
    (
        "judge: people, upper half",
        "textured/human_female/human_female.obj",
        "textured/human_male/human_male.obj",
        DVec3::Y,
    ),
    ("judge: SMPL, one side", "gt/smpl_same/woman.obj", "gt/smpl_same/man.obj", DVec3::X),
];

/// How much of what has no image is claimed to be valid, and of what has one.
fn halves(data: &Path, filter: &str) -> Result<()> {
    println!(
        "\n| source cut | anchors | without an image: valid % | with one: valid %, mean | whole source: valid %, mean |"
    );
    println!("|---|---|---|---|---|");
    for (name, source, target, across) in HALVES.iter().filter(|p| p.0.contains(filter)) {
        let (whole, target) = (Surface::read(data.join(source))?, Surface::read(data.join(target))?);
        let (low, high) = whole.mesh.bounds().ok_or("an empty mesh")?;
        let middle = across.dot(0.5 * (low + high));
        let kept = |v: u32| across.dot(whole.mesh.positions[v as usize]) > middle;
        let triangles: Vec<[u32; 3]> =
            whole.mesh.triangles().iter().copied().filter(|t| t.iter().all(|&v| kept(v))).collect();
        let mut number = vec![u32::MAX; whole.mesh.vertex_count()];
        let mut used: Vec<u32> = triangles.iter().flatten().copied().collect();
        used.sort_unstable();
        used.dedup();
        used.iter().zip(0..).for_each(|(&v, k)| number[v as usize] = k);
        let triangles: Vec<[u32; 3]> = triangles.iter().map(|t| t.map(|v| number[v as usize])).collect();
        let places = used.iter().map(|&v| whole.mesh.positions[v as usize]).collect();
        let half = Surface::new(Mesh::from_arrays("half", places, &triangles, Texcoords::None)?)?;
        let vertices: Vec<u32> =
            target.farthest(80).into_iter().filter(|&v| number[v as usize] != u32::MAX).take(27).collect();
        let on = |s: &Surface, number: &dyn Fn(u32) -> u32| -> Result<AnchorPairs> {
            Ok(AnchorPairs {
                source: vertices.iter().map(|&v| s.vertex(number(v))).collect::<Result<_>>()?,
                target: vertices.iter().map(|&v| target.vertex(v)).collect::<Result<_>>()?,
            })
        };
        let unit = whole.mesh.area().sqrt();
        let run = |s: &Surface, anchors: &AnchorPairs, has: bool| -> Result<[f64; 2]> {
            let map = correspondence(s.shape(), target.shape(), anchors, &CorrespondenceOptions::default())?;
            let found = vertex_map((&s.mesh, &s.topology), (&target.mesh, &target.topology), map.as_ref())?;
            let (mut area, mut valid, mut error) = (0.0, 0.0, 0.0);
            for t in 0..target.mesh.triangle_count() {
                let v = target.mesh.triangle(t);
                if v.iter().any(|&v| (number[v as usize] != u32::MAX) != has) {
                    continue;
                }
                let a = target.mesh.triangle_area(t);
                area += a;
                if v.iter().all(|&v| found.images[v as usize].status() == Status::Valid) {
                    valid += a;
                }
                let off = |v: u32| {
                    found.positions[v as usize].map_or(1.0, |p| p.distance(whole.mesh.positions[v as usize]) / unit)
                };
                error += a * v.iter().map(|&v| off(v)).sum::<f64>() / 3.0;
            }
            Ok([100.0 * valid / area, 1e3 * error / area])
        };
        let anchors = on(&half, &|v| number[v as usize])?;
        let without = run(&half, &anchors, false)?;
        let with = run(&half, &anchors, true)?;
        let before = run(&whole, &on(&whole, &|v| v)?, true)?;
        println!(
            "| {name} | {} | {:.2} | {:.1}, {:.1} | {:.1}, {:.1} |",
            anchors.len(),
            without[0],
            with[0],
            with[1],
            before[0],
            before[1]
        );
    }
    Ok(())
}

fn pair(data: &Path, name: &str, source: &str, target: &str, outfit: &Outfit) -> Result<()> {
    let s = Surface::read(data.join(source))?;
    let worn = dressed(&barymap::io::read_mesh(data.join(target))?.mesh, outfit)?;
    let truth: Vec<SurfacePoint> = worn.truth.iter().map(|&v| s.vertex(v)).collect::<Result<_>>()?;
    let t = Surface::new(worn.mesh)?;
    let unit = s.mesh.area().sqrt();
    for count in ANCHORS {
        let vertices = t.farthest(count);
        let mut random = Random::new(11);
        let anchors = AnchorPairs {
            source: vertices.iter().map(|&v| sloppy(&s, truth[v as usize], unit, &mut random)).collect(),
            target: vertices.iter().map(|&v| t.vertex(v)).collect::<Result<_>>()?,
        };
        for (what, how) in METHODS {
            let (map, spent) = once(|| how.map(&s, &t, &anchors));
            let map = map?;
            let found = vertex_map((&s.mesh, &s.topology), (&t.mesh, &t.topology), map.as_ref())?;
            let errors: Vec<f64> = (0..truth.len())
                .map(|v| found.positions[v].map_or(1.0, |p| p.distance(truth[v].position(&s.mesh)) / unit))
                .collect();
            let valid: Vec<f64> =
                (0..truth.len()).filter(|&v| found.images[v].status() == Status::Valid).map(|v| errors[v]).collect();
            let off = |by: f64| 100.0 * valid.iter().filter(|e| **e > by).count() as f64 / valid.len().max(1) as f64;
            let expected = map.field().and_then(|f| f.expected).map_or(String::new(), |e| {
                let within = e.p95.map_or(f64::INFINITY, |p| p);
                let below = errors.iter().filter(|e| **e <= within).count();
                let times = |e: Option<f64>| e.map_or("unknown".to_owned(), |e| format!("{:.1}", 1e3 * e));
                format!("{}, {}; {:.0}", times(e.median), times(e.p95), 100.0 * below as f64 / errors.len() as f64)
            });
            let mut sorted = errors.clone();
            sorted.sort_by(f64::total_cmp);
            println!(
                "| {name} | {count} | {what} | {:.1} | {:.1} | {:.2} | {:.0} | {:.1}, {:.1} | {} | {:.2} |",
                1e3 * errors.iter().sum::<f64>() / errors.len() as f64,
                1e3 * sorted[sorted.len() * 95 / 100],
                100.0 * found.distortion.flipped_area,
                100.0 * found.valid_fraction,
                off(0.02),
                off(0.05),
                expected,
                spent.cpu / 2.0
            );
        }
    }
    Ok(())
}

/// A point of the same triangle, up to [`SLOPPY`] away.
fn sloppy(s: &Surface, at: SurfacePoint, unit: f64, random: &mut Random) -> SurfacePoint {
    let corners = s.mesh.triangle(at.face as usize).map(|v| s.mesh.positions[v as usize]);
    let length = corners[0].distance(corners[1]).max(corners[0].distance(corners[2])) / unit;
    let along = random.unit();
    let t = (SLOPPY * random.unit() / length).min(1.0);
    let corner = at.dominant_corner();
    let mut barycentric = [0.0; 3];
    barycentric[corner] = 1.0 - t;
    barycentric[(corner + 1) % 3] = t * along;
    barycentric[(corner + 2) % 3] = t * (1.0 - along);
    SurfacePoint::new(at.face, barycentric)
}
