//! Editing anchors: a field that follows them.

use faer::Mat;
use nalgebra::{Cholesky, DMatrix, Dyn};
use rayon::prelude::*;

use super::closest::{ClosestOnSurface, FLAT};
use super::{Field, FieldOptions, FieldPair, joined, stiffness};
use crate::engine::Real;
use crate::error::{Error, Result};
use crate::geometry::SurfacePoint;
use crate::geometry::cholesky::SparseCholesky;
use crate::surface::anchors::AnchorPairs;
use crate::surface::vector::{Vector, add_scaled, cast, combine, dot, sub};

/// Part of the first stiffness of the relaxation with which dragged images follow.
const SOFT: f64 = 0.1;
/// What keeps anchors at one place from making the ties singular, in parts of the largest of them.
const RIDGE: f64 = 1e-10;
/// A vertex whose image moved by less than this part of an edge has not moved.
const STILL: f64 = 1e-3;

/// One change of the anchors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Edit {
    /// Another pair: a point of the source and one of the target.
    Add(SurfacePoint, SurfacePoint),
    /// The pair of this number goes to these points of source and target.
    Move(usize, SurfacePoint, SurfacePoint),
    /// The pair of this number goes; those after it count one less.
    Remove(usize),
}

/// A field while its anchors are edited.
///
/// [`FieldSession::edit`] is the fast form, for dragging: what all anchors together chose
/// (predictions, lambda) stays, and the images follow by one smooth displacement from where they
/// are and one step towards the source. Of the factorised system only the columns of anchors that
/// moved on the target are solved for. [`FieldSession::settle`] makes the whole field anew, as for
/// these anchors from the start. Both surfaces and the factors are kept throughout.
#[derive(Debug)]
pub struct FieldSession<'a, S: Real, const D: usize, const K: usize> {
    pair: FieldPair<'a, D>,
    options: FieldOptions,
    anchors: AnchorPairs,
    field: Field<S, K>,
    /// `A = M + eps L' M^-1 L`.
    factor: SparseCholesky,
    /// For each anchor `A^-1 x`, x being its barycentric coordinates.
    columns: Vec<Vec<f64>>,
}

impl<'a, S: Real, const D: usize, const K: usize> FieldSession<'a, S, D, K> {
    /// Makes the field of all `anchors` and what edits need: one factorisation and a solve for each
    /// anchor.
    ///
    /// # Errors
    /// As [`FieldPair::field`] and [`AnchorPairs::check`].
    pub fn new(pair: FieldPair<'a, D>, anchors: AnchorPairs, options: &FieldOptions) -> Result<Self> {
        check(&pair, &anchors)?;
        // Whoever drags a pair wants it there.
        let options = FieldOptions { keep_all: true, ..*options };
        let field: Field<S, K> = pair.field(&anchors, &options)?;
        // Edits keep what was chosen: a choice costs several fields.
        let report = &field.report;
        let lambda = options.lambda.or(report.lambda_by_strain.then_some(report.lambda));
        let options = FieldOptions { lambda, relaxation: report.relaxation.or(options.relaxation), ..options };
        let factor = pair.shapes.bending.factorise(SOFT * stiffness(anchors.len()), &[], 0.0)?;
        let mut session = Self { pair, options, anchors, field, factor, columns: Vec::new() };
        let targets = session.anchors.target.clone();
        session.columns = targets.iter().map(|p| session.column(p)).collect::<Result<_>>()?;
        Ok(session)
    }

    /// The field as it is now.
    pub fn field(&self) -> &Field<S, K> {
        &self.field
    }

    /// The anchors as they are now.
    pub fn anchors(&self) -> &AnchorPairs {
        &self.anchors
    }

    /// Makes the changes in order and lets the images follow. Gives the triangles of the target
    /// whose images moved, rising. `O(V n)` and a solve for each anchor that is new on the target.
    ///
    /// # Errors
    /// If there is no such pair, a point is not on its mesh, or no anchor is left; then nothing has
    /// changed.
    pub fn edit(&mut self, edits: &[Edit]) -> Result<Vec<u32>> {
        let (mut anchors, mut columns) = (self.anchors.clone(), self.columns.clone());
        for edit in edits {
            match *edit {
                Edit::Add(source, target) => {
                    check(&self.pair, &AnchorPairs { source: vec![source], target: vec![target] })?;
                    anchors.source.push(source);
                    anchors.target.push(target);
                    columns.push(self.column(&target)?);
                }
                Edit::Move(i, source, target) => {
                    known(i, &anchors)?;
                    check(&self.pair, &AnchorPairs { source: vec![source], target: vec![target] })?;
                    if anchors.target[i] != target {
                        columns[i] = self.column(&target)?;
                    }
                    anchors.source[i] = source;
                    anchors.target[i] = target;
                }
                Edit::Remove(i) => {
                    known(i, &anchors)?;
                    anchors.source.remove(i);
                    anchors.target.remove(i);
                    columns.remove(i);
                }
            }
        }
        check(&self.pair, &anchors)?;
        let moved = self.follow(&anchors, &columns)?;
        self.anchors = anchors;
        self.columns = columns;
        Ok(moved)
    }

    /// Makes the whole field anew.
    ///
    /// # Errors
    /// As [`FieldPair::field`].
    pub fn settle(&mut self) -> Result<()> {
        self.field = self.pair.field(&self.anchors, &self.options)?;
        Ok(())
    }

    /// `A^-1 x` for a point of the target.
    fn column(&self, p: &SurfacePoint) -> Result<Vec<f64>> {
        let n = self.pair.shapes.used.len();
        let mut x = Mat::zeros(n, 1);
        for (v, b) in self.pair.shapes.target.topology.triangles[p.face as usize].iter().zip(p.barycentric) {
            x[(*v as usize, 0)] += b;
        }
        self.factor.solve(&mut x)?;
        Ok((0..n).map(|v| x[(v, 0)]).collect())
    }

    /// Moves the images so that each anchor has its own: `A d = M (P - z) + sum X lambda`, `X' d =
    /// to - here`.
    fn follow(&mut self, anchors: &AnchorPairs, columns: &[Vec<f64>]) -> Result<Vec<u32>> {
        let (pair, field) = (&self.pair, &self.field);
        let corners = |i: usize| pair.shapes.target.topology.triangles[anchors.target[i].face as usize];
        let at = |i: usize, value: &dyn Fn(usize) -> f64| -> f64 {
            corners(i).iter().zip(anchors.target[i].barycentric).map(|(&v, b)| b * value(v as usize)).sum()
        };
        let n = anchors.len();
        let mut ties = DMatrix::from_fn(n, n, |i, j| at(i, &|v| columns[j][v]));
        let ridge = RIDGE * ties.diagonal().amax();
        (0..n).for_each(|i| ties[(i, i)] += ridge);
        let ties = Cholesky::<f64, Dyn>::new((&ties + ties.transpose()) * 0.5)
            .ok_or_else(|| Error::numeric("the anchors contradict one another", "Remove those that coincide"))?;

        let mut z: Vec<Vector<f64, K>> = field.z.iter().map(cast).collect();
        let closest = ClosestOnSurface::new(&field.reference, &field.vertices);
        let positions = pair.shapes.on_source(anchors);
        let wanted: Vec<Vector<f64, K>> = (0..n)
            .map(|i| {
                let b = pair.to.place(&anchors.source[i]).0;
                let to = field.framed(joined(&b, field.report.lambda, positions[i].to_array()));
                sub(&to, &combine(&anchors.target[i].barycentric, corners(i).map(|v| &z[v as usize])))
            })
            .collect();
        // First the anchors alone, so that what is pulled is near where it will be.
        let smooth = |free: &Mat<f64>| -> Vec<Vector<f64, K>> {
            let missing = DMatrix::from_fn(n, K, |i, k| wanted[i][k] - at(i, &|v| free[(v, k)]));
            let force = ties.solve(&missing);
            let row = |i: usize| -> Vector<f64, K> { std::array::from_fn(|k| force[(i, k)]) };
            let forces: Vec<Vector<f64, K>> = (0..n).map(row).collect();
            (0..z.len())
                .into_par_iter()
                .map(|v| {
                    let own: Vector<f64, K> = std::array::from_fn(|k| free[(v, k)]);
                    forces.iter().zip(columns).fold(own, |d, (f, column)| add_scaled(&d, column[v], f))
                })
                .collect()
        };
        let first = smooth(&Mat::zeros(z.len(), K));
        let here: Vec<Vector<f64, K>> = z.iter().zip(&first).map(|(z, d)| add_scaled(z, 1.0, d)).collect();
        let normals = field.relief.as_ref().map(|r| r.of(&here, &field.triangles));
        let closest = match &field.relief {
            Some(relief) => closest.with_normals(&relief.source),
            None => closest,
        };
        let pull = |v: usize| {
            let normal = normals.as_ref().map_or(&FLAT, |n| &n[v]);
            closest
                .follow_from((&here[v], normal), field.starts[v])
                .map_or([0.0; K], |c| sub(&closest.point(&c), &here[v]))
        };
        let pulls: Vec<Vector<f64, K>> = (0..z.len()).into_par_iter().map(pull).collect();
        let mut free = Mat::from_fn(z.len(), K, |v, k| pair.shapes.bending.mass[v] * (first[v][k] + pulls[v][k]));
        self.factor.solve(&mut free)?;
        let moves = smooth(&free);
        let still = STILL * STILL;
        let moved: Vec<bool> = moves.iter().map(|d| dot(d, d) > still).collect();
        // What has not moved stays to the bit, so that no other triangle has changed.
        z.iter_mut().zip(&moves).zip(&moved).filter(|(_, m)| **m).for_each(|((z, d), _)| *z = add_scaled(z, 1.0, d));

        let triangles: Vec<u32> = (0..field.triangles.len() as u32)
            .filter(|&t| field.triangles[t as usize].iter().any(|&v| moved[v as usize]))
            .collect();
        self.field.move_to(&z, &moved, &triangles);
        Ok(triangles)
    }
}

fn known(i: usize, anchors: &AnchorPairs) -> Result<()> {
    if i < anchors.len() {
        return Ok(());
    }
    Err(Error::input(format!("there is no pair {i}, only {}", anchors.len()), "Pairs are counted from 0"))
}

fn check<const D: usize>(pair: &FieldPair<'_, D>, anchors: &AnchorPairs) -> Result<()> {
    let (source, target) = (pair.shapes.source, pair.shapes.target);
    anchors.check((source.mesh, source.topology), (target.mesh, target.topology)).map(|_| ())
}
