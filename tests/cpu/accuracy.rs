//! The accuracy of the correspondence on real pairs whose truth is known, and the honesty of its
//! statuses.
//!
//! Errors are distances in space between image and truth over the square root of the source's area.

use barymap::geometry::{Geodesics, March, SurfacePoint};
use barymap::surface::correspondence::{CorrespondenceOptions, Method, Precision, correspondence};
use barymap::surface::quality::{ErrorSummary, summarise};
use barymap::surface::{AnchorPairs, EmbeddingOptions, Status};
use barymap::tools::vertex_map::{VertexMap, vertex_map};
use glam::DVec3;

use crate::common::{data, load};
use crate::embedded::Embedded;

fn read(file: &str) -> Embedded {
    Embedded::new(load(file), &EmbeddingOptions::default())
}

/// A pair with its anchors and the true image of each target vertex.
struct Pair<'a> {
    source: &'a Embedded,
    target: &'a Embedded,
    anchors: AnchorPairs,
    truth: Vec<DVec3>,
}

/// What a method achieves on a pair.
struct Outcome {
    error: ErrorSummary,
    errors: Vec<f64>,
    map: VertexMap,
}

impl<'a> Pair<'a> {
    /// Meshes of the same connectivity: vertex i is vertex i.
    fn same(source: &'a Embedded, target: &'a Embedded, vertices: &[u32]) -> Self {
        let anchors = AnchorPairs {
            source: vertices.iter().map(|&v| source.point(v)).collect(),
            target: vertices.iter().map(|&v| target.point(v)).collect(),
        };
        Self { source, target, anchors, truth: source.mesh.positions.clone() }
    }

    fn map(&self, method: Method) -> Outcome {
        let options =
            CorrespondenceOptions { method, precision: Precision::Single, ..CorrespondenceOptions::default() };
        let map = correspondence(self.source.shape(), self.target.shape(), &self.anchors, &options).unwrap();
        let sides = ((&self.source.mesh, &self.source.topology), (&self.target.mesh, &self.target.topology));
        let map = vertex_map(sides.0, sides.1, map.as_ref()).unwrap();
        let unit = self.source.mesh.area().sqrt();
        // A point that was not found counts as far off.
        let errors: Vec<f64> =
            self.truth.iter().zip(&map.positions).map(|(t, p)| p.map_or(1.0, |p| p.distance(*t) / unit)).collect();
        Outcome { error: summarise(&errors), errors, map }
    }

    /// Area of the target around each of its vertices.
    fn areas(&self) -> Vec<f64> {
        let mut area = vec![0.0; self.target.mesh.vertex_count()];
        for t in 0..self.target.mesh.triangle_count() {
            for v in self.target.mesh.triangle(t) {
                area[v as usize] += self.target.mesh.triangle_area(t) / 3.0;
            }
        }
        area
    }

    /// Mean error over the surface.
    fn mean_by_area(&self, outcome: &Outcome) -> f64 {
        let area = self.areas();
        outcome.errors.iter().zip(&area).map(|(e, a)| e * a).sum::<f64>() / area.iter().sum::<f64>()
    }

    /// Shares of the target's area: claimed valid, and of that off by more than 0.02 and 0.05.
    fn honesty(&self, outcome: &Outcome) -> [f64; 3] {
        let area = self.areas();
        let sum = |f: &dyn Fn(usize) -> bool| (0..area.len()).filter(|&v| f(v)).map(|v| area[v]).sum::<f64>();
        let valid = |v: usize| outcome.map.images[v].status() == Status::Valid;
        let claimed = sum(&valid);
        [
            claimed / sum(&|_| true),
            sum(&|v| valid(v) && outcome.errors[v] > 0.02) / claimed,
            sum(&|v| valid(v) && outcome.errors[v] > 0.05) / claimed,
        ]
    }
}

fn say(name: &str, method: &str, o: &Outcome) {
    println!(
        "{name} {method}: mean {:.4} median {:.4} p95 {:.4} max {:.3}, flipped {:.2} %, stretch {:.3} / {:.3}",
        o.error.mean,
        o.error.median,
        o.error.p95,
        o.error.max,
        100.0 * o.map.distortion.flipped_area,
        o.map.distortion.stretch_all,
        o.map.distortion.stretch_best95
    );
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn smpl_and_fox_pairs_meet_the_bar_of_the_study() {
    // The bars of the issue: mean error 0.008 (SMPL 0.0045) with 93 anchors, and with 27 at most
    // 0.75 of what the published method has.
    for (name, source, target, bar) in [
        ("smpl", "gt/smpl_same/man.obj", "gt/smpl_same/woman.obj", 0.0045),
        ("fox survey to rest", "gt/fox_same/fox_survey.obj", "gt/fox_same/fox_rest.obj", 0.008),
        ("fox run to rest", "gt/fox_same/fox_run.obj", "gt/fox_same/fox_rest.obj", 0.008),
        ("fox rest to run", "gt/fox_same/fox_rest.obj", "gt/fox_same/fox_run.obj", 0.008),
    ] {
        let (source, target) = (read(source), read(target));
        let pair = Pair::same(&source, &target, &target.spread(93));
        let (averages, transport) = (pair.map(Method::Averages), pair.map(Method::Transport));
        say(name, "averages, 93", &averages);
        say(name, "transport, 93", &transport);
        assert!(transport.error.mean <= bar, "{name}: {}", transport.error.mean);
        // The study that set the bar had its surfaces remeshed evenly, which is the mean by area.
        // Over the vertices as they are, most of them in the fox's face and feet, the published
        // method has up to 0.0096.
        let published = pair.mean_by_area(&averages);
        println!("{name} averages, 93: mean by area {published:.4}");
        assert!(published <= 0.008 && averages.error.mean <= 0.0098, "{name}: {published}");
        assert!(transport.map.distortion.flipped_area <= 0.04);
        assert!(transport.error.mean < averages.error.mean);
        let few = Pair::same(&source, &target, &target.spread(27));
        let (averages, transport) = (few.map(Method::Averages), few.map(Method::Transport));
        say(name, "averages, 27", &averages);
        say(name, "transport, 27", &transport);
        assert!(transport.error.mean <= 0.75 * averages.error.mean, "{name} with 27 anchors");
    }
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn what_is_claimed_valid_on_the_human_pair_is_right() {
    let woman = read("textured/human_female/human_female.obj");
    let man = read("textured/human_male/human_male.obj");
    let text = std::fs::read_to_string(data("gt/makehuman_same/anchors_80.txt")).unwrap();
    let vertices: Vec<u32> =
        text.lines().filter_map(|l| l.split_whitespace().next()).map(|v| v.parse().unwrap()).collect();
    assert_eq!(vertices.len(), 80);
    for (name, source, target) in [("woman to man", &woman, &man), ("man to woman", &man, &woman)] {
        let pair = Pair::same(source, target, &vertices);
        for method in [Method::Averages, Method::Transport, Method::Field] {
            let o = pair.map(method);
            say(name, method.word(), &o);
            let [valid, off02, off05] = pair.honesty(&o);
            println!("{name} {}: valid {valid:.4}, of that off by 0.02 {off02:.4}, by 0.05 {off05:.4}", method.word());
            if method != Method::Averages {
                // Points of turned-over triangles are doubtful, and only the field mends these.
                let least = if method == Method::Field { 0.97 } else { 0.92 };
                assert!(valid >= least && off02 <= 0.05 && off05 <= 0.005, "{name}: {valid} {off02} {off05}");
            }
        }
    }
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn different_connectivity_with_known_truth() {
    let (man, woman, truth) = cross();
    let text = std::fs::read_to_string(data("gt/smpl_cross/anchors_80.txt")).unwrap();
    let vertices: Vec<u32> = text.lines().map(|l| l.trim().parse().unwrap()).collect();
    let anchors = AnchorPairs {
        source: vertices.iter().map(|&v| truth[v as usize]).collect(),
        target: vertices.iter().map(|&v| woman.point(v)).collect(),
    };
    let positions = truth.iter().map(|p| p.position(&man.mesh)).collect();
    let pair = Pair { source: &man, target: &woman, anchors, truth: positions };
    let transport = pair.map(Method::Transport);
    say("smpl_cross", "transport, 80", &transport);
    assert!(transport.error.mean <= 0.0045 && transport.map.distortion.flipped_area <= 0.04);
    let field = pair.map(Method::Field);
    say("smpl_cross", "field, 80", &field);
    assert!(field.error.mean <= 0.0015 && field.map.distortion.flipped_area <= 1e-3);
    // The measure can fail: with two anchors exchanged the map is far worse.
    let mut wrong = pair.anchors.clone();
    wrong.source.rotate_left(1);
    let wrong = Pair { anchors: wrong, truth: pair.truth.clone(), ..pair };
    assert!(wrong.map(Method::Transport).error.mean > 0.05);
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn round_trips_on_one_mesh() {
    let man = read("gt/smpl_same/man.obj");
    let pair = Pair::same(&man, &man, &man.spread(93));
    let edge = man.mesh.mean_edge_length() / man.mesh.area().sqrt();
    let transport = pair.map(Method::Transport);
    let within = transport.errors.iter().filter(|&&e| e <= edge).count() as f64 / transport.errors.len() as f64;
    println!("transport: {:.3} % of the vertices return within one edge", 100.0 * within);
    assert!(within >= 0.999, "{within}");

    // As published some do not return; their confidence is among the lowest tenth.
    let averages = pair.map(Method::Averages);
    let mut order: Vec<usize> = (0..averages.errors.len()).collect();
    order.sort_by(|&a, &b| averages.map.images[a].confidence.total_cmp(&averages.map.images[b].confidence));
    let off = |list: &[usize]| list.iter().filter(|&&v| averages.errors[v] > edge).count();
    let (worst, all) = (off(&order[..order.len() / 10]), off(&order));
    println!("averages: {all} of {} vertices do not return, {worst} of them in the least trusted tenth", order.len());
    assert!(all > 0 && worst as f64 >= 0.7 * all as f64, "{worst} of {all}");
}

/// The pair of different connectivity, every vertex of the target with its place on the source.
fn cross() -> (Embedded, Embedded, Vec<SurfacePoint>) {
    let (man, woman) = (read("gt/smpl_cross/man.obj"), read("gt/smpl_cross/woman_9k.obj"));
    let text = std::fs::read_to_string(data("gt/smpl_cross/truth.txt")).unwrap();
    let point = |l: &str| {
        let n: Vec<f64> = l.split_whitespace().map(|x| x.parse().unwrap()).collect();
        SurfacePoint::new(n[0] as u32, [n[1], n[2], n[3]])
    };
    (man, woman, text.lines().map(point).collect())
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn the_field_is_nearer_to_the_truth_than_every_other_method() {
    let humans = ["male", "female"].map(|w| read(&format!("textured/human_{w}/human_{w}.obj")));
    let foxes = ["run", "rest", "survey"].map(|w| read(&format!("gt/fox_same/fox_{w}.obj")));
    let smpl = ["man", "woman"].map(|w| read(&format!("gt/smpl_same/{w}.obj")));
    let (man, woman, truth) = cross();
    let same = [
        (&humans[0], &humans[1]),
        (&humans[1], &humans[0]),
        (&foxes[0], &foxes[1]),
        (&foxes[1], &foxes[0]),
        (&foxes[2], &foxes[1]),
        (&foxes[0], &foxes[2]),
        (&smpl[0], &smpl[1]),
        (&smpl[1], &smpl[0]),
    ];
    // Sums of logarithms: mean error over rbf and averages, 95th percentile over both.
    let (mut sums, mut runs) = ([0.0; 4], 0.0);
    for k in 0..=same.len() {
        let (source, target) = same.get(k).copied().unwrap_or((&man, &woman));
        let name = format!("{} to {}", source.mesh.name, target.mesh.name);
        let mut few = 0.0;
        for anchors in [21, 27, 64, 93] {
            let vertices = target.spread(anchors);
            let pair = if k < same.len() {
                Pair::same(source, target, &vertices)
            } else {
                let anchors = AnchorPairs {
                    source: vertices.iter().map(|&v| truth[v as usize]).collect(),
                    target: vertices.iter().map(|&v| target.point(v)).collect(),
                };
                Pair { source, target, anchors, truth: truth.iter().map(|p| p.position(&man.mesh)).collect() }
            };
            let outcome = |method: Method| {
                let o = pair.map(method);
                say(&name, &format!("{}, {anchors}", method.word()), &o);
                o
            };
            let (field, rbf, averages) = (outcome(Method::Field), outcome(Method::Rbf), outcome(Method::Averages));
            let ratios = [
                field.error.mean / rbf.error.mean,
                field.error.mean / averages.error.mean,
                field.error.p95 / rbf.error.p95,
                field.error.p95 / averages.error.p95,
            ];
            println!("{name}, {anchors}: field / rbf {:.3}, field / averages {:.3}", ratios[0], ratios[1]);
            assert!(ratios[0] <= 0.95 && ratios[1] <= 0.85, "{name}, {anchors}: {ratios:?}");
            // Some are before the repair.
            assert_eq!(field.map.distortion.flipped_faces, 0, "{name}, {anchors}");
            sums.iter_mut().zip(ratios).for_each(|(s, r)| *s += f64::ln(r));
            runs += 1.0;
            if anchors == 27 {
                few = field.error.mean;
            } else if anchors == 93 {
                let ratio = few / averages.error.mean;
                println!("{name}: field with 27 anchors / averages with 93 {ratio:.3}");
                assert!(ratio <= 1.0, "{name}: {ratio}");
            }
        }
    }
    let mean = sums.map(|s| f64::exp(s / runs));
    println!("geometric means of mean error and 95th percentile, over rbf and averages: {mean:.3?}");
    assert!(mean[0] <= 0.6 && mean[1] <= 0.35 && mean[2] <= 0.6 && mean[3] <= 0.35, "{mean:?}");
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn a_cluster_of_anchors_spoils_nothing_elsewhere() {
    let foxes = ["run", "rest", "survey"].map(|w| read(&format!("gt/fox_same/fox_{w}.obj")));
    for (source, target) in [(&foxes[0], &foxes[1]), (&foxes[1], &foxes[0]), (&foxes[0], &foxes[2])] {
        let spread = target.spread(16);
        // Forty more around one of them: every third of the vertices nearest to it.
        let mut march = March::default();
        Geodesics::new(&target.mesh.positions, &target.mesh.triangles()).unwrap().distances_from(spread[1], &mut march);
        let mut near: Vec<u32> = (0..target.mesh.vertex_count() as u32).collect();
        near.sort_by(|&a, &b| march.distances[a as usize].total_cmp(&march.distances[b as usize]).then(a.cmp(&b)));
        let mut clustered = spread.clone();
        clustered.extend(near.iter().skip(3).step_by(3).take(40).filter(|v| !spread.contains(v)));
        let error = |vertices: &[u32]| Pair::same(source, target, vertices).map(Method::Field).error.mean;
        let (few, more) = (error(&spread), error(&clustered));
        println!(
            "{} to {}: {} anchors {few:.4}, with a cluster {} anchors {more:.4}",
            source.mesh.name,
            target.mesh.name,
            spread.len(),
            clustered.len()
        );
        assert!(more <= few, "{more} {few}");
    }
}

#[test]
#[ignore = "needs BARYMAP_DATA"]
fn the_field_returns_on_one_mesh() {
    let man = read("gt/smpl_same/man.obj");
    let edge = man.mesh.mean_edge_length() / man.mesh.area().sqrt();
    for anchors in [27, 93] {
        let field = Pair::same(&man, &man, &man.spread(anchors)).map(Method::Field);
        let within = field.errors.iter().filter(|&&e| e <= edge).count() as f64 / field.errors.len() as f64;
        println!("field, {anchors} anchors: {:.3} % of the vertices return within one edge", 100.0 * within);
        assert!(within >= 0.999, "{within}");
    }
}
