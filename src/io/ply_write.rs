//! Writing binary PLY.

use std::io::Write;
use std::path::Path;

use super::{finite, output};
use crate::geometry::Mesh;
use crate::{Error, Result};

/// Numbers of all vertices.
#[derive(Clone, Debug, PartialEq)]
pub enum PropertyValues {
    /// Whole numbers of 0 to 255.
    Byte(Vec<u8>),
    /// Numbers in double precision.
    Double(Vec<f64>),
}

/// A property of the vertices beside their positions.
#[derive(Clone, Debug, PartialEq)]
pub struct VertexProperty {
    /// Its name in the file, without spaces.
    pub name: String,
    /// One value for each vertex.
    pub values: PropertyValues,
}

impl VertexProperty {
    fn len(&self) -> usize {
        match &self.values {
            PropertyValues::Byte(v) => v.len(),
            PropertyValues::Double(v) => v.len(),
        }
    }
}

/// Writes positions (double precision), polygons and, if given, one RGB colour a vertex as
/// little-endian binary PLY.
///
/// # Errors
/// [`Error::Io`]; [`Error::Input`] if there are not as many colours as vertices.
pub fn write_ply(mesh: &Mesh, colors: Option<&[[u8; 3]]>, path: impl AsRef<Path>) -> Result<()> {
    let channel = |(k, name): (usize, &str)| VertexProperty {
        name: name.into(),
        values: PropertyValues::Byte(colors.unwrap_or_default().iter().map(|c| c[k]).collect()),
    };
    let channels: Vec<VertexProperty> = ["red", "green", "blue"].into_iter().enumerate().map(channel).collect();
    write_ply_with(mesh, if colors.is_some() { &channels } else { &[] }, path)
}

/// Writes positions (double precision), polygons and properties of the vertices as little-endian
/// binary PLY.
///
/// # Errors
/// [`Error::Io`]; [`Error::NotFinite`] for a position that is not finite; [`Error::Input`] if a
/// property has not as many values as there are vertices. A property may be NaN where there is
/// none.
pub fn write_ply_with(mesh: &Mesh, properties: &[VertexProperty], path: impl AsRef<Path>) -> Result<()> {
    let path = path.as_ref();
    if let Some(p) = properties.iter().find(|p| p.len() != mesh.vertex_count()) {
        let what =
            format!("{} values of {:?} for the {} vertices of {}", p.len(), p.name, mesh.vertex_count(), mesh.name);
        return Err(Error::input(what, "Give one a vertex"));
    }
    finite::positions(path, &mesh.positions, "vertex")?;
    output::write_atomically(path, |w| write_elements(mesh, properties, w).map_err(output::failed(path)))
}

fn write_elements(mesh: &Mesh, properties: &[VertexProperty], w: &mut impl Write) -> std::io::Result<()> {
    writeln!(w, "ply\nformat binary_little_endian 1.0\nelement vertex {}", mesh.vertex_count())?;
    writeln!(w, "property double x\nproperty double y\nproperty double z")?;
    for p in properties {
        let kind = match p.values {
            PropertyValues::Byte(_) => "uchar",
            PropertyValues::Double(_) => "double",
        };
        writeln!(w, "property {kind} {}", p.name)?;
    }
    // Readers commonly know 8-bit lengths only; longer polygons are rare.
    let small = (0..mesh.polygon_count()).all(|p| mesh.polygon(p).len() < 256);
    let length = if small { "uchar" } else { "uint" };
    writeln!(w, "element face {}\nproperty list {length} uint vertex_indices\nend_header", mesh.polygon_count())?;
    for (v, p) in mesh.positions.iter().enumerate() {
        for x in p.to_array() {
            w.write_all(&x.to_le_bytes())?;
        }
        for p in properties {
            match &p.values {
                PropertyValues::Byte(values) => w.write_all(&values[v..=v])?,
                PropertyValues::Double(values) => w.write_all(&values[v].to_le_bytes())?,
            }
        }
    }
    for p in 0..mesh.polygon_count() {
        let corners = mesh.file_polygon(p);
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
            let mesh = builder.finish();
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
