//! Progress within a load step.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::progress::Progress;

/// Progress of a load step: iterations of its solver do not count as steps, and an interrupt ends them.
pub(super) struct InsideStep<'a> {
    pub progress: &'a dyn Progress,
    pub interrupt: Option<&'a AtomicBool>,
}

impl Progress for InsideStep<'_> {
    fn stage(&self, _name: &str, _total: Option<u64>) {}

    fn advance(&self, _by: u64) {
        self.progress.advance(0);
    }

    fn asks_to_end(&self) -> bool {
        self.interrupt.is_some_and(|i| i.load(Ordering::Relaxed))
    }

    fn tell(&self, text: &str) {
        self.progress.tell(text);
    }

    fn finish(&self) {}
}
