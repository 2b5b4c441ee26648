//! Rings that change by single entries, in constant time also where they are long.

use std::collections::HashMap;

use crate::geometry::NONE;

/// A ring of more entries is long.
pub(crate) const LONGEST: usize = 128;

/// The ordered ring of every vertex. An entry that leaves a long ring leaves a gap there, which is
/// closed when half of the ring are gaps: without that each of thousands of changes would move
/// thousands of entries.
#[derive(Debug)]
pub(crate) struct Rings {
    rings: Vec<Vec<u32>>,
    long: HashMap<u32, Long>,
}

/// What a long ring has beside its entries.
#[derive(Debug)]
struct Long {
    /// Where each of its entries stands.
    place: HashMap<u32, u32>,
    gaps: usize,
}

impl Rings {
    /// Rings of entries that differ.
    pub(crate) fn new(rings: Vec<Vec<u32>>) -> Self {
        let mut result = Self { rings, long: HashMap::new() };
        (0..result.rings.len() as u32).for_each(|v| result.index(v));
        result
    }

    /// The number of neighbours of `v`.
    pub(crate) fn count(&self, v: u32) -> usize {
        self.rings[v as usize].len() - self.long.get(&v).map_or(0, |long| long.gaps)
    }

    /// The ring of `v`, if it has at most [`LONGEST`] entries.
    pub(crate) fn short(&self, v: u32) -> Option<&[u32]> {
        (!self.long.contains_key(&v)).then(|| self.rings[v as usize].as_slice())
    }

    /// The ring of `v` in order.
    pub(crate) fn of(&self, v: u32) -> impl Iterator<Item = u32> + '_ {
        self.rings[v as usize].iter().copied().filter(|&u| u != NONE)
    }

    /// Puts `new` in the place of `old`.
    pub(crate) fn replace(&mut self, v: u32, old: u32, new: u32) {
        let ring = &mut self.rings[v as usize];
        match self.long.get_mut(&v) {
            Some(long) => {
                if let Some(place) = long.place.remove(&old) {
                    ring[place as usize] = new;
                    long.place.insert(new, place);
                }
            }
            None => ring.iter_mut().filter(|u| **u == old).for_each(|u| *u = new),
        }
    }

    /// Takes `old` out.
    pub(crate) fn remove(&mut self, v: u32, old: u32) {
        let ring = &mut self.rings[v as usize];
        let Some(long) = self.long.get_mut(&v) else { return ring.retain(|&u| u != old) };
        let Some(place) = long.place.remove(&old) else { return };
        ring[place as usize] = NONE;
        long.gaps += 1;
        if 2 * long.gaps > ring.len() || ring.len() - long.gaps <= LONGEST {
            ring.retain(|&u| u != NONE);
            self.index(v);
        }
    }

    /// Puts `new` in the place of entry number `place` of a short ring.
    pub(crate) fn splice(&mut self, v: u32, place: usize, new: impl IntoIterator<Item = u32>) {
        self.rings[v as usize].splice(place..=place, new);
        self.index(v);
    }

    /// Notes where the entries of a ring without gaps stand, if it is long.
    fn index(&mut self, v: u32) {
        let ring = &self.rings[v as usize];
        if ring.len() > LONGEST {
            let place = (0..).zip(ring).map(|(k, &u)| (u, k)).collect();
            self.long.insert(v, Long { place, gaps: 0 });
        } else {
            self.long.remove(&v);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::shapes::Random;

    #[test]
    fn long_rings_are_as_plain_ones() {
        let n = 1000;
        let mut rings = Rings::new(vec![(0..n).collect(), vec![7, 8, 9]]);
        let mut plain: Vec<u32> = (0..n).collect();
        let mut random = Random::new(1);
        let mut next = n;
        while plain.len() > 3 {
            let old = plain[(random.unit() * plain.len() as f64) as usize];
            if random.unit() < 0.3 {
                rings.replace(0, old, next);
                plain.iter_mut().filter(|u| **u == old).for_each(|u| *u = next);
                next += 1;
            } else {
                rings.remove(0, old);
                plain.retain(|&u| u != old);
            }
            assert_eq!(rings.count(0), plain.len());
            assert_eq!(rings.short(0).is_some(), plain.len() <= LONGEST);
            assert!(rings.of(0).eq(plain.iter().copied()));
            // Gaps are at most as many as entries.
            assert!(rings.rings[0].len() <= 2 * plain.len().max(LONGEST));
        }
        assert_eq!(rings.short(0), Some(&plain[..]));
        // What is not there changes nothing.
        rings.remove(1, 100);
        rings.replace(1, 100, 3);
        assert_eq!(rings.short(1), Some(&[7, 8, 9][..]));
    }

    #[test]
    fn a_ring_may_become_long() {
        let mut rings = Rings::new(vec![vec![1, 2, 3]]);
        rings.splice(0, 1, 10..10 + LONGEST as u32);
        assert!(rings.short(0).is_none());
        rings.remove(0, 10);
        rings.remove(0, 1);
        assert!(rings.of(0).eq((11..10 + LONGEST as u32).chain([3])));
        assert_eq!(rings.short(0).map(<[u32]>::len), Some(LONGEST));
    }
}
