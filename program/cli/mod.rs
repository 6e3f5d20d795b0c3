//! The command line: arguments to settings, and one function per command.

/// Prints a line to stderr; a stderr that can't be written to is no error.
macro_rules! say {
    ($($text:tt)*) => {
        let _ = std::io::Write::write_fmt(
            &mut std::io::stderr(),
            format_args!("{}\n", ppm_vk::internals::text::escaped(&format!($($text)*))),
        );
    };
}

pub mod advice;
mod args;
mod bench;
mod compare;
mod converge;
mod crops;
mod denoise;
mod events;
mod frames;
mod interrupt;
mod list;
mod manual;
mod merge;
mod outputs;
mod progress;
mod render;
mod save;
mod scene;
mod serve;
mod settings;
mod shutter;
mod takers;
mod view;
mod watch;

use std::io::Write as _;

use anyhow::Result;
use clap::Parser;

use args::{Arguments, Command};
use ppm_vk::internals::text;

/// The outcome of a command; the process's exit code.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// Done: 0.
    Done,
    /// Interrupted, with results so far written: 130.
    Interrupted,
}

/// Parses the process's arguments and runs the command. Wrong arguments end the process with exit code 2.
///
/// # Errors
/// A failed command; the error's text is one line.
pub fn run() -> Result<Outcome> {
    interrupt::survive_file_limits()?;
    let arguments = Arguments::try_parse().unwrap_or_else(|error| refuse(&error));
    match arguments.command {
        None => render::render(&arguments.render),
        Some(Command::Devices { json }) => print(&list::devices(json)?),
        Some(Command::Bench(args::Bench::Gather(arguments))) => bench::gather(&arguments),
        Some(Command::Bench(args::Bench::Random(arguments))) => bench::random(&arguments),
        Some(Command::Bench(args::Bench::Features(arguments))) => bench::features(&arguments),
        Some(Command::Bench(args::Bench::Kernels(arguments))) => bench::kernels(&arguments),
        Some(Command::Compare(arguments)) => compare::run(&arguments),
        Some(Command::Converge(arguments)) => converge::run(&arguments),
        Some(Command::Manual(arguments)) => manual::run(&arguments),
        Some(Command::Merge(arguments)) => merge::run(&arguments),
        Some(Command::Gathers) => print(&list::gathers()?),
        Some(Command::Inspect { scene, read, json }) => print(&list::inspect(&scene, &read, json)?),
    }
}

/// Ends the process as clap does, but with control characters in arguments escaped.
fn refuse(error: &clap::Error) -> ! {
    let text = error.render().to_string();
    let plain = text::escaped_lines(&text);
    if plain == text {
        error.exit();
    }
    let _ = write!(std::io::stderr(), "{plain}");
    std::process::exit(error.exit_code());
}

/// Prints to stdout; a reader that closes the pipe (`| head`) is no error.
fn print(text: &str) -> Result<Outcome> {
    match std::io::stdout().lock().write_all(text::escaped_lines(text).as_bytes()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Err(error.into()),
        _ => Ok(Outcome::Done),
    }
}
