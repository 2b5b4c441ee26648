//! Simple shapes with a controlled triangulation.
//!
//! All shapes are oriented counter-clockwise seen from outside (from +z for planar ones). Counts
//! below the smallest that makes a proper shape are raised to it. Building takes time and memory
//! linear in the number of vertices.

use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};

use crate::geometry::{Corner, Mesh, MeshBuilder, NONE};

/// How the quads of a grid are cut into triangles.
#[doc(hidden)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Diagonal {
    /// From the quad's (0, 0) to its (1, 1).
    #[default]
    Forward,
    /// From the quad's (1, 0) to its (0, 1).
    Backward,
    /// In turns, like a chess board.
    Alternating,
}

impl Diagonal {
    /// The corners (0: (0,0), 1: (1,0), 2: (1,1), 3: (0,1)) of the two triangles of quad `(i, j)`.
    pub fn split(self, i: usize, j: usize) -> [[usize; 3]; 2] {
        let forward = match self {
            Self::Forward => true,
            Self::Backward => false,
            Self::Alternating => (i + j).is_multiple_of(2),
        };
        if forward { [[0, 1, 2], [0, 2, 3]] } else { [[0, 1, 3], [1, 2, 3]] }
    }
}

/// A grid of `nx` by `ny` quads whose vertices may be glued at the ends, with texture coordinates
/// over the unit square.
///
/// Quads that collapse to a triangle or less (at a pole) give one triangle or none.
struct Grid<'a> {
    name: &'a str,
    nx: usize,
    ny: usize,
    diagonal: Diagonal,
    positions: Vec<DVec3>,
}

impl Grid<'_> {
    fn build(self, vertex: impl Fn(usize, usize) -> u32) -> Mesh {
        let (nx, ny) = (self.nx, self.ny);
        let mut builder = MeshBuilder::new(self.name);
        builder.mesh.positions = self.positions;
        builder.mesh.texcoords = (0..=ny)
            .flat_map(|j| (0..=nx).map(move |i| DVec2::new(i as f64 / nx as f64, j as f64 / ny as f64)))
            .collect();
        for j in 0..ny {
            for i in 0..nx {
                let corner = |i: usize, j: usize| Corner {
                    vertex: vertex(i, j),
                    texcoord: (j * (nx + 1) + i) as u32,
                    normal: NONE,
                };
                let c = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
                let diagonal = if c[0].vertex == c[1].vertex {
                    // At the lower pole the cut must not run into the collapsed side twice.
                    Diagonal::Forward
                } else if c[2].vertex == c[3].vertex {
                    Diagonal::Backward
                } else {
                    self.diagonal
                };
                for t in diagonal.split(i, j) {
                    let t = t.map(|k| c[k]);
                    let [a, b, d] = t.map(|c| c.vertex);
                    if a != b && b != d && d != a {
                        builder.polygon(t);
                    }
                }
            }
        }
        builder.finish()
    }
}

/// A rectangle `[0, width] x [0, height]` at z = 0 of `nx` by `ny` quads, with texture coordinates
/// over the unit square.
///
/// Vertex `(i, j)` has the index `j * (nx + 1) + i`.
#[doc(hidden)]
pub fn plane_grid(nx: usize, ny: usize, width: f64, height: f64, diagonal: Diagonal) -> Mesh {
    irregular_plane(nx, ny, width, height, diagonal, 0.0, 0)
}

/// A [`plane_grid`] whose inner vertices are moved at random by up to `amount` (0 to 0.3 keeps all
/// triangles upright) of the grid's spacing; the texture coordinates move along, so that the
/// texture stays affine.
#[doc(hidden)]
pub fn irregular_plane(
    nx: usize,
    ny: usize,
    width: f64,
    height: f64,
    diagonal: Diagonal,
    amount: f64,
    seed: u64,
) -> Mesh {
    let (nx, ny) = (nx.max(1), ny.max(1));
    let mut random = Random::new(seed);
    let mut parameters = Vec::with_capacity((nx + 1) * (ny + 1));
    for j in 0..=ny {
        for i in 0..=nx {
            let (dx, dy) = (random.signed(), random.signed());
            let inner = i > 0 && i < nx && j > 0 && j < ny;
            let shift = if inner { amount } else { 0.0 };
            let u = (i as f64 + shift * dx) / nx as f64;
            let v = (j as f64 + shift * dy) / ny as f64;
            parameters.push(DVec2::new(u, v));
        }
    }
    let positions = parameters.iter().map(|p| DVec3::new(p.x * width, p.y * height, 0.0)).collect();
    let mut mesh = Grid { name: "plane", nx, ny, diagonal, positions }.build(|i, j| (j * (nx + 1) + i) as u32);
    mesh.texcoords = parameters;
    mesh
}

/// A sphere of `slices` meridians and `stacks` parallels around the y axis, poles included, closed,
/// with texture coordinates (u along the equator with a seam, v from the south to the north pole).
///
/// Vertex 0 is the south pole, `1 + j * slices + i` lies on parallel `j`, the last one is the north
/// pole.
pub fn uv_sphere(radius: f64, slices: usize, stacks: usize) -> Mesh {
    let (slices, stacks) = (slices.max(3), stacks.max(2));
    let mut positions = vec![DVec3::new(0.0, -radius, 0.0)];
    for j in 1..stacks {
        let latitude = PI * (j as f64 / stacks as f64 - 0.5);
        for i in 0..slices {
            let (s, c) = (TAU * i as f64 / slices as f64).sin_cos();
            positions.push(DVec3::new(
                radius * latitude.cos() * s,
                radius * latitude.sin(),
                radius * latitude.cos() * c,
            ));
        }
    }
    positions.push(DVec3::new(0.0, radius, 0.0));
    let last = positions.len() as u32 - 1;
    Grid { name: "sphere", nx: slices, ny: stacks, diagonal: Diagonal::Forward, positions }.build(|i, j| match j {
        0 => 0,
        j if j == stacks => last,
        j => (1 + (j - 1) * slices + i % slices) as u32,
    })
}

/// A torus around the z axis: `n` quads around the axis at distance `major`, `m` around the tube of
/// radius `minor`.
///
/// Vertex `(i, j)` has the index `j * n + i`, `i` around the axis; texture coordinates over the
/// unit square with two seams.
#[doc(hidden)]
pub fn torus(major: f64, minor: f64, n: usize, m: usize, diagonal: Diagonal) -> Mesh {
    let (n, m) = (n.max(3), m.max(3));
    let mut positions = Vec::with_capacity(n * m);
    for j in 0..m {
        let (sv, cv) = (TAU * j as f64 / m as f64).sin_cos();
        for i in 0..n {
            let (su, cu) = (TAU * i as f64 / n as f64).sin_cos();
            let r = major + minor * cv;
            positions.push(DVec3::new(r * cu, r * su, minor * sv));
        }
    }
    Grid { name: "torus", nx: n, ny: m, diagonal, positions }.build(|i, j| ((j % m) * n + i % n) as u32)
}

/// An open tube around the y axis from 0 to `height`: two boundary loops.
///
/// Vertex `(i, j)` has the index `j * slices + i`; texture coordinates over the unit square with
/// one seam.
pub fn tube(radius: f64, height: f64, slices: usize, stacks: usize, diagonal: Diagonal) -> Mesh {
    let (slices, stacks) = (slices.max(3), stacks.max(1));
    let mut positions = Vec::with_capacity(slices * (stacks + 1));
    for j in 0..=stacks {
        for i in 0..slices {
            let (s, c) = (TAU * i as f64 / slices as f64).sin_cos();
            positions.push(DVec3::new(radius * s, height * j as f64 / stacks as f64, radius * c));
        }
    }
    Grid { name: "tube", nx: slices, ny: stacks, diagonal, positions }.build(|i, j| (j * slices + i % slices) as u32)
}

/// The tetrahedron with vertices on the unit sphere, without texture coordinates.
#[doc(hidden)]
pub fn tetrahedron() -> Mesh {
    let s = 1.0 / 3f64.sqrt();
    let p = [(1.0, 1.0, 1.0), (1.0, -1.0, -1.0), (-1.0, 1.0, -1.0), (-1.0, -1.0, 1.0)];
    let positions = p.map(|(x, y, z)| DVec3::new(x, y, z) * s).to_vec();
    Mesh::of_triangles("tetrahedron", positions, &[[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
}

/// A sphere from an icosahedron whose triangles are cut into four `level` times (at most 8),
/// without texture coordinates.
///
/// It has `10 * 4^level + 2` vertices; the first twelve are the icosahedron's.
pub fn icosphere(radius: f64, level: u32) -> Mesh {
    let (positions, triangles) = icosphere_directions(level);
    Mesh::of_triangles("icosphere", positions.into_iter().map(|p| p * radius).collect(), &triangles)
}

/// A closed body without symmetry: an [`icosphere`] of radius one with bumps of relative height
/// `amplitude` (0.3 is lively, up to 0.6 is sensible).
///
/// Vertices correspond between amplitudes at the same level.
pub fn lobed_sphere(level: u32, amplitude: f64) -> Mesh {
    // Directions, heights and sharpness of the bumps: uneven, so that no rotation or reflection
    // maps the body to itself.
    let lobes = [
        (DVec3::new(0.0, 1.0, 0.15), 1.0, 5.0),
        (DVec3::new(0.9, -0.2, 0.4), 0.8, 6.0),
        (DVec3::new(-0.7, -0.3, 0.65), 0.9, 7.0),
        (DVec3::new(-0.1, -0.6, -0.8), 0.6, 4.0),
        (DVec3::new(0.3, 0.35, -0.88), -0.4, 6.0),
    ];
    let (positions, triangles) = icosphere_directions(level);
    let positions = positions
        .into_iter()
        .map(|p| {
            let bumps: f64 = lobes.iter().map(|&(d, h, k)| h * (k * (p.dot(d.normalize()) - 1.0)).exp()).sum();
            p * (1.0 + 2.0 * amplitude * bumps)
        })
        .collect();
    Mesh::of_triangles("lobed sphere", positions, &triangles)
}

fn icosphere_directions(level: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let g = 0.5 * (1.0 + 5f64.sqrt());
    let mut positions: Vec<DVec3> = [
        (-1.0, g, 0.0),
        (1.0, g, 0.0),
        (-1.0, -g, 0.0),
        (1.0, -g, 0.0),
        (0.0, -1.0, g),
        (0.0, 1.0, g),
        (0.0, -1.0, -g),
        (0.0, 1.0, -g),
        (g, 0.0, -1.0),
        (g, 0.0, 1.0),
        (-g, 0.0, -1.0),
        (-g, 0.0, 1.0),
    ]
    .map(|(x, y, z)| DVec3::new(x, y, z).normalize())
    .to_vec();
    let mut triangles: Vec<[u32; 3]> = vec![
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    for _ in 0..level.min(8) {
        let mut middle: HashMap<(u32, u32), u32> = HashMap::new();
        let mut finer = Vec::with_capacity(4 * triangles.len());
        for [a, b, c] in triangles {
            let mut half = |i: u32, j: u32| {
                *middle.entry((i.min(j), i.max(j))).or_insert_with(|| {
                    positions.push((positions[i as usize] + positions[j as usize]).normalize());
                    positions.len() as u32 - 1
                })
            };
            let (ab, bc, ca) = (half(a, b), half(b, c), half(c, a));
            finer.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    (positions, triangles)
}

/// A small deterministic generator (splitmix64) for shapes and tests that need numbers without a
/// pattern.
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// A generator; equal seeds give equal numbers.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// The next 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Uniform in [-1, 1).
    pub fn signed(&mut self) -> f64 {
        2.0 * self.unit() - 1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Topology;

    fn euler(mesh: &Mesh) -> i64 {
        let mut edges: Vec<_> = mesh
            .triangles()
            .iter()
            .flat_map(|t| [0, 1, 2].map(|k| (t[k].min(t[(k + 1) % 3]), t[k].max(t[(k + 1) % 3]))))
            .collect();
        edges.sort_unstable();
        edges.dedup();
        mesh.vertex_count() as i64 - edges.len() as i64 + mesh.triangle_count() as i64
    }

    fn volume(mesh: &Mesh) -> f64 {
        (0..mesh.triangle_count())
            .map(|t| {
                let [a, b, c] = mesh.triangle_positions(t);
                a.dot(b.cross(c)) / 6.0
            })
            .sum()
    }

    #[test]
    fn closed_shapes_are_closed_manifolds_facing_out() {
        let all = [Diagonal::Forward, Diagonal::Backward, Diagonal::Alternating];
        let mut shapes = vec![
            (uv_sphere(1.0, 3, 2), 2),
            (uv_sphere(1.0, 17, 9), 2),
            (tetrahedron(), 2),
            (icosphere(2.0, 0), 2),
            (icosphere(2.0, 3), 2),
            (lobed_sphere(4, 0.4), 2),
        ];
        shapes.extend(all.map(|d| (torus(2.0, 0.5, 12, 7, d), 0)));
        for (mesh, chi) in shapes {
            let t = Topology::new(&mesh);
            assert!(t.usable.iter().all(|&u| u), "{}", mesh.name);
            assert_eq!(
                (t.boundary_edges, t.nonmanifold_edges, t.misoriented_edges, t.component_count),
                (0, 0, 0, 1),
                "{}",
                mesh.name
            );
            assert_eq!(euler(&mesh), chi, "{}", mesh.name);
            assert!(volume(&mesh) > 0.0, "{}", mesh.name);
        }
    }

    #[test]
    fn open_shapes_have_their_boundary_and_area() {
        for diagonal in [Diagonal::Forward, Diagonal::Backward, Diagonal::Alternating] {
            let plane = irregular_plane(7, 5, 3.0, 2.0, diagonal, 0.3, 9);
            let t = Topology::new(&plane);
            assert_eq!((t.boundary_edges, t.misoriented_edges, euler(&plane)), (24, 0, 1));
            assert!((0..plane.triangle_count()).all(|f| plane.triangle_area_normal(f).z > 0.0));
            assert!((plane.area() - 6.0).abs() < 1e-12);
            let t = Topology::new(&tube(1.0, 2.0, 8, 3, diagonal));
            assert_eq!((t.boundary_edges, t.misoriented_edges), (16, 0));
        }
    }

    #[test]
    fn texture_coordinates_of_the_plane_are_affine() {
        let plane = irregular_plane(4, 4, 2.0, 3.0, Diagonal::Alternating, 0.3, 1);
        for t in 0..plane.triangle_count() {
            let (p, uv) = (plane.triangle_positions(t), plane.triangle_texcoords(t).unwrap());
            for k in 0..3 {
                assert!((p[k].truncate() - uv[k] * DVec2::new(2.0, 3.0)).length() < 1e-14);
            }
        }
    }
}
