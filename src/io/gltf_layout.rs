//! Where the used parts of a file's buffers go in the one binary chunk that is written.

use std::ops::Range;

use super::gltf_document::Document;

/// What views begin at multiples of, whatever they hold.
pub(super) const ALIGNED: usize = 8;

/// Where the used parts of the file's buffers are in the output: each byte once, however many views
/// share it.
pub(super) struct Layout {
    /// Buffer, part of it, and where it is.
    pieces: Vec<(usize, Range<usize>, usize)>,
}

impl Layout {
    pub(super) fn new(mut used: Vec<(usize, Range<usize>)>) -> Self {
        for (_, range) in &mut used {
            range.start -= range.start % ALIGNED;
        }
        used.sort_by_key(|(buffer, range)| (*buffer, range.start, range.end));
        let mut pieces: Vec<(usize, Range<usize>, usize)> = Vec::new();
        for (buffer, range) in used {
            match pieces.last_mut() {
                Some((b, r, _)) if *b == buffer && range.start <= r.end => r.end = r.end.max(range.end),
                _ => pieces.push((buffer, range, 0)),
            }
        }
        let mut at: usize = 0;
        for (_, range, place) in &mut pieces {
            *place = at;
            at = (at + range.len()).next_multiple_of(ALIGNED);
        }
        Self { pieces }
    }

    pub(super) fn bytes(&self, document: &Document) -> Vec<u8> {
        let mut all = Vec::new();
        for (buffer, range, place) in &self.pieces {
            all.resize(*place, 0);
            all.extend_from_slice(document.buffers[*buffer].as_ref().map_or(&[], |b| &b[range.clone()]));
        }
        all.resize(all.len().next_multiple_of(ALIGNED), 0);
        all
    }

    /// Where a byte of a buffer is.
    pub(super) fn place(&self, buffer: usize, offset: usize) -> usize {
        let after = self.pieces.partition_point(|(b, r, _)| (*b, r.start) <= (buffer, offset));
        let (_, range, place) = &self.pieces[after.saturating_sub(1)];
        place + offset - range.start
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_byte_is_there_once_and_views_find_theirs() {
        let layout =
            Layout::new(vec![(1, 3..10), (0, 100..120), (0, 110..130), (0, 0..16), (1, 40..41), (0, 100..120)]);
        let lengths: usize = layout.pieces.iter().map(|(_, r, _)| r.len()).sum();
        assert_eq!(layout.pieces.len(), 4);
        assert_eq!(lengths, 16 + 34 + 10 + 1);
        assert_eq!(layout.place(0, 0), 0);
        assert_eq!(layout.place(0, 110), layout.place(0, 100) + 10);
        assert_eq!(layout.place(1, 3), layout.place(0, 100) - 4 + 40 + 3);
        assert!([(0, 100), (1, 3), (1, 40)].iter().all(|&(b, at)| layout.place(b, at) % ALIGNED == at % ALIGNED));
    }
}
