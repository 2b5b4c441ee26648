//! The back ends against one another: where `cpu` and `gpu` put the vertices of a target, and where
//! `reference` does.
//!
//! `cargo bench --bench back_ends [-- PAIR]`. Every pair whose anchors are known, in both
//! directions, with 27 and 93 anchors far from one another and with those that come with it.
//! Distances are in mean edges of the source, at all vertices of the target; `apart` counts those
//! farther than a thousandth of an edge, `claimed` those of them that either side calls valid.

mod support;

use std::path::Path;

use barymap::engine::{Backend, Engine, EngineOptions};
use barymap::geometry::SurfacePoint;
use barymap::models::character_pair;
use barymap::surface::correspondence::{CorrespondenceOptions, Method};
use barymap::surface::gpu::correspondence_on;
use barymap::surface::{AnchorPairs, PackedImage, Status};
use barymap::tools::vertex_map::vertex_images;
use support::{Result, Surface, data};

/// Images farther apart than this are two decisions, in mean edges.
const APART: f64 = 1e-3;

/// Two surfaces and sets of anchors.
struct Pair {
    name: String,
    source: Surface,
    target: Surface,
    anchors: Vec<AnchorPairs>,
}

fn numbers(path: &Path) -> Result<Vec<Vec<f64>>> {
    let line = |l: &str| l.split_whitespace().filter_map(|w| w.parse().ok()).collect::<Vec<f64>>();
    Ok(std::fs::read_to_string(path)?.lines().map(line).filter(|l| !l.is_empty()).collect())
}

/// What a pair is called by the paths of its meshes.
fn name(source: &str, target: &str) -> String {
    let stem = |path: &str| path.rsplit('/').next().unwrap_or(path).trim_end_matches(".obj").to_owned();
    format!("{} to {}", stem(source), stem(target))
}

impl Pair {
    /// Meshes with anchors that `set` makes of so many vertices of the target, 27 and 93.
    fn new(
        folder: &Path,
        [source, target]: [&str; 2],
        there: &dyn Fn(&Surface, u32) -> Result<SurfacePoint>,
    ) -> Result<Self> {
        let name = name(source, target);
        let (source, target) = (Surface::read(folder.join(source))?, Surface::read(folder.join(target))?);
        let set = |n: usize| -> Result<AnchorPairs> {
            let vertices = target.farthest(n);
            let on = vertices.iter().map(|&v| target.vertex(v)).collect::<Result<_>>()?;
            Ok(AnchorPairs { source: vertices.iter().map(|&v| there(&source, v)).collect::<Result<_>>()?, target: on })
        };
        let anchors = vec![set(27)?, set(93)?];
        Ok(Self { name, source, target, anchors })
    }

    /// Meshes with these pairs of vertices.
    fn given(folder: &Path, [source, target]: [&str; 2], pairs: &[[u32; 2]]) -> Result<Self> {
        let name = name(source, target);
        let (source, target) = (Surface::read(folder.join(source))?, Surface::read(folder.join(target))?);
        let on = |s: &Surface, k: usize| pairs.iter().map(|p| s.vertex(p[k])).collect::<Result<Vec<SurfacePoint>>>();
        let anchors = vec![AnchorPairs { source: on(&source, 0)?, target: on(&target, 1)? }];
        Ok(Self { name, source, target, anchors })
    }

    /// The pairs of the folder of real models whose names are wanted.
    fn read(folder: &Path, wanted: &dyn Fn(&str) -> bool) -> Result<Vec<Self>> {
        let mut pairs = Vec::new();
        let wanted = |pair: &[&str; 2]| wanted(&name(pair[0], pair[1]));
        // Of the same connectivity.
        let same = [
            ["gt/smpl_same/woman.obj", "gt/smpl_same/man.obj"],
            ["gt/fox_same/fox_rest.obj", "gt/fox_same/fox_run.obj"],
            ["gt/fox_same/fox_rest.obj", "gt/fox_same/fox_survey.obj"],
            ["gt/fox_same/fox_run.obj", "gt/fox_same/fox_survey.obj"],
            ["textured/human_female/human_female.obj", "textured/human_male/human_male.obj"],
        ];
        for pair in same.into_iter().flat_map(|[a, b]| [[a, b], [b, a]]).filter(wanted) {
            pairs.push(Self::new(folder, pair, &|source, v| source.vertex(v))?);
        }
        // Of other connectivity, with a true image for each vertex of the target.
        for pair in [["gt/smpl_cross/man.obj", "gt/smpl_cross/woman_9k.obj"]].into_iter().filter(wanted) {
            let truth = numbers(&folder.join("gt/smpl_cross/truth.txt"))?;
            pairs.push(Self::new(folder, pair, &|_, v| {
                let l = &truth[v as usize];
                Ok(SurfacePoint::new(l[0] as u32, [l[1], l[2], l[3]]))
            })?);
        }
        // With landmarks.
        let (cat, lion) = ("gt/cat_lion/cat-00.obj", "gt/cat_lion/lion-00.obj");
        for pair in [[cat, lion], [lion, cat]].into_iter().filter(wanted) {
            let lines = numbers(&folder.join("gt/cat_lion/landmarks.txt"))?;
            let first = usize::from(pair[0] == lion);
            let marks: Vec<[u32; 2]> = lines.iter().map(|l| [l[first] as u32, l[1 - first] as u32]).collect();
            pairs.push(Self::given(folder, pair, &marks)?);
        }
        let animals = ["381", "384", "388", "391"].map(|a| format!("gt/shrec_quadrupeds/{a}"));
        for (a, b) in animals.iter().flat_map(|a| animals.iter().map(move |b| (a, b))).filter(|(a, b)| a != b) {
            let files = [format!("{a}.obj"), format!("{b}.obj")];
            let pair = [files[0].as_str(), files[1].as_str()];
            if wanted(&pair) {
                let marks = |a: &str| numbers(&folder.join(format!("{a}.vts")));
                let both = marks(a)?.into_iter().zip(marks(b)?).map(|(a, b)| [a[0] as u32, b[0] as u32]);
                pairs.push(Self::given(folder, pair, &both.collect::<Vec<_>>())?);
            }
        }
        Ok(pairs)
    }

    fn built_in() -> Result<Self> {
        let pair = character_pair();
        let anchors = [27, 93].map(|n| {
            let (source, target) = pair.anchors(n);
            AnchorPairs { source, target }
        });
        let (source, target) = (Surface::new(pair.source.mesh)?, Surface::new(pair.target.mesh)?);
        Ok(Self { name: "strider to stout (built in)".into(), source, target, anchors: anchors.to_vec() })
    }

    fn images(&self, engine: &Engine, anchors: &AnchorPairs, method: Method) -> Result<Vec<PackedImage>> {
        let options = CorrespondenceOptions { method, ..CorrespondenceOptions::default() };
        let (map, _) = correspondence_on(engine, self.source.shape(), self.target.shape(), anchors, &options)?;
        Ok(vertex_images(&self.target.mesh, &self.target.topology, map.as_ref())?)
    }
}

fn main() -> Result<()> {
    let filter = std::env::args().skip(1).find(|a| !a.starts_with('-')).unwrap_or_default();
    let mut pairs = vec![Pair::built_in()?];
    if let Some(folder) = data() {
        pairs.extend(Pair::read(&folder, &|name| name.contains(&filter))?);
    }
    let engine = |backend| Engine::new(EngineOptions { backend, ..EngineOptions::default() });
    let reference = engine(Backend::Reference)?;
    let mut others = vec![engine(Backend::Cpu)?];
    others.extend(engine(Backend::Gpu).ok());
    println!(
        "| pair | anchors | method | back end | vertices | median | largest | apart | claimed | judged otherwise |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for pair in pairs.iter().filter(|p| p.name.contains(&filter)) {
        for anchors in &pair.anchors {
            for method in [Method::Field, Method::Transport, Method::Averages] {
                let truth = pair.images(&reference, anchors, method)?;
                for other in &others {
                    let images = pair.images(other, anchors, method)?;
                    let edge = pair.source.mesh.mean_edge_length();
                    let place = |i: &PackedImage| i.point().map(|p| p.position(&pair.source.mesh));
                    let (mut distances, mut claimed, mut otherwise) = (Vec::new(), 0, 0);
                    for (v, (a, b)) in truth.iter().zip(&images).enumerate() {
                        let d = match (place(a), place(b)) {
                            (Some(a), Some(b)) => a.distance(b) / edge,
                            (None, None) => continue,
                            _ => f64::INFINITY,
                        };
                        let valid = a.status() == Status::Valid || b.status() == Status::Valid;
                        if d > APART && valid {
                            claimed += 1;
                            if std::env::args().any(|a| a == "--list") {
                                println!("vertex {v}: {a:?} {b:?} {d:.3}");
                            }
                        }
                        otherwise += usize::from(a.status != b.status);
                        distances.push(d);
                    }
                    distances.sort_by(f64::total_cmp);
                    let apart = distances.iter().filter(|d| **d > APART).count();
                    println!(
                        "| {} | {} | {} | {} | {} | {:.1e} | {:.1e} | {apart} | {claimed} | {otherwise} |",
                        pair.name,
                        anchors.len(),
                        method.word(),
                        other.description().backend,
                        distances.len(),
                        distances[distances.len() / 2],
                        distances[distances.len() - 1],
                    );
                }
            }
        }
    }
    Ok(())
}
