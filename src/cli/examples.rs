//! An example of each command, shown at the end of its help.

use clap::Command;

/// Commands with lines that use them.
const EXAMPLES: [(&str, &[&str]); 24] = [
    ("demo", &["barymap demo --output out"]),
    ("devices", &["barymap devices --check"]),
    ("embed", &["barymap embed a.obj -o a.npy"]),
    ("average", &["barymap average a.obj --anchors anchors.json --weights weights.npy -o points.csv"]),
    ("weights", &["barymap weights a.obj --anchors anchors.json --points points.csv -o weights.npy"]),
    ("check", &["barymap check a.obj --anchors anchors.json -o covered.ply"]),
    (
        "anchors",
        &[
            "barymap anchors a.obj b.obj --anchors eight.json -o pairs.json --picture pairs.png",
            "barymap anchors a.obj b.obj --anchors pairs.json --check",
        ],
    ),
    ("map", &["barymap map --source a.obj --target b.obj --anchors pairs.json -o map.csv"]),
    (
        "transfer",
        &[
            "barymap transfer --source a.obj --target b.obj --anchors pairs.json -o b.png --model b.glb",
            "barymap transfer --source a.obj --texture skin.png --target b.obj --anchors pairs.json --size 4096 -o b.png",
        ],
    ),
    (
        "attributes",
        &[
            "barymap attributes --source a.glb --target b.glb --anchors pairs.json --attributes a.glb --kind weights -o rigged.glb",
        ],
    ),
    ("batch", &["barymap batch --source a.obj --texture skin.png --targets list.csv -o results"]),
    ("decal", &["barymap decal a.obj --anchors corners.json --image logo.png --texture skin.png -o painted.png"]),
    ("unwrap", &["barymap unwrap a.obj -o unwrapped.obj --layout charts.png"]),
    (
        "warp",
        &[
            "barymap warp photo.jpg --cage cage.json -o bent.jpg",
            "barymap warp photo.jpg --cage cage.json --scale 0.1 -o preview.jpg",
            "barymap warp photo.jpg --cage corners.json --projective -o straight.jpg",
        ],
    ),
    ("warp-points", &["barymap warp-points drawing.svg --cage cage.json -o bent.svg"]),
    ("cage", &["barymap cage a.obj --from cage.obj --to moved.obj -o bent.obj"]),
    ("deform", &["barymap deform a.obj --handles handles.json -o posed.obj"]),
    (
        "morph",
        &[
            "barymap morph rest.obj smile.obj --frames 24 -o smile.glb",
            "barymap morph a.obj b.obj --pairs pairs.json --weights 0.5,0.5 -o between.obj",
        ],
    ),
    ("animate", &["barymap animate body.obj --motion walk.bvh --markers markers.json -o walk.glb"]),
    ("remesh", &["barymap remesh scan.ply --base coarse.obj --levels 3 -o quads.obj"]),
    ("spline", &["barymap spline a.obj --points points.json -o curve.obj"]),
    ("render", &["barymap render a.obj --texture skin.png -o a.png"]),
    ("completions", &["barymap completions bash"]),
    ("man", &["barymap man --output man"]),
];

/// The program with an example in the help of every command.
pub(crate) fn with_examples(program: Command) -> Command {
    EXAMPLES.iter().fold(program, |program, (name, lines)| {
        let text = format!("Example:\n  {}", lines.join("\n  "));
        program.mut_subcommand(name, |command| command.after_help(text))
    })
}

#[cfg(test)]
mod tests {
    use clap::{CommandFactory, Parser};

    use super::*;
    use crate::cli::Cli;

    #[test]
    fn every_command_has_an_example_that_it_takes() {
        let program = with_examples(Cli::command());
        for command in program.get_subcommands() {
            assert!(EXAMPLES.iter().any(|(name, _)| *name == command.get_name()), "{command}");
            assert!(command.get_after_help().is_some());
        }
        for line in EXAMPLES.iter().flat_map(|(_, lines)| lines.iter()) {
            if let Err(error) = Cli::try_parse_from(line.split_whitespace()) {
                panic!("{line}: {error}");
            }
        }
        assert!(Cli::try_parse_from(["barymap", "warp", "photo.jpg"]).is_err(), "the comparison can fail");
    }
}
