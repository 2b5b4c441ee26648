//! Bijective composite mean value mappings (Schneider, Hormann, Floater 2013).
//!
//! A map from one polygon to another by barycentric coordinates can fold. Carried through
//! intermediate polygons in steps that are small enough it does not: [`plane`] has the coordinates,
//! the Jacobian and its minimum, the paths of the vertices, the partition into steps, and the
//! composite of the steps with its inverse; [`space`] has the same for polyhedra.

mod knots;
pub mod plane;
pub mod space;
