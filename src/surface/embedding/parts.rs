//! Splitting a mesh into components, and putting their embeddings side by side.

use glam::DVec3;

use crate::geometry::{Mesh, NONE, Topology};

/// One component with its own numbering; lengths in units of the square root of the whole mesh's
/// area.
#[derive(Clone, Debug)]
pub(crate) struct Part {
    /// Vertices in the mesh, ascending.
    pub(crate) vertices: Vec<u32>,
    /// Their positions.
    pub(crate) positions: Vec<DVec3>,
    /// Usable triangles, in the part's own numbering.
    pub(crate) triangles: Vec<[u32; 3]>,
    /// Area; those of all parts sum to one.
    pub(crate) area: f64,
}

/// Length that the parts' positions are multiplied with to be in the mesh's units again.
pub(crate) fn unit_length(mesh: &Mesh, topology: &Topology) -> f64 {
    // Relative to the largest triangle, so that the sum cannot overflow.
    let areas = || (0..topology.triangles.len()).filter(|&t| topology.usable[t]).map(|t| mesh.triangle_area(t));
    let largest = areas().fold(0.0, f64::max);
    areas().map(|a| a / largest).sum::<f64>().sqrt() * largest.sqrt()
}

/// The components of `mesh`, in the topology's order.
pub(crate) fn split(mesh: &Mesh, topology: &Topology, unit: f64) -> Vec<Part> {
    let empty = Part { vertices: Vec::new(), positions: Vec::new(), triangles: Vec::new(), area: 0.0 };
    let mut parts = vec![empty; topology.component_count as usize];
    let mut own = vec![NONE; topology.vertex_count()];
    let origin = mesh.positions[topology.vertex_component.iter().position(|&c| c != NONE).unwrap_or(0)];
    for (v, &component) in topology.vertex_component.iter().enumerate().filter(|(_, c)| **c != NONE) {
        let part = &mut parts[component as usize];
        own[v] = part.vertices.len() as u32;
        part.vertices.push(v as u32);
        part.positions.push((mesh.positions[v] - origin) / unit);
    }
    for (t, triangle) in topology.triangles.iter().enumerate().filter(|(t, _)| topology.usable[*t]) {
        let part = &mut parts[topology.triangle_component(t as u32) as usize];
        part.triangles.push(triangle.map(|v| own[v as usize]));
        part.area += mesh.triangle_area(t) / unit / unit;
    }
    parts
}

/// Landmarks of each part: its share by area of `landmarks`, at least `least`, at most all its
/// vertices.
pub(crate) fn share(parts: &[Part], landmarks: usize, least: usize) -> Vec<usize> {
    parts
        .iter()
        .map(|p| {
            let fair = (p.area * landmarks as f64).round() as usize;
            fair.max(least).min(p.vertices.len())
        })
        .collect()
}

/// Where the centres of `count` parts go: distinct points of the grid with the given spacing, the
/// first at the origin.
///
/// All grid points with coordinates 0, 1, -1 come first, then those with 2, -2 and so on, so that
/// the whole stays compact: single precision loses least.
pub(crate) fn centers(count: usize, dimension: usize, spacing: f64) -> Vec<Vec<f64>> {
    let mut base = 3usize;
    while base.checked_pow(dimension as u32).is_some_and(|all| all < count) {
        base += 2;
    }
    (0..count)
        .map(|mut index| {
            (0..dimension)
                .map(|_| {
                    let digit = index % base;
                    index /= base;
                    let steps = digit.div_ceil(2) as f64;
                    spacing * if digit % 2 == 1 { steps } else { -steps } + 0.0
                })
                .collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn centers_are_distinct_and_near() {
        let c = centers(7000, 8, 2.0);
        assert_eq!(c[0], vec![0.0; 8]);
        let mut sorted: Vec<Vec<i32>> = c.iter().map(|x| x.iter().map(|y| *y as i32).collect()).collect();
        sorted.sort();
        sorted.dedup();
        assert_eq!(sorted.len(), 7000);
        assert!(c.iter().flatten().all(|x| x.abs() <= 4.0));
    }

    #[test]
    fn parts_share_area_and_landmarks() {
        let p: Vec<DVec3> =
            [DVec3::ZERO, DVec3::X * 3.0, DVec3::Y * 3.0, DVec3::Z, DVec3::Z + DVec3::X, DVec3::Z + DVec3::Y].into();
        let mesh = Mesh::of_triangles("two", p, &[[3, 4, 5], [0, 1, 2]]);
        let topology = Topology::new(&mesh);
        let unit = unit_length(&mesh, &topology);
        assert!((unit - 5f64.sqrt()).abs() < 1e-15);
        let parts = split(&mesh, &topology, unit);
        assert!((parts[0].area - 0.9).abs() < 1e-12 && (parts[1].area - 0.1).abs() < 1e-12);
        assert_eq!((parts[1].vertices.clone(), parts[1].triangles.clone()), (vec![3, 4, 5], vec![[0, 1, 2]]));
        assert_eq!(share(&parts, 100, 8), vec![3, 3]);
    }
}
