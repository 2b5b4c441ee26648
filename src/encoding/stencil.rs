//! Flat arrays of rings, readable from both ends.

use crate::geometry::NONE;

/// Rings of some vertices ("rows") as flat arrays of neighbours ("slots"), with the way back from a
/// neighbour to the slots that name it, so that products with a transposed matrix are gathers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Stencils {
    /// The vertex of each row.
    pub vertex: Vec<u32>,
    /// First slot of each row, and the number of slots at the end.
    pub start: Vec<u32>,
    /// The neighbour in each slot, in order around the row's vertex.
    pub neighbour: Vec<u32>,
    /// The row of each slot.
    pub slot_row: Vec<u32>,
    /// The row of each vertex, or [`NONE`].
    pub row_of: Vec<u32>,
    /// First entry of `incoming` for each vertex, and their number at the end.
    pub incoming_start: Vec<u32>,
    /// The slots that name a vertex, ascending.
    pub incoming: Vec<u32>,
}

impl Stencils {
    /// Stencils over `vertex_count` vertices from rows of a vertex and its ring.
    ///
    /// # Panics
    /// If a vertex has two rows or an index is out of range.
    pub fn new<'a>(vertex_count: usize, rows: impl IntoIterator<Item = (u32, &'a [u32])>) -> Self {
        let mut s = Self { start: vec![0], row_of: vec![NONE; vertex_count], ..Self::default() };
        for (row, (vertex, ring)) in rows.into_iter().enumerate() {
            assert!(s.row_of[vertex as usize] == NONE, "vertex {vertex} has two rows");
            s.row_of[vertex as usize] = row as u32;
            s.vertex.push(vertex);
            s.neighbour.extend_from_slice(ring);
            s.slot_row.resize(s.neighbour.len(), row as u32);
            s.start.push(s.neighbour.len() as u32);
        }
        s.incoming_start = vec![0; vertex_count + 1];
        for &v in &s.neighbour {
            s.incoming_start[v as usize + 1] += 1;
        }
        for v in 0..vertex_count {
            s.incoming_start[v + 1] += s.incoming_start[v];
        }
        let mut fill = s.incoming_start.clone();
        s.incoming = vec![0; s.neighbour.len()];
        for (slot, &v) in s.neighbour.iter().enumerate() {
            s.incoming[fill[v as usize] as usize] = slot as u32;
            fill[v as usize] += 1;
        }
        s
    }

    /// Number of rows.
    pub fn row_count(&self) -> usize {
        self.vertex.len()
    }

    /// Number of vertices, with a row or without.
    pub fn vertex_count(&self) -> usize {
        self.row_of.len()
    }

    /// The slots of row `r`.
    #[inline]
    pub fn slots(&self, r: usize) -> std::ops::Range<usize> {
        self.start[r] as usize..self.start[r + 1] as usize
    }

    /// The ring of row `r`.
    #[inline]
    pub fn ring(&self, r: usize) -> &[u32] {
        &self.neighbour[self.slots(r)]
    }

    /// The slots that name vertex `v`.
    #[inline]
    pub fn incoming(&self, v: usize) -> &[u32] {
        &self.incoming[self.incoming_start[v] as usize..self.incoming_start[v + 1] as usize]
    }
}
