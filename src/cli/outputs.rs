//! The files that a command writes.

use std::path::Path;

use anyhow::{Result, ensure};

use crate::film::check_writable;

/// Fails if two outputs, or an output and an input, are one file, or if an output can't be written.
pub fn check_outputs<'a>(inputs: &[&Path], outputs: impl Iterator<Item = &'a Path>) -> Result<()> {
    let place = |path: &Path| {
        path.canonicalize()
            .or_else(|_| std::path::absolute(path))
            .unwrap_or(path.to_owned())
    };
    let outputs: Vec<&Path> = outputs.collect();
    let mut taken: Vec<_> = inputs.iter().map(|input| place(input)).collect();
    for output in &outputs {
        let file = place(output);
        ensure!(
            !taken.contains(&file),
            "{}: would overwrite the scene or another file of this command; name another",
            output.display()
        );
        taken.push(file);
    }
    outputs.into_iter().try_for_each(|output| Ok(check_writable(output)?))
}
