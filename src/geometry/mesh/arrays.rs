//! Meshes from arrays, as other programs hold them.

use std::collections::HashMap;

use glam::{DVec2, DVec3};

use super::{Corner, Mesh, MeshBuilder, NONE};
use crate::error::{Error, Result};

/// Texture coordinates as other programs hold them; v = 1 is the top of the picture.
#[derive(Clone, Copy, Debug, Default)]
pub enum Texcoords<'a> {
    /// The mesh has none.
    #[default]
    None,
    /// One for each vertex.
    Vertices(&'a [DVec2]),
    /// One for each corner of each triangle. Corners of one vertex with equal values share one, so
    /// that charts stay connected.
    Corners(&'a [[DVec2; 3]]),
    /// A list, and the index in it of each corner of each triangle.
    Indexed(&'a [DVec2], &'a [[u32; 3]]),
}

impl Mesh {
    /// A mesh of triangles with texture coordinates. Vertices keep their numbers; repeated ones are
    /// not joined ([`weld`](crate::geometry::weld::weld()) joins them). O(V + F).
    ///
    /// # Errors
    /// [`Error::Mesh`] naming the vertex whose position is not finite, the face and corner whose
    /// vertex or texture coordinate does not exist, or the list whose length does not fit.
    pub fn from_arrays(
        name: impl Into<String>,
        positions: Vec<DVec3>,
        triangles: &[[u32; 3]],
        texcoords: Texcoords<'_>,
    ) -> Result<Self> {
        let name = name.into();
        let fault = |what: String, remedy: &str| Err(Error::mesh(&name, what, remedy));
        if let Some(v) = positions.iter().position(|p| !p.is_finite()) {
            return fault(format!("the position of vertex {v} is not finite"), "Correct it, or leave the vertex out");
        }
        let (what, given, wanted) = match texcoords {
            Texcoords::None => ("", 0, 0),
            Texcoords::Vertices(list) => ("vertices", list.len(), positions.len()),
            Texcoords::Corners(list) => ("triangles", list.len(), triangles.len()),
            Texcoords::Indexed(_, list) => ("triangles", list.len(), triangles.len()),
        };
        if given != wanted {
            let what = format!("there are texture coordinates for {given} {what} of {wanted}");
            return fault(what, "Give as many as there are, in the same order");
        }
        let mut builder = MeshBuilder::new(&name);
        let mut known: HashMap<(u32, [u64; 2]), u32> = HashMap::new();
        let list = &mut builder.mesh.texcoords;
        let corners: Vec<[u32; 3]> = match texcoords {
            Texcoords::None => vec![[NONE; 3]; triangles.len()],
            Texcoords::Vertices(of) => {
                list.extend_from_slice(of);
                triangles.to_vec()
            }
            Texcoords::Indexed(of, corners) => {
                list.extend_from_slice(of);
                corners.to_vec()
            }
            Texcoords::Corners(of) => {
                let mut number = |vertex: u32, uv: DVec2| {
                    // Adding zero makes -0 equal to 0.
                    let key = (vertex, (uv + DVec2::ZERO).to_array().map(f64::to_bits));
                    *known.entry(key).or_insert_with(|| {
                        list.push(uv);
                        list.len() as u32 - 1
                    })
                };
                triangles.iter().zip(of).map(|(t, uv)| [0, 1, 2].map(|k| number(t[k], uv[k]))).collect()
            }
        };
        builder.mesh.positions = positions;
        for (t, uv) in triangles.iter().zip(&corners) {
            builder.polygon([0, 1, 2].map(|k| Corner { vertex: t[k], texcoord: uv[k], normal: NONE }));
        }
        let finite = |c: &Corner| builder.mesh.texcoords.get(c.texcoord as usize).is_none_or(|uv| uv.is_finite());
        if let Some(i) = builder.mesh.corners.iter().position(|c| !finite(c)) {
            let what = format!("face {}, corner {}: its texture coordinate is not finite", i / 3, i % 3);
            return fault(what, "Correct it, or give no texture coordinates");
        }
        builder.build()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of two triangles.
    fn square() -> (Vec<DVec3>, [[u32; 3]; 2]) {
        (vec![DVec3::ZERO, DVec3::X, DVec3::ONE, DVec3::Y], [[0, 1, 2], [0, 2, 3]])
    }

    #[test]
    fn the_forms_of_texture_coordinates_say_the_same() {
        let (positions, triangles) = square();
        let uv = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y];
        let corners = triangles.map(|t| t.map(|v| uv[v as usize]));
        let make = |texcoords| Mesh::from_arrays("square", positions.clone(), &triangles, texcoords).unwrap();
        let forms = [Texcoords::Vertices(&uv), Texcoords::Corners(&corners), Texcoords::Indexed(&uv, &triangles)];
        for mesh in forms.map(make) {
            assert_eq!([0, 1].map(|t| mesh.triangle_texcoords(t).unwrap()), corners);
            assert_eq!(mesh.texcoords.len(), 4, "corners of one vertex share their coordinate");
        }
        assert!(!make(Texcoords::None).has_texcoords());
        // A seam: the corners of vertex 2 differ.
        let apart = [corners[0], [corners[1][0], DVec2::splat(0.5), corners[1][2]]];
        assert_eq!(make(Texcoords::Corners(&apart)).texcoords.len(), 5);
    }

    #[test]
    fn what_does_not_fit_is_named() {
        let (positions, triangles) = square();
        let uv = [DVec2::ZERO; 4];
        let fails = |positions: &[DVec3], triangles: &[[u32; 3]], texcoords, expected: &str| {
            let error = Mesh::from_arrays("square", positions.to_vec(), triangles, texcoords).unwrap_err().to_string();
            assert!(error.starts_with("mesh square: ") && error.contains(expected), "{error}");
        };
        fails(&positions[..3], &triangles, Texcoords::None, "face 1, corner 2: there is no vertex 3, there are 3");
        fails(&positions, &[[0, NONE, 1]], Texcoords::None, "face 0, corner 1");
        fails(&[DVec3::ZERO, DVec3::NAN], &[], Texcoords::None, "vertex 1 is not finite");
        fails(&positions, &triangles, Texcoords::Vertices(&uv[1..]), "for 3 vertices of 4");
        fails(&positions, &triangles, Texcoords::Corners(&[]), "for 0 triangles of 2");
        fails(&positions, &triangles, Texcoords::Indexed(&uv, &[[0; 3], [0, 4, 0]]), "no texture coordinate 4");
        let infinite = [uv[0], DVec2::splat(f64::INFINITY), uv[2], uv[3]];
        fails(&positions, &triangles, Texcoords::Vertices(&infinite), "face 0, corner 1: its texture");
    }
}
