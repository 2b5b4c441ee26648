//! Charts: the parts of a mesh over which texture coordinates are continuous.

use std::collections::HashMap;

use crate::geometry::{Mesh, NONE};

/// Chart of each triangle, or [`NONE`] without texture coordinates; charts count from 0 in the
/// order of their first triangles.
///
/// Triangles are of one chart if they share an edge with equal positions and equal texture
/// coordinates at both ends, whatever vertices and texture coordinate indices the file uses for
/// them. O(n log n).
pub fn charts(mesh: &Mesh) -> Vec<u32> {
    let n = mesh.triangle_count();
    let mut corner_ids: HashMap<[u64; 5], u32> = HashMap::new();
    let mut edges: Vec<(u32, u32, u32)> = Vec::with_capacity(3 * n);
    let mut textured = vec![false; n];
    for (t, textured) in textured.iter_mut().enumerate() {
        let Some(uv) = mesh.triangle_texcoords(t) else { continue };
        *textured = true;
        let p = mesh.triangle_positions(t);
        let ids = [0, 1, 2].map(|k| {
            // Adding zero makes -0 and 0 the same bits.
            let key = [p[k].x, p[k].y, p[k].z, uv[k].x, uv[k].y].map(|c| (c + 0.0).to_bits());
            let next = corner_ids.len() as u32;
            *corner_ids.entry(key).or_insert(next)
        });
        for k in 0..3 {
            let (a, b) = (ids[k], ids[(k + 1) % 3]);
            edges.push((a.min(b), a.max(b), t as u32));
        }
    }
    edges.sort_unstable();
    let mut parent: Vec<u32> = (0..n as u32).collect();
    for pair in edges.windows(2) {
        if (pair[0].0, pair[0].1) == (pair[1].0, pair[1].1) {
            let (a, b) = (root(&mut parent, pair[0].2), root(&mut parent, pair[1].2));
            // The lowest triangle stands for its chart.
            parent[a.max(b) as usize] = a.min(b);
        }
    }
    let mut number = vec![NONE; n];
    let mut count = 0;
    for t in 0..n {
        if !textured[t] {
            continue;
        }
        let r = root(&mut parent, t as u32) as usize;
        if r == t {
            number[t] = count;
            count += 1;
        } else {
            number[t] = number[r];
        }
    }
    number
}

fn root(parent: &mut [u32], mut t: u32) -> u32 {
    while parent[t as usize] != t {
        let up = parent[parent[t as usize] as usize];
        parent[t as usize] = up;
        t = up;
    }
    t
}
