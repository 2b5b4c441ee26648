//! A coarse base mesh from the surface itself: decimated, and triangles paired into quads.

use glam::DVec3;

use crate::error::{Error, Result};
use crate::geometry::simplify::{SimplifyOptions, simplify};
use crate::geometry::{Corner, Mesh, MeshBuilder, NONE, Topology};

/// Rounds in which pairs give way to two others.
const ROUNDS: usize = 8;
/// Longest edge of the decimated mesh, in edges of equilateral triangles as many as it has.
const LONGEST: f64 = 2.0;
/// Largest angle of a quad that two triangles may make, in degrees.
const WIDEST: f64 = 160.0;
/// Least cosine between the normals of two triangles that are paired.
const BEND: f64 = 0.5;

/// A base mesh of about `vertices` vertices, all of them vertices of `mesh`: half-edge collapses
/// that turn normals least, then pairs of neighbouring triangles, those first that
/// make the best quads. Triangles that find no partner stay. O(F log F).
///
/// # Errors
/// [`Error::Option`] for fewer than 4 vertices; [`Error::Mesh`] if there is no usable triangle.
pub fn automatic_base(mesh: &Mesh, topology: &Topology, vertices: usize) -> Result<Mesh> {
    if vertices < 4 {
        let what = format!("{vertices} vertices are too few for a mesh");
        return Err(Error::option("base_vertices", what, "Give some hundred"));
    }
    let usable: Vec<[u32; 3]> =
        topology.triangles.iter().zip(&topology.usable).filter(|(_, u)| **u).map(|(t, _)| *t).collect();
    if usable.is_empty() {
        return Err(Error::mesh(
            &mesh.name,
            "it has no usable triangle",
            "Give a mesh with triangles of positive area",
        ));
    }
    // A closed mesh has about twice as many triangles as vertices.
    let edge = (mesh.area() / (2.0 * vertices as f64) * 4.0 / 3f64.sqrt()).sqrt();
    let left = simplify(&mesh.positions, &usable, &SimplifyOptions { vertices, longest_edge: LONGEST * edge })?;
    let coarse =
        Topology::from_triangles(mesh.vertex_count(), left.triangles.clone(), vec![true; left.triangles.len()]);
    // Every inner edge, with how bad the quad is that it would vanish in.
    let mut pairs: Vec<Pair> = Vec::new();
    for (t, neighbours) in coarse.neighbours.iter().enumerate() {
        for (k, &s) in neighbours.iter().enumerate().filter(|(_, s)| **s != NONE && **s > t as u32) {
            let v = coarse.triangles[t];
            let opposite = coarse.triangles[s as usize].into_iter().find(|w| !v.contains(w));
            let Some(across) = opposite else { continue };
            let quad = [v[k], v[(k + 1) % 3], across, v[(k + 2) % 3]];
            if let Some(badness) = badness(quad.map(|v| mesh.positions[v as usize])) {
                pairs.push((badness, t as u32, s, quad));
            }
        }
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let chosen = matched(coarse.triangles.len(), &pairs);
    let mut builder = MeshBuilder::new(format!("base of {}", mesh.name));
    let mut number = vec![NONE; mesh.vertex_count()];
    for (&v, n) in left.vertices.iter().zip(0..) {
        number[v as usize] = n;
        builder.mesh.positions.push(mesh.positions[v as usize]);
    }
    let corner = |v: u32| Corner { vertex: number[v as usize], texcoord: NONE, normal: NONE };
    let mut taken = vec![false; coarse.triangles.len()];
    for &(_, t, s, quad) in chosen.iter().map(|&p| &pairs[p]) {
        (taken[t as usize], taken[s as usize]) = (true, true);
        builder.polygon(quad.map(corner));
    }
    for (t, _) in coarse.triangles.iter().zip(&taken).filter(|(_, taken)| !**taken) {
        builder.polygon(t.map(corner));
    }
    builder.build()
}

/// Two triangles that make a quad, how bad it is, and its corners.
type Pair = (f64, u32, u32, [u32; 4]);

/// Pairs without a common triangle, rising: the best ones first, then two for one wherever the
/// neighbours of a pair on both sides are left alone.
fn matched(triangles: usize, pairs: &[Pair]) -> Vec<usize> {
    let mut of = vec![usize::MAX; triangles];
    let mut around: Vec<Vec<usize>> = vec![Vec::new(); triangles];
    for (p, &(_, t, s, _)) in pairs.iter().enumerate() {
        around[t as usize].push(p);
        around[s as usize].push(p);
        if of[t as usize] == usize::MAX && of[s as usize] == usize::MAX {
            (of[t as usize], of[s as usize]) = (p, p);
        }
    }
    let other = |p: usize, t: usize| (pairs[p].1 as usize + pairs[p].2 as usize) - t;
    for _ in 0..ROUNDS {
        let before = of.clone();
        for t in 0..triangles {
            if of[t] != usize::MAX {
                continue;
            }
            // From t to s, whose partner r goes to u instead.
            let swap = around[t].iter().find_map(|&p| {
                let s = other(p, t);
                let q = of[s];
                if q == usize::MAX {
                    return Some((p, None));
                }
                let r = other(q, s);
                around[r].iter().find(|&&k| of[other(k, r)] == usize::MAX && other(k, r) != t).map(|&k| (p, Some(k)))
            });
            if let Some((p, k)) = swap {
                for p in k.into_iter().chain([p]) {
                    of[pairs[p].1 as usize] = p;
                    of[pairs[p].2 as usize] = p;
                }
            }
        }
        if of == before {
            break;
        }
    }
    (0..pairs.len()).filter(|&p| of[pairs[p].1 as usize] == p && of[pairs[p].2 as usize] == p).collect()
}

/// How far a quad is from a flat one of right angles, in degrees; `None` for one that is folded or
/// nearly a triangle. The first and the third corner lie on the two triangles it is made of.
fn badness(p: [DVec3; 4]) -> Option<f64> {
    let normal = |a: usize, b: usize, c: usize| (p[b] - p[a]).cross(p[c] - p[a]).normalize_or_zero();
    let bend = normal(0, 1, 3).dot(normal(2, 3, 1));
    if !(bend > BEND) {
        return None;
    }
    let up = normal(0, 1, 3) + normal(2, 3, 1);
    let mut worst = 0f64;
    for k in 0..4 {
        let (e, f) = (p[(k + 1) % 4] - p[k], p[(k + 3) % 4] - p[k]);
        let angle = e.cross(f).dot(up.normalize_or_zero()).atan2(e.dot(f)).to_degrees();
        if !(angle > 180.0 - WIDEST && angle < WIDEST) {
            return None;
        }
        worst = worst.max((angle - 90.0).abs());
    }
    Some(worst + bend.clamp(-1.0, 1.0).acos().to_degrees())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::shapes::{Diagonal, lobed_sphere, plane_grid};

    #[test]
    fn the_base_covers_the_surface_with_mostly_quads() {
        for (mesh, closed) in
            [(lobed_sphere(4, 0.3), true), (plane_grid(30, 30, 1.0, 1.0, Diagonal::Alternating), false)]
        {
            let topology = Topology::new(&mesh);
            let base = automatic_base(&mesh, &topology, 120).unwrap();
            assert!((100..=140).contains(&base.vertex_count()), "{}", base.vertex_count());
            let quads = (0..base.polygon_count()).filter(|&p| base.polygon(p).len() == 4).count();
            assert!(5 * quads > 3 * base.polygon_count(), "{quads} of {}", base.polygon_count());
            // The quads cut into triangles are as closed as the surface, with its orientation.
            let cut = Topology::new(&base);
            assert_eq!((cut.boundary_edges == 0, cut.nonmanifold_edges, cut.misoriented_edges), (closed, 0, 0));
            assert!((base.area() / mesh.area() - 1.0).abs() < 0.1);
            // Every vertex is one of the surface.
            assert!(base.positions.iter().all(|p| mesh.positions.contains(p)));
        }
        let mesh = lobed_sphere(2, 0.3);
        let error = automatic_base(&mesh, &Topology::new(&mesh), 3).unwrap_err();
        assert!(error.to_string().contains("option base_vertices"));
        assert!(automatic_base(&Mesh::default(), &Topology::new(&Mesh::default()), 100).is_err());
    }
}
