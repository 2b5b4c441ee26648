//! Disjoint sets of numbers; the lowest of a set names it.

/// Disjoint sets of 0 .. n, each named by its lowest member.
#[derive(Clone, Debug)]
pub(crate) struct UnionFind {
    parent: Vec<u32>,
}

impl UnionFind {
    /// `count` sets of one member each.
    pub(crate) fn new(count: usize) -> Self {
        Self { parent: (0..count as u32).collect() }
    }

    /// The lowest member of the set of `v`. O(log n) amortised.
    pub(crate) fn root(&mut self, mut v: u32) -> u32 {
        while self.parent[v as usize] != v {
            let up = self.parent[self.parent[v as usize] as usize];
            self.parent[v as usize] = up;
            v = up;
        }
        v
    }

    /// Joins two sets; false if they are one already.
    pub(crate) fn join(&mut self, a: u32, b: u32) -> bool {
        let (a, b) = (self.root(a), self.root(b));
        self.parent[a.max(b) as usize] = a.min(b);
        a != b
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lowest_member_names_a_set() {
        let mut sets = UnionFind::new(6);
        assert!(sets.join(5, 3) && sets.join(4, 5) && !sets.join(3, 4) && sets.join(1, 4));
        assert_eq!([0, 1, 2, 3, 4, 5].map(|v| sets.root(v)), [0, 1, 2, 1, 1, 1]);
    }
}
