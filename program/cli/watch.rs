//! All who follow a render: the bar or a script, files that are rewritten, a viewer, a page.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::Result;

use super::args::RenderArguments;
use super::events::{Event, Events, JsonLines, Listener, ProgressFormat};
use super::frames::RenderFiles;
use super::progress::Bar;
use super::save::Saver;
use super::serve::{self, Board, Page};
use super::takers::Takers;
use super::view::Viewer;
use super::{Outcome, advice};

/// The followers of a render.
pub struct Watch<'a> {
    arguments: &'a RenderArguments,
    output: PathBuf,
    /// Tells them what happens.
    pub events: Arc<Events>,
    board: Option<Arc<Board>>,
}

impl<'a> Watch<'a> {
    /// Those that the arguments ask for, of a render to this file.
    pub fn new(arguments: &'a RenderArguments, output: &Path) -> Self {
        let board = arguments.serve.as_ref().map(|_| Arc::new(Board::new(name_of(output))));
        let follower: Box<dyn Listener> = if arguments.has_events_on_stdout() {
            Box::new(JsonLines::default())
        } else {
            Box::new(Bar::new(arguments.quiet))
        };
        let mut listeners = vec![follower];
        if let Some(board) = &board {
            listeners.push(Box::new(board.clone()));
        }
        Self {
            arguments,
            output: output.to_owned(),
            events: Arc::new(Events::new(listeners)),
            board,
        }
    }

    /// Opens the page.
    ///
    /// # Errors
    /// A port that can't be listened on.
    pub fn begin(&self) -> Result<()> {
        match (&self.arguments.serve, &self.board) {
            (Some(address), Some(board)) => serve::start(address, board, &self.events),
            _ => Ok(()),
        }
    }

    /// Those who take pictures, of a render to these files.
    pub fn takers(&self, files: &RenderFiles) -> Takers {
        let mut takers = Takers::default();
        if let Some(saver) = Saver::new(self.arguments, files, &self.events) {
            takers.add(saver);
        }
        if let Some(address) = &self.arguments.view {
            takers.add(Viewer::new(address.clone(), name_of(&self.output), &self.events));
        }
        if let Some(board) = &self.board {
            takers.add(Page::new(board.clone()));
        }
        takers
    }

    /// Tells them how it ended.
    pub fn end(&self, outcome: &Result<Outcome>) {
        self.events.tell(&match outcome {
            Ok(outcome) => Event::Done {
                interrupted: *outcome == Outcome::Interrupted,
            },
            Err(error) => Event::Error {
                text: advice::line(error),
            },
        });
        if let Some(board) = &self.board {
            board.wait_for_browsers();
        }
    }
}

impl RenderArguments {
    /// Whether stdout has events and nothing else.
    pub fn has_events_on_stdout(&self) -> bool {
        self.progress == Some(ProgressFormat::Json)
    }
}

/// The name by which viewers show a picture.
fn name_of(output: &Path) -> String {
    let name = output.file_name().unwrap_or(output.as_os_str());
    name.to_string_lossy().into_owned()
}
