//! A shape with what is known of it.

use std::path::Path;
use std::sync::Arc;

use crate::error::Result;
use crate::geometry::{Diagnosis, Mesh, Topology};
use crate::io::cache::Cache;
use crate::io::{GltfScene, LoadedMesh, ReadOptions, read_mesh_with};
use crate::progress::Progress;
use crate::surface::correspondence::Shape;
use crate::surface::embedding::cache_key;
use crate::surface::{Embedding, EmbeddingOptions};

/// A shape: its mesh, adjacency and, once made, its embedding. Owned; it can be sent to another
/// thread.
#[derive(Clone, Debug)]
pub struct Subject {
    /// The mesh, with the numbers of its file.
    pub mesh: Mesh,
    /// Its adjacency.
    pub topology: Topology,
    /// Its embedding, once [`Subject::embed`] has made it.
    pub embedding: Option<Embedding>,
    /// What its file holds beside the mesh, if that is glTF.
    pub scene: Option<Arc<GltfScene>>,
    /// What the reader and the diagnosis found, one sentence each.
    pub notes: Vec<String>,
}

impl Subject {
    /// A mesh that was made in memory. O(F).
    ///
    /// # Errors
    /// [`Error::Mesh`](crate::Error::Mesh) if it has no usable triangle.
    pub fn new(mesh: Mesh) -> Result<Self> {
        let topology = Topology::new(&mesh);
        let diagnosis = Diagnosis::new(&mesh, &topology);
        diagnosis.is_usable()?;
        let notes = diagnosis.findings().iter().map(|finding| format!("{}: {finding}", mesh.name)).collect();
        Ok(Self { mesh, topology, embedding: None, scene: None, notes })
    }

    /// The mesh of a file.
    ///
    /// # Errors
    /// As [`read_mesh_with`] and [`Subject::new`].
    pub fn open(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Self> {
        let path = path.as_ref();
        Self::loaded(path, read_mesh_with(path, options)?)
    }

    /// A mesh that was read from `path`.
    ///
    /// # Errors
    /// As [`Subject::new`].
    pub fn loaded(path: &Path, loaded: LoadedMesh) -> Result<Self> {
        let mut subject = Self::new(loaded.mesh)?;
        let read = loaded.warnings.iter().map(|warning| format!("{}: {warning}", path.display()));
        subject.notes = read.chain(subject.notes).collect();
        subject.scene = loaded.scene;
        Ok(subject)
    }

    /// What the methods need.
    pub fn shape(&self) -> Shape<'_> {
        Shape { mesh: &self.mesh, topology: &self.topology, embedding: self.embedding.as_ref() }
    }

    /// Embeds the shape, or takes its embedding from the cache; one that it has already is kept, so
    /// that the options must be the same for all calls. Returns sentences for the user.
    ///
    /// # Errors
    /// As [`Embedding::compute`].
    pub fn embed(&mut self, options: &EmbeddingOptions, cache: &Cache, progress: &dyn Progress) -> Result<Vec<String>> {
        if self.embedding.is_some() {
            return Ok(Vec::new());
        }
        let mut notes = Vec::new();
        let key = cache_key(&self.mesh, options);
        let fits = |e: &Embedding| e.points.len() == self.mesh.vertex_count() * options.dimension;
        let cached = cache.get(&key).and_then(|bytes| Embedding::from_bytes(&bytes).ok()).filter(fits);
        let embedding = match cached {
            Some(embedding) => embedding,
            None => {
                let made = Embedding::compute(&self.mesh, &self.topology, options, progress)?;
                if let Err(error) = cache.put(&key, &made.to_bytes()) {
                    notes.push(format!("the embedding is not cached: {error}"));
                }
                made
            }
        };
        notes.extend(embedding.warnings.iter().map(|warning| format!("{}: {warning}", self.mesh.name)));
        self.embedding = Some(embedding);
        Ok(notes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::shapes::lobed_sphere;
    use crate::progress::Quiet;

    #[test]
    fn a_subject_is_sent_between_threads_and_embedded_once() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::in_folder(folder.path());
        let options = EmbeddingOptions { landmarks: 30, ..EmbeddingOptions::default() };
        let mut subject = Subject::new(lobed_sphere(2, 0.2)).unwrap();
        subject = std::thread::spawn(move || {
            subject.embed(&options, &cache, &Quiet).unwrap();
            subject
        })
        .join()
        .unwrap();
        let made = subject.embedding.clone().unwrap();
        // Another subject of the same mesh finds it in the cache, to the bit.
        let mut other = Subject::new(lobed_sphere(2, 0.2)).unwrap();
        let counting = Counting::default();
        other.embed(&options, &Cache::in_folder(folder.path()), &counting).unwrap();
        assert_eq!(other.embedding.as_ref().unwrap().points, made.points);
        assert_eq!(counting.0.into_inner(), 0, "nothing is computed");
        // What is in the cache for the key but does not fit the mesh is made anew.
        let wrong = Embedding { points: made.points[8..].to_vec(), ..made.clone() };
        Cache::in_folder(folder.path()).put(&cache_key(&other.mesh, &options), &wrong.to_bytes()).unwrap();
        other.embedding = None;
        other.embed(&options, &Cache::in_folder(folder.path()), &Quiet).unwrap();
        assert_eq!(other.embedding.unwrap().points, made.points);
    }

    #[derive(Default)]
    struct Counting(std::sync::atomic::AtomicUsize);

    impl Progress for Counting {
        fn stage(&self, _: &str, _: u64) {
            self.0.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        }

        fn advance(&self, _: u64) {}
    }

    #[test]
    fn a_mesh_without_triangles_is_refused_and_findings_are_sentences() {
        assert!(Subject::new(Mesh::of_triangles("none", vec![glam::DVec3::X; 3], &[])).is_err());
        let mut mesh = lobed_sphere(1, 0.2);
        mesh.positions.push(glam::DVec3::splat(9.0));
        let subject = Subject::new(mesh).unwrap();
        assert!(subject.notes.iter().all(|n| n.starts_with(&subject.mesh.name)), "{:?}", subject.notes);
    }
}
