//! The memory budget of a scene.

use std::cell::Cell;
use std::fmt::Display;
use std::sync::{Arc, Mutex, PoisonError};

use crate::loader::diagnostic::Check;
use crate::text::bytes;

/// Default limit of a scene's memory, in bytes: the size of one buffer of common devices. It does not depend on the machine's
/// memory, so that a scene that loads on one machine loads on all.
pub const MEMORY_LIMIT: u64 = 2 << 30;

/// The budget of a scene and its use, including temporary memory while reading. A small file can request any amount, so sizes are
/// checked before memory is allocated.
#[derive(Debug)]
pub(crate) struct Budget {
    limit: u64,
    taken: Cell<u64>,
    refused: FirstRefusal,
}

/// A request exceeded the limit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Refusal {
    /// The item that requested it.
    pub what: String,
    /// A limit that would have been sufficient, in bytes.
    pub needed: u64,
}

/// The first refusal of a budget; it outlives the budget.
#[derive(Debug, Clone, Default)]
pub(crate) struct FirstRefusal(Arc<Mutex<Option<Refusal>>>);

impl FirstRefusal {
    /// The refusal, if there was one.
    pub(crate) fn get(&self) -> Option<Refusal> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn set(&self, refusal: Refusal) {
        self.0
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .get_or_insert(refusal);
    }
}

impl Budget {
    /// An unused budget.
    pub(crate) fn new(limit: u64) -> Self {
        Self {
            limit,
            taken: Cell::new(0),
            refused: FirstRefusal::default(),
        }
    }

    /// The place of the first refusal.
    pub(crate) fn refused(&self) -> FirstRefusal {
        self.refused.clone()
    }

    /// Takes `size` bytes for `what` permanently.
    pub(crate) fn take(&self, size: u64, what: impl Display) -> Check<()> {
        self.check(size, what)?;
        self.taken.set(self.taken.get() + size);
        Ok(())
    }

    /// Gives back bytes that were taken.
    pub(crate) fn give_back(&self, size: u64) {
        self.taken.set(self.taken.get().saturating_sub(size));
    }

    /// Whether `size` bytes are available for `what` temporarily.
    pub(crate) fn check(&self, size: u64, what: impl Display) -> Check<()> {
        let taken = self.taken.get();
        let needed = taken.saturating_add(size);
        if needed <= self.limit {
            return Ok(());
        }
        let text = format!(
            "{what} needs {} of memory in addition to {} for the rest of the scene, and the limit is {}",
            bytes(size),
            bytes(taken),
            bytes(self.limit)
        );
        let refusal = Refusal {
            what: text.clone(),
            needed,
        };
        self.refused.set(refusal);
        Err(text)
    }

    /// Fails if any request was refused, even if the scene could do without it.
    pub(crate) fn settle(&self) -> Check<()> {
        self.refused.get().map_or(Ok(()), |refusal| Err(refusal.what))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_goes_over_the_limit_is_refused_with_the_limit_that_allows_it() {
        let budget = Budget::new(3 << 30);
        budget.take(1 << 30, "a buffer").expect("room");
        budget.check(2 << 30, "an image").expect("room");
        budget.settle().expect("nothing was refused");
        let error = budget.take((2 << 30) + 1, "image 3").expect_err("no room");
        assert!(error.starts_with("image 3 needs 2.0 GiB"), "{error}");
        let refused = budget.refused().get().expect("a refusal");
        assert_eq!((refused.what, refused.needed), (error.clone(), (3 << 30) + 1));
        assert_eq!(budget.settle(), Err(error));
        budget.check(u64::MAX, "all").expect_err("no room");
    }
}
