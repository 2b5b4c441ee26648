//! The window itself, without a display: widgets are found through AccessKit, as screen readers
//! find them, and clicks go to pixels.

mod bad_files;
mod clicked_pairs;
mod drags;
mod exported;
mod projects;
mod support;
mod warped;
