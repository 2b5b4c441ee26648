//! Data of the vertices of one mesh on those of another, through a map between their points: skin
//! weights, colours, scalars, labels, vectors.
//!
//! Every vertex of the target takes what the triangle of the source says at its image, each kind of
//! data in its own way ([`AttributeKind`]); vertices that the map does not vouch for are filled
//! from their neighbours ([`Fill`]).

mod carry;
mod fill;

pub(crate) use fill::harmonic;

use crate::error::{Error, Result};
use crate::geometry::{Mesh, Topology};
use crate::surface::quality::vertex_normals;
use crate::surface::{PointMap, Status};
use crate::tools::vertex_map::{VertexMap, vertex_map};
use crate::words::words;
use carry::Carrier;

/// What the numbers of a vertex mean, hence what is done with them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AttributeKind {
    /// Amounts, also colours and texture coordinates without seams: linear in the source's
    /// triangle.
    #[default]
    Scalars,
    /// Shares, as of the bones that move a vertex: linear, the largest `keep` of them (all for 0),
    /// divided by their sum. Not negative.
    Weights {
        /// How many of a vertex may differ from 0.
        keep: usize,
    },
    /// Names, not amounts: in each column the value of the corners that together weigh most.
    Labels,
    /// Vectors in space, three columns each: turned by the rotation closest to the map's
    /// differential, their lengths linear.
    Vectors,
    /// As [`AttributeKind::Vectors`], of unit length.
    Normals,
    /// A unit vector across the target's smooth normal and, in a fourth column if there is one, the
    /// handedness (1 or -1).
    Tangents,
}

/// What vertices get that the map does not vouch for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Fill {
    /// The smoothest values between the valid vertices (the cotangent Laplacian is 0 there); labels
    /// those of the nearest valid vertex along edges.
    #[default]
    Smooth,
    /// The map's best guess where it has one, else NaN.
    None,
}

words! { Fill, "fill", "a way to fill":
    Smooth => "smooth" "The smoothest values between valid vertices",
    None => "none" "The best guess, or nothing",
}

/// Data of the vertices of a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Attribute {
    /// Name, used in messages.
    pub name: String,
    /// What the numbers mean.
    pub kind: AttributeKind,
    /// Numbers per vertex.
    pub columns: usize,
    /// The numbers, vertex after vertex.
    pub values: Vec<f64>,
}

/// Where the data of a target vertex come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VertexStatus {
    /// From nowhere: NaN.
    Failed,
    /// From its image, which the map does not vouch for.
    Doubtful,
    /// From its image.
    Valid,
    /// From valid vertices around.
    Filled,
}

impl VertexStatus {
    /// The word used in files and reports.
    pub fn word(self) -> &'static str {
        match self {
            Self::Failed => "failed",
            Self::Doubtful => "doubtful",
            Self::Valid => "valid",
            Self::Filled => "filled",
        }
    }

    /// The number used in PLY files: 0 failed, 1 doubtful, 2 valid, 3 filled.
    pub fn number(self) -> u8 {
        match self {
            Self::Failed => 0,
            Self::Doubtful => 1,
            Self::Valid => 2,
            Self::Filled => 3,
        }
    }
}

/// What [`transfer_attributes`] gives.
#[derive(Clone, Debug)]
pub struct AttributeTransfer {
    /// The attributes on the target's vertices, in the order given.
    pub attributes: Vec<Attribute>,
    /// Where each vertex's data come from.
    pub status: Vec<VertexStatus>,
    /// The images of the vertices and what is known of the map.
    pub map: VertexMap,
}

impl AttributeTransfer {
    /// Number of vertices of a status.
    pub fn count(&self, status: VertexStatus) -> usize {
        self.status.iter().filter(|&&s| s == status).count()
    }
}

/// Carries `attributes` from the vertices of `source` to those of `target` by `map`, which takes
/// points of the target to points of the source.
///
/// O(vertices x columns), and where [`Fill::Smooth`] has work, a sparse factorisation of the
/// vertices to fill. The same input gives the same numbers for any number of threads.
///
/// # Errors
/// If an attribute has another number of values than the source's vertices need, a value that is
/// not finite, a negative weight, or a number of columns that its kind does not allow; those of the
/// map; a lack of memory.
pub fn transfer_attributes(
    source: (&Mesh, &Topology),
    target: (&Mesh, &Topology),
    map: &dyn PointMap,
    attributes: &[Attribute],
    fill: Fill,
) -> Result<AttributeTransfer> {
    attributes.iter().try_for_each(|a| a.check(source.0))?;
    let found = vertex_map(source, target, map)?;
    let normals = vertex_normals(target.0, target.1);
    let carrier = Carrier::new(source, target, &found, &normals);
    let turned = attributes.iter().any(|a| a.kind.is_turned());
    let differentials = if turned { carrier.differentials() } else { Vec::new() };
    let mut status: Vec<VertexStatus> = found
        .images
        .iter()
        .map(|i| match (i.point(), i.status()) {
            (None, _) => VertexStatus::Failed,
            (Some(_), Status::Valid) => VertexStatus::Valid,
            (Some(_), Status::Doubtful | Status::Failed) => VertexStatus::Doubtful,
        })
        .collect();
    let mut carried: Vec<Attribute> = attributes.iter().map(|a| carrier.carry(a, &differentials)).collect();
    if fill == Fill::Smooth {
        for a in &mut carried {
            // No direction is known at a vertex without a normal.
            let rows = a.values.chunks_exact(a.columns).zip(&status);
            let known: Vec<bool> =
                rows.map(|(row, &s)| s == VertexStatus::Valid && row.iter().all(|v| !v.is_nan())).collect();
            match a.kind {
                AttributeKind::Labels => fill::nearest(target, &known, a.columns, &mut a.values),
                _ => fill::harmonic(target, &known, a.columns, &mut a.values)?,
            }
        }
        let valid: Vec<bool> = status.iter().map(|&s| s == VertexStatus::Valid).collect();
        for (s, reached) in status.iter_mut().zip(fill::reached(target.1, &valid)) {
            if reached && *s != VertexStatus::Valid {
                *s = VertexStatus::Filled;
            }
        }
    }
    for a in &mut carried {
        carry::finish(a, &normals);
        target.0.spread_rows(a.columns, &mut a.values);
    }
    target.0.spread(&mut status);
    Ok(AttributeTransfer { attributes: carried, status, map: found })
}

impl AttributeKind {
    /// Whether values depend on the directions around a point.
    fn is_turned(self) -> bool {
        matches!(self, Self::Vectors | Self::Normals | Self::Tangents)
    }
}

impl Attribute {
    /// Whether this can be data of the vertices of `source`; [`transfer_attributes`] asks first of
    /// all.
    ///
    /// # Errors
    /// [`Error::Input`] on another number of values, a value that is not finite, a negative weight,
    /// or a number of columns that the kind does not allow.
    pub fn check(&self, source: &Mesh) -> Result<()> {
        let (name, n, vertices) = (&self.name, self.columns, source.vertex_count());
        let fits = match self.kind {
            AttributeKind::Vectors | AttributeKind::Normals => n > 0 && n.is_multiple_of(3),
            AttributeKind::Tangents => n == 3 || n == 4,
            _ => n > 0,
        };
        if !fits {
            return Err(Error::input(
                format!("{name}: {n} columns for {:?}", self.kind),
                "Vectors and normals have three columns each, tangents three or four, everything else at least one",
            ));
        }
        if n.checked_mul(vertices) != Some(self.values.len()) {
            return Err(Error::input(
                format!("{name}: {} rows for the {vertices} vertices of {}", self.values.len() / n, source.name),
                "Give a row for each vertex line of the source, used or not",
            ));
        }
        if let Some(i) = self.values.iter().position(|v| !v.is_finite()) {
            return Err(Error::input(
                format!("{name}: vertex {}, column {}: {} is not a finite number", i / n, i % n, self.values[i]),
                "Give a number for every vertex",
            ));
        }
        let weights = matches!(self.kind, AttributeKind::Weights { .. });
        // Programs that normalise leave rounding below zero.
        if let Some(i) = self.values.iter().position(|v| weights && *v < -1e-6) {
            return Err(Error::input(
                format!("{name}: vertex {}, column {}: the weight {} is negative", i / n, i % n, self.values[i]),
                "Give weights of 0 or more, or --kind scalars for other numbers",
            ));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
