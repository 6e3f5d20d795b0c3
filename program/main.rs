//! The `ppm-vk` program. Exit codes: 0 done, 1 the work failed, 2 the arguments are wrong, 130 interrupted.

mod bench;
mod cli;

use std::io::Write as _;
use std::process::ExitCode;

use cli::Outcome;

fn main() -> ExitCode {
    match cli::run() {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::Interrupted) => ExitCode::from(130),
        Err(error) => {
            // A stderr that can't be written to must not change the exit code.
            let line = ppm_vk::internals::text::escaped(&format!("error: {}", cli::advice::line(&error)));
            let _ = writeln!(std::io::stderr(), "{line}");
            ExitCode::FAILURE
        }
    }
}
