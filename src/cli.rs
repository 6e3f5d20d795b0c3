//! The command line: arguments to settings, and one function a command.

mod args;
mod interrupt;
mod list;
mod progress;
mod render;

use anyhow::Result;
use clap::Parser;

use args::{Arguments, Command};

/// How a command ended; the process's exit code.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// Done: 0.
    Done,
    /// Interrupted, with what was done so far written: 130.
    Interrupted,
}

/// Parses the process's arguments and does what they ask for. Wrong arguments end the process with exit code 2.
///
/// # Errors
/// The work failed; the error's text is one line.
pub fn run() -> Result<Outcome> {
    let arguments = Arguments::parse();
    match arguments.command {
        None => render::render(&arguments.render),
        Some(Command::Devices { json }) => list::devices(json).map(|()| Outcome::Done),
        Some(Command::Gathers) => {
            list::gathers();
            Ok(Outcome::Done)
        }
        Some(Command::Inspect { scene, json }) => list::inspect(&scene, json).map(|()| Outcome::Done),
    }
}
