//! Two triangulations of one convex polygon laid over one another (Aronov, Seidel, Souvaine 1993).
//!
//! A disc cut out of two drawings has the same word of boundary vertices in both, and a
//! triangulation without inner vertices in each. Placed on a convex polygon, diagonals of the one
//! cross diagonals of the other; with the crossings as new vertices the cells are convex in both
//! drawings, since each lies in one triangle of either. Nothing here needs coordinates but the new
//! vertices themselves: which diagonals cross, and in which order, follows from the places of their
//! ends.

use std::collections::HashMap;

use glam::DVec2;

/// A diagonal by the places of its ends, the smaller first.
type Diagonal = (usize, usize);

/// A vertex of the overlay.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Point {
    /// A place of the word.
    Place(usize),
    /// A crossing, by number.
    Crossing(usize),
}

fn diagonals(triangles: &[[usize; 3]], n: usize) -> Vec<Diagonal> {
    let mut found: Vec<Diagonal> = triangles
        .iter()
        .flat_map(|&[i, j, k]| [(i, j), (j, k), (i, k)])
        .filter(|&(a, b)| b - a > 1 && (a, b) != (0, n - 1))
        .collect();
    found.sort_unstable();
    found.dedup();
    found
}

/// Crossings along each diagonal of `own` with those of `other`, from its smaller end on.
fn order(own: &[Diagonal], other: &[Diagonal], n: usize) -> Vec<Vec<Diagonal>> {
    own.iter()
        .map(|&(a, b)| {
            let within = |x: usize| a < x && x < b;
            let mut crossing: Vec<(usize, usize, Diagonal)> = other
                .iter()
                .filter(|&&(c, d)| (within(c) && (d > b)) || (within(d) && c < a))
                .map(|&(c, d)| {
                    let (inner, outer) = if within(c) { (c, d) } else { (d, c) };
                    // Diagonals of one triangulation do not cross: from a on, both ends move away
                    // from it.
                    (inner, (a + n - outer) % n, (c, d))
                })
                .collect();
            crossing.sort_unstable();
            crossing.into_iter().map(|(_, _, diagonal)| diagonal).collect()
        })
        .collect()
}

/// What the overlay adds to the word.
pub(super) struct Overlay {
    /// New vertices in both drawings.
    pub(super) points: [Vec<DVec2>; 2],
    /// Triangles, anticlockwise in both: vertices of the drawings, and new ones numbered from
    /// `first`.
    pub(super) triangles: Vec<[usize; 3]>,
}

/// The overlay of two triangulations of the disc with boundary `word`, given by places; new
/// vertices count from `first`.
///
/// `None` if there would be more than `most` crossings.
pub(super) fn overlay(
    word: &[usize],
    triangles: &[Vec<[usize; 3]>; 2],
    drawings: &[Vec<DVec2>; 2],
    first: usize,
    most: usize,
) -> Option<Overlay> {
    let n = word.len();
    let diagonals = [diagonals(&triangles[0], n), diagonals(&triangles[1], n)];
    let orders = [order(&diagonals[0], &diagonals[1], n), order(&diagonals[1], &diagonals[0], n)];
    if orders[0].iter().map(Vec::len).sum::<usize>() > most {
        return None;
    }
    // Numbers of the crossings, and where they are in the drawing whose diagonal they are on:
    // evenly spaced.
    let mut number: HashMap<(Diagonal, Diagonal), usize> = HashMap::new();
    let mut points = [Vec::new(), Vec::new()];
    let spaced = |side: usize, (a, b): Diagonal, k: usize, count: usize| {
        let points = &drawings[side];
        points[word[a]].lerp(points[word[b]], (k + 1) as f64 / (count + 1) as f64)
    };
    for (&own, crossing) in diagonals[0].iter().zip(&orders[0]) {
        for (k, &other) in crossing.iter().enumerate() {
            number.insert((own, other), points[0].len());
            points[0].push(spaced(0, own, k, crossing.len()));
        }
    }
    points[1] = vec![DVec2::ZERO; points[0].len()];
    for (&other, crossing) in diagonals[1].iter().zip(&orders[1]) {
        for (k, &own) in crossing.iter().enumerate() {
            points[1][number[&(own, other)]] = spaced(1, other, k, crossing.len());
        }
    }
    let along: HashMap<Diagonal, &Vec<Diagonal>> = diagonals[0].iter().copied().zip(&orders[0]).collect();
    let mut cells = Vec::new();
    for &[i, j, k] in &triangles[0] {
        cells.extend(split([i, j, k], &along, &number));
    }
    let vertex = |point: &Point| match *point {
        Point::Place(place) => word[place],
        Point::Crossing(number) => first + number,
    };
    let triangles =
        cells.iter().flat_map(|cell| (2..cell.len()).map(|k| [&cell[0], &cell[k - 1], &cell[k]].map(vertex))).collect();
    Some(Overlay { points, triangles })
}

/// Cells of one triangle of the first triangulation, cut by the diagonals of the second that pass
/// through it.
fn split(
    triangle: [usize; 3],
    along: &HashMap<Diagonal, &Vec<Diagonal>>,
    number: &HashMap<(Diagonal, Diagonal), usize>,
) -> Vec<Vec<Point>> {
    let [i, j, k] = triangle;
    // The triangle's outline, and for each diagonal the positions on it where it enters and leaves.
    let mut outline = Vec::new();
    let mut hits: Vec<(Diagonal, usize)> = Vec::new();
    let mut corner_at = [0; 3];
    for (side, (a, b)) in [(i, j), (j, k), (k, i)].into_iter().enumerate() {
        corner_at[side] = outline.len();
        outline.push(Point::Place(a));
        let own = (a.min(b), a.max(b));
        let mut crossing: Vec<Diagonal> = along.get(&own).map(|c| c.to_vec()).unwrap_or_default();
        if a > b {
            crossing.reverse();
        }
        for other in crossing {
            hits.push((other, outline.len()));
            outline.push(Point::Crossing(number[&(own, other)]));
        }
    }
    hits.sort_unstable();
    let mut chords: Vec<(usize, usize)> = Vec::new();
    let mut at = 0;
    while at < hits.len() {
        let (diagonal, position) = hits[at];
        if hits.get(at + 1).is_some_and(|next| next.0 == diagonal) {
            chords.push((position, hits[at + 1].1));
            at += 2;
            continue;
        }
        // It ends in the corner opposite to the side it crosses.
        let ends = [diagonal.0, diagonal.1];
        if let Some(corner) = (0..3).find(|&c| ends.contains(&triangle[c])) {
            chords.push((position.min(corner_at[corner]), position.max(corner_at[corner])));
        }
        at += 1;
    }
    // Shorter chords first: each cuts a cell off what is left.
    chords.sort_unstable_by_key(|&(a, b)| (b - a, a));
    let mut next: Vec<usize> = (1..=outline.len()).collect();
    let walk = |next: &[usize], from: usize, to: usize| {
        let mut cell = Vec::new();
        let mut at = from;
        while at < to {
            cell.push(outline[at]);
            at = next[at];
        }
        cell
    };
    let mut cells = Vec::new();
    for (a, b) in chords {
        let mut cell = walk(&next, a, b);
        cell.push(outline[b]);
        cells.push(cell);
        next[a] = b;
    }
    cells.push(walk(&next, 0, outline.len()));
    cells
}
