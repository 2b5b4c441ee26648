//! The choice of a method, and the map that it makes between two subjects.

use super::Subject;
use crate::engine::Engine;
use crate::error::{Error, Result};
use crate::progress::Progress;
use crate::surface::alignment::AlignmentReport;
use crate::surface::correspondence::{CorrespondenceOptions, Method, Shape};
use crate::surface::gpu::correspondence_on;
use crate::surface::{AlignmentOptions, AnchorPairs, Embedding, EmbeddingOptions, PointMap, align};
use crate::tools::anchors::mirrored;

/// How points are carried.
///
/// | field | default | meaning |
/// |---|---|---|
/// | `method` | `Field` | the method |
/// | `relax` | none | whether images are drawn onto the source; as the method is known where none |
/// | `align` | no | whether the target is embedded once more, where anchors left out say it is better |
/// | `keep_all` | no | whether pairs that the others contradict are used as well |
/// | `anchor_error` | 0 | what pairs are off by, over the square root of the source's area |
/// | `mirror` | no | whether pairs of one side count for both |
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Choice {
    /// The method.
    pub method: Method,
    /// Whether images of `Field` and `Rbf` are drawn onto the source by a smooth relaxation.
    pub relax: Option<bool>,
    /// Whether `Field` tries to embed the target once more, from where its landmarks are on the
    /// source.
    pub align: bool,
    /// Whether `Field` uses pairs that the others contradict as well.
    pub keep_all: bool,
    /// What pairs are off by, root mean square, over the square root of the source's area, for
    /// `Field`: 0 where they are held.
    pub anchor_error: f64,
    /// Whether pairs of one side count for both, with any method, where both shapes are their own
    /// mirror images.
    pub mirror: bool,
}

/// A map, and how it came about.
pub struct Made {
    /// From points of the target to points of the source; owns what it needs.
    pub map: Box<dyn PointMap + Send>,
    /// For each pair that was added as the mirror image of another one the number of that one.
    pub mirrored: Vec<usize>,
    /// How many of those given lie on the middle lines and count once.
    pub middle: usize,
    /// What became of an alignment that was asked for.
    pub alignment: Option<AlignmentReport>,
    /// Sentences for the user: why it works on the CPU where a device was asked for.
    pub notes: Vec<String>,
}

impl std::fmt::Debug for Made {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Made").field("alignment", &self.alignment).field("notes", &self.notes).finish_non_exhaustive()
    }
}

/// Pairs that are off by more than this are wrong rather than not exact.
const MOST_ERROR: f64 = 0.2;

impl Choice {
    /// The method for a source that is no surface: radial basis functions where another one is
    /// asked for.
    pub fn for_points(self) -> Self {
        use Method::{Closest, Rbf};
        match self.method {
            Closest => self,
            Rbf => Self { relax: Some(false), ..self },
            _ => Self { method: Rbf, relax: Some(false), align: false, ..self },
        }
    }

    /// The name in reports and messages.
    pub fn name(self) -> &'static str {
        match (self.method, self.relax) {
            (Method::Rbf, Some(true)) => "rbf, relaxed",
            (Method::Field, Some(false)) => "field, not relaxed",
            (method, _) => method.word(),
        }
    }

    /// The options of the correspondence.
    ///
    /// # Errors
    /// [`Error::Option`] for `relax` or `align` with a method that has no use for it.
    pub fn options(self) -> Result<CorrespondenceOptions> {
        use Method::{Field, Rbf};
        if self.relax.is_some() && !matches!(self.method, Field | Rbf) {
            let what = format!("the method {} has nothing to relax", self.method.word());
            return Err(Error::option("relax", what, "Use it with the method field or rbf"));
        }
        if self.align && self.method != Field {
            let what = format!("the method {} has no use for it", self.method.word());
            return Err(Error::option("align", what, "Use it with the method field"));
        }
        if !(0.0..=MOST_ERROR).contains(&self.anchor_error) {
            let what = format!("{} is not in 0..={MOST_ERROR}", self.anchor_error);
            return Err(Error::option(
                "anchor-error",
                what,
                "Give what pairs are off by over the square root of the area, say 0.01",
            ));
        }
        if self.anchor_error > 0.0 && self.method != Field {
            let what = format!("the method {} holds its pairs", self.method.word());
            return Err(Error::option("anchor-error", what, "Use it with the method field"));
        }
        Ok(CorrespondenceOptions {
            method: self.method,
            relax: self.relax,
            keep_all: self.keep_all,
            anchor_error: self.anchor_error,
            ..CorrespondenceOptions::default()
        })
    }
}

/// Makes the map from points of `target` to points of `source` where `engine` works. Both have
/// their embeddings, made with `embedding`, where the method needs them ([`Subject::embed`]).
///
/// # Errors
/// As [`Choice::options`], [`mirrored`], [`align`] and [`correspondence_on`].
pub fn correspond(
    engine: &Engine,
    source: &Subject,
    target: &Subject,
    anchors: &AnchorPairs,
    choice: &Choice,
    embedding: &EmbeddingOptions,
    progress: &dyn Progress,
) -> Result<Made> {
    let options = choice.options()?;
    let both = choice.mirror.then(|| mirrored(source.shape(), target.shape(), anchors)).transpose()?;
    let anchors = both.as_ref().map_or(anchors, |b| &b.pairs);
    let mut alignment = None;
    let mut aligned: Option<Embedding> = None;
    if choice.align {
        let options = AlignmentOptions {
            embedding: *embedding,
            relax: choice.relax.unwrap_or(true),
            ..AlignmentOptions::default()
        };
        let made = align(source.shape(), target.shape(), anchors, &options, progress)?;
        alignment = Some(made.report);
        aligned = made.embedding;
    }
    // The target keeps its own embedding: another pair may want another.
    let shape = Shape { embedding: aligned.as_ref().or(target.embedding.as_ref()), ..target.shape() };
    let (map, note) = correspondence_on(engine, source.shape(), shape, anchors, &options)?;
    let (mirrored, middle) = both.map_or((Vec::new(), 0), |b| (b.of, b.middle));
    Ok(Made { map, mirrored, middle, alignment, notes: note.into_iter().collect() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_for_methods_that_use_them() {
        let all = [Method::Averages, Method::Transport, Method::Field, Method::Rbf, Method::Closest];
        for method in all {
            let relaxed = Choice { method, relax: Some(true), align: false, ..Choice::default() }.options();
            let fits = matches!(method, Method::Field | Method::Rbf);
            assert_eq!(relaxed.is_ok(), fits, "{method:?}");
            let aligned = Choice { method, relax: None, align: true, ..Choice::default() }.options();
            assert_eq!(aligned.is_ok(), method == Method::Field, "{method:?}");
            let cloud = Choice { method, ..Choice::default() }.for_points();
            assert!(!cloud.method.needs_embedding() && cloud.options().is_ok(), "{method:?}");
        }
    }
}
