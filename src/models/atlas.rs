//! Texture coordinates: quads of the cage unfolded into charts, charts packed into the unit square.

use std::collections::{BTreeMap, VecDeque};

use glam::{DVec2, IVec3};

use super::cage::{Cage, Facing, Part};

/// How a character's surface is cut into charts and how these are packed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum AtlasStyle {
    /// One chart around each part: sleeves unrolled.
    Unrolled,
    /// Parts cut into a front and a back half, charts turned by a quarter.
    Halves,
}

/// Space between charts, as a fraction of the texture: 10 texels at 1024.
const GAP: f64 = 10.0 / 1024.0;

/// The texture coordinates of the corners of each quad of the cage, and its chart.
#[derive(Clone, Debug)]
pub(super) struct Atlas {
    /// Texture coordinates at parameters (0,0), (1,0), (1,1), (0,1); bilinear between.
    pub(super) corners: Vec<[DVec2; 4]>,
    /// Chart of each quad.
    pub(super) charts: Vec<u32>,
}

/// A quad placed in a chart: cell and quarter turns.
#[derive(Clone, Copy)]
struct Cell {
    quad: u32,
    x: i32,
    y: i32,
    turn: usize,
}

const SIDES: [(i32, i32); 4] = [(0, -1), (1, 0), (0, 1), (-1, 0)];
const CORNERS: [(i32, i32); 4] = [(0, 0), (1, 0), (1, 1), (0, 1)];

impl Atlas {
    /// The atlas for quads with given side lengths (along their two parameters).
    pub(super) fn new(cage: &Cage, lengths: &[[f64; 2]], style: AtlasStyle) -> Self {
        let groups: Vec<_> = (0..cage.quads.len()).map(|q| group(cage.parts[q], cage.facings[q], style)).collect();
        let mut charts = vec![u32::MAX; cage.quads.len()];
        let mut flat: Vec<(Vec<Cell>, Layout)> = Vec::new();
        for seed in 0..cage.quads.len() {
            // Start in the middle of the front where a part has one, so that its seam lies at the
            // back.
            if charts[seed] != u32::MAX {
                continue;
            }
            let seed = front_seed(cage, &groups, &charts, seed);
            let cells = unfold(cage, &groups, seed, &mut charts, flat.len() as u32);
            let layout = Layout::new(&cells, lengths);
            flat.push((cells, layout));
        }
        let mut sizes: Vec<DVec2> = flat.iter().map(|(_, l)| l.size()).collect();
        let turned: Vec<bool> = sizes.iter().map(|s| (s.x > s.y) == (style == AtlasStyle::Halves)).collect();
        for (s, &t) in sizes.iter_mut().zip(&turned) {
            if t {
                *s = DVec2::new(s.y, s.x);
            }
        }
        let (scale, places) = pack(&sizes);
        let mut corners = vec![[DVec2::ZERO; 4]; cage.quads.len()];
        for (chart, (cells, layout)) in flat.iter().enumerate() {
            for cell in cells {
                for c in 0..4 {
                    let (dx, dy) = CORNERS[(c + cell.turn) % 4];
                    let p = layout.point(cell.x + dx, cell.y + dy);
                    // A quarter turn counter-clockwise, kept in the positive quadrant.
                    let p = if turned[chart] { DVec2::new(sizes[chart].x - p.y, p.x) } else { p };
                    corners[cell.quad as usize][c] = places[chart] + p * scale;
                }
            }
        }
        Self { corners, charts }
    }

    /// Texture coordinates at parameters of a quad.
    pub(super) fn texcoord(&self, quad: u32, p: DVec2) -> DVec2 {
        let [a, b, c, d] = self.corners[quad as usize];
        a.lerp(b, p.x).lerp(d.lerp(c, p.x), p.y)
    }
}

/// Quads of different groups lie in different charts.
fn group(part: Part, (axis, positive): Facing, style: AtlasStyle) -> (Part, u8) {
    if style == AtlasStyle::Unrolled {
        let half = match part {
            // Soles come apart from uppers.
            Part::Foot(_) if axis == 1 && !positive => 1,
            _ => 0,
        };
        return (part, half);
    }
    let half = match part {
        Part::Torso | Part::Head | Part::Neck | Part::Leg(_) => u8::from(axis == 2 && !positive),
        Part::Arm(_) => u8::from(axis == 1 && !positive),
        Part::Foot(_) => u8::from(axis == 1 && !positive),
        Part::Nose | Part::Ear(_) | Part::Thumb(_) => 0,
    };
    (part, half)
}

/// The unplaced quad of the group of `first` whose lattice place is most central, preferring those
/// that face the front.
fn front_seed(cage: &Cage, groups: &[(Part, u8)], charts: &[u32], first: usize) -> usize {
    let members: Vec<usize> =
        (first..cage.quads.len()).filter(|&q| groups[q] == groups[first] && charts[q] == u32::MAX).collect();
    let front: Vec<usize> = members.iter().copied().filter(|&q| cage.facings[q] == (2, true)).collect();
    let candidates = if front.is_empty() { &members } else { &front };
    // Four times the centre of a quad in the lattice, kept whole.
    let centre = |q: usize| -> IVec3 { cage.quads[q].iter().map(|&v| IVec3::from(cage.vertices[v as usize])).sum() };
    let sum: IVec3 = candidates.iter().map(|&q| centre(q)).sum();
    let n = candidates.len() as i32;
    let off = |q: usize| (centre(q) * n - sum).abs().element_sum();
    candidates.iter().copied().min_by_key(|&q| (off(q), q)).unwrap_or(first)
}

/// Unfolds quads of one group from `seed` into the cells of a lattice, breadth first. A cell is
/// taken only if each of its neighbours in the plane is its neighbour on the cage too, so that
/// nothing meets in the plane that is apart on the body.
fn unfold(cage: &Cage, groups: &[(Part, u8)], seed: usize, charts: &mut [u32], chart: u32) -> Vec<Cell> {
    let mut cells = vec![Cell { quad: seed as u32, x: 0, y: 0, turn: 0 }];
    let mut taken: BTreeMap<(i32, i32), Cell> = BTreeMap::from([((0, 0), cells[0])]);
    charts[seed] = chart;
    let mut queue = VecDeque::from([cells[0]]);
    while let Some(cell) = queue.pop_front() {
        for side in [1, 3, 2, 0] {
            let edge = (side + 4 - cell.turn) % 4;
            let (other, f) = cage.neighbours[cell.quad as usize][edge];
            if charts[other as usize] != u32::MAX || groups[other as usize] != groups[seed] {
                continue;
            }
            let (dx, dy) = SIDES[side];
            let next = Cell { quad: other, x: cell.x + dx, y: cell.y + dy, turn: (side + 2 + 4 - f) % 4 };
            if taken.contains_key(&(next.x, next.y)) || !fits(cage, &taken, next) {
                continue;
            }
            charts[other as usize] = chart;
            taken.insert((next.x, next.y), next);
            cells.push(next);
            queue.push_back(next);
        }
    }
    cells
}

fn fits(cage: &Cage, taken: &BTreeMap<(i32, i32), Cell>, cell: Cell) -> bool {
    let corner = |c: &Cell, k: usize| cage.quads[c.quad as usize][(k + 4 - c.turn) % 4];
    (0..4).all(|side| {
        let (dx, dy) = SIDES[side];
        let beside = taken.get(&(cell.x + dx, cell.y + dy)).is_none_or(|other| {
            let (neighbour, f) = cage.neighbours[cell.quad as usize][(side + 4 - cell.turn) % 4];
            neighbour == other.quad && (f + other.turn) % 4 == (side + 2) % 4
        });
        // Corner k and the cell diagonally beyond it.
        let (cx, cy) = CORNERS[side];
        let diagonal = taken
            .get(&(cell.x + 2 * cx - 1, cell.y + 2 * cy - 1))
            .is_none_or(|other| corner(&cell, side) == corner(other, (side + 2) % 4));
        beside && diagonal
    })
}

/// Places of the lattice points of a chart, in metres from its lower left.
struct Layout {
    x: BTreeMap<i32, f64>,
    y: BTreeMap<i32, f64>,
}

impl Layout {
    fn new(cells: &[Cell], lengths: &[[f64; 2]]) -> Self {
        let axis = |along: usize| {
            let mut sums: BTreeMap<i32, (f64, f64)> = BTreeMap::new();
            for cell in cells {
                let length = lengths[cell.quad as usize][(along + cell.turn) % 2];
                let sum = sums.entry(if along == 0 { cell.x } else { cell.y }).or_default();
                sum.0 += length;
                sum.1 += 1.0;
            }
            let mut at = 0.0;
            let mut points = BTreeMap::new();
            for (&i, &(sum, n)) in &sums {
                points.insert(i, at);
                at += sum / n;
                points.insert(i + 1, at);
            }
            points
        };
        Self { x: axis(0), y: axis(1) }
    }

    fn point(&self, x: i32, y: i32) -> DVec2 {
        DVec2::new(self.x[&x], self.y[&y])
    }

    fn size(&self) -> DVec2 {
        let last = |m: &BTreeMap<i32, f64>| m.values().copied().fold(0.0, f64::max);
        DVec2::new(last(&self.x), last(&self.y))
    }
}

/// Packs boxes into the unit square at the largest common scale: the scale and the lower left
/// corners.
fn pack(sizes: &[DVec2]) -> (f64, Vec<DVec2>) {
    let mut order: Vec<usize> = (0..sizes.len()).collect();
    order.sort_by(|&a, &b| sizes[b].max_element().total_cmp(&sizes[a].max_element()).then(a.cmp(&b)));
    let area: f64 = sizes.iter().map(|s| s.x * s.y).sum();
    let (mut low, mut high) = (0.0, 1.0 / area.sqrt());
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if drop_boxes(sizes, &order, middle).is_some() {
            low = middle;
        } else {
            high = middle;
        }
    }
    let places = drop_boxes(sizes, &order, low).unwrap_or_else(|| vec![DVec2::splat(0.5); sizes.len()]);
    (low, places)
}

/// Drops one box after the other to the lowest, then leftmost place over the skyline of those
/// before; `None` if one does not fit.
fn drop_boxes(sizes: &[DVec2], order: &[usize], scale: f64) -> Option<Vec<DVec2>> {
    let mut places = vec![DVec2::ZERO; sizes.len()];
    // Steps of the skyline from the left: start and height.
    let mut skyline = vec![(GAP, GAP)];
    for &i in order {
        let size = sizes[i] * scale;
        let height_over = |x: f64| {
            let end = x + size.x + GAP;
            let next = |k: usize| skyline.get(k + 1).map_or(1.0, |s| s.0);
            (0..skyline.len()).filter(|&k| next(k) > x && skyline[k].0 < end).fold(GAP, |h, k| skyline[k].1.max(h))
        };
        let (y, x) = skyline
            .iter()
            .map(|s| (height_over(s.0), s.0))
            .filter(|(y, x)| x + size.x + GAP <= 1.0 && y + size.y + GAP <= 1.0)
            .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)))?;
        places[i] = DVec2::new(x, y);
        let end = x + size.x + GAP;
        let after = skyline.iter().rev().find(|s| s.0 <= end).map_or(GAP, |s| s.1);
        skyline.retain(|s| s.0 < x || s.0 > end);
        skyline.extend([(x, y + size.y + GAP), (end, after)]);
        skyline.sort_by(|a, b| a.0.total_cmp(&b.0));
    }
    Some(places)
}
