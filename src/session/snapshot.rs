//! Pictures and states of a render that goes on.

use std::sync::Arc;
use std::time::Duration;

use super::{Rendered, State};
use crate::report::StageTimes;

/// What a render has done so far.
#[derive(Clone)]
pub struct Snapshot {
    /// The picture.
    pub rendered: Arc<Rendered>,
    /// What it has learned, if [`Wanted::State`].
    pub state: Option<Arc<State>>,
    /// Times of the stages of this call's iterations.
    pub stages: StageTimes,
    /// Time that the render spent on this snapshot.
    pub cost: Duration,
}

/// The snapshot that is wanted of an iteration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Wanted {
    /// A picture, if the render makes one anyway, for its error or to keep it.
    Spare,
    /// A picture.
    Picture,
    /// A picture and the state.
    State,
}

/// Snapshots of a render that goes on.
pub struct Snapshots<'a> {
    /// Called before every iteration: the snapshot that is wanted after it, if any. Each costs time of the render, unless it is
    /// [`Wanted::Spare`].
    pub wanted: &'a dyn Fn() -> Option<Wanted>,
    /// Takes a snapshot, between two iterations; the render waits for it to return.
    pub take: &'a dyn Fn(Snapshot),
}
