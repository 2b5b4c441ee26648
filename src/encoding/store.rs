//! Hierarchies as bytes, and the key they are kept under.

use super::hierarchy::Stage;
use super::{Connectivity, Encoding, Hierarchy, HierarchyOptions, Stencils, V3};
use crate::error::{Error, Result};

/// Changes whenever the same mesh, held vertices and options may give another hierarchy, or its
/// bytes another layout.
pub(super) const ALGORITHM_VERSION: u32 = 1;
const MAGIC: [u8; 8] = *b"BARYHIER";

/// The name under which a hierarchy may be kept: a hash of everything it depends on.
pub fn cache_key(
    connectivity: &Connectivity,
    positions: &[V3<f64>],
    held: &[u32],
    options: &HierarchyOptions,
) -> String {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&MAGIC);
    let mut list = |bytes: &[u8]| {
        hasher.update(&(bytes.len() as u64).to_le_bytes());
        hasher.update(bytes);
    };
    list(&ALGORITHM_VERSION.to_le_bytes());
    list(bytemuck::cast_slice(positions));
    list(bytemuck::cast_slice(held));
    let stages: Vec<u64> = options.stages.iter().map(|&s| s as u64).collect();
    list(bytemuck::cast_slice(&stages));
    for (ring, open) in connectivity.rings.iter().zip(&connectivity.open) {
        list(bytemuck::cast_slice(ring));
        list(&[u8::from(*open)]);
    }
    hasher.finalize().to_hex().to_string()
}

#[derive(Default)]
struct Writer(Vec<u8>);

impl Writer {
    fn number(&mut self, x: usize) {
        self.0.extend((x as u64).to_le_bytes());
    }

    fn indices(&mut self, list: &[u32]) {
        self.number(list.len());
        self.0.extend(list.iter().flat_map(|x| x.to_le_bytes()));
    }

    fn reals(&mut self, list: &[f64]) {
        self.number(list.len());
        self.0.extend(list.iter().flat_map(|x| x.to_le_bytes()));
    }

    fn coefficients(&mut self, stencils: &Stencils, encoding: &Encoding<f64>) {
        self.indices(&stencils.vertex);
        self.indices(&stencils.start);
        self.indices(&stencils.neighbour);
        self.reals(&encoding.w);
        self.reals(&encoding.b);
    }
}

struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    fn take(&mut self, n: usize) -> Option<&'a [u8]> {
        let (head, rest) = self.0.split_at_checked(n)?;
        self.0 = rest;
        Some(head)
    }

    fn number(&mut self) -> Option<usize> {
        usize::try_from(u64::from_le_bytes(self.take(8)?.try_into().ok()?)).ok()
    }

    /// A list whose length fits into what is left; no length makes it allocate more.
    fn list<const N: usize, T>(&mut self, item: impl Fn([u8; N]) -> T) -> Option<Vec<T>> {
        let count = self.number()?;
        let bytes = self.take(count.checked_mul(N)?)?;
        Some(bytes.chunks_exact(N).filter_map(|b| b.try_into().ok()).map(item).collect())
    }

    fn indices(&mut self) -> Option<Vec<u32>> {
        self.list(u32::from_le_bytes)
    }

    fn coefficients(&mut self, vertices: usize) -> Option<(Stencils, Encoding<f64>)> {
        let (vertex, start, neighbour) = (self.indices()?, self.indices()?, self.indices()?);
        let encoding = Encoding { w: self.list(f64::from_le_bytes)?, b: self.list(f64::from_le_bytes)? };
        let n = neighbour.len();
        let rising = start.windows(2).all(|s| s[0] < s[1]);
        let whole = start.len() == vertex.len() + 1
            && (start[0], start[start.len() - 1]) == (0, n as u32)
            && rising
            && encoding.w.len() == n
            && encoding.b.len() == n
            && vertex.iter().chain(&neighbour).all(|&v| (v as usize) < vertices);
        let mut distinct = vertex.clone();
        distinct.sort_unstable();
        distinct.dedup();
        if !whole || distinct.len() != vertex.len() {
            return None;
        }
        let ring = |r: usize| &neighbour[start[r] as usize..start[r + 1] as usize];
        let stencils = Stencils::new(vertices, vertex.iter().enumerate().map(|(r, &v)| (v, ring(r))));
        Some((stencils, encoding))
    }
}

impl Hierarchy {
    /// The hierarchy as bytes: versioned, little-endian.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut out = Writer(MAGIC.to_vec());
        for x in [ALGORITHM_VERSION as usize, self.held, self.base, self.stages.len()] {
            out.number(x);
        }
        for list in [&self.order, &self.level_start, &self.substituted, &self.left_out] {
            out.indices(list);
        }
        out.coefficients(&self.splits, &self.split_encoding);
        for stage in &self.stages {
            for x in [stage.vertices, stage.levels.start, stage.levels.end] {
                out.number(x);
            }
            out.coefficients(&stage.stencils, &stage.encoding);
        }
        out.0
    }

    /// The hierarchy that [`Hierarchy::to_bytes`] wrote.
    ///
    /// # Errors
    /// [`Error::Input`] if the bytes are cut off, of another version, or do not fit together. The
    /// remedy is to make it again.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        Self::read(bytes).ok_or_else(|| {
            Error::input("this is no stored hierarchy of this version", "Delete it; it is made again then")
        })
    }

    fn read(bytes: &[u8]) -> Option<Self> {
        let mut r = Reader(bytes.strip_prefix(&MAGIC)?);
        if r.number()? != ALGORITHM_VERSION as usize {
            return None;
        }
        let (held, base, stage_count) = (r.number()?, r.number()?, r.number()?);
        let mut h = Self { held, base, ..Self::default() };
        h.order = r.indices()?;
        h.level_start = r.indices()?;
        h.substituted = r.indices()?;
        h.left_out = r.indices()?;
        let n = h.order.len();
        (h.splits, h.split_encoding) = r.coefficients(n)?;
        let rows = h.splits.row_count();
        // Every level must follow what it is made from, and the rows the numbering.
        let levels_fit = h.level_start.first() == Some(&0)
            && h.level_start.last() == Some(&(rows as u32))
            && h.level_start.windows(2).all(|l| {
                l[0] < l[1]
                    && (l[0]..l[1])
                        .all(|row| h.splits.ring(row as usize).iter().all(|&v| (v as usize) < base + l[0] as usize))
            })
            && h.splits.vertex.iter().enumerate().all(|(row, &v)| v as usize == base + row);
        if held > base || base.checked_add(rows)? != n || !levels_fit {
            return None;
        }
        let mut level = 0;
        for _ in 0..stage_count {
            let (vertices, levels) = (r.number()?, r.number()?..r.number()?);
            let end = *h.level_start.get(levels.end)? as usize;
            if levels.start != level || levels.end < levels.start || vertices != base + end {
                return None;
            }
            level = levels.end;
            let (stencils, encoding) = r.coefficients(vertices)?;
            h.stages.push(Stage { vertices, levels, stencils, encoding });
        }
        (r.0.is_empty() && h.stages.last().is_some_and(|s| s.vertices == n)).then_some(h)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::shapes::lobed_sphere;

    #[test]
    fn what_is_stored_comes_back_or_is_refused() {
        let mesh = lobed_sphere(3, 0.4);
        let positions: Vec<V3<f64>> = mesh.positions.iter().map(|p| p.to_array()).collect();
        let connectivity = Connectivity::new(&mesh);
        let options = HierarchyOptions { stages: vec![50, 200] };
        let h = Hierarchy::new(&connectivity, &positions, &[0, 5, 100, 300], &options).unwrap();
        let bytes = h.to_bytes();
        assert!(Hierarchy::from_bytes(&bytes).unwrap() == h);
        for cut in [0, 7, 8, 16, 100, bytes.len() / 2, bytes.len() - 1] {
            assert!(Hierarchy::from_bytes(&bytes[..cut]).is_err(), "{cut}");
        }
        // No damage may lead to a panic later: indices stay in range, levels in order.
        let mut random = crate::models::shapes::Random::new(1);
        for _ in 0..300 {
            let mut damaged = bytes.clone();
            let k = (random.unit() * bytes.len() as f64) as usize;
            damaged[k] ^= 1 << (random.bits() % 8);
            let _ = Hierarchy::from_bytes(&damaged);
        }
        let key = |held: &[u32]| cache_key(&connectivity, &positions, held, &options);
        assert!(key(&[0, 5]) == key(&[0, 5]) && key(&[0, 5]) != key(&[0, 6]));
    }
}
