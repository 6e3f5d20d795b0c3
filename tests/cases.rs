//! The files of `../shared/cases`, small inputs after public bug reports, as the `expected.txt` of each folder says. Where that leaves
//! a choice, `docs/files.md` has it. Where the folder isn't there, the tests say so.

#[path = "cases/files.rs"]
mod files;
#[path = "cases/plate.rs"]
mod plate;
#[path = "program/mod.rs"]
mod program;
#[path = "cases/values.rs"]
mod values;
