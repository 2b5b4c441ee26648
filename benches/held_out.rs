//! Landmarks of really different animals that a map is not told of: how far along the surface it
//! misses them.
//!
//! `BARYMAP_DATA=... cargo bench --bench held_out`. Four pairs of the SHREC quadrupeds with 21
//! landmarks, and cat and lion both ways: in three folds two thirds are anchors, the rest is
//! tested. Errors are geodesic distances on the source over the square root of its area, means over
//! all tested landmarks of a pair.

mod support;

use std::path::Path;

use barymap::geometry::{Geodesics, March};
use barymap::surface::correspondence::{CorrespondenceOptions, Method, correspondence};
use barymap::surface::{AnchorPairs, PackedPoint};
use support::{Result, Surface, data};

const FOLDS: usize = 3;

/// Landmarks by pairs of vertices, source and target.
struct Case {
    name: String,
    source: Surface,
    target: Surface,
    landmarks: Vec<(u32, u32)>,
}

/// The first number of each line.
fn first(file: &Path) -> Result<Vec<u32>> {
    let text = std::fs::read_to_string(file)?;
    Ok(text.lines().filter_map(|l| l.split_whitespace().next()?.parse().ok()).collect())
}

fn cases(folder: &Path) -> Result<Vec<Case>> {
    let mut cases = Vec::new();
    let shrec = folder.join("gt/shrec_quadrupeds");
    for (a, b) in [("381", "384"), ("384", "388"), ("388", "391"), ("391", "381")] {
        let read = |n: &str| Surface::read(shrec.join(format!("{n}.obj")));
        let marks = |n: &str| first(&shrec.join(format!("{n}.vts")));
        let landmarks = marks(a)?.into_iter().zip(marks(b)?).collect();
        cases.push(Case { name: format!("SHREC {a} to {b}"), source: read(a)?, target: read(b)?, landmarks });
    }
    let folder = folder.join("gt/cat_lion");
    let text = std::fs::read_to_string(folder.join("landmarks.txt"))?;
    let mut landmarks: Vec<(u32, u32)> = text
        .lines()
        .filter_map(|l| {
            let mut n = l.split_whitespace().map_while(|w| w.parse().ok());
            Some((n.next()?, n.next()?))
        })
        .collect();
    let (cat, lion) = ("cat-00.obj", "lion-00.obj");
    for (name, a, b) in [("cat to lion", cat, lion), ("lion to cat", lion, cat)] {
        let (source, target) = (Surface::read(folder.join(a))?, Surface::read(folder.join(b))?);
        cases.push(Case { name: name.into(), source, target, landmarks: landmarks.clone() });
        landmarks.iter_mut().for_each(|l| *l = (l.1, l.0));
    }
    Ok(cases)
}

impl Case {
    fn errors(&self, method: Method, relax: Option<bool>) -> Result<Vec<f64>> {
        let (s, t) = (&self.source, &self.target);
        let geodesics = Geodesics::new(&s.mesh.positions, &s.mesh.triangles()).unwrap();
        let mut march = March::default();
        let unit = s.mesh.area().sqrt();
        let mut errors = Vec::new();
        for fold in 0..FOLDS {
            let part = |tested: bool| {
                let of = move |(i, l): (usize, &(u32, u32))| ((i % FOLDS == fold) == tested).then_some(*l);
                self.landmarks.iter().enumerate().filter_map(of)
            };
            let anchors = AnchorPairs {
                source: part(false).map(|l| s.vertex(l.0)).collect::<Result<_>>()?,
                target: part(false).map(|l| t.vertex(l.1)).collect::<Result<_>>()?,
            };
            let options = CorrespondenceOptions { method, relax, confidence: false, ..Default::default() };
            let map = correspondence(s.shape(), t.shape(), &anchors, &options)?;
            let points: Vec<PackedPoint> = part(true).map(|l| Ok(t.vertex(l.1)?.into())).collect::<Result<_>>()?;
            let mut images = Vec::new();
            map.map(&points, &mut images)?;
            for (l, image) in part(true).zip(images) {
                let Some(p) = image.point() else {
                    errors.push(1.0);
                    continue;
                };
                geodesics.distances_from(l.0, &mut march);
                let v = s.mesh.triangle(p.face as usize);
                errors.push((0..3).map(|k| p.barycentric[k] * march.distances[v[k] as usize]).sum::<f64>() / unit);
            }
        }
        Ok(errors)
    }
}

fn main() -> Result<()> {
    let Some(folder) = data() else {
        println!("BARYMAP_DATA names no folder of real models: nothing to measure");
        return Ok(());
    };
    let cases = cases(&folder)?;
    let methods = [
        ("closest", Method::Closest, None),
        ("rbf", Method::Rbf, None),
        ("rbf --relax", Method::Rbf, Some(true)),
        ("averages", Method::Averages, None),
        ("transport", Method::Transport, None),
        ("field", Method::Field, None),
    ];
    println!("| pair | {} |", methods.map(|m| m.0).join(" | "));
    println!("|---|{}", "---|".repeat(methods.len()));
    let mut sums = vec![0.0; methods.len()];
    for case in &cases {
        print!("| {} |", case.name);
        for (sum, (_, method, relax)) in sums.iter_mut().zip(methods) {
            let e = case.errors(method, relax)?;
            let mean = e.iter().sum::<f64>() / e.len() as f64;
            *sum += mean;
            print!(" {mean:.4} |");
        }
        println!();
    }
    let means: Vec<String> = sums.iter().map(|s| format!("{:.4}", s / cases.len() as f64)).collect();
    println!("| mean | {} |", means.join(" | "));
    Ok(())
}
