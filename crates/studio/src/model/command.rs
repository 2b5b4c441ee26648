//! The command line that does what the window does.

use std::path::Path;

use barymap::surface::correspondence::Method;
use barymap::tools::transfer::Fill;

use super::Side;
use super::document::TransferDocument;

/// What a transfer writes.
#[derive(Clone, Debug, PartialEq)]
pub struct Outputs<'a> {
    /// Where the pairs are.
    pub pairs: &'a Path,
    /// The target with its new textures (GLB).
    pub model: &'a Path,
    /// The texture alone, if wanted.
    pub texture: Option<&'a Path>,
    /// What is covered, if wanted.
    pub coverage: Option<&'a Path>,
}

/// The arguments of `barymap` that make this transfer; none without both meshes.
pub fn transfer(document: &TransferDocument, outputs: &Outputs<'_>) -> Option<Vec<String>> {
    let (source, target) = document.file(Side::Source).zip(document.file(Side::Target))?;
    let name = |p: &Path| p.to_string_lossy().into_owned();
    let mut words = vec!["transfer".to_owned()];
    let mut option = |key: &str, value: String| words.extend([format!("--{key}"), value]);
    let options = &document.options;
    option("source", name(source));
    if let Some(texture) = &document.texture {
        option("texture", name(texture));
    }
    option("target", name(target));
    option("anchors", name(outputs.pairs));
    if let Some(texture) = outputs.texture {
        option("output", name(texture));
    }
    option("model", name(outputs.model));
    if let Some(coverage) = outputs.coverage {
        option("coverage", name(coverage));
    }
    option("size", options.size.to_string());
    option("margin", options.margin.to_string());
    if options.fill != Fill::None {
        option("fill", options.fill.word().to_owned());
    }
    option("method", options.method.word().to_owned());
    if options.unwrap {
        words.push("--unwrap".to_owned());
    }
    // Whoever sets a pair and sees it in the window wants it there.
    if options.method == Method::Field {
        words.push("--keep-all".to_owned());
    }
    Some(words)
}

/// Arguments as one types them after `barymap` in a shell.
pub fn shown(words: &[String]) -> String {
    let plain = |w: &str| {
        let ok = |c: char| c.is_ascii_alphanumeric() || "-_./:=@%+,".contains(c);
        !w.is_empty() && w.chars().all(ok)
    };
    let quoted = |w: &String| if plain(w) { w.clone() } else { format!("'{}'", w.replace('\'', "'\\''")) };
    let words: Vec<String> = words.iter().map(quoted).collect();
    format!("barymap {}", words.join(" "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_names_everything_and_is_quoted_for_a_shell() {
        let mut document = TransferDocument::default();
        let (pairs, model) = (Path::new("my pairs.json"), Path::new("out.glb"));
        let outputs = Outputs { pairs, model, texture: None, coverage: None };
        assert_eq!(transfer(&document, &outputs), None);
        document.set_file(Side::Source, "it's a.obj".into());
        document.set_file(Side::Target, "b.glb".into());
        let words = transfer(&document, &outputs).unwrap();
        assert_eq!(
            shown(&words),
            "barymap transfer --source 'it'\\''s a.obj' --target b.glb --anchors 'my pairs.json' --model out.glb \
             --size 2048 --margin 16 --method field --keep-all"
        );
        document.options.method = Method::Rbf;
        document.options.unwrap = true;
        let words = transfer(&document, &outputs).unwrap();
        assert!(words.contains(&"--unwrap".to_owned()) && !words.contains(&"--keep-all".to_owned()));
    }
}
