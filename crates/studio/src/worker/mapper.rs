//! The map between the shapes, by whatever method, while pairs are edited.

use barymap::desk::{Choice, correspond};
use barymap::engine::Engine;
use barymap::geometry::SurfacePoint;
use barymap::progress::Quiet;
use barymap::surface::correspondence::Method;
use barymap::surface::field::{Edit, FieldOptions, FieldPair, FieldSession};
use barymap::surface::{AnchorPairs, EmbeddingOptions, PointMap};
use barymap::{Error, Result};

use super::desk::Owned;
use super::message::PairList;
use crate::model::Side;

/// Fewer pairs than this make no map that is worth looking at.
pub(crate) const FEWEST: usize = 3;

/// Dimensions of embeddings as the studio makes them, and of a field's images.
type Session<'a> = FieldSession<'a, f32, 8, 12>;

/// A map that follows its pairs.
pub(crate) enum Mapper<'a> {
    /// The method `field`, which is dragged.
    Session(Box<Session<'a>>),
    /// Another method, which is made anew.
    Whole(Box<dyn PointMap + Send>),
}

/// Which triangles of the target have other images now.
pub(crate) enum Moved {
    All,
    These(Vec<u32>),
}

/// Pairs as the library takes them.
pub(crate) fn anchors(pairs: &PairList) -> AnchorPairs {
    AnchorPairs { source: pairs.iter().map(|p| p.1).collect(), target: pairs.iter().map(|p| p.2).collect() }
}

impl<'a> Mapper<'a> {
    /// The map of these pairs.
    pub(crate) fn new(owned: &'a Owned, pairs: &PairList, method: Method) -> Result<Self> {
        let [Some(source), Some(target)] = &owned.subjects else {
            return Err(Error::input("a shape is missing", "Open two meshes"));
        };
        if method == Method::Field {
            let pair = FieldPair::<8>::new(source.shape(), target.shape())?;
            let session = FieldSession::new(pair, anchors(pairs), &FieldOptions::default())?;
            return Ok(Self::Session(Box::new(session)));
        }
        let choice = Choice { method, ..Choice::default() };
        let options = EmbeddingOptions::default();
        let made = correspond(&Engine::cpu(), source, target, &anchors(pairs), &choice, &options, &Quiet)?;
        Ok(Self::Whole(made.map))
    }

    /// The map.
    pub(crate) fn map(&self) -> &dyn PointMap {
        match self {
            Self::Session(session) => session.field(),
            Self::Whole(map) => map.as_ref(),
        }
    }

    /// Goes from pairs to others.
    pub(crate) fn follow(
        &mut self,
        owned: &'a Owned,
        before: &PairList,
        now: &PairList,
        method: Method,
    ) -> Result<Moved> {
        match self {
            Self::Session(session) => {
                let edits = edits(before, now);
                session.edit(&edits).map(Moved::These)
            }
            Self::Whole(_) => {
                *self = Self::new(owned, now, method)?;
                Ok(Moved::All)
            }
        }
    }

    /// What the pairs say from the start; for methods that are dragged.
    pub(crate) fn settle(&mut self) -> Result<()> {
        match self {
            Self::Session(session) => session.settle(),
            Self::Whole(_) => Ok(()),
        }
    }

    /// Errors of pairs left out, if the method knows them.
    pub(crate) fn left_out(&self) -> &[f64] {
        self.map().field().map_or(&[], |report| &report.left_out)
    }
}

/// The changes that lead from one list of pairs to another.
pub(crate) fn edits(before: &PairList, now: &PairList) -> Vec<Edit> {
    // Pairs keep their order, so that it is a merge; where an undo brought one back in the middle,
    // those behind it are taken out and added again.
    let mut list: Vec<(u64, SurfacePoint, SurfacePoint)> = before.clone();
    let mut edits = Vec::new();
    for (k, pair) in now.iter().enumerate() {
        while k < list.len() && list[k].0 != pair.0 {
            list.remove(k);
            edits.push(Edit::Remove(k));
        }
        if k >= list.len() {
            list.push(*pair);
            edits.push(Edit::Add(pair.1, pair.2));
        } else if list[k] != *pair {
            list[k] = *pair;
            edits.push(Edit::Move(k, pair.1, pair.2));
        }
    }
    while list.len() > now.len() {
        list.pop();
        edits.push(Edit::Remove(list.len()));
    }
    // An addition before a removal, lest no pair is left in between.
    edits
}

/// A point of a side's mesh.
pub(crate) fn fits(owned: &Owned, pairs: &PairList) -> bool {
    let count = |side: Side| owned.shape(side).map_or(0, |s| s.mesh.triangle_count());
    let (source, target) = (count(Side::Source), count(Side::Target));
    pairs.iter().all(|p| (p.1.face as usize) < source && (p.2.face as usize) < target)
}

#[cfg(test)]
mod tests {
    use super::*;
    use barymap::models::shapes::Random;

    fn apply(list: &mut Vec<(SurfacePoint, SurfacePoint)>, edits: &[Edit]) {
        for edit in edits {
            match *edit {
                Edit::Add(s, t) => list.push((s, t)),
                Edit::Move(i, s, t) => list[i] = (s, t),
                Edit::Remove(i) => _ = list.remove(i),
            }
        }
    }

    #[test]
    fn edits_lead_from_any_list_to_any_other() {
        let mut random = Random::new(5);
        let point = |x: u64| SurfacePoint::new(x as u32 % 50, [1.0, 0.0, 0.0]);
        let list = |random: &mut Random| -> PairList {
            let drawn = (0..12).map(|id| (random.unit() < 0.6, (id, point(random.bits() % 3), point(id))));
            drawn.filter(|d| d.0).map(|d| d.1).collect()
        };
        let plain = |list: &PairList| list.iter().map(|p| (p.1, p.2)).collect::<Vec<_>>();
        for _ in 0..300 {
            let (before, now) = (list(&mut random), list(&mut random));
            let mut got = plain(&before);
            apply(&mut got, &edits(&before, &now));
            assert_eq!(got, plain(&now));
        }
        // One pair that moves is one edit.
        let before: PairList = (0..5).map(|id| (id, point(id), point(id))).collect();
        let mut now = before.clone();
        now[2].1 = point(40);
        assert_eq!(edits(&before, &now), [Edit::Move(2, point(40), point(2))]);
        assert_eq!(edits(&before, &before), []);
    }
}
