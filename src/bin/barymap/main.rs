//! The program: the command line of the library ([`barymap::cli`]).

mod loader;

use std::process::ExitCode;

fn main() -> ExitCode {
    loader::hush();
    barymap::cli::run(std::env::args_os())
}
