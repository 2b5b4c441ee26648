//! The control cage all characters share: the boundary of a body made of unit cubes.
//!
//! Every character is the Catmull-Clark surface of this one cage of quads with its own control
//! positions, so a point of the body is named by a quad and two parameters, the same for all of
//! them.

use std::collections::{BTreeMap, HashMap};

/// A corner of the lattice in which the cage is built: x to the character's left, y up, z to the
/// front.
pub(super) type Lattice = [i32; 3];

/// Parts of the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) enum Part {
    /// From the crotch to the shoulders.
    Torso,
    /// The neck.
    Neck,
    /// The head without nose and ears.
    Head,
    /// The nose.
    Nose,
    /// An ear, by side (0 right, 1 left).
    Ear(u8),
    /// An arm with its hand but without the thumb, by side.
    Arm(u8),
    /// A thumb, by side.
    Thumb(u8),
    /// A leg without the foot, by side.
    Leg(u8),
    /// A foot, by side.
    Foot(u8),
}

/// Outward direction of a lattice face: the axis and its sign.
pub(super) type Facing = (usize, bool);

/// A closed cage of quads.
#[derive(Clone, Debug)]
pub(super) struct Cage {
    /// Lattice place of each control vertex.
    pub(super) vertices: Vec<Lattice>,
    /// Quads, counter-clockwise from outside; corners stand at parameters (0,0), (1,0), (1,1),
    /// (0,1).
    pub(super) quads: Vec<[u32; 4]>,
    /// Part of each quad.
    pub(super) parts: Vec<Part>,
    /// Direction each quad faces in the lattice.
    pub(super) facings: Vec<Facing>,
    /// Across edge `e` (from corner e to e + 1) of a quad: the neighbour and its own edge.
    pub(super) neighbours: Vec<[(u32, usize); 4]>,
    /// Undirected edge of each quad's edge.
    pub(super) edges: Vec<[u32; 4]>,
    /// Number of undirected edges.
    pub(super) edge_count: usize,
}

/// Highest lattice row of the torso.
pub(super) const TORSO_TOP: i32 = 5;
/// Segments of an arm.
pub(super) const ARM_SEGMENTS: i32 = 7;
/// Segments of a leg, the last one being the foot.
pub(super) const LEG_SEGMENTS: i32 = 7;

/// The cubes of the body.
fn cubes() -> BTreeMap<Lattice, Part> {
    let mut cubes = BTreeMap::new();
    let mut fill = |x: std::ops::Range<i32>, y: std::ops::Range<i32>, z: std::ops::Range<i32>, part: Part| {
        for x in x {
            for y in y.clone() {
                for z in z.clone() {
                    cubes.insert([x, y, z], part);
                }
            }
        }
    };
    fill(0..3, 0..TORSO_TOP, 0..2, Part::Torso);
    fill(1..2, 5..6, 0..2, Part::Neck);
    fill(0..3, 6..9, 0..2, Part::Head);
    fill(1..2, 7..8, 2..3, Part::Nose);
    fill(-1..0, 7..8, 0..1, Part::Ear(0));
    fill(3..4, 7..8, 0..1, Part::Ear(1));
    fill(-ARM_SEGMENTS..0, 4..5, 0..2, Part::Arm(0));
    fill(3..3 + ARM_SEGMENTS, 4..5, 0..2, Part::Arm(1));
    fill(-6..-5, 4..5, 2..3, Part::Thumb(0));
    fill(8..9, 4..5, 2..3, Part::Thumb(1));
    for (side, x) in [(0, 0), (1, 2)] {
        fill(x..x + 1, 1 - LEG_SEGMENTS..0, 0..2, Part::Leg(side));
        fill(x..x + 1, -LEG_SEGMENTS..1 - LEG_SEGMENTS, 0..4, Part::Foot(side));
    }
    cubes
}

impl Cage {
    /// The cage of the body.
    pub(super) fn new() -> Self {
        let cubes = cubes();
        // Per direction: the corners of the unit cube's face with u to the right and v up as seen
        // from outside.
        let faces: [(Facing, [Lattice; 4]); 6] = [
            ((0, true), [[1, 0, 1], [1, 0, 0], [1, 1, 0], [1, 1, 1]]),
            ((0, false), [[0, 0, 0], [0, 0, 1], [0, 1, 1], [0, 1, 0]]),
            ((1, true), [[0, 1, 1], [1, 1, 1], [1, 1, 0], [0, 1, 0]]),
            ((1, false), [[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]]),
            ((2, true), [[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]),
            ((2, false), [[1, 0, 0], [0, 0, 0], [0, 1, 0], [1, 1, 0]]),
        ];
        let mut index: BTreeMap<Lattice, u32> = BTreeMap::new();
        let mut vertices = Vec::new();
        let (mut quads, mut parts, mut facings) = (Vec::new(), Vec::new(), Vec::new());
        for (&cube, &part) in &cubes {
            for (facing, corners) in faces {
                let mut beyond = cube;
                beyond[facing.0] += if facing.1 { 1 } else { -1 };
                if cubes.contains_key(&beyond) {
                    continue;
                }
                quads.push(corners.map(|c| {
                    let place = [cube[0] + c[0], cube[1] + c[1], cube[2] + c[2]];
                    *index.entry(place).or_insert_with(|| {
                        vertices.push(place);
                        vertices.len() as u32 - 1
                    })
                }));
                parts.push(part);
                facings.push(facing);
            }
        }
        let (edges, edge_count, neighbours) = adjacency(&quads);
        Self { vertices, quads, parts, facings, neighbours, edges, edge_count }
    }
}

/// Edge numbers and neighbours of the quads of a closed manifold.
#[expect(clippy::type_complexity, reason = "an internal triple that is taken apart at once")]
pub(super) fn adjacency(quads: &[[u32; 4]]) -> (Vec<[u32; 4]>, usize, Vec<[(u32, usize); 4]>) {
    let mut seen: HashMap<(u32, u32), (u32, u32, usize)> = HashMap::new();
    let mut edges = vec![[0; 4]; quads.len()];
    let mut neighbours = vec![[(u32::MAX, 0); 4]; quads.len()];
    let mut count = 0;
    for (q, quad) in quads.iter().enumerate() {
        for e in 0..4 {
            let (a, b) = (quad[e], quad[(e + 1) % 4]);
            if let Some(&(edge, other, f)) = seen.get(&(b, a)) {
                edges[q][e] = edge;
                neighbours[q][e] = (other, f);
                neighbours[other as usize][f] = (q as u32, e);
            } else {
                edges[q][e] = count;
                seen.insert((a, b), (count, q as u32, e));
                count += 1;
            }
        }
    }
    (edges, count as usize, neighbours)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cage_is_a_closed_sphere_of_quads() {
        let cage = Cage::new();
        assert!(cage.neighbours.iter().flatten().all(|n| n.0 != u32::MAX));
        assert_eq!(2 * cage.edge_count, 4 * cage.quads.len());
        assert_eq!(cage.vertices.len() + cage.quads.len(), cage.edge_count + 2);
        for (q, around) in cage.neighbours.iter().enumerate() {
            for (e, &(other, f)) in around.iter().enumerate() {
                assert_eq!(cage.neighbours[other as usize][f], (q as u32, e));
                assert_eq!(cage.edges[other as usize][f], cage.edges[q][e]);
            }
        }
    }
}
