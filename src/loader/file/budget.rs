//! What a scene may take of memory.

use std::cell::{Cell, RefCell};
use std::fmt::Display;
use std::rc::Rc;

use crate::loader::diagnostic::Check;
use crate::text::bytes;

/// Bytes that a scene may take where the user doesn't say: as many as one buffer of usual devices. It doesn't follow the machine's
/// memory, so that a scene that is read on one is read on all.
pub const MEMORY_LIMIT: u64 = 2 << 30;

/// What a scene may take and has taken, with what reading needs for a while. A small file can ask for any amount: sizes are
/// asked for before they are taken.
#[derive(Debug)]
pub(crate) struct Budget {
    limit: u64,
    taken: Cell<u64>,
    refused: FirstRefusal,
}

/// More than the limit was asked for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Refusal {
    /// By what.
    pub what: String,
    /// The limit that would have been enough, bytes.
    pub needed: u64,
}

/// The first refusal of a budget; it outlives the budget.
pub(crate) type FirstRefusal = Rc<RefCell<Option<Refusal>>>;

impl Budget {
    /// Nothing is taken yet.
    pub(crate) fn new(limit: u64) -> Self {
        Self {
            limit,
            taken: Cell::new(0),
            refused: FirstRefusal::default(),
        }
    }

    /// Where the first refusal will be.
    pub(crate) fn refused(&self) -> FirstRefusal {
        Rc::clone(&self.refused)
    }

    /// Takes `size` bytes for `what`, to be kept.
    pub(crate) fn take(&self, size: u64, what: impl Display) -> Check<()> {
        self.check(size, what)?;
        self.taken.set(self.taken.get() + size);
        Ok(())
    }

    /// Whether `size` bytes are left for `what`, for a while.
    pub(crate) fn check(&self, size: u64, what: impl Display) -> Check<()> {
        let taken = self.taken.get();
        let needed = taken.saturating_add(size);
        if needed <= self.limit {
            return Ok(());
        }
        let text = format!(
            "{what} needs {} of memory beside {} of the rest of the scene, which may take {} in all",
            bytes(size),
            bytes(taken),
            bytes(self.limit)
        );
        let refusal = Refusal {
            what: text.clone(),
            needed,
        };
        self.refused.borrow_mut().get_or_insert(refusal);
        Err(text)
    }

    /// Fails if anything was refused, though the scene could do without it.
    pub(crate) fn settle(&self) -> Check<()> {
        self.refused
            .borrow()
            .clone()
            .map_or(Ok(()), |refusal| Err(refusal.what))
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
        let refused = budget.refused().borrow().clone().expect("a refusal");
        assert_eq!((refused.what, refused.needed), (error.clone(), (3 << 30) + 1));
        assert_eq!(budget.settle(), Err(error));
        budget.check(u64::MAX, "all").expect_err("no room");
    }
}
