//! Parts of a job that is done in several: shards of a list, and ranges of a sequence.

use std::ops::Range;

/// Part `index` (from 0) of `count`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Shard {
    index: usize,
    count: usize,
}

/// Reads `I/N`, I counted from 1.
pub(crate) fn shard(text: &str) -> std::result::Result<Shard, String> {
    let wrong = || format!("{text:?} is no shard: write 1/4 for the first of four");
    let (i, n) = text.split_once('/').ok_or_else(wrong)?;
    let (i, n): (usize, usize) = (i.trim().parse().map_err(|_| wrong())?, n.trim().parse().map_err(|_| wrong())?);
    if i == 0 || i > n {
        return Err(format!("{text:?} is no shard: they are counted from 1/{n} to {n}/{n}"));
    }
    Ok(Shard { index: i - 1, count: n })
}

impl Shard {
    /// Its share of so many frames, those that follow one another.
    pub(crate) fn part(self, frames: usize) -> Range<usize> {
        let border = |k: usize| (k as u128 * frames as u128 / self.count as u128) as usize;
        border(self.index)..border(self.index + 1)
    }

    /// Its share of a list.
    pub(crate) fn of<T>(self, items: Vec<T>) -> Vec<T> {
        items.into_iter().skip(self.index).step_by(self.count).collect()
    }
}

/// Numbers from the first to before the end; to the end of the sequence if there is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Part {
    first: usize,
    end: Option<usize>,
}

/// Reads `A..B`, `A..` or `..B`.
pub(crate) fn part(text: &str) -> std::result::Result<Part, String> {
    let wrong = || format!("{text:?} is no range: write 10..20 for the frames 10 to 19, or 10.. or ..20");
    let (first, end) = text.split_once("..").ok_or_else(wrong)?;
    let number = |word: &str| match word.trim() {
        "" => Ok(None),
        word => word.parse::<usize>().map(Some).map_err(|_| wrong()),
    };
    let (first, end) = (number(first)?.unwrap_or(0), number(end)?);
    if end.is_some_and(|end| end <= first) {
        return Err(format!("{text:?} is empty: the end, which does not belong to it, is after the first"));
    }
    Ok(Part { first, end })
}

impl Part {
    /// Those of `count`; `None` if it reaches beyond.
    pub(crate) fn of(self, count: usize) -> Option<Range<usize>> {
        let end = self.end.unwrap_or(count);
        (self.first < end && end <= count).then_some(self.first..end)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_part_a_list() {
        let items: Vec<u32> = (0..11).collect();
        for n in 1..=13 {
            let mut all: Vec<u32> =
                (1..=n).flat_map(|i| shard(&format!("{i}/{n}")).unwrap().of(items.clone())).collect();
            all.sort_unstable();
            assert_eq!(all, items);
        }
        assert_eq!(shard("2/4").unwrap().of(items), [1, 5, 9]);
        for (n, frames) in [(1, 10), (3, 10), (7, 5), (4, 0)] {
            let all: Vec<usize> = (1..=n).flat_map(|i| shard(&format!("{i}/{n}")).unwrap().part(frames)).collect();
            assert!(all.into_iter().eq(0..frames), "{n} parts of {frames}");
        }
        for bad in ["", "1", "0/4", "5/4", "1/0", "a/b", "-1/2", "1/2/3"] {
            assert!(shard(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn parts_have_a_first_and_an_end() {
        let of = |text: &str, count: usize| part(text).unwrap().of(count);
        assert_eq!(
            (of("3..5", 9), of("..2", 9), of("7..", 9), of("..", 9)),
            (Some(3..5), Some(0..2), Some(7..9), Some(0..9))
        );
        assert_eq!((of("3..5", 4), of("9..", 9), of("..", 0)), (None, None, None));
        for bad in ["", "3", "5..5", "6..5", "a..b", "-1..3", "1..2..3", "1...3"] {
            assert!(part(bad).is_err(), "{bad}");
        }
    }
}
