//! The back ends against one another: where `cpu` and `gpu` put the vertices of a target, and where `reference` does.
//!
//! `cargo bench --bench back_ends [-- PAIR]`. Every pair whose anchors are known, in both directions, with 27 and 93 anchors far from one another and with those that come with it. Distances are in mean
//! edges of the source, at all vertices of the target; `apart` counts those farther than a thousandth of an edge, `claimed` those of them that either side calls valid.

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

impl Pair {
    /// Meshes of the same connectivity.
    fn same(folder: &Path, source: &str, target: &str) -> Result<Self> {
        let (source, target) = (Surface::read(folder.join(source))?, Surface::read(folder.join(target))?);
        let set = |n: usize| -> Result<AnchorPairs> {
            let vertices = target.farthest(n);
            let on = |s: &Surface| vertices.iter().map(|&v| s.vertex(v)).collect::<Result<Vec<SurfacePoint>>>();
            Ok(AnchorPairs { source: on(&source)?, target: on(&target)? })
        };
        let anchors = vec![set(27)?, set(93)?];
        Ok(Self { name: format!("{} to {}", source.mesh.name, target.mesh.name), source, target, anchors })
    }

    /// Meshes with these pairs of vertices.
    fn given(folder: &Path, source: &str, target: &str, pairs: &[[u32; 2]]) -> Result<Self> {
        let (source, target) = (Surface::read(folder.join(source))?, Surface::read(folder.join(target))?);
        let on = |s: &Surface, k: usize| pairs.iter().map(|p| s.vertex(p[k])).collect::<Result<Vec<SurfacePoint>>>();
        let anchors = vec![AnchorPairs { source: on(&source, 0)?, target: on(&target, 1)? }];
        Ok(Self { name: format!("{} to {}", source.mesh.name, target.mesh.name), source, target, anchors })
    }

    fn read(folder: &Path) -> Result<Vec<Self>> {
        let mut pairs = Vec::new();
        let both = |pairs: &mut Vec<Self>, a: &str, b: &str| -> Result<()> {
            pairs.push(Self::same(folder, a, b)?);
            pairs.push(Self::same(folder, b, a)?);
            Ok(())
        };
        both(&mut pairs, "gt/smpl_same/woman.obj", "gt/smpl_same/man.obj")?;
        let fox = |pose: &str| format!("gt/fox_same/fox_{pose}.obj");
        for (a, b) in [("rest", "run"), ("rest", "survey"), ("run", "survey")] {
            both(&mut pairs, &fox(a), &fox(b))?;
        }
        let human = |who: &str| format!("textured/human_{who}/human_{who}.obj");
        both(&mut pairs, &human("female"), &human("male"))?;
        let landmarks = numbers(&folder.join("gt/cat_lion/landmarks.txt"))?;
        let landmarks: Vec<[u32; 2]> = landmarks.iter().map(|l| [l[0] as u32, l[1] as u32]).collect();
        let turned: Vec<[u32; 2]> = landmarks.iter().map(|l| [l[1], l[0]]).collect();
        let (cat, lion) = ("gt/cat_lion/cat-00.obj", "gt/cat_lion/lion-00.obj");
        pairs.push(Self::given(folder, cat, lion, &landmarks)?);
        pairs.push(Self::given(folder, lion, cat, &turned)?);
        let animals = ["381", "384", "388", "391"];
        let marks = |a: &str| -> Result<Vec<u32>> {
            let lines = numbers(&folder.join(format!("gt/shrec_quadrupeds/{a}.vts")))?;
            Ok(lines.iter().filter_map(|l| l.first()).map(|&v| v as u32).collect())
        };
        for a in animals {
            for b in animals.into_iter().filter(|b| *b != a) {
                let together: Vec<[u32; 2]> = marks(a)?.into_iter().zip(marks(b)?).map(|(a, b)| [a, b]).collect();
                let path = |a: &str| format!("gt/shrec_quadrupeds/{a}.obj");
                pairs.push(Self::given(folder, &path(a), &path(b), &together)?);
            }
        }
        // Of other connectivity, with a true image for each vertex of the target.
        let (man, woman) = ("gt/smpl_cross/man.obj", "gt/smpl_cross/woman_9k.obj");
        let (source, target) = (Surface::read(folder.join(man))?, Surface::read(folder.join(woman))?);
        let truth = numbers(&folder.join("gt/smpl_cross/truth.txt"))?;
        let there = |v: u32| {
            let l = &truth[v as usize];
            SurfacePoint::new(l[0] as u32, [l[1], l[2], l[3]])
        };
        let set = |n: usize| -> Result<AnchorPairs> {
            let vertices = target.farthest(n);
            let on = vertices.iter().map(|&v| target.vertex(v)).collect::<Result<_>>()?;
            Ok(AnchorPairs { source: vertices.iter().map(|&v| there(v)).collect(), target: on })
        };
        let anchors = vec![set(27)?, set(93)?];
        pairs.push(Self { name: "man to woman of other connectivity".into(), source, target, anchors });
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
        pairs.extend(Pair::read(&folder)?);
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
                        method.name(),
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
