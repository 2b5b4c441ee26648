//! A folder of results that are costly to compute again.
//!
//! An entry is found by a key that names everything the result depends on; [`CacheKey`] hashes it.
//! A missing, unreadable or damaged entry is no entry: the cache can never make a command fail.

use std::path::{Path, PathBuf};

use super::{open, output};
use crate::Result;

/// Collects what a result depends on: content, parameters and the version of the algorithm.
#[derive(Clone, Debug)]
pub struct CacheKey {
    hasher: blake3::Hasher,
}

impl CacheKey {
    /// A key for the results of `algorithm`, which changes its name or version whenever the same
    /// input may give another result.
    pub fn new(algorithm: &str, version: u32) -> Self {
        Self { hasher: blake3::Hasher::new() }.bytes(algorithm.as_bytes()).bytes(&version.to_le_bytes())
    }

    /// Adds bytes; their length counts too, so that neighbouring values cannot run into one
    /// another.
    #[must_use]
    pub fn bytes(mut self, bytes: &[u8]) -> Self {
        self.hasher.update(&(bytes.len() as u64).to_le_bytes());
        self.hasher.update(bytes);
        self
    }

    /// Adds a whole number.
    #[must_use]
    pub fn number(self, number: u64) -> Self {
        self.bytes(&number.to_le_bytes())
    }

    /// Adds values of plain data, such as positions or triangles.
    #[must_use]
    pub fn values<T: bytemuck::NoUninit>(self, values: &[T]) -> Self {
        self.bytes(bytemuck::cast_slice(values))
    }

    /// The key as text.
    pub fn finish(&self) -> String {
        self.hasher.finalize().to_hex().to_string()
    }
}

/// The cache: a folder, or nothing.
#[derive(Clone, Debug)]
pub struct Cache {
    folder: Option<PathBuf>,
}

const MAGIC: &[u8; 8] = b"barymap1";
const CHECKSUM: usize = blake3::OUT_LEN;

impl Cache {
    /// The folder named by the environment variable `BARYMAP_CACHE`, else `barymap` in the user's
    /// cache folder (with the feature `files`), else no cache.
    pub fn from_environment() -> Self {
        let named = std::env::var_os("BARYMAP_CACHE").filter(|v| !v.is_empty()).map(PathBuf::from);
        #[cfg(feature = "files")]
        let named = named.or_else(|| dirs::cache_dir().map(|d| d.join("barymap")));
        Self { folder: named }
    }

    /// A cache in `folder`, which is made when something is put there.
    pub fn in_folder(folder: impl Into<PathBuf>) -> Self {
        Self { folder: Some(folder.into()) }
    }

    /// A cache that holds nothing (`--no-cache`).
    pub fn disabled() -> Self {
        Self { folder: None }
    }

    /// Where entries lie.
    pub fn folder(&self) -> Option<&Path> {
        self.folder.as_deref()
    }

    /// The entry under `key`, if there is one and it is whole.
    pub fn get(&self, key: &str) -> Option<Vec<u8>> {
        let mut bytes = open::read_all(&self.entry(key)?).ok()?;
        let head = MAGIC.len() + CHECKSUM;
        let content = bytes.get(head..)?;
        let intact = bytes.starts_with(MAGIC) && *blake3::hash(content).as_bytes() == bytes[MAGIC.len()..head];
        intact.then(|| bytes.split_off(head))
    }

    /// Stores an entry, replacing an older one.
    ///
    /// # Errors
    /// [`crate::Error::Io`] if the folder cannot be made or written; callers tell it as a warning
    /// at most.
    pub fn put(&self, key: &str, content: &[u8]) -> Result<()> {
        use std::io::Write;
        let Some(path) = self.entry(key) else { return Ok(()) };
        if let Some(folder) = path.parent() {
            let remedy = "Name a writable folder in BARYMAP_CACHE, or use --no-cache";
            std::fs::create_dir_all(folder).map_err(|e| crate::Error::io(folder, e, remedy))?;
        }
        output::write_atomically(&path, |w| {
            let checksum = blake3::hash(content);
            let mut parts = [&MAGIC[..], checksum.as_bytes(), content].into_iter();
            parts.try_for_each(|part| w.write_all(part)).map_err(output::failed(&path))
        })
    }

    fn entry(&self, key: &str) -> Option<PathBuf> {
        // The hash keeps any key a plain file name.
        let name = blake3::hash(key.as_bytes()).to_hex();
        self.folder.as_ref().map(|f| f.join(name.as_str()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_come_back_whole_or_not_at_all() {
        let dir = tempfile::tempdir().unwrap();
        let cache = Cache::in_folder(dir.path().join("made/when/needed"));
        assert_eq!(cache.get("a/../b"), None);
        cache.put("a/../b", b"content").unwrap();
        cache.put("empty", b"").unwrap();
        assert_eq!(cache.get("a/../b").as_deref(), Some(&b"content"[..]));
        assert_eq!(cache.get("empty").as_deref(), Some(&b""[..]));
        let entry = cache.entry("a/../b").unwrap();
        let bytes = std::fs::read(&entry).unwrap();
        for k in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[k] ^= 1;
            std::fs::write(&entry, &damaged).unwrap();
            assert_eq!(cache.get("a/../b"), None, "byte {k}");
            std::fs::write(&entry, &bytes[..k]).unwrap();
            assert_eq!(cache.get("a/../b"), None, "cut at {k}");
        }
        cache.put("a/../b", b"again").unwrap();
        assert_eq!(cache.get("a/../b").as_deref(), Some(&b"again"[..]));
        Cache::disabled().put("x", b"").unwrap();
        assert_eq!(Cache::disabled().get("x"), None);
    }

    #[test]
    fn keys_tell_their_parts_apart() {
        let key = |parts: &[&[u8]]| parts.iter().fold(CacheKey::new("embed", 1), |k, p| k.bytes(p)).finish();
        assert_eq!(key(&[b"ab", b"c"]), key(&[b"ab", b"c"]));
        assert_ne!(key(&[b"ab", b"c"]), key(&[b"a", b"bc"]));
        assert_ne!(CacheKey::new("embed", 1).number(2).finish(), CacheKey::new("embed", 2).number(1).finish());
        assert_ne!(CacheKey::new("e", 1).values(&[1.0f64]).finish(), CacheKey::new("e", 1).values(&[2.0f64]).finish());
    }
}
