//! Values for vertices without, from those with.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use faer::Mat;

use crate::error::{Error, Result};
use crate::geometry::cholesky::SparseCholesky;
use crate::geometry::{Laplacian, Mesh, NONE, Topology};

/// Weight of the plain edge beside its cotangents: right angles would leave vertices without
/// neighbours.
const EDGE_WEIGHT: f64 = 1e-6;
/// Columns that are solved for at once.
const COLUMNS: usize = 16;

/// The triangles that count.
fn triangles(topology: &Topology) -> Vec<[u32; 3]> {
    topology.triangles.iter().zip(&topology.usable).filter(|(_, usable)| **usable).map(|(t, _)| *t).collect()
}

/// Vertices connected with a known one.
pub(super) fn reached(topology: &Topology, known: &[bool]) -> Vec<bool> {
    let mut component = vec![false; topology.component_count as usize];
    for (v, _) in known.iter().enumerate().filter(|(_, known)| **known) {
        if let Some(c) = component.get_mut(topology.vertex_component[v] as usize) {
            *c = true;
        }
    }
    topology.vertex_component.iter().map(|&c| component.get(c as usize).copied().unwrap_or(false)).collect()
}

/// Gives the vertices that are connected with `known` ones the values between the known ones whose
/// Dirichlet energy is least: the cotangent Laplacian is zero there. Known ones keep theirs.
///
/// # Errors
/// If memory is lacking.
pub(crate) fn harmonic(
    (mesh, topology): (&Mesh, &Topology),
    known: &[bool],
    columns: usize,
    values: &mut [f64],
) -> Result<()> {
    let reached = reached(topology, known);
    let unknown: Vec<u32> = (0..known.len()).filter(|&v| reached[v] && !known[v]).map(|v| v as u32).collect();
    if unknown.is_empty() {
        return Ok(());
    }
    let triangles = triangles(topology);
    let stiffness = Laplacian::new(&mesh.positions, &triangles).stiffness;
    // Off the diagonal, with the weight of the plain edge; a surface of bad angles is filled by
    // plain edges alone.
    let factor = |cotangents: f64| -> Result<Option<Factor>> {
        let weight = |entry: f64| cotangents * -entry + EDGE_WEIGHT;
        let mut index = vec![NONE; known.len()];
        for (i, &v) in unknown.iter().enumerate() {
            index[v as usize] = i as u32;
        }
        let (mut starts, mut rows, mut entries) = (vec![0], Vec::new(), Vec::new());
        let mut boundary = Vec::new();
        for (i, &v) in unknown.iter().enumerate() {
            let (beside, entry) = stiffness.row(v as usize);
            rows.push(i);
            entries.push(0.0);
            let diagonal = entries.len() - 1;
            for (&w, &e) in beside.iter().zip(entry).filter(|(w, _)| **w != v) {
                let weight = weight(e);
                entries[diagonal] += weight;
                match index[w as usize] {
                    NONE => boundary.push((i as u32, w, weight)),
                    j if j as usize > i => {
                        rows.push(j as usize);
                        entries.push(-weight);
                    }
                    _ => {}
                }
            }
            starts.push(rows.len());
        }
        let factor = SparseCholesky::new("the filling of attributes", starts, rows, entries, 0)?;
        Ok(factor.map(|matrix| Factor { matrix, boundary }))
    };
    let factor = match factor(1.0)? {
        Some(factor) => factor,
        None => factor(0.0)?.ok_or_else(|| {
            Error::numeric("attributes could not be filled: the system is singular", "Use --fill none")
        })?,
    };
    for first in (0..columns).step_by(COLUMNS) {
        let count = COLUMNS.min(columns - first);
        let mut x = Mat::<f64>::zeros(unknown.len(), count);
        for &(i, w, weight) in &factor.boundary {
            for k in 0..count {
                x[(i as usize, k)] += weight * values[w as usize * columns + first + k];
            }
        }
        factor.matrix.solve(&mut x)?;
        for (i, &v) in unknown.iter().enumerate() {
            for k in 0..count {
                values[v as usize * columns + first + k] = x[(i, k)];
            }
        }
    }
    Ok(())
}

/// The system of the unknown vertices, and the weights of their known neighbours: unknown, vertex,
/// weight.
struct Factor {
    matrix: SparseCholesky,
    boundary: Vec<(u32, u32, f64)>,
}

/// Gives the vertices that are not `known` the values of the nearest known one along edges, the
/// lowest of equals.
pub(super) fn nearest((mesh, topology): (&Mesh, &Topology), known: &[bool], columns: usize, values: &mut [f64]) {
    let mut edges: Vec<(u32, u32)> = Vec::new();
    for t in triangles(topology) {
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            edges.extend([(a, b), (b, a)]);
        }
    }
    edges.sort_unstable();
    edges.dedup();
    let mut start = vec![0; known.len() + 1];
    for &(a, _) in &edges {
        start[a as usize + 1] += 1;
    }
    for v in 0..known.len() {
        start[v + 1] += start[v];
    }
    // Dijkstra's algorithm. Lengths are not negative, so their bits are in their order.
    let mut queue: BinaryHeap<Reverse<(u64, u32, u32)>> =
        (0..known.len() as u32).filter(|&v| known[v as usize]).map(|v| Reverse((0, v, v))).collect();
    let mut from = vec![NONE; known.len()];
    while let Some(Reverse((distance, source, v))) = queue.pop() {
        if from[v as usize] != NONE {
            continue;
        }
        from[v as usize] = source;
        for &(_, w) in &edges[start[v as usize]..start[v as usize + 1]] {
            if from[w as usize] == NONE {
                let length = mesh.positions[v as usize].distance(mesh.positions[w as usize]);
                queue.push(Reverse(((f64::from_bits(distance) + length).to_bits(), source, w)));
            }
        }
    }
    for (v, &source) in from.iter().enumerate().filter(|(v, source)| **source != NONE && !known[*v]) {
        values.copy_within(source as usize * columns..(source as usize + 1) * columns, v * columns);
    }
}
