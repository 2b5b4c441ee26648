//! Colours of vertices: their columns by name, and the range of their numbers.
//!
//! Files do not say what number is full. Whole numbers of one byte are parts of 255. Of others the
//! whole set of columns decides: numbers up to 1 are taken as they are, up to 255 as parts of 255,
//! larger ones as parts of 65535. Opacity is judged by itself where its numbers all lie in 0..1 and
//! those of the colours do not.

/// Names of columns, by red, green, blue and opacity; the first set that is there counts.
const NAMES: [[&str; 4]; 3] = [
    ["red", "green", "blue", "alpha"],
    ["diffuse_red", "diffuse_green", "diffuse_blue", "diffuse_alpha"],
    ["r", "g", "b", "a"],
];

/// Numbers that exceed 1 by no more than this are rounded, not parts of 255.
const ROUNDING: f64 = 1e-3;

/// A column that may hold colours.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ColorColumn<'a> {
    pub(crate) name: &'a str,
    /// Whether it is stored as whole numbers of one byte without sign.
    pub(crate) byte: bool,
    pub(crate) values: &'a [f64],
}

/// Colours of vertices, RGB or RGBA, 0..1.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Colors {
    /// 3, or 4 with opacity.
    pub(crate) channels: usize,
    /// Row after row.
    pub(crate) values: Vec<f64>,
    /// What was decided about the range, if there was a choice.
    pub(crate) note: Option<String>,
}

impl Colors {
    /// As a mesh has them. Numbers outside 0..1 are cut off, what is not finite is white.
    pub(crate) fn rgba(&self) -> Vec<[f32; 4]> {
        let cut = |x: f64| if x.is_finite() { x.clamp(0.0, 1.0) as f32 } else { 1.0 };
        let color = |c: &[f64]| [cut(c[0]), cut(c[1]), cut(c[2]), c.get(3).map_or(1.0, |&a| cut(a))];
        self.values.chunks_exact(self.channels).map(color).collect()
    }
}

/// Whether a column of this name may hold colours.
pub(crate) fn may_be(name: &str) -> bool {
    NAMES.iter().flatten().any(|n| n.eq_ignore_ascii_case(name))
}

/// The colours among columns, whatever their letter case; `None` without any.
pub(crate) fn find(columns: &[ColorColumn<'_>]) -> Option<Colors> {
    let column = |name: &str| columns.iter().find(|c| c.name.eq_ignore_ascii_case(name));
    let named = |[r, g, b, a]: &[&str; 4]| Some(([column(r)?, column(g)?, column(b)?], column(a)));
    let (colors, opacity) = NAMES.iter().find_map(named)?;
    let free = |c: &&ColorColumn<'_>| !c.byte;
    let largest = |c: &ColorColumn<'_>| c.values.iter().copied().filter(|x| x.is_finite()).fold(0.0, f64::max);
    let of_colors = colors.iter().copied().filter(free).map(largest).fold(0.0, f64::max);
    let of_opacity = opacity.filter(free).map_or(0.0, largest);
    let opacity_apart = of_opacity <= 1.0 + ROUNDING;
    let full = full_scale(if opacity_apart { of_colors } else { of_colors.max(of_opacity) });
    let scale = |c: &ColorColumn<'_>, full: f64| if c.byte { 1.0 / 255.0 } else { 1.0 / full };
    let mut all = colors.map(|c| (c, scale(c, full))).to_vec();
    all.extend(opacity.map(|c| (c, scale(c, if opacity_apart { 1.0 } else { full }))));
    let rows = all.iter().map(|(c, _)| c.values.len()).min().unwrap_or(0);
    let values = (0..rows).flat_map(|row| all.iter().map(move |(c, scale)| c.values[row] * scale)).collect();
    Some(Colors { channels: all.len(), values, note: note(full) })
}

/// The number that stands for 1, by the largest there is.
fn full_scale(largest: f64) -> f64 {
    match largest {
        x if x <= 1.0 + ROUNDING => 1.0,
        x if x <= 255.0 => 255.0,
        _ => 65535.0,
    }
}

fn note(full: f64) -> Option<String> {
    (full != 1.0).then(|| format!("vertex colours have numbers above 1 and are read as parts of {full}"))
}

/// Colours that stand behind the positions of an OBJ file: up to four numbers a vertex, from the
/// fourth on, and their count. Six numbers in all are x y z r g b; seven x y z w r g b where the
/// fourth is 1 throughout, else x y z r g b a. Vertices with fewer numbers are white. `None` where
/// no vertex has six numbers.
pub(crate) fn behind_positions(numbers: &[([f64; 4], u8)]) -> Option<Colors> {
    let with = |count: u8| numbers.iter().filter(move |(_, n)| *n == count);
    if !numbers.iter().any(|(_, n)| *n >= 3) {
        return None;
    }
    let weighted = with(4).count() > 0 && with(4).all(|(n, _)| n[0] == 1.0);
    let color = |(n, count): &([f64; 4], u8)| match (count, weighted) {
        (4.., true) => ([n[1], n[2], n[3], f64::NAN], 3),
        (count, _) => (*n, *count),
    };
    of_rows(&numbers.iter().map(color).collect::<Vec<_>>())
}

/// Colours by rows of three or four numbers; rows with fewer are white. `None` where no row has
/// three.
pub(crate) fn of_rows(rows: &[([f64; 4], u8)]) -> Option<Colors> {
    let most = rows.iter().map(|r| r.1).max().filter(|&n| n >= 3)?;
    let mut columns = [const { Vec::new() }; 4];
    for (numbers, count) in rows {
        for (k, column) in columns.iter_mut().enumerate() {
            column.push(if *count >= 3 && k < usize::from(*count) { numbers[k] } else { f64::NAN });
        }
    }
    let column = |k: usize| ColorColumn { name: NAMES[0][k], byte: false, values: &columns[k] };
    find(&[column(0), column(1), column(2), column(3)][..usize::from(most)])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column<'a>(name: &'a str, byte: bool, values: &'a [f64]) -> ColorColumn<'a> {
        ColorColumn { name, byte, values }
    }

    #[test]
    fn names_of_all_kinds_are_found() {
        let v = [0.25, 1.0];
        for names in [["red", "green", "blue"], ["R", "G", "B"], ["Diffuse_Red", "diffuse_green", "diffuse_blue"]] {
            let columns = [
                column("x", false, &v),
                column(names[2], false, &v),
                column(names[0], false, &v),
                column(names[1], false, &v),
            ];
            let found = find(&columns).unwrap();
            assert_eq!((found.channels, found.values.len(), found.note), (3, 6, None), "{names:?}");
        }
        assert_eq!(find(&[column("red", true, &v), column("green", true, &v), column("b", true, &v)]), None);
    }

    #[test]
    fn the_range_is_that_of_the_whole_set() {
        let set = |r: &[f64], g: &[f64], b: &[f64], a: Option<&[f64]>, byte: bool| {
            let mut columns = vec![column("red", byte, r), column("green", byte, g), column("blue", byte, b)];
            columns.extend(a.map(|a| column("alpha", false, a)));
            find(&columns).unwrap()
        };
        // Blue alone shows that 1 is not full.
        let c = set(&[1.0], &[0.0], &[51.0], None, false);
        assert_eq!((c.values, c.note.is_some()), (vec![1.0 / 255.0, 0.0, 0.2], true));
        assert_eq!(set(&[1.0], &[0.5], &[1.0000001], None, false).values, [1.0, 0.5, 1.0000001]);
        assert_eq!(set(&[65535.0], &[0.0], &[13107.0], None, false).values, [1.0, 0.0, 0.2]);
        // Bytes need no decision.
        let c = set(&[1.0], &[255.0], &[0.0], None, true);
        assert_eq!((c.values, c.note), (vec![1.0 / 255.0, 1.0, 0.0], None));
        // Opacity of 0..1 beside colours of 0..255, and of the same range.
        assert_eq!(set(&[255.0], &[0.0], &[0.0], Some(&[0.5]), false).values[3], 0.5);
        assert_eq!(set(&[255.0], &[0.0], &[0.0], Some(&[51.0]), false).values[3], 0.2);
        assert_eq!(set(&[255.0], &[0.0], &[0.0], Some(&[0.5]), true).values, [1.0, 0.0, 0.0, 0.5]);
        let cut = Colors { channels: 3, values: vec![-1.0, f64::NAN, 1.5], note: None };
        assert_eq!(cut.rgba(), [[0.0, 1.0, 1.0, 1.0]]);
    }

    #[test]
    fn the_count_of_numbers_tells_colours_from_weights() {
        let row = |numbers: &[f64]| {
            let mut four = [0.0; 4];
            four[..numbers.len()].copy_from_slice(numbers);
            (four, numbers.len() as u8)
        };
        let rgba =
            |rows: &[&[f64]]| behind_positions(&rows.iter().map(|r| row(r)).collect::<Vec<_>>()).map(|c| c.rgba());
        assert_eq!(rgba(&[&[], &[1.0]]), None, "positions, and weights");
        assert_eq!(rgba(&[&[0.5, 0.25, 1.0], &[]]).unwrap(), [[0.5, 0.25, 1.0, 1.0], [1.0; 4]]);
        assert_eq!(rgba(&[&[51.0, 255.0, 0.0]]).unwrap(), [[0.2, 1.0, 0.0, 1.0]]);
        assert_eq!(
            rgba(&[&[1.0, 0.5, 0.25, 0.0], &[1.0, 0.0, 0.0, 1.0]]).unwrap()[0],
            [0.5, 0.25, 0.0, 1.0],
            "x y z w"
        );
        assert_eq!(
            rgba(&[&[1.0, 0.5, 0.25, 0.0], &[0.5, 0.0, 0.0, 1.0]]).unwrap()[0],
            [1.0, 0.5, 0.25, 0.0],
            "r g b a"
        );
    }
}
