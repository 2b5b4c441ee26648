//! Constants that shaders share with Rust: each has the value of its twin.
//!
//! A constant of a shader names its twin in the comment above it, as `module::NAME`; constants that
//! follow it without a comment of their own belong to the same module. The tables beside the
//! kernels say the same in Rust. This test holds both against the values that the kernels compile
//! to.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use naga::{Expression, Literal};

use crate::conformance::kernels;
use crate::engine::Kernel;

/// A constant of a shader and the value it has in Rust.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Twin {
    /// The file below `shaders`, without its ending.
    pub(crate) file: &'static str,
    /// The constant in it.
    pub(crate) name: &'static str,
    /// Its value in Rust.
    pub(crate) value: f64,
}

/// The twins of one shader.
pub(crate) fn of<const N: usize>(file: &'static str, twins: [(&'static str, f64); N]) -> Vec<Twin> {
    twins.map(|(name, value)| Twin { file, name, value }).into()
}

/// File and name of a constant.
type Place = (String, String);

/// The constants of a kernel and what it imports: their values as the compiler sees them.
fn compiled(kernel: &Kernel, found: &mut BTreeMap<Place, f64>) {
    let composed = kernel.compose().unwrap();
    let module = naga::front::wgsl::parse_str(&composed.text).unwrap();
    for (handle, constant) in module.constants.iter() {
        let Expression::Literal(literal) = module.global_expressions[constant.init] else { continue };
        let value = match literal {
            Literal::F32(x) => f64::from(x),
            Literal::U32(x) => f64::from(x),
            Literal::I32(x) => f64::from(x),
            _ => continue,
        };
        let Some(name) = &constant.name else { continue };
        let line = module.constants.get_span(handle).location(&composed.text).line_number as usize;
        let origin = composed.origin(line);
        let file = origin.trim_start_matches("shaders/").split(".wgsl").next().unwrap().to_owned();
        found.insert((file, name.clone()), value);
    }
}

/// The constants of a shader's text that name a twin.
fn named(text: &str) -> Vec<String> {
    let mut names = Vec::new();
    let (mut comment, mut last_was_comment) = (String::new(), false);
    for line in text.lines() {
        if let Some(more) = line.strip_prefix("//") {
            if !last_was_comment {
                comment.clear();
            }
            comment += more;
            last_was_comment = true;
            continue;
        }
        last_was_comment = false;
        match line.strip_prefix("const ").and_then(|rest| rest.split(':').next()) {
            Some(name) if comment.contains("::") => names.push(name.to_owned()),
            Some(_) => {}
            // What stands between ends what a comment is about.
            None => comment.clear(),
        }
    }
    names
}

/// Every value that is not the twin's, and every constant that names a twin and has none.
fn faults(twins: &[Twin], compiled: &BTreeMap<Place, f64>, named: &BTreeSet<Place>) -> Vec<String> {
    let mut faults = Vec::new();
    let mut known = BTreeSet::new();
    for twin in twins {
        let place = (twin.file.to_owned(), twin.name.to_owned());
        match compiled.get(&place) {
            // Single precision is what both work in.
            Some(&value) if value as f32 == twin.value as f32 => {}
            Some(value) => faults.push(format!("{}, {}: {value}, in Rust {}", twin.file, twin.name, twin.value)),
            None => faults.push(format!("{}: there is no constant {}", twin.file, twin.name)),
        }
        known.insert(place);
    }
    faults.extend(named.difference(&known).map(|(file, name)| format!("{file}: the twin of {name} is in no table")));
    faults
}

#[test]
fn constants_of_shaders_are_those_of_rust() {
    let twins = [
        crate::encoding::gpu::twins(),
        crate::engine::twins(),
        crate::mapping::plane::gpu::twins(),
        crate::mapping::space::gpu::twins(),
        crate::surface::average::twins(),
        crate::surface::gpu::twins(),
        crate::tools::transfer::gpu::twins(),
        crate::tools::warp::gpu::twins(),
    ]
    .concat();
    let mut values = BTreeMap::new();
    kernels().iter().for_each(|k| compiled(k, &mut values));
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders");
    let mut names = BTreeSet::new();
    for (folder, prefix) in [(folder.clone(), ""), (folder.join("lib"), "lib/")] {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_some_and(|e| e == "wgsl") {
                let file = format!("{prefix}{}", path.file_stem().unwrap().to_string_lossy());
                let text = std::fs::read_to_string(&path).unwrap();
                names.extend(named(&text).into_iter().map(|name| (file.clone(), name)));
            }
        }
    }
    assert!(names.len() > 30, "{names:?}");
    let found = faults(&twins, &values, &names);
    assert!(found.is_empty(), "{}", found.join("\n"));
    println!("{} constants have the value of their twin", twins.len());
}

#[test]
fn the_comparison_notices_another_value_a_missing_constant_and_a_missing_twin() {
    let text =
        "// Far away; pad::FAR.\nconst FAR: f32 = 2.0;\nconst NEAR: f32 = 1.0;\n\n// No twin.\nconst OWN: u32 = 1u;\n";
    assert_eq!(named(text), ["FAR", "NEAR"]);
    let place = |name: &str| ("a".to_owned(), name.to_owned());
    let names: BTreeSet<Place> = named(text).iter().map(|n| place(n)).collect();
    let values = BTreeMap::from([(place("FAR"), 2.0), (place("NEAR"), 1.0)]);
    let right = of("a", [("FAR", 2.0), ("NEAR", 1.0)]);
    assert!(faults(&right, &values, &names).is_empty());
    let says = |twins: &[Twin], word: &str| {
        let found = faults(twins, &values, &names);
        assert!(found.len() == 1 && found[0].contains(word), "{found:?}");
    };
    says(&of("a", [("FAR", 2.000_001), ("NEAR", 1.0)]), "FAR");
    says(&of("a", [("FAR", 2.0), ("NEAR", 1.0), ("LOST", 3.0)]), "no constant LOST");
    says(&of("a", [("FAR", 2.0)]), "NEAR is in no table");
}
