//! What a wrong click does: shapes whose correspondence is known, with anchors that are wrong.
//!
//! `BARYMAP_DATA=... cargo bench --bench mistakes [-- PAIR]`. Twenty anchors by farthest points; of
//! them one is moved along the source by a distance, or two are exchanged. Errors are means over
//! the target's vertices of the distance to the truth, over the square root of the source's area:
//! of the field with the wrong pairs kept, of the field as it is by default, and of the field
//! without the wrong pairs. Constants were chosen on the first four pairs; those called `judge`
//! judge them, with 27 anchors. `named` are the pairs that the default left out, `*` those that are
//! right.

mod support;

use std::path::Path;

use barymap::geometry::{Geodesics, March, SurfacePoint};
use barymap::models::character_pair;
use barymap::models::shapes::Random;
use barymap::surface::AnchorPairs;
use barymap::surface::correspondence::{CorrespondenceOptions, correspondence};
use barymap::tools::vertex_map::vertex_map;
use support::{Result, Surface, data, once};

const ANCHORS: usize = 20;
/// Draws of each kind.
const DRAWS: usize = 5;

struct Pair {
    name: &'static str,
    source: Surface,
    target: Surface,
    truth: Vec<SurfacePoint>,
}

impl Pair {
    fn same(name: &'static str, source: impl AsRef<Path>, target: impl AsRef<Path>) -> Result<Self> {
        let (source, target) = (Surface::read(source)?, Surface::read(target)?);
        let truth = (0..target.mesh.vertex_count() as u32).map(|v| source.vertex(v)).collect::<Result<_>>()?;
        Ok(Self { name, source, target, truth })
    }

    fn all(filter: &str) -> Result<Vec<Self>> {
        let built_in = character_pair();
        let mut pairs = Vec::new();
        let wanted = |name: &str| name.contains(filter);
        if wanted("built in") {
            let (source, target) = (Surface::new(built_in.source.mesh)?, Surface::new(built_in.target.mesh)?);
            pairs.push(Self { name: "built in", source, target, truth: built_in.truth });
        }
        if let Some(data) = data() {
            for (name, source, target) in [
                ("SMPL", "gt/smpl_same/man.obj", "gt/smpl_same/woman.obj"),
                ("fox", "gt/fox_same/fox_run.obj", "gt/fox_same/fox_rest.obj"),
                ("people", "textured/human_female/human_female.obj", "textured/human_male/human_male.obj"),
                ("judge: SMPL, the other way", "gt/smpl_same/woman.obj", "gt/smpl_same/man.obj"),
                ("judge: another fox", "gt/fox_same/fox_survey.obj", "gt/fox_same/fox_rest.obj"),
                (
                    "judge: people, the other way",
                    "textured/human_male/human_male.obj",
                    "textured/human_female/human_female.obj",
                ),
            ] {
                if wanted(name) {
                    pairs.push(Self::same(name, data.join(source), data.join(target))?);
                }
            }
        }
        Ok(pairs)
    }

    /// Mean and p95 error times 1000, what was left out, and CPU seconds / 2.
    fn run(&self, anchors: &AnchorPairs, keep_all: bool) -> Result<([f64; 2], Vec<usize>, f64)> {
        self.run_with(anchors, &CorrespondenceOptions { keep_all, ..CorrespondenceOptions::default() })
    }

    fn run_with(&self, anchors: &AnchorPairs, options: &CorrespondenceOptions) -> Result<([f64; 2], Vec<usize>, f64)> {
        let (s, t) = (&self.source, &self.target);
        let (map, spent) = once(|| correspondence(s.shape(), t.shape(), anchors, options));
        let map = map?;
        let found = vertex_map((&s.mesh, &s.topology), (&t.mesh, &t.topology), map.as_ref())?;
        let unit = s.mesh.area().sqrt();
        let mut errors: Vec<f64> = (0..self.truth.len())
            .map(|v| found.positions[v].map_or(1.0, |p| p.distance(self.truth[v].position(&s.mesh)) / unit))
            .collect();
        errors.sort_by(f64::total_cmp);
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        let named = map.field().map_or(Vec::new(), |f| f.contradicted.iter().map(|c| c.index).collect());
        Ok(([1e3 * mean, 1e3 * errors[errors.len() * 95 / 100]], named, spent.cpu / 2.0))
    }

    /// A point of the source about so far from the one of this anchor, along the surface.
    fn moved(&self, at: SurfacePoint, by: f64, random: &mut Random) -> Result<SurfacePoint> {
        let s = &self.source;
        let geodesics = Geodesics::new(&s.mesh.positions, &s.mesh.triangles()).unwrap();
        let mut march = March::default();
        let v = s.mesh.triangle(at.face as usize)[0];
        geodesics.distances_from(v, &mut march);
        let unit = s.mesh.area().sqrt();
        let near: Vec<u32> = (0..s.mesh.vertex_count() as u32)
            .filter(|&w| ((march.distances[w as usize] / unit) / by - 1.0).abs() < 0.1)
            .collect();
        if near.is_empty() {
            // Nearer than the vertices are: along an edge.
            let [v, w, _] = s.mesh.triangle(at.face as usize);
            let length = s.mesh.positions[v as usize].distance(s.mesh.positions[w as usize]) / unit;
            let t = (by / length).min(1.0);
            return Ok(SurfacePoint::new(at.face, [1.0 - t, t, 0.0]));
        }
        let pick = near[(random.unit() * near.len() as f64) as usize % near.len()];
        s.vertex(pick)
    }
}

fn main() -> Result<()> {
    let filter = std::env::args().skip(1).find(|a| !a.starts_with('-')).unwrap_or_default();
    println!("| pair | mistake | kept: mean, p95 | default: mean, p95 | without: mean, p95 | named | CPU s / 2 |");
    println!("|---|---|---|---|---|---|---|");
    for pair in Pair::all(&filter)? {
        let count = if pair.name.starts_with("judge") { 27 } else { ANCHORS };
        let vertices = pair.target.farthest(count);
        let exact = AnchorPairs {
            source: vertices.iter().map(|&v| pair.truth[v as usize]).collect(),
            target: vertices.iter().map(|&v| pair.target.vertex(v)).collect::<Result<_>>()?,
        };
        let mut random = Random::new(7);
        let row = |what: &str, anchors: &AnchorPairs, wrong: &[usize]| -> Result<[f64; 2]> {
            let (kept, ..) = pair.run(anchors, true)?;
            let (found, named, seconds) = pair.run(anchors, false)?;
            let without = AnchorPairs {
                source: (0..count).filter(|i| !wrong.contains(i)).map(|i| anchors.source[i]).collect(),
                target: (0..count).filter(|i| !wrong.contains(i)).map(|i| anchors.target[i]).collect(),
            };
            let (ideal, ..) = if wrong.is_empty() { (kept, Vec::new(), 0.0) } else { pair.run(&without, true)? };
            let words: Vec<String> =
                named.iter().map(|i| format!("{i}{}", if wrong.contains(i) { "" } else { "*" })).collect();
            println!(
                "| {} | {what} | {:.1}, {:.1} | {:.1}, {:.1} | {:.1}, {:.1} | {} of {wrong:?} | {seconds:.2} |",
                pair.name,
                kept[0],
                kept[1],
                found[0],
                found[1],
                ideal[0],
                ideal[1],
                words.join(" ")
            );
            Ok([found[0] / ideal[0], found[0] / kept[0]])
        };
        row("none", &exact, &[])?;
        for by in [0.05, 0.1, 0.2, 0.5] {
            let mut logs = [0.0; 2];
            for _ in 0..DRAWS {
                let i = (random.unit() * count as f64) as usize % count;
                let mut anchors = exact.clone();
                anchors.source[i] = pair.moved(exact.source[i], by, &mut random)?;
                let ratios = row(&format!("one off by {by}"), &anchors, &[i])?;
                logs.iter_mut().zip(ratios).for_each(|(l, r)| *l += r.ln() / DRAWS as f64);
            }
            println!("geometric mean over the field without it {:.3}, with it {:.3}", logs[0].exp(), logs[1].exp());
        }
        for noise in [0.005, 0.01, 0.02] {
            let mut log = 0.0;
            for _ in 0..DRAWS {
                let mut anchors = exact.clone();
                for at in &mut anchors.source {
                    // The distance of an error whose mean square is that of the noise.
                    let by = noise * (-random.unit().max(1e-9).ln()).sqrt();
                    *at = pair.moved(*at, by, &mut random)?;
                }
                let (held, ..) = pair.run(&anchors, true)?;
                let (default, named, _) = pair.run(&anchors, false)?;
                let told = CorrespondenceOptions { anchor_error: noise, ..CorrespondenceOptions::default() };
                let (told, _, seconds) = pair.run_with(&anchors, &told)?;
                println!(
                    "| {} | all off by {noise} | held {:.1}, {:.1} | default {:.1}, {:.1} | told {:.1}, {:.1} | {named:?} | {seconds:.2} |",
                    pair.name, held[0], held[1], default[0], default[1], told[0], told[1]
                );
                log += (told[0] / held[0]).ln() / DRAWS as f64;
            }
            println!("geometric mean of told over held {:.3}", log.exp());
        }
        for _ in 0..DRAWS {
            let i = (random.unit() * count as f64) as usize % count;
            let j = (i + 1 + (random.unit() * (count - 1) as f64) as usize) % count;
            let mut anchors = exact.clone();
            anchors.source.swap(i, j);
            row("two exchanged", &anchors, &[i, j])?;
        }
    }
    Ok(())
}
