//! Embeddings as bytes, and the key they are kept under.

use super::{Embedding, EmbeddingOptions, Seconds};
use crate::error::{Error, Result};
use crate::geometry::Mesh;

/// Changes whenever the same mesh and options may give another embedding, or its bytes another
/// layout.
pub const ALGORITHM_VERSION: u32 = 5;

const MAGIC: [u8; 8] = *b"BARYEMBD";
/// Bytes of the checksum at the end.
const CHECKSUM: usize = 32;

/// Reads little-endian numbers one after the other; `None` at the end.
struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    fn take(&mut self, n: usize) -> Option<&'a [u8]> {
        let (head, rest) = self.0.split_at_checked(n)?;
        self.0 = rest;
        Some(head)
    }

    fn u64(&mut self) -> Option<u64> {
        Some(u64::from_le_bytes(self.take(8)?.try_into().ok()?))
    }

    fn f64(&mut self) -> Option<f64> {
        Some(f64::from_bits(self.u64()?))
    }

    /// A list of items of `size` bytes; a length that does not fit into the rest gives `None`, not
    /// an allocation.
    fn list<T>(&mut self, size: usize, item: impl Fn(&[u8]) -> T) -> Option<Vec<T>> {
        let count = usize::try_from(self.u64()?).ok()?;
        Some(self.take(count.checked_mul(size)?)?.chunks_exact(size).map(item).collect())
    }
}

impl Embedding {
    /// The embedding as bytes (versioned, little-endian, with a checksum), without the times. About
    /// 8 (D V) bytes.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(8 * self.points.len() + 4 * self.landmarks.len() + 256);
        out.extend(MAGIC);
        out.extend(u64::from(ALGORITHM_VERSION).to_le_bytes());
        out.extend((self.dimension as u64).to_le_bytes());
        out.extend(self.stress.to_le_bytes());
        out.extend(self.sweeps.to_le_bytes());
        out.extend((self.points.len() as u64).to_le_bytes());
        out.extend(self.points.iter().flat_map(|x| x.to_le_bytes()));
        out.extend((self.landmarks.len() as u64).to_le_bytes());
        out.extend(self.landmarks.iter().flat_map(|x| x.to_le_bytes()));
        out.extend((self.warnings.len() as u64).to_le_bytes());
        for warning in &self.warnings {
            out.extend((warning.len() as u64).to_le_bytes());
            out.extend(warning.as_bytes());
        }
        let checksum = blake3::hash(&out);
        out.extend(checksum.as_bytes());
        out
    }

    /// The embedding that [`Embedding::to_bytes`] wrote; its times are zero.
    ///
    /// # Errors
    /// [`Error::Input`] if the bytes are cut off, changed, or of another version. The remedy is to
    /// compute the embedding again.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        let bad =
            |what: &str| Error::input(format!("cached embedding: {what}"), "Delete it; it is computed again then");
        let length = bytes.len().checked_sub(CHECKSUM).ok_or_else(|| bad("it is cut off"))?;
        let (body, checksum) = bytes.split_at(length);
        if !body.starts_with(&MAGIC) {
            return Err(bad("these bytes are something else"));
        }
        if blake3::hash(body).as_bytes() != checksum {
            return Err(bad("its checksum is wrong"));
        }
        let mut reader = Reader(&body[MAGIC.len()..]);
        if reader.u64() != Some(u64::from(ALGORITHM_VERSION)) {
            return Err(bad("it was made by another version"));
        }
        let read = |r: &mut Reader<'_>| -> Option<Self> {
            let dimension = usize::try_from(r.u64()?).ok()?;
            let (stress, sweeps) = (r.f64()?, r.u64()?);
            let points = r.list(8, |b| f64::from_le_bytes(b.try_into().unwrap_or_default()))?;
            let landmarks = r.list(4, |b| u32::from_le_bytes(b.try_into().unwrap_or_default()))?;
            let mut warnings = Vec::new();
            for _ in 0..r.u64()? {
                warnings.push(String::from_utf8(r.list(1, |b| b[0])?).ok()?);
            }
            let whole = r.0.is_empty() && dimension > 0 && points.len() % dimension == 0;
            whole.then_some(Self {
                dimension,
                points,
                landmarks,
                stress,
                sweeps,
                seconds: Seconds::default(),
                warnings,
            })
        };
        read(&mut reader).ok_or_else(|| bad("its parts do not fit together"))
    }
}

/// The name under which the embedding of `mesh` with `options` may be kept: a hash of everything it
/// depends on.
pub fn cache_key(mesh: &Mesh, options: &EmbeddingOptions) -> String {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&MAGIC);
    let numbers = [
        u64::from(ALGORITHM_VERSION),
        options.landmarks as u64,
        options.sampling as u64,
        options.dimension as u64,
        options.sweeps as u64,
        options.tolerance.to_bits(),
        options.mid_level as u64,
        mesh.vertex_count() as u64,
        mesh.triangle_count() as u64,
    ];
    let mut buffer: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
    buffer.extend(mesh.positions.iter().flat_map(|p| p.to_array()).flat_map(f64::to_le_bytes));
    buffer.extend((0..mesh.triangle_count()).flat_map(|t| mesh.triangle(t)).flat_map(u32::to_le_bytes));
    hasher.update(&buffer);
    hasher.finalize().to_hex().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Embedding {
        Embedding {
            dimension: 4,
            points: vec![1.0, -2.5, f64::NAN, 1e-300, 0.0, 1.0, 2.0, 3.0],
            landmarks: vec![0, 7],
            stress: 0.01,
            sweeps: 12,
            seconds: Seconds::default(),
            warnings: vec!["two components".into(), String::new()],
        }
    }

    #[test]
    fn bytes_come_back() {
        let e = sample();
        let back = Embedding::from_bytes(&e.to_bytes()).unwrap();
        assert_eq!(back.to_bytes(), e.to_bytes());
        assert_eq!((back.landmarks, back.warnings, back.sweeps), (e.landmarks, e.warnings, e.sweeps));
    }

    #[test]
    fn damaged_bytes_are_refused() {
        let bytes = sample().to_bytes();
        for i in 0..bytes.len() {
            let mut changed = bytes.clone();
            changed[i] ^= 1;
            assert!(Embedding::from_bytes(&changed).is_err() && Embedding::from_bytes(&bytes[..i]).is_err());
        }
        // A right checksum over nonsense: a length that cannot be.
        let mut body = bytes[..40].to_vec();
        body.extend(u64::MAX.to_le_bytes());
        let checksum = blake3::hash(&body);
        body.extend(checksum.as_bytes());
        assert!(Embedding::from_bytes(&body).is_err());
    }

    #[test]
    fn the_key_sees_everything() {
        let p = vec![glam::DVec3::ZERO, glam::DVec3::X, glam::DVec3::Y];
        let mesh = Mesh::of_triangles("a", p.clone(), &[[0, 1, 2]]);
        let options = EmbeddingOptions::default();
        let key = cache_key(&mesh, &options);
        assert_eq!(key, cache_key(&Mesh::of_triangles("b", p.clone(), &[[0, 1, 2]]), &options));
        assert_ne!(key, cache_key(&Mesh::of_triangles("a", p.clone(), &[[0, 2, 1]]), &options));
        assert_ne!(key, cache_key(&mesh, &EmbeddingOptions { dimension: 12, ..options }));
        let mut moved = p;
        moved[1].x += 1e-15;
        assert_ne!(key, cache_key(&Mesh::of_triangles("a", moved, &[[0, 1, 2]]), &options));
    }
}
