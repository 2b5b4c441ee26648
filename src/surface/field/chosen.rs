//! How much space counts, and how images are drawn onto the source, where the usual choice shows
//! that it is a poor one.
//!
//! The usual relaxation slides images along the source. Where one shape has pieces that the other
//! one lacks (a collar, boots, horns), nothing there fits, and images slide until triangles turn
//! over. Where many do, images are drawn towards the closest points themselves, which keeps them
//! nearer to where they were predicted.
//!
//! Predictions choose lambda by what pairs left out would have missed. With few pairs that is
//! chance, and one more pair may make a map worse. The finished map says more: where another lambda
//! strains the map much less, it is the better one.

use super::pair::FieldPair;
use super::{Field, FieldOptions, FieldReport, Relaxation};
use crate::error::Result;
use crate::surface::anchors::AnchorPairs;

/// Part of the target's triangles that a relaxation turns over where the shapes are of one kind, at
/// most: 0.1 % on bodies and animals, several per cent on clothes (`cargo bench --bench packs`).
const TURNED: f64 = 0.01;
/// Weights of space that are tried beside the one that predictions choose.
const LAMBDAS: [f64; 5] = [0.1, 0.3, 1.0, 3.0, 9.0];
/// More pairs than these choose well by themselves.
const FEW: usize = 16;
/// Another lambda is taken where the map's strain falls below this part of what it was. Shapes of
/// other proportions must be strained, so that less is not always better.
const LESS_STRAIN: f64 = 0.7;

impl<const D: usize> FieldPair<'_, D> {
    /// `field`, or a better one of the same pairs, and its options. The same for every back end, as
    /// it is chosen in double precision. One field more for shapes of different kinds, five for few
    /// pairs.
    ///
    /// # Errors
    /// As [`FieldPair::field`].
    pub(super) fn chosen<const K: usize>(
        &self,
        field: Field<f64, K>,
        anchors: &AnchorPairs,
        options: &FieldOptions,
    ) -> Result<(Field<f64, K>, FieldOptions)> {
        // A map that nobody has to vouch for is a step of something else.
        if options.relaxation.is_some() || !options.confidence {
            return Ok((field, *options));
        }
        let usable = self.shapes.target.topology.usable.iter().filter(|u| **u).count();
        let many = |triangles: usize| triangles as f64 > TURNED * usable as f64;
        let FieldReport { turned, turned_within, .. } = field.report;
        if many(turned[0]) {
            // What lies beyond the rim of a source that is only a part collapses there and turns over
            // too; that says nothing of kinds.
            let relaxation = if many(turned_within) { Relaxation::Points } else { Relaxation::Part };
            let options = FieldOptions { relaxation: Some(relaxation), ..*options };
            return Ok((Field::of(self, anchors, &options)?, options));
        }
        // Strain says nothing where shapes are of different kinds.
        if options.lambda.is_none() && anchors.len() <= FEW {
            return self.less_strained(field, anchors, options);
        }
        Ok((field, *options))
    }

    fn less_strained<const K: usize>(
        &self,
        field: Field<f64, K>,
        anchors: &AnchorPairs,
        options: &FieldOptions,
    ) -> Result<(Field<f64, K>, FieldOptions)> {
        let usual = self.strain(&field);
        let (mut best, mut chosen, mut least) = (field, *options, LESS_STRAIN * usual);
        for lambda in LAMBDAS {
            let options = FieldOptions { lambda: Some(lambda), ..*options };
            let other: Field<f64, K> = Field::of(self, anchors, &options)?;
            let strain = self.strain(&other);
            if strain < least {
                (best, chosen, least) = (other, options, strain);
                best.report.lambda_by_strain = true;
            }
        }
        Ok((best, chosen))
    }
}
