//! A line drawing of a curve on its surface, as SVG.

use std::fmt::Write;

use glam::{DVec2, DVec3};

use super::{CurvePoint, SurfaceCurve};
use crate::geometry::{Frame, Mesh, SurfacePoint, Topology};
use crate::surface::quality::vertex_normals;

/// What a drawing looks like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DrawingOptions {
    /// Degrees around the y axis: 0 looks at the +z side, 90 at the +x side.
    pub azimuth: f64,
    /// Height of the eye above the horizon, degrees.
    pub elevation: f64,
    /// Width and height of the drawing, in pixels.
    pub size: [u32; 2],
}

impl Default for DrawingOptions {
    fn default() -> Self {
        Self { azimuth: 20.0, elevation: 8.0, size: [800, 800] }
    }
}

/// The curve, its control points and the outline of the mesh from a direction, as the text of an
/// SVG file.
///
/// An orthographic view. The curve is black where its surface faces the eye and light and dashed
/// where it looks away; parts that other parts of the surface hide are not found out. The outline
/// is made of the mesh edges between triangles that face the eye and triangles that do not, and of
/// boundary edges.
pub fn drawing(
    mesh: &Mesh,
    topology: &Topology,
    curve: &SurfaceCurve,
    controls: &[SurfacePoint],
    options: &DrawingOptions,
) -> String {
    let (sin_a, cos_a) = options.azimuth.to_radians().sin_cos();
    let (sin_e, cos_e) = options.elevation.to_radians().sin_cos();
    let back = DVec3::new(sin_a * cos_e, sin_e, cos_a * cos_e);
    let right = DVec3::new(cos_a, 0.0, -sin_a);
    let up = back.cross(right);
    let frame = Frame::of_mesh(mesh);
    let flat = |p: DVec3| DVec2::new(p.dot(right), -p.dot(up));
    let used = topology.triangles.iter().zip(&topology.usable).filter(|(_, u)| **u).flat_map(|(t, _)| t);
    let (low, high) = used.fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), &v| {
        let p = flat(frame.local(mesh.positions[v as usize]));
        (low.min(p), high.max(p))
    });
    let size = DVec2::new(f64::from(options.size[0]), f64::from(options.size[1]));
    let scale = (0.92 * size / (high - low).max(DVec2::splat(1e-300))).min_element();
    let offset = 0.5 * size - 0.5 * scale * (low + high);
    let pixel = |p: DVec3| flat(p) * scale + offset;

    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} {1}\">\n<g fill=\"none\" stroke-linejoin=\"round\" stroke-linecap=\"round\">\n",
        options.size[0], options.size[1]
    );
    let mut path = String::new();
    let faces = |t: usize| mesh.triangle_area_normal(t).dot(back) > 0.0;
    for (t, neighbours) in topology.neighbours.iter().enumerate().filter(|(t, _)| topology.usable[*t]) {
        for (k, &s) in neighbours.iter().enumerate() {
            let boundary = s == crate::geometry::NONE;
            if boundary || ((t as u32) < s && faces(t) != faces(s as usize)) {
                let v = topology.triangles[t];
                let [a, b] = [v[(k + 1) % 3], v[(k + 2) % 3]].map(|v| pixel(frame.local(mesh.positions[v as usize])));
                // Writing to a string does not fail.
                let _ = write!(path, "M{:.2} {:.2}L{:.2} {:.2}", a.x, a.y, b.x, b.y);
            }
        }
    }
    let _ = writeln!(out, "<path id=\"outline\" stroke=\"#9aa\" stroke-width=\"1\" d=\"{path}\"/>");
    let normals = vertex_normals(mesh, topology);
    let front = |p: &CurvePoint| {
        let v = mesh.triangle(p.point.face as usize);
        let n = v.iter().zip(p.point.barycentric).fold(DVec3::ZERO, |n, (&v, b)| n + normals[v as usize] * b);
        n.dot(back) >= 0.0
    };
    for (id, style, shown) in [
        ("back", "stroke=\"#b99\" stroke-width=\"1.5\" stroke-dasharray=\"4 4\"", false),
        ("curve", "stroke=\"#000\" stroke-width=\"2.5\"", true),
    ] {
        let mut path = String::new();
        for run in &curve.runs {
            let mut drawn = false;
            for pair in run.windows(2) {
                if (front(&pair[0]) && front(&pair[1])) != shown {
                    drawn = false;
                    continue;
                }
                let [a, b] = [0, 1].map(|k| pixel(frame.place(&pair[k].point, mesh)));
                if !drawn {
                    let _ = write!(path, "M{:.3} {:.3}", a.x, a.y);
                }
                let _ = write!(path, "L{:.3} {:.3}", b.x, b.y);
                drawn = true;
            }
        }
        let _ = writeln!(out, "<path id=\"{id}\" {style} d=\"{path}\"/>");
    }
    out += "</g>\n<g id=\"controls\" fill=\"#c22\">\n";
    for p in controls {
        let p = pixel(frame.place(p, mesh));
        let _ = writeln!(out, "<circle cx=\"{:.2}\" cy=\"{:.2}\" r=\"4\"/>", p.x, p.y);
    }
    out += "</g>\n</svg>\n";
    out
}
