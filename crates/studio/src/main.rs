//! The studio, and the command line for its exports.

use std::process::ExitCode;

fn main() -> ExitCode {
    let mut arguments = std::env::args_os();
    let program = arguments.next().unwrap_or_default();
    let rest: Vec<_> = arguments.collect();
    match rest.split_first() {
        Some((first, rest)) if first == barymap_studio::export::AS_COMMAND_LINE => {
            barymap::cli::run(std::iter::once(program).chain(rest.iter().cloned()))
        }
        _ => barymap_studio::start::run(&rest),
    }
}
