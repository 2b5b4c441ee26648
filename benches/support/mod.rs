//! What the benches share: clocks, meshes with embeddings kept between runs, points and anchors.
#![allow(dead_code, reason = "each bench is a program of its own and uses a part of this")]

use std::path::{Path, PathBuf};
use std::time::Instant;

use barymap::geometry::{Geodesics, Mesh, SurfacePoint, Topology, sampling};
use barymap::models::shapes::Random;
use barymap::progress::Quiet;
use barymap::surface::anchors::vertex_point;
use barymap::surface::correspondence::Shape;
use barymap::surface::embedding::cache_key;
use barymap::surface::{AnchorPairs, Embedding, EmbeddingOptions, PackedPoint};

/// Any error ends a bench.
pub(crate) type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// Time spent.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Spent {
    /// Wall seconds.
    pub(crate) wall: f64,
    /// Seconds of all threads of this process together.
    pub(crate) cpu: f64,
}

impl Spent {
    /// Nanoseconds of CPU time / 2 per item: the measure all figures of this project use.
    pub(crate) fn per_item(self, items: usize) -> f64 {
        self.cpu / 2.0 / items as f64 * 1e9
    }
}

/// CPU seconds of the threads that live; wall time by all threads where the system does not tell.
pub(crate) fn cpu_seconds(start: Instant) -> f64 {
    let threads = std::fs::read_dir("/proc/self/task").into_iter().flatten().flatten();
    let nanoseconds: f64 = threads
        .filter_map(|t| std::fs::read_to_string(t.path().join("schedstat")).ok())
        .filter_map(|s| s.split(' ').next()?.parse::<f64>().ok())
        .sum();
    if nanoseconds > 0.0 {
        nanoseconds * 1e-9
    } else {
        start.elapsed().as_secs_f64() * rayon::current_num_threads() as f64
    }
}

/// Runs `job` once.
pub(crate) fn once<T>(job: impl FnOnce() -> T) -> (T, Spent) {
    let start = Instant::now();
    let before = cpu_seconds(start);
    let result = job();
    (result, Spent { cpu: cpu_seconds(start) - before, wall: start.elapsed().as_secs_f64() })
}

/// Runs `job` once to warm up, then `rounds` times; the least of each kind of time.
pub(crate) fn best(rounds: usize, mut job: impl FnMut() -> Result<()>) -> Result<Spent> {
    job()?;
    let mut least = Spent { wall: f64::INFINITY, cpu: f64::INFINITY };
    for _ in 0..rounds {
        let (done, spent) = once(&mut job);
        done?;
        least = Spent { wall: least.wall.min(spent.wall), cpu: least.cpu.min(spent.cpu) };
    }
    Ok(least)
}

/// The folder of real models, if the environment names one.
pub(crate) fn data() -> Option<PathBuf> {
    let folder = std::env::var_os("BARYMAP_DATA").map(PathBuf::from);
    if folder.is_none() {
        println!("BARYMAP_DATA is not set: built-in models only");
    }
    folder
}

/// A mesh with its adjacency and embedding.
pub(crate) struct Surface {
    pub(crate) mesh: Mesh,
    pub(crate) topology: Topology,
    pub(crate) embedding: Embedding,
}

impl Surface {
    /// Embeds `mesh` with the default options, or takes the embedding of an earlier run.
    pub(crate) fn new(mesh: Mesh) -> Result<Self> {
        let topology = Topology::new(&mesh);
        let options = EmbeddingOptions::default();
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("embeddings");
        let file = folder.join(cache_key(&mesh, &options));
        let kept = std::fs::read(&file).ok().and_then(|b| Embedding::from_bytes(&b).ok());
        let embedding = match kept {
            Some(e) => e,
            None => {
                let e = Embedding::compute(&mesh, &topology, &options, &Quiet)?;
                std::fs::create_dir_all(&folder)?;
                std::fs::write(&file, e.to_bytes())?;
                e
            }
        };
        Ok(Self { mesh, topology, embedding })
    }

    /// Reads and embeds a mesh.
    pub(crate) fn read(path: impl AsRef<Path>) -> Result<Self> {
        Self::new(barymap::io::read_mesh(path)?.mesh)
    }

    /// What the methods take.
    pub(crate) fn shape(&self) -> Shape<'_> {
        Shape { mesh: &self.mesh, topology: &self.topology, embedding: Some(&self.embedding) }
    }

    /// Up to `count` vertices by farthest-point sampling along the surface.
    pub(crate) fn farthest(&self, count: usize) -> Vec<u32> {
        sampling::farthest_points(&Geodesics::new(&self.mesh.positions, &self.mesh.triangles()).unwrap(), 0, count)
    }

    /// A vertex as a point of one of its triangles.
    pub(crate) fn vertex(&self, v: u32) -> Result<SurfacePoint> {
        Ok(vertex_point(&self.mesh, &self.topology, v, "anchor")?)
    }

    /// `count` farthest-point anchors of this surface, paired with themselves.
    pub(crate) fn self_anchors(&self, count: usize) -> Result<AnchorPairs> {
        let points: Vec<SurfacePoint> =
            self.farthest(count).into_iter().map(|v| self.vertex(v)).collect::<Result<_>>()?;
        Ok(AnchorPairs { source: points.clone(), target: points })
    }
}

/// Points spread evenly over the area of `mesh`, the same ones for the same seed.
pub(crate) fn random_points(mesh: &Mesh, count: usize, seed: u64) -> Vec<PackedPoint> {
    let mut sums = Vec::with_capacity(mesh.triangle_count());
    let mut area = 0.0;
    for t in 0..mesh.triangle_count() {
        area += mesh.triangle_area(t);
        sums.push(area);
    }
    let mut random = Random::new(seed);
    (0..count)
        .map(|_| {
            let at = random.unit() * area;
            let face = sums.partition_point(|&s| s <= at).min(sums.len() - 1) as u32;
            let (r, s) = (random.unit().sqrt(), random.unit());
            PackedPoint { face, b0: (1.0 - r) as f32, b1: (r * (1.0 - s)) as f32 }
        })
        .collect()
}

/// Starts the program again without the driver's cache of compiled shaders, unless it runs so
/// already: first dispatches then hold their compilation. The driver reads the variable once, and a
/// program cannot safely set its own environment.
pub(crate) fn without_shader_cache() -> Result<()> {
    if std::env::var_os("MESA_SHADER_CACHE_DISABLE").is_none() {
        let mut again = std::process::Command::new(std::env::current_exe()?);
        let status = again.args(std::env::args_os().skip(1)).env("MESA_SHADER_CACHE_DISABLE", "true").status()?;
        std::process::exit(status.code().unwrap_or(1));
    }
    Ok(())
}
