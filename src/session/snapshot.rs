//! Pictures and states of a render that goes on.

use std::time::Duration;

use super::{Rendered, State};

/// What a render has done so far.
pub struct Snapshot {
    /// The picture.
    pub rendered: Rendered,
    /// What it has learned, if [`Snapshots::with_state`].
    pub state: Option<State>,
}

/// Snapshots of a render that goes on.
pub struct Snapshots<'a> {
    /// Minimum time from one to the next.
    pub every: Duration,
    /// Whether they have states.
    pub with_state: bool,
    /// Takes a snapshot, between two iterations; the render waits for it to return.
    pub take: &'a dyn Fn(Snapshot),
}
