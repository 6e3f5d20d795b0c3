//! Who takes snapshots of a render that goes on, and when.

use std::cell::Cell;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use ppm_vk::{Rendered, Snapshot, Wanted};

/// Takes snapshots. The render waits for its functions: work is done on threads of its own.
pub trait Taker {
    /// The snapshot that it wants now, if any.
    fn wants(&self) -> Option<Wanted>;
    /// Takes one.
    fn take(&self, snapshot: &Snapshot);
    /// The render has ended, with this picture if there is one.
    fn end(self: Box<Self>, last: Option<&Arc<Rendered>>);
}

/// All takers of a render.
#[derive(Default)]
pub struct Takers(Vec<Box<dyn Taker>>);

impl Takers {
    /// Adds one.
    pub fn add(&mut self, taker: impl Taker + 'static) {
        self.0.push(Box::new(taker));
    }

    /// The snapshot that serves all who want one now.
    pub fn want(&self) -> Option<Wanted> {
        self.0.iter().filter_map(|taker| taker.wants()).max()
    }

    /// Gives a snapshot to all whom it serves.
    pub fn take(&self, snapshot: &Snapshot) {
        let made = if snapshot.state.is_some() {
            Wanted::State
        } else {
            Wanted::Picture
        };
        for taker in &self.0 {
            if taker.wants().is_some_and(|wanted| wanted <= made) {
                taker.take(snapshot);
            }
        }
    }

    /// Ends them, with the last picture.
    pub fn end(self, last: Option<&Arc<Rendered>>) {
        self.0.into_iter().for_each(|taker| taker.end(last));
    }
}

/// When a taker is due.
#[derive(Debug)]
pub struct Pace {
    every: Duration,
    /// Maximum share of the render's time for its snapshots.
    share: f64,
    next: Cell<Instant>,
}

impl Pace {
    /// Due whenever this time has passed.
    pub fn every(every: Duration) -> Self {
        // A time beyond what can be counted is never.
        let next = Instant::now().checked_add(every);
        let never = Duration::from_secs(1 << 30);
        Self {
            every,
            share: 1.0,
            next: Cell::new(next.unwrap_or_else(|| Instant::now() + never)),
        }
    }

    /// Due at once, then once a second at most, less often where snapshots cost more than 2 % of the time.
    pub fn of_a_view() -> Self {
        Self {
            every: Duration::from_secs(1),
            share: 0.02,
            next: Cell::new(Instant::now()),
        }
    }

    /// Whether it is due.
    pub fn is_due(&self) -> bool {
        Instant::now() >= self.next.get()
    }

    /// A snapshot that cost this time was taken.
    pub fn taken(&self, cost: Duration) {
        let wait = self.every.max(cost.div_f64(self.share));
        self.next
            .set(Instant::now().checked_add(wait).unwrap_or(self.next.get()));
    }
}

/// Hands the latest of something to a thread that may be slower than what it comes from.
pub struct Mailbox<T> {
    slot: Mutex<Slot<T>>,
    changed: Condvar,
}

struct Slot<T> {
    latest: Option<T>,
    is_closed: bool,
    is_awaited: bool,
}

impl<T> Default for Mailbox<T> {
    fn default() -> Self {
        Self {
            slot: Mutex::new(Slot {
                latest: None,
                is_closed: false,
                is_awaited: false,
            }),
            changed: Condvar::new(),
        }
    }
}

impl<T> Mailbox<T> {
    fn slot(&self) -> MutexGuard<'_, Slot<T>> {
        self.slot.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Puts the latest in; one that was not taken out yet is dropped.
    pub fn put(&self, latest: T) {
        self.slot().latest = Some(latest);
        self.changed.notify_all();
    }

    /// Nothing more comes.
    pub fn close(&self) {
        self.slot().is_closed = true;
        self.changed.notify_all();
    }

    /// Whether the thread waits for the next.
    pub fn is_awaited(&self) -> bool {
        let slot = self.slot();
        slot.is_awaited && slot.latest.is_none()
    }

    /// Waits for the next; `None` after the last.
    pub fn next(&self) -> Option<T> {
        let mut slot = self.slot();
        slot.is_awaited = true;
        slot = self
            .changed
            .wait_while(slot, |slot| slot.latest.is_none() && !slot.is_closed)
            .unwrap_or_else(PoisonError::into_inner);
        slot.is_awaited = false;
        slot.latest.take()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slow_reader_gets_the_latest() {
        let mailbox = Mailbox::default();
        assert!(!mailbox.is_awaited(), "nobody reads yet");
        mailbox.put(1);
        mailbox.put(2);
        mailbox.close();
        assert_eq!((mailbox.next(), mailbox.next()), (Some(2), None));
    }

    #[test]
    fn views_that_cost_more_are_taken_less_often() {
        let wait = |cost| {
            let pace = Pace::of_a_view();
            assert!(pace.is_due(), "the first picture is taken at once");
            pace.taken(Duration::from_millis(cost));
            (pace.next.get() - Instant::now()).as_secs_f64()
        };
        // 5 ms: once a second; 200 ms: every 10 s.
        assert!((0.9..=1.0).contains(&wait(5)) && (9.9..=10.0).contains(&wait(200)));
    }
}
