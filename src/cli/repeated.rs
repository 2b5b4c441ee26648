//! Work on one item after the other, told as one stage.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::progress::Progress;

/// Reports work of one stage that is done several times, on one item after the other, as one stage.
pub(crate) struct Repeated<'a> {
    inner: &'a dyn Progress,
    times: u64,
    begun: AtomicBool,
}

impl<'a> Repeated<'a> {
    /// Of work on `times` items of the same size.
    pub(crate) fn new(inner: &'a dyn Progress, times: usize) -> Self {
        Self { inner, times: times as u64, begun: AtomicBool::new(false) }
    }
}

impl Progress for Repeated<'_> {
    fn stage(&self, name: &str, total: u64) {
        if !self.begun.swap(true, Ordering::Relaxed) {
            self.inner.stage(name, total.saturating_mul(self.times));
        }
    }

    fn advance(&self, count: u64) {
        self.inner.advance(count);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    #[derive(Default)]
    struct Kept(Mutex<Vec<(String, u64)>>);

    impl Progress for Kept {
        fn stage(&self, name: &str, total: u64) {
            self.0.lock().unwrap().push((name.into(), total));
        }
        fn advance(&self, count: u64) {
            self.0.lock().unwrap().push((String::new(), count));
        }
    }

    #[test]
    fn several_items_are_one_stage() {
        let kept = Kept::default();
        let repeated = Repeated::new(&kept, 3);
        for _ in 0..2 {
            repeated.stage("pixels", 10);
            repeated.advance(10);
        }
        let told = kept.0.into_inner().unwrap();
        assert_eq!(told, [("pixels".to_owned(), 30), (String::new(), 10), (String::new(), 10)]);
    }
}
