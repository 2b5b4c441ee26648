//! `barymap completions` and `barymap man`: what shells and manuals need.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;
use clap_complete::Shell;

use crate::cli::program;
use crate::io::output::write_bytes;
use crate::{Error, Result};

#[derive(Debug, Args)]
pub(crate) struct CompletionArguments {
    /// The shell
    #[arg(value_enum)]
    shell: Shell,
}

#[derive(Debug, Args)]
pub(crate) struct ManualArguments {
    /// Folder for the pages: barymap.1, barymap-transfer.1 and so on
    #[arg(long = "output", short = 'o', alias = "out", default_value = "man")]
    out: PathBuf,
}

/// Writes the completions to stdout.
pub(crate) fn completions(arguments: &CompletionArguments) -> Result<()> {
    let mut text = Vec::new();
    clap_complete::generate(arguments.shell, &mut program(), "barymap", &mut text);
    // Nobody is left to tell where the pipe is closed.
    let _ = std::io::stdout().write_all(&text);
    Ok(())
}

/// Writes a page for the program and one for each command.
pub(crate) fn manual(arguments: &ManualArguments) -> Result<()> {
    let folder = &arguments.out;
    std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, e, "Choose a folder that can be written"))?;
    let mut program = program();
    program.build();
    for command in std::iter::once(&program).chain(program.get_subcommands()) {
        // Of a built command: `barymap-transfer`.
        let name = command.get_display_name().unwrap_or(command.get_name()).to_owned();
        let page = clap_mangen::Man::new(command.clone());
        let mut text = Vec::new();
        let path = folder.join(format!("{name}.1"));
        page.render(&mut text).map_err(|e| Error::io(&path, e, "Choose a folder that can be written"))?;
        write_bytes(&path, &text)?;
    }
    Ok(())
}
