//! The files of `../shared/cases`: small inputs after public bug reports, with the results of each folder's `expected.txt`. Where
//! it allows several, `docs/files.md` says which. The tests report it when the folder is missing.

#[path = "cases/files.rs"]
mod files;
#[path = "cases/plate.rs"]
mod plate;
#[path = "program/mod.rs"]
mod program;
#[path = "cases/values.rs"]
mod values;
