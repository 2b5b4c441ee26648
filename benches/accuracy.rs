//! Distance to the truth, distortion and honesty of every method, on pairs whose correspondence is
//! known.
//!
//! `cargo bench --bench accuracy [-- PAIR] [-- --align]`. With `--align` only the field, and beside
//! it the field with the target's embedding aligned, whatever anchors left out say of that, and
//! what they say. With `BARYMAP_DATA` the scanned and modelled pairs, else the built-in characters.
//! Errors are distances on the source, over the square root of its area, at all vertices of the
//! target; `by area` weighs each vertex with the area around it, so that finely divided parts do
//! not count more.

mod support;

use std::path::Path;

use barymap::geometry::SurfacePoint;
use barymap::models::character_pair;
use barymap::progress::Quiet;
use barymap::surface::correspondence::{CorrespondenceOptions, Method, Shape, correspondence};
use barymap::surface::quality::summarise;
use barymap::surface::{AlignmentOptions, AnchorPairs, Embedding, Status, align};
use barymap::tools::vertex_map::vertex_map;
use support::{Result, Surface, data};

/// Two surfaces, the true image of each vertex of the target, and anchors that come with them.
struct Pair {
    name: String,
    source: Surface,
    target: Surface,
    truth: Vec<SurfacePoint>,
    given: Option<Vec<u32>>,
}

fn numbers<T: std::str::FromStr>(line: &str) -> Vec<T> {
    line.split_whitespace().filter_map(|w| w.parse().ok()).collect()
}

impl Pair {
    /// Two meshes whose vertices correspond by number.
    fn same(name: &str, source: impl AsRef<Path>, target: impl AsRef<Path>) -> Result<Self> {
        let (source, target) = (Surface::read(source)?, Surface::read(target)?);
        let truth = (0..target.mesh.vertex_count() as u32).map(|v| source.vertex(v)).collect::<Result<_>>()?;
        Ok(Self { name: name.into(), source, target, truth, given: None })
    }

    /// The pairs in the folder of real models.
    fn read(folder: &Path, wanted: &dyn Fn(&str) -> bool) -> Result<Vec<Self>> {
        let mut pairs = Vec::new();
        for (name, source, target) in [
            ("woman to man (SMPL)", "gt/smpl_same/woman.obj", "gt/smpl_same/man.obj"),
            ("man to woman (SMPL)", "gt/smpl_same/man.obj", "gt/smpl_same/woman.obj"),
            ("fox, running to rest", "gt/fox_same/fox_run.obj", "gt/fox_same/fox_rest.obj"),
            ("fox, survey to rest", "gt/fox_same/fox_survey.obj", "gt/fox_same/fox_rest.obj"),
        ] {
            if wanted(name) {
                pairs.push(Self::same(name, folder.join(source), folder.join(target))?);
            }
        }
        let name = "man to woman of other connectivity (SMPL)";
        if wanted(name) {
            let gt = folder.join("gt/smpl_cross");
            let (source, target) = (Surface::read(gt.join("man.obj"))?, Surface::read(gt.join("woman_9k.obj"))?);
            let mut truth = Vec::new();
            for line in std::fs::read_to_string(gt.join("truth.txt"))?.lines() {
                let [face, a, b, c] = numbers::<f64>(line)[..] else { return Err(format!("truth.txt: {line}").into()) };
                truth.push(SurfacePoint::new(face as u32, [a, b, c]));
            }
            pairs.push(Self { name: name.into(), source, target, truth, given: None });
        }
        let name = "woman to man (textured)";
        if wanted(name) {
            let human = |who: &str| folder.join(format!("textured/human_{who}/human_{who}.obj"));
            let mut pair = Self::same(name, human("female"), human("male"))?;
            let lines = std::fs::read_to_string(folder.join("gt/makehuman_same/anchors_80.txt"))?;
            pair.given = Some(lines.lines().filter_map(|l| numbers::<u32>(l).get(1).copied()).collect());
            pairs.push(pair);
        }
        Ok(pairs)
    }

    fn built_in() -> Result<Self> {
        let pair = character_pair();
        Ok(Self {
            name: "strider to stout (built in)".into(),
            source: Surface::new(pair.source.mesh)?,
            target: Surface::new(pair.target.mesh)?,
            truth: pair.truth,
            given: None,
        })
    }

    fn anchors(&self, vertices: &[u32]) -> Result<AnchorPairs> {
        Ok(AnchorPairs {
            source: vertices.iter().map(|&v| self.truth[v as usize]).collect(),
            target: vertices.iter().map(|&v| self.target.vertex(v)).collect::<Result<_>>()?,
        })
    }

    fn row(&self, anchors: &AnchorPairs, method: Method) -> Result<()> {
        let options = CorrespondenceOptions { method, ..CorrespondenceOptions::default() };
        self.row_with(anchors, method.word(), None, &options)
    }

    /// The field with the target's embedding aligned.
    fn aligned(&self, anchors: &AnchorPairs) -> Result<()> {
        let (s, t) = (self.source.shape(), self.target.shape());
        // Whatever the report says.
        let always = AlignmentOptions { gain: f64::NEG_INFINITY, ..AlignmentOptions::default() };
        let made = align(s, t, anchors, &always, &Quiet)?;
        let r = made.report;
        self.row_with(anchors, "field, aligned", made.embedding.as_ref(), &CorrespondenceOptions::default())?;
        println!(
            "left out, missed by {:.5}, before {:.5}: {:.1} standard errors, {:.1} s",
            r.after, r.before, r.standard_errors, r.seconds
        );
        Ok(())
    }

    fn row_with(
        &self,
        anchors: &AnchorPairs,
        name: &str,
        embedding: Option<&Embedding>,
        options: &CorrespondenceOptions,
    ) -> Result<()> {
        let (s, t) = (&self.source, &self.target);
        let shape = Shape { embedding: embedding.or(t.shape().embedding), ..t.shape() };
        let map = correspondence(s.shape(), shape, anchors, options)?;
        let found = vertex_map((&s.mesh, &s.topology), (&t.mesh, &t.topology), map.as_ref())?;
        let unit = s.mesh.area().sqrt();
        let mut area = vec![0.0; t.mesh.vertex_count()];
        for f in (0..t.mesh.triangle_count()).filter(|&f| t.topology.usable[f]) {
            for v in t.mesh.triangle(f) {
                area[v as usize] += t.mesh.triangle_area(f) / 3.0;
            }
        }
        let used: Vec<usize> = (0..area.len()).filter(|&v| area[v] > 0.0).collect();
        let error = |v: usize| {
            let truth = self.truth[v].position(&s.mesh);
            found.positions[v].map_or(f64::INFINITY, |p| p.distance(truth) / unit)
        };
        let e = summarise(&used.iter().map(|&v| error(v)).collect::<Vec<_>>());
        let by_area =
            used.iter().map(|&v| error(v) * area[v]).sum::<f64>() / used.iter().map(|&v| area[v]).sum::<f64>();
        let valid: Vec<usize> = used.iter().copied().filter(|&v| found.images[v].status() == Status::Valid).collect();
        let claimed: f64 = valid.iter().map(|&v| area[v]).sum();
        let off = |x: f64| {
            // An empty sum of floats is -0.
            let wrong = valid.iter().filter(|&&v| error(v) > x).fold(0.0, |sum, &v| sum + area[v]);
            100.0 * wrong / claimed.max(f64::MIN_POSITIVE)
        };
        let d = &found.distortion;
        println!(
            "| {} | {} | {} | {:.4} | {:.4} | {:.4} | {:.4} | {:.3} | {:.2} % | {:.3} | {:.3} | {:.1} % | {:.2} % | {:.2} % |",
            self.name,
            anchors.len(),
            name,
            e.mean,
            by_area,
            e.median,
            e.p95,
            e.max,
            100.0 * d.flipped_area,
            d.stretch_all,
            d.stretch_best95,
            100.0 * found.valid_fraction,
            off(0.02),
            off(0.05)
        );
        Ok(())
    }
}

fn main() -> Result<()> {
    let filter = std::env::args().skip(1).find(|a| !a.starts_with('-')).unwrap_or_default();
    let mut pairs = vec![Pair::built_in()?];
    if let Some(folder) = data() {
        pairs.extend(Pair::read(&folder, &|name| name.contains(&filter))?);
    }
    println!(
        "| pair | anchors | method | mean | by area | median | 95 % | max | flipped | stretch | best 95 % | valid | of it off > 0.02 | > 0.05 |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|---|---|");
    for pair in pairs.iter().filter(|p| p.name.contains(&filter)) {
        let mut sets = vec![pair.target.farthest(27), pair.target.farthest(93)];
        sets.extend(pair.given.clone());
        for vertices in sets {
            let anchors = pair.anchors(&vertices)?;
            if std::env::args().any(|a| a == "--align") {
                pair.row(&anchors, Method::Field)?;
                pair.aligned(&anchors)?;
                continue;
            }
            for method in [Method::Averages, Method::Transport, Method::Field, Method::Rbf, Method::Closest] {
                pair.row(&anchors, method)?;
            }
        }
    }
    Ok(())
}
