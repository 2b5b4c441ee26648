//! Putting a kernel's text together.
//!
//! A line `//#import lib/NAME` is replaced by the file `shaders/lib/NAME.wgsl`, once per kernel
//! however often it is named; imports may import. The directive is a comment, so that every file
//! stays plain WGSL to an editor. Library files hold structs, constants and pure functions, never
//! bindings. The origin of every line is kept, so that a message about line 212 of the whole can
//! name file and line.

use crate::error::{Error, Result};

/// The files that kernels may import.
const LIBRARY: &[(&str, &str)] = &[
    ("lib/angle", include_str!("../../shaders/lib/angle.wgsl")),
    ("lib/atlas", include_str!("../../shaders/lib/atlas.wgsl")),
    ("lib/corners", include_str!("../../shaders/lib/corners.wgsl")),
    ("lib/decoded", include_str!("../../shaders/lib/decoded.wgsl")),
    ("lib/derivative", include_str!("../../shaders/lib/derivative.wgsl")),
    ("lib/ellipse", include_str!("../../shaders/lib/ellipse.wgsl")),
    ("lib/encoded", include_str!("../../shaders/lib/encoded.wgsl")),
    ("lib/encoding", include_str!("../../shaders/lib/encoding.wgsl")),
    ("lib/faces", include_str!("../../shaders/lib/faces.wgsl")),
    ("lib/footprint", include_str!("../../shaders/lib/footprint.wgsl")),
    ("lib/frame", include_str!("../../shaders/lib/frame.wgsl")),
    ("lib/gradients", include_str!("../../shaders/lib/gradients.wgsl")),
    ("lib/halvings", include_str!("../../shaders/lib/halvings.wgsl")),
    ("lib/image", include_str!("../../shaders/lib/image.wgsl")),
    ("lib/lanczos", include_str!("../../shaders/lib/lanczos.wgsl")),
    ("lib/lattice", include_str!("../../shaders/lib/lattice.wgsl")),
    ("lib/matching", include_str!("../../shaders/lib/matching.wgsl")),
    ("lib/mean_value", include_str!("../../shaders/lib/mean_value.wgsl")),
    ("lib/mean_value_3d", include_str!("../../shaders/lib/mean_value_3d.wgsl")),
    ("lib/newton", include_str!("../../shaders/lib/newton.wgsl")),
    ("lib/none", include_str!("../../shaders/lib/none.wgsl")),
    ("lib/padding", include_str!("../../shaders/lib/padding.wgsl")),
    ("lib/phong", include_str!("../../shaders/lib/phong.wgsl")),
    ("lib/place", include_str!("../../shaders/lib/place.wgsl")),
    ("lib/points", include_str!("../../shaders/lib/points.wgsl")),
    ("lib/projected", include_str!("../../shaders/lib/projected.wgsl")),
    ("lib/projection", include_str!("../../shaders/lib/projection.wgsl")),
    ("lib/shown", include_str!("../../shaders/lib/shown.wgsl")),
    ("lib/span", include_str!("../../shaders/lib/span.wgsl")),
    ("lib/table", include_str!("../../shaders/lib/table.wgsl")),
    ("lib/vector12", include_str!("../../shaders/lib/vector12.wgsl")),
    ("lib/vector8", include_str!("../../shaders/lib/vector8.wgsl")),
    ("lib/window", include_str!("../../shaders/lib/window.wgsl")),
    ("lib/runs", include_str!("../../shaders/lib/runs.wgsl")),
    ("lib/wrap", include_str!("../../shaders/lib/wrap.wgsl")),
];

/// The whole text of a kernel.
#[derive(Clone, Debug)]
pub struct Composed {
    /// WGSL.
    pub text: String,
    /// For each line, the file (without folder and ending) and its 1-based line there.
    origins: Vec<(String, usize)>,
}

impl Composed {
    /// The place `file.wgsl:line` that a 1-based line of [`Composed::text`] came from.
    pub fn origin(&self, line: usize) -> String {
        match line.checked_sub(1).and_then(|i| self.origins.get(i)) {
            Some((file, line)) => format!("shaders/{file}.wgsl:{line}"),
            None => "the end of the kernel".into(),
        }
    }
}

/// Resolves the imports of a kernel called `name` whose own text is `source`.
///
/// # Errors
/// [`Error::Device`] if an import is not in the library: a fault of the crate, not of the user.
pub fn compose(name: &str, source: &str) -> Result<Composed> {
    let mut whole = Composed { text: String::new(), origins: Vec::new() };
    let mut seen = Vec::new();
    append(name, source, &mut whole, &mut seen)?;
    Ok(whole)
}

fn append(name: &str, source: &str, whole: &mut Composed, seen: &mut Vec<String>) -> Result<()> {
    for (i, line) in source.lines().enumerate() {
        let Some(import) = line.trim().strip_prefix("//#import ") else {
            whole.text.push_str(line);
            whole.text.push('\n');
            whole.origins.push((name.to_string(), i + 1));
            continue;
        };
        let import = import.trim();
        if seen.iter().any(|s| s == import) {
            continue;
        }
        seen.push(import.to_string());
        let Some((_, text)) = LIBRARY.iter().find(|(n, _)| *n == import) else {
            return Err(Error::Device {
                what: format!("shaders/{name}.wgsl:{} imports {import}, which is not in the library", i + 1),
                remedy: "This is a fault of barymap: please report it".into(),
            });
        };
        append(import, text, whole, seen)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn imports_come_once_and_lines_keep_their_origin() {
        let c = compose("demo", "// a\n//#import lib/span\n//#import lib/span\n// b\n").unwrap();
        assert_eq!(c.text.matches("struct Span").count(), 1);
        assert_eq!(c.origin(1), "shaders/demo.wgsl:1");
        assert_eq!(c.origin(2), "shaders/lib/span.wgsl:1");
        assert_eq!(c.origin(c.text.lines().count()), "shaders/demo.wgsl:4");
        assert_eq!(c.origin(100_000), "the end of the kernel");
        assert_eq!(c.origin(0), "the end of the kernel");
    }

    #[test]
    fn an_unknown_import_names_file_and_line() {
        let e = compose("demo", "\n//#import lib/nowhere").unwrap_err().to_string();
        assert!(e.contains("shaders/demo.wgsl:2") && e.contains("lib/nowhere"), "{e}");
    }
}
