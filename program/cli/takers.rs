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

/// When a taker wants a picture.
#[derive(Debug)]
pub struct Pace {
    every: Duration,
    /// Maximum share of the render's time for its snapshots.
    share: f64,
    /// When it wants one that the render makes anyway.
    spare: Cell<Instant>,
    /// When it wants one that costs time.
    next: Cell<Instant>,
}

/// This time from now; never, if that is beyond what can be counted.
fn after(wait: Duration) -> Instant {
    const NEVER: Duration = Duration::from_secs(1 << 30);
    Instant::now() + wait.min(NEVER)
}

impl Pace {
    /// Whenever this time has passed.
    pub fn every(every: Duration) -> Self {
        Self {
            every,
            share: 1.0,
            spare: Cell::new(after(every)),
            next: Cell::new(after(every)),
        }
    }

    /// At once, then once a second at most, less often where snapshots cost more than 2 % of the time.
    pub fn of_a_view() -> Self {
        Self {
            every: Duration::from_secs(1),
            share: 0.02,
            spare: Cell::new(Instant::now()),
            next: Cell::new(Instant::now()),
        }
    }

    /// Whether it wants a picture, even if that costs time.
    pub fn is_due(&self) -> bool {
        Instant::now() >= self.next.get()
    }

    /// The picture that it wants, if any.
    pub fn wants(&self) -> Option<Wanted> {
        let is_welcome = Instant::now() >= self.spare.get();
        let spare = is_welcome.then_some(Wanted::Spare);
        if self.is_due() { Some(Wanted::Picture) } else { spare }
    }

    /// A snapshot that cost this time was taken.
    pub fn taken(&self, cost: Duration) {
        self.spare.set(after(self.every));
        let next = after(self.every.max(cost.div_f64(self.share)));
        self.next.set(self.next.get().max(next));
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
        let pace = Pace::of_a_view();
        assert_eq!(
            pace.wants(),
            Some(Wanted::Picture),
            "the first picture is taken at once"
        );
        let waits = |cost| {
            pace.taken(Duration::from_millis(cost));
            [&pace.spare, &pace.next].map(|time| (time.get() - Instant::now()).as_secs_f64().ceil())
        };
        assert_eq!(waits(5), [1.0, 1.0], "cheap ones once a second");
        assert_eq!(waits(200), [1.0, 10.0], "others for 2 % of the time");
        assert_eq!(waits(0), [1.0, 10.0], "one that cost nothing changes nothing in that");
        pace.spare.set(Instant::now());
        assert_eq!(pace.wants(), Some(Wanted::Spare));
    }
}
