//! The command line of barymap, which the program and wheels start.

mod anchors;
mod animate;
mod attributes;
mod batch;
mod batch_record;
mod cage;
mod cage_map;
mod check;
mod common;
mod decal;
mod deform;
mod demo;
mod devices;
mod embed;
mod examples;
mod guard;
mod interrupt;
mod layer_kinds;
mod machine;
mod map;
mod method;
mod model_file;
mod morph;
mod named;
mod needs;
mod pictures;
mod plan;
mod progress_bar;
mod remesh;
mod render;
mod repeated;
mod rig;
mod shard;
mod shell;
mod side;
mod spline;
mod streams;
mod told;
mod transfer;
mod unwrap;
mod verdict;
mod warp;
mod warp_points;
mod weights;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

use crate::control::Control;
use crate::io::kept::keep_inputs;
use crate::{Error, Result};
use common::Common;
use machine::Machine;
use streams::Streams;

/// Maps one shape onto another from a handful of control points.
#[derive(Debug, Parser)]
#[command(version, about, propagate_version = true)]
struct Cli {
    #[command(flatten)]
    common: Common,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// The main job on built-in models; no input needed
    Demo(demo::Arguments),
    /// Adapters, limits, canaries, and which one `auto` takes; `--check` runs every kernel
    Devices(devices::Arguments),
    /// The embedding of a mesh, as an array
    Embed(embed::Arguments),
    /// The forward problem: averages of anchors with given weights
    Average(weights::ForwardArguments),
    /// The inverse problem: weights of points with respect to anchors
    Weights(weights::InverseArguments),
    /// What the anchors of a mesh cover, and where one is missing
    Check(check::Arguments),
    /// Anchors proposed from a few pairs or none, wrong ones named, the next ones suggested
    Anchors(anchors::Arguments),
    /// Where the points of one mesh lie on another
    Map(map::Arguments),
    /// Transfers a texture from one mesh to a different one
    Transfer(transfer::Arguments),
    /// Carries data of vertices from one mesh to a different one: skin weights, colours, scalars,
    /// labels, vectors
    Attributes(attributes::Arguments),
    /// Transfers the texture of one mesh to many others
    Batch(batch::Arguments),
    /// Lays a picture onto a part of a surface by four anchors or more
    Decal(decal::Arguments),
    /// Makes texture coordinates for a mesh: charts without overlaps, flattened and packed
    Unwrap(unwrap::Arguments),
    /// Warps a picture by a cage, without folds
    Warp(warp::Arguments),
    /// Warps points and outlines by a cage, either way
    WarpPoints(warp_points::Arguments),
    /// Deforms a model by a closed cage around it, without folds as far as is sampled
    Cage(cage::Arguments),
    /// Poses a mesh by a few of its vertices and keeps its shape
    Deform(deform::Arguments),
    /// In-betweens and blends of meshes, of the same connectivity or by pairs of anchors
    Morph(morph::Arguments),
    /// Sets a mesh in motion by markers or joints
    Animate(animate::Arguments),
    /// A fine quad mesh on a mesh, from a coarse one
    Remesh(remesh::Arguments),
    /// B-splines and Bezier curves on a mesh
    Spline(spline::Arguments),
    /// A shaded picture of a mesh, to look at results
    Render(render::Arguments),
    /// Completions of options for a shell, on stdout
    Completions(shell::CompletionArguments),
    /// Manual pages of all commands
    Man(shell::ManualArguments),
}

fn command(cli: &Cli) -> Result<()> {
    let common = &cli.common;
    match &cli.command {
        Command::Demo(a) => demo::run(common, a),
        Command::Devices(a) => devices::run(common, a),
        Command::Embed(a) => embed::run(common, a),
        Command::Average(a) => weights::forward(common, a),
        Command::Weights(a) => weights::inverse(common, a),
        Command::Check(a) => check::run(common, a),
        Command::Anchors(a) => anchors::run(common, a),
        Command::Map(a) => map::run(common, a),
        Command::Transfer(a) => transfer::run(common, a),
        Command::Attributes(a) => attributes::run(common, a),
        Command::Batch(a) => batch::run(common, a),
        Command::Decal(a) => decal::run(common, a),
        Command::Unwrap(a) => unwrap::run(common, a),
        Command::Warp(a) => warp::run(common, a),
        Command::WarpPoints(a) => warp_points::run(common, a),
        Command::Cage(a) => cage::run(common, a),
        Command::Deform(a) => deform::run(common, a),
        Command::Morph(a) => morph::run(common, a),
        Command::Animate(a) => animate::run(common, a),
        Command::Remesh(a) => remesh::run(common, a),
        Command::Spline(a) => spline::run(common, a),
        Command::Render(a) => render::run(common, a),
        Command::Completions(a) => shell::completions(a),
        Command::Man(a) => shell::manual(a),
    }
}

/// The exit code: 2 for wrong use of the command line, 3 where nothing usable was written, 4 where
/// some of several results failed and all others are done, 1 for a fault in the data, a file or the
/// machine. A signal n ends the program with 128 + n ([`interrupt`]).
fn code(error: &Error) -> u8 {
    match error {
        Error::Option { .. } => 2,
        Error::Unusable { .. } => 3,
        Error::Incomplete { .. } => 4,
        _ => 1,
    }
}

/// The library names fields of its options (`linear_light`); here they are options of the command
/// line (`--linear-light`), where it has them.
fn as_option(error: Error) -> Error {
    let Error::Option { option, what, remedy } = error else { return error };
    let name = option.replace('_', "-");
    let command = Cli::command();
    let all = || command.get_arguments().chain(command.get_subcommands().flat_map(|c| c.get_arguments()));
    let known = all().find(|a| a.get_long() == Some(name.as_str()));
    // Fields that kept a name which the option had once.
    let known = known.or_else(|| all().find(|a| a.get_all_aliases().unwrap_or_default().contains(&name.as_str())));
    let option = known.and_then(clap::Arg::get_long).map_or(option, |long| format!("--{long}"));
    Error::Option { option, what, remedy }
}

/// Runs the command line `arguments`, the first of which is the name of the program, as its `main`
/// would: results go to files and stdout, notes and errors to stderr. Signals that end a program
/// are handled from then on in the whole process, so that nothing half written stays.
///
/// The exit code is 0 for success and for help, 2 for wrong use, 3 where nothing usable was
/// written, 4 where some of several results failed, 1 for other faults.
pub fn run<T: Into<OsString> + Clone>(arguments: impl IntoIterator<Item = T>) -> ExitCode {
    if let Err(error) = interrupt::handle_signals() {
        common::note(&format!("interrupts are not handled: {error}"));
    }
    match given(arguments.into_iter().map(Into::into).collect()) {
        Ok(code) => code,
        Err(error) => ExitCode::from(common::failed(error)),
    }
}

/// Does what a command line says, within what the machine and the user allow.
fn carry_out(cli: &mut Cli) -> Result<()> {
    let (machine, notes) = Machine::prepare(cli.common.threads)?;
    notes.iter().filter(|_| !cli.common.quiet).for_each(|text| common::note(text));
    if let Some(free) = machine.addresses.filter(|&free| free < cli.common.memory && !cli.common.quiet) {
        common::note(&format!(
            "memory is limited to {} MB by the system (ulimit -v or -d), whatever --memory says",
            free >> 20
        ));
    }
    cli.common.memory = cli.common.memory.min(machine.addresses.unwrap_or(u64::MAX));
    if machine.more_threads {
        guard::watch(cli.common.memory);
    }
    let work = || Control::of_process(cli.common.memory).run(|| command(cli));
    if cli.common.confine { crate::io::confined(work) } else { work() }
}

/// The program as a parser, with its examples.
fn program() -> clap::Command {
    examples::with_examples(Cli::command())
}

/// Parses a command line and does what it says.
fn given(arguments: Vec<OsString>) -> Result<ExitCode> {
    let (arguments, streams) = Streams::redirect(arguments)?;
    let mut program = program();
    let parsed =
        program.try_get_matches_from_mut(arguments).and_then(|matches| Ok((Cli::from_arg_matches(&matches)?, matches)));
    let (mut cli, matches) = match parsed {
        Ok(parsed) => parsed,
        Err(error) => {
            // As common::note: a closed stream changes nothing.
            let _ = error.print();
            return Ok(ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(2)));
        }
    };
    let overwrite = cli.common.overwrite;
    let outputs = named::check(&program, &matches, overwrite)?;
    keep_inputs(Some(outputs.planned), overwrite);
    cli.common.stages = plan::stages(matches.subcommand_name().unwrap_or_default());
    let done = carry_out(&mut cli);
    keep_inputs(None, false);
    if done.is_err() {
        // A folder that something was written to stays.
        outputs.made.iter().for_each(|folder| drop(std::fs::remove_dir(folder)));
    }
    done?;
    streams.finish()?;
    Ok(ExitCode::SUCCESS)
}
