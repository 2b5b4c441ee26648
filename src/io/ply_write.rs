//! Writing binary PLY.

use std::io::Write;
use std::path::Path;

use super::output;
use crate::geometry::Mesh;
use crate::{Error, Result};

/// Writes positions (double precision), polygons and, if given, one RGB colour a vertex as little-endian binary PLY.
///
/// # Errors
/// [`Error::Io`]; [`Error::Input`] if there are not as many colours as vertices.
pub fn write_ply(mesh: &Mesh, colors: Option<&[[u8; 3]]>, path: impl AsRef<Path>) -> Result<()> {
    let path = path.as_ref();
    if let Some(colors) = colors.filter(|c| c.len() != mesh.vertex_count()) {
        let what = format!("{} colours for the {} vertices of {}", colors.len(), mesh.vertex_count(), mesh.name);
        return Err(Error::input(what, "Give one colour a vertex"));
    }
    output::write_atomically(path, |w| write_elements(mesh, colors, w).map_err(output::failed(path)))
}

fn write_elements(mesh: &Mesh, colors: Option<&[[u8; 3]]>, w: &mut impl Write) -> std::io::Result<()> {
    writeln!(w, "ply\nformat binary_little_endian 1.0\nelement vertex {}", mesh.vertex_count())?;
    writeln!(w, "property double x\nproperty double y\nproperty double z")?;
    if colors.is_some() {
        writeln!(w, "property uchar red\nproperty uchar green\nproperty uchar blue")?;
    }
    // Readers commonly know 8-bit lengths only; longer polygons are rare.
    let small = (0..mesh.polygon_count()).all(|p| mesh.polygon(p).len() < 256);
    let length = if small { "uchar" } else { "uint" };
    writeln!(w, "element face {}\nproperty list {length} uint vertex_indices\nend_header", mesh.polygon_count())?;
    for (v, p) in mesh.positions.iter().enumerate() {
        for x in p.to_array() {
            w.write_all(&x.to_le_bytes())?;
        }
        if let Some(colors) = colors {
            w.write_all(&colors[v])?;
        }
    }
    for p in 0..mesh.polygon_count() {
        let corners = mesh.polygon(p);
        if small {
            w.write_all(&[corners.len() as u8])?;
        } else {
            w.write_all(&(corners.len() as u32).to_le_bytes())?;
        }
        for c in corners {
            w.write_all(&c.vertex.to_le_bytes())?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::geometry::{Corner, MeshBuilder, NONE};
    use crate::io::ply::read_ply;

    #[test]
    fn what_is_written_reads_back() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.ply");
        for sides in [4u32, 300] {
            let mut builder = MeshBuilder::new("ring");
            builder.mesh.positions =
                (0..sides + 1).map(|k| DVec3::new(0.1 * f64::from(k), 1.0 / 3.0, (f64::from(k)).sin())).collect();
            builder.polygon((0..sides).map(|vertex| Corner { vertex, texcoord: NONE, normal: NONE }));
            let mesh = builder.build();
            let colors = vec![[1, 2, 3]; mesh.vertex_count()];
            for colors in [None, Some(&colors[..])] {
                write_ply(&mesh, colors, &path).unwrap();
                let back = read_ply(&path).unwrap().mesh;
                assert_eq!((&back.positions, back.polygon(0)), (&mesh.positions, mesh.polygon(0)));
            }
            assert!(write_ply(&mesh, Some(&colors[1..]), &path).is_err());
        }
    }
}
