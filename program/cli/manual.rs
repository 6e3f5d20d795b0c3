//! Manual pages and shell completions, made of the arguments' own descriptions.

use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::{Args, Command, CommandFactory};
use clap_complete::Shell;

use super::Outcome;
use super::args::Arguments;

/// Write manual pages and completions for bash, zsh and fish.
#[derive(Debug, Args)]
pub struct Manual {
    /// An existing folder. Packages put ppm-vk*.1 into share/man/man1, ppm-vk.bash into share/bash-completion/completions,
    /// _ppm-vk into share/zsh/site-functions, ppm-vk.fish into share/fish/vendor_completions.d.
    folder: PathBuf,
}

/// The command.
pub fn run(arguments: &Manual) -> Result<Outcome> {
    let folder = &arguments.folder;
    let failed = || folder.display().to_string();
    for shell in [Shell::Bash, Shell::Zsh, Shell::Fish] {
        clap_complete::generate_to(shell, &mut Arguments::command(), "ppm-vk", folder).with_context(failed)?;
    }
    clap_mangen::generate_to(without_help(Arguments::command()), folder).with_context(failed)?;
    Ok(Outcome::Done)
}

/// Without the commands `help`, each of which would have a page.
fn without_help(command: Command) -> Command {
    command.disable_help_subcommand(true).mut_subcommands(without_help)
}
