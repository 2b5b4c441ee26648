//! A value with its past and future.

/// States kept at most.
const MOST: usize = 500;

/// A value that is edited, with what it was before. Every edit can be undone; the steps of one
/// gesture, such as a drag, count as one edit.
#[derive(Clone, Debug, Default)]
pub struct History<T> {
    now: T,
    past: Vec<T>,
    future: Vec<T>,
    /// What it was when the gesture began.
    gesture: Option<T>,
    /// Counts changes.
    revision: u64,
}

impl<T: Clone + PartialEq> History<T> {
    /// A value without a past.
    pub fn new(now: T) -> Self {
        Self { now, past: Vec::new(), future: Vec::new(), gesture: None, revision: 0 }
    }

    /// The value.
    pub fn now(&self) -> &T {
        &self.now
    }

    /// A number that is another one after every change.
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// Changes the value; an edit that changes nothing leaves no trace.
    pub fn edit<R>(&mut self, change: impl FnOnce(&mut T) -> R) -> R {
        let before = self.now.clone();
        let result = change(&mut self.now);
        if self.now != before {
            self.revision += 1;
            self.future.clear();
            if self.gesture.is_none() {
                self.keep(before);
            }
        }
        result
    }

    /// Edits up to [`History::end`] are one.
    pub fn begin(&mut self) {
        if self.gesture.is_none() {
            self.gesture = Some(self.now.clone());
        }
    }

    /// Ends a gesture, if there is one.
    pub fn end(&mut self) {
        if let Some(before) = self.gesture.take().filter(|b| *b != self.now) {
            self.keep(before);
        }
    }

    /// Whether a gesture is going on.
    pub fn in_gesture(&self) -> bool {
        self.gesture.is_some()
    }

    fn keep(&mut self, before: T) {
        self.past.push(before);
        if self.past.len() > MOST {
            self.past.remove(0);
        }
    }

    /// Goes back by one edit; a gesture that is going on is what is undone. Whether there was one.
    pub fn undo(&mut self) -> bool {
        self.end();
        let Some(before) = self.past.pop() else { return false };
        self.future.push(std::mem::replace(&mut self.now, before));
        self.revision += 1;
        true
    }

    /// Takes back an undo. Whether there was one.
    pub fn redo(&mut self) -> bool {
        self.end();
        let Some(after) = self.future.pop() else { return false };
        self.past.push(std::mem::replace(&mut self.now, after));
        self.revision += 1;
        true
    }

    /// Whether there is something to undo.
    pub fn can_undo(&self) -> bool {
        !self.past.is_empty()
    }

    /// Whether there is something to do again.
    pub fn can_redo(&self) -> bool {
        !self.future.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edits_are_undone_and_done_again() {
        let mut h = History::new(0);
        h.edit(|x| *x = 1);
        h.edit(|x| *x = 2);
        assert!(h.undo() && h.undo() && !h.undo());
        assert_eq!(*h.now(), 0);
        assert!(h.redo());
        assert_eq!(*h.now(), 1);
        h.edit(|x| *x = 5);
        assert!(!h.redo(), "a new edit ends the future");
        assert!(h.undo());
        assert_eq!(*h.now(), 1);
    }

    #[test]
    fn a_gesture_is_one_edit_and_nothing_is_none() {
        let mut h = History::new(0);
        h.edit(|_| ());
        assert!(!h.can_undo());
        h.begin();
        (1..10).for_each(|k| h.edit(|x| *x = k));
        h.end();
        assert!(h.undo());
        assert_eq!(*h.now(), 0);
        h.begin();
        h.edit(|x| *x = 3);
        h.edit(|x| *x = 0);
        h.end();
        assert!(!h.can_undo());
        // Undo within a gesture takes the gesture back.
        h.begin();
        h.edit(|x| *x = 8);
        assert!(h.undo());
        assert_eq!((*h.now(), h.in_gesture()), (0, false));
    }

    #[test]
    fn the_past_is_bounded_and_revisions_rise() {
        let mut h = History::new(0);
        for k in 1..2000 {
            let before = h.revision();
            h.edit(|x| *x = k);
            assert!(h.revision() > before);
        }
        assert_eq!(h.past.len(), MOST);
    }
}
