//! Shapes and characters made by code, so that tests, examples and the demonstration need no files.

pub mod shapes;
