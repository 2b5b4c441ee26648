//! Forms of one surface: files with the same faces that repeat vertices more or less.

use std::collections::HashMap;

use barymap::geometry::{Corner, Mesh, MeshBuilder, NONE};
use glam::{DVec2, DVec3};

/// A form of a mesh: the file, and the vertex of the welded form that each of its vertices is.
pub(super) struct Form {
    pub(super) name: &'static str,
    pub(super) mesh: Mesh,
    pub(super) welded: Vec<u32>,
}

/// `mesh` with charts by the side that faces look to, in three forms with equal polygons:
/// welded, split at the seams of the charts, and each polygon with its own vertices.
///
/// Vertices are numbered as the polygons use them, so that those that are computed with come in the
/// same order in all forms.
pub(super) fn forms(mesh: &Mesh) -> [Form; 3] {
    let charts = charts(mesh);
    [
        form(mesh, &charts, "welded", |_| 0),
        form(mesh, &charts, "seams", |p| charts[p]),
        form(mesh, &charts, "faces", |p| p as u32),
    ]
}

/// The chart of each polygon: the axis, and its direction, that it looks along, in each half of the
/// box along its longest side. A relief looks one way everywhere.
fn charts(mesh: &Mesh) -> Vec<u32> {
    let (low, high) = mesh.bounds().unwrap();
    let largest = |d: [f64; 3]| (0..3).fold(0, |best, k| if d[k].abs() > d[best].abs() { k } else { best });
    let long = largest((high - low).to_array());
    let middle = (0.5 * (low + high))[long];
    let mut normals = vec![DVec3::ZERO; mesh.polygon_count()];
    for t in 0..mesh.triangle_count() {
        normals[mesh.triangle_polygon(t) as usize] += mesh.triangle_area_normal(t);
    }
    let chart = |(p, n): (usize, DVec3)| {
        let n = n.to_array();
        let axis = largest(n);
        let corners = mesh.polygon(p);
        let place: f64 = corners.iter().map(|c| mesh.positions[c.vertex as usize][long]).sum();
        let far = place > middle * corners.len() as f64;
        (4 * axis + 2 * usize::from(n[axis] < 0.0) + usize::from(far)) as u32
    };
    normals.into_iter().enumerate().map(chart).collect()
}

/// The form in which polygons of equal `key` share vertices.
fn form(mesh: &Mesh, charts: &[u32], name: &'static str, key: impl Fn(usize) -> u32) -> Form {
    let (low, high) = mesh.bounds().unwrap();
    let size = (high - low).max_element();
    let place = |v: u32, chart: u32| {
        let p = (mesh.positions[v as usize] - low) / size;
        let axis = chart as usize / 4;
        let flat = DVec2::new(p[(axis + 1) % 3], p[(axis + 2) % 3]);
        let cell = DVec2::new(f64::from(chart % 4), f64::from(chart / 4));
        (cell + DVec2::splat(0.05) + 0.9 * flat) / DVec2::new(4.0, 3.0)
    };
    let mut builder = MeshBuilder::new(name);
    let (mut vertices, mut texcoords, mut first) = (HashMap::new(), HashMap::new(), HashMap::new());
    let mut welded = Vec::new();
    for (p, &chart) in charts.iter().enumerate() {
        let corners: Vec<Corner> = mesh
            .polygon(p)
            .iter()
            .map(|c| {
                let v = c.vertex;
                let next = first.len() as u32;
                let number = *first.entry(v).or_insert(next);
                let vertex = *vertices.entry((v, key(p))).or_insert_with(|| {
                    builder.mesh.positions.push(mesh.positions[v as usize]);
                    welded.push(number);
                    welded.len() as u32 - 1
                });
                let texcoord = *texcoords.entry((v, chart)).or_insert_with(|| {
                    builder.mesh.texcoords.push(place(v, chart));
                    builder.mesh.texcoords.len() as u32 - 1
                });
                Corner { vertex, texcoord, normal: NONE }
            })
            .collect();
        builder.polygon(corners);
    }
    Form { name, mesh: builder.build().unwrap(), welded }
}

/// The largest side of the box of a mesh.
pub(super) fn size_of(mesh: &Mesh) -> f64 {
    let (low, high) = mesh.bounds().unwrap();
    (high - low).max_element()
}

/// The same form, bent and stretched.
pub(super) fn bent(mesh: &Mesh) -> Mesh {
    let (size, mut mesh) = (size_of(mesh), mesh.clone());
    for p in &mut mesh.positions {
        let q = *p / size;
        *p = DVec3::new(1.1 * q.x + 0.1 * q.y * q.y, q.y, 0.9 * q.z + 0.15 * (2.0 * q.x).sin()) * size;
    }
    mesh
}

/// The welded form of a mesh among the data.
pub(super) fn form_of(name: &str) -> Form {
    let folder = std::path::PathBuf::from(std::env::var_os("BARYMAP_DATA").unwrap());
    let [welded, ..] = forms(&barymap::io::read_mesh(folder.join(name)).unwrap().mesh);
    welded
}
