//! Pairs of corresponding points, as they are set by hand.

use barymap::geometry::SurfacePoint;

use super::Side;

/// A pair, or the first half of one.
#[derive(Clone, Debug, PartialEq)]
pub struct Pair {
    /// Stays the same whatever becomes of others; gives the colour.
    pub id: u64,
    /// Where it is on the source and on the target; one of them at least.
    pub points: [Option<SurfacePoint>; 2],
    /// What the user calls it.
    pub label: String,
}

impl Pair {
    /// Its point on a side.
    pub fn on(&self, side: Side) -> Option<SurfacePoint> {
        self.points[side.index()]
    }

    /// Its points on source and target, if it has both.
    pub fn both(&self) -> Option<(SurfacePoint, SurfacePoint)> {
        self.on(Side::Source).zip(self.on(Side::Target))
    }
}

/// Pairs in the order in which they were set. At most one is not complete, the last one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pairs {
    list: Vec<Pair>,
    next: u64,
}

impl Pairs {
    /// All, in order.
    pub fn list(&self) -> &[Pair] {
        &self.list
    }

    /// The pair that lacks a point.
    pub fn open(&self) -> Option<&Pair> {
        self.list.last().filter(|p| p.both().is_none())
    }

    /// Those that are complete: id, source, target.
    pub fn complete(&self) -> Vec<(u64, SurfacePoint, SurfacePoint)> {
        self.list.iter().filter_map(|p| p.both().map(|(s, t)| (p.id, s, t))).collect()
    }

    /// The place of a pair in the list.
    pub fn position(&self, id: u64) -> Option<usize> {
        self.list.iter().position(|p| p.id == id)
    }

    /// A click: begins a pair, completes the one that lacks this side, or moves the only point of
    /// the one that has this side alone. Gives its id.
    pub fn click(&mut self, side: Side, point: SurfacePoint) -> u64 {
        if let Some(open) = self.list.last_mut().filter(|p| p.both().is_none()) {
            open.points[side.index()] = Some(point);
            return open.id;
        }
        let mut points = [None; 2];
        points[side.index()] = Some(point);
        self.push(points, String::new())
    }

    /// Adds a whole pair, before one that is not complete. Gives its id.
    pub fn add(&mut self, source: SurfacePoint, target: SurfacePoint, label: String) -> u64 {
        let open = self.list.pop_if(|p| p.both().is_none());
        let id = self.push([Some(source), Some(target)], label);
        self.list.extend(open);
        id
    }

    fn push(&mut self, points: [Option<SurfacePoint>; 2], label: String) -> u64 {
        let id = self.next;
        self.next += 1;
        self.list.push(Pair { id, points, label });
        id
    }

    /// Moves a point that a pair has. Whether there is one.
    pub fn move_to(&mut self, id: u64, side: Side, point: SurfacePoint) -> bool {
        let pair = self.list.iter_mut().find(|p| p.id == id);
        let Some(place) = pair.and_then(|p| p.points[side.index()].as_mut()) else { return false };
        *place = point;
        true
    }

    /// Names a pair.
    pub fn rename(&mut self, id: u64, label: &str) {
        if let Some(pair) = self.list.iter_mut().find(|p| p.id == id) {
            label.clone_into(&mut pair.label);
        }
    }

    /// Takes a pair out. Whether there was one.
    pub fn remove(&mut self, id: u64) -> bool {
        let before = self.list.len();
        self.list.retain(|p| p.id != id);
        self.list.len() < before
    }

    /// Drops the pair that lacks a point. Whether there was one.
    pub fn drop_open(&mut self) -> bool {
        self.list.pop_if(|p| p.both().is_none()).is_some()
    }

    /// Takes points off a side whose mesh is another one now: no pair stays.
    pub fn clear(&mut self) {
        self.list.clear();
    }

    /// Pairs that a file holds, in place of these.
    pub fn replace(&mut self, pairs: impl IntoIterator<Item = ([Option<SurfacePoint>; 2], String)>) {
        self.clear();
        for (points, label) in pairs {
            match points {
                [Some(source), Some(target)] => _ = self.add(source, target, label),
                [None, None] => (),
                half => {
                    self.drop_open();
                    self.push(half, label);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(face: u32) -> SurfacePoint {
        SurfacePoint::new(face, [0.2, 0.3, 0.5])
    }

    #[test]
    fn clicks_begin_complete_and_move() {
        let mut pairs = Pairs::default();
        let a = pairs.click(Side::Source, point(1));
        assert_eq!(pairs.click(Side::Source, point(2)), a, "the only point moves");
        assert!(pairs.open().is_some() && pairs.complete().is_empty());
        assert_eq!(pairs.click(Side::Target, point(3)), a);
        assert_eq!(pairs.complete(), [(a, point(2), point(3))]);
        // A pair may begin on the target.
        let b = pairs.click(Side::Target, point(4));
        assert_ne!(a, b);
        assert_eq!(pairs.open().unwrap().on(Side::Source), None);
        assert!(pairs.drop_open() && !pairs.drop_open());
    }

    #[test]
    fn ids_stay_when_others_go() {
        let mut pairs = Pairs::default();
        let ids: Vec<u64> = (0..3).map(|k| pairs.add(point(k), point(k), String::new())).collect();
        assert!(pairs.remove(ids[1]) && !pairs.remove(ids[1]));
        assert!(pairs.move_to(ids[2], Side::Target, point(9)) && !pairs.move_to(ids[1], Side::Target, point(9)));
        assert_eq!(pairs.complete()[1], (ids[2], point(2), point(9)));
        assert!(!ids.contains(&pairs.add(point(5), point(5), String::new())));
        pairs.rename(ids[0], "nose");
        assert_eq!(pairs.list()[0].label, "nose");
    }

    #[test]
    fn a_half_stays_last() {
        let mut pairs = Pairs::default();
        let half = pairs.click(Side::Source, point(1));
        pairs.add(point(2), point(2), String::new());
        assert_eq!(pairs.open().unwrap().id, half);
        pairs.replace([([Some(point(1)), None], "a".into()), ([Some(point(1)), Some(point(2))], "b".into())]);
        assert_eq!((pairs.complete().len(), pairs.open().unwrap().label.as_str()), (1, "a"));
        assert!(!pairs.move_to(pairs.open().unwrap().id, Side::Target, point(0)), "it has no point there");
    }
}
