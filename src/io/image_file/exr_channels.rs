//! Which channels of an OpenEXR file are the picture.

use std::collections::BTreeMap;

/// A channel of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Channel {
    /// Its name with that of its layer: `ViewLayer.Combined.R`.
    pub(super) name: String,
    /// The part of the file that it belongs to.
    pub(super) part: usize,
    /// Its place in the part.
    pub(super) index: usize,
}

impl Channel {
    /// The layer, and the name in it.
    fn split(&self) -> (&str, &str) {
        self.name.rsplit_once('.').unwrap_or(("", &self.name))
    }
}

/// What the chosen channels are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Form {
    /// Grey or colours, as they are.
    Plain,
    /// Luminance with two colour differences, and transparency perhaps.
    Chroma,
    /// Two numbers, to which a third, 0, is added.
    Pair,
}

/// The channels of a picture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Chosen {
    pub(super) channels: Vec<Channel>,
    pub(super) form: Form,
    pub(super) notes: Vec<String>,
}

/// Layers that programs write the whole picture to.
const WHOLE: [&str; 6] = ["combined", "beauty", "rgba", "image", "composite", "main"];

/// The channels that `wanted` (a layer or a channel) names, else those that show the picture of the
/// file `name`.
///
/// # Errors
/// If it is not clear which; the sentence lists the channels, and says how one is chosen.
pub(super) fn choose(all: &[Channel], wanted: Option<&str>, name: &str) -> Result<Chosen, String> {
    let mut layers: BTreeMap<(usize, &str), Vec<&Channel>> = BTreeMap::new();
    all.iter().for_each(|c| layers.entry((c.part, c.split().0)).or_default().push(c));
    let layers: Vec<(&str, Vec<&Channel>)> = layers.into_iter().map(|((_, layer), list)| (layer, list)).collect();
    let listing = |what: String| {
        let names: Vec<&str> = all.iter().take(60).map(|c| c.name.as_str()).collect();
        let more = all.len().saturating_sub(names.len());
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        let example =
            layers.iter().map(|l| l.0).find(|l| !l.is_empty()).unwrap_or(names.first().copied().unwrap_or("R"));
        format!(
            "{what}; its channels are {}{more}. Name a layer or a channel behind the file: {name}:{example}",
            names.join(", ")
        )
    };
    if let Some(wanted) = wanted {
        let same = |n: &str| n.eq_ignore_ascii_case(wanted);
        if let Some(channel) = all.iter().find(|c| same(&c.name)) {
            return Ok(Chosen { channels: vec![channel.clone()], form: Form::Plain, notes: Vec::new() });
        }
        let ends = |layer: &str| layer.to_ascii_lowercase().ends_with(&format!(".{}", wanted.to_ascii_lowercase()));
        let exact: Vec<_> = layers.iter().filter(|l| same(l.0)).collect();
        let found = if exact.is_empty() { layers.iter().filter(|l| ends(l.0)).collect() } else { exact };
        return match found[..] {
            [] => Err(listing(format!("the picture has no layer or channel {wanted:?}"))),
            [(_, list)] => pick(list).ok_or_else(|| listing(format!("layer {wanted:?} is no picture"))),
            _ => Err(listing(format!("several layers are called {wanted:?}"))),
        };
    }
    let colored: Vec<_> = layers.iter().filter(|(_, list)| find(list, &["R", "G", "B"]).is_some()).collect();
    let last = |layer: &str| layer.rsplit('.').next().unwrap_or(layer).to_ascii_lowercase();
    let whole = WHOLE.iter().find_map(|w| colored.iter().find(|(layer, _)| last(layer) == *w));
    let picture = colored.iter().find(|l| l.0.is_empty()).or(whole).or(match colored[..] {
        [ref only] => Some(only),
        _ => None,
    });
    let chosen = match picture {
        Some(layer) => Some(*layer),
        None if !colored.is_empty() => None,
        None => layers.iter().find(|l| l.0.is_empty() && pick(&l.1).is_some()).or(match &layers[..] {
            [only] => Some(only),
            _ => None,
        }),
    };
    let Some((layer, list)) = chosen else {
        return Err(listing("it is not clear which channels are the picture".into()));
    };
    let mut chosen = pick(list).ok_or_else(|| listing("it is not clear which channels are the picture".into()))?;
    if chosen.channels.len() < all.len() {
        let rest: Vec<&str> =
            all.iter().filter(|c| !chosen.channels.contains(c)).map(|c| c.name.as_str()).take(20).collect();
        let what =
            if layer.is_empty() { "the channels without a layer are".to_owned() } else { format!("layer {layer} is") };
        chosen
            .notes
            .push(format!("{what} read; there are also {}: {name}:NAME reads a layer or channel", rest.join(", ")));
    }
    Ok(chosen)
}

/// The channels of these names.
fn find(list: &[&Channel], names: &[&str]) -> Option<Vec<Channel>> {
    let of = |name: &&str| list.iter().find(|c| c.split().1.eq_ignore_ascii_case(name)).map(|c| (*c).clone());
    names.iter().map(of).collect()
}

/// The channels of a layer that can be shown, in order.
fn pick(list: &[&Channel]) -> Option<Chosen> {
    let alpha = find(list, &["A"]).or_else(|| find(list, &["alpha"])).unwrap_or_default();
    let with = |channels: Vec<Channel>, form: Form| {
        let channels = channels.into_iter().chain(alpha.iter().cloned()).collect();
        Some(Chosen { channels, form, notes: Vec::new() })
    };
    for names in [["R", "G", "B"], ["red", "green", "blue"], ["X", "Y", "Z"]] {
        if let Some(channels) = find(list, &names) {
            return with(channels, Form::Plain);
        }
    }
    if let Some(channels) = find(list, &["Y", "RY", "BY"]) {
        return with(channels, Form::Chroma);
    }
    if let Some(channels) = find(list, &["Y"]) {
        return with(channels, Form::Plain);
    }
    for names in [["R", "G"], ["U", "V"], ["X", "Y"]] {
        if let Some(channels) = find(list, &names) {
            return Some(Chosen { channels, form: Form::Pair, notes: Vec::new() });
        }
    }
    let colors: Vec<Channel> = list.iter().filter(|c| !alpha.contains(c)).map(|c| (*c).clone()).collect();
    match colors.len() {
        0 if !alpha.is_empty() => Some(Chosen { channels: alpha, form: Form::Plain, notes: Vec::new() }),
        1 => with(colors, Form::Plain),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chosen(names: &[&str], wanted: Option<&str>) -> Result<Vec<String>, String> {
        let channel = |(index, name): (usize, &&str)| Channel { name: (*name).to_owned(), part: 0, index };
        let all: Vec<Channel> = names.iter().enumerate().map(channel).collect();
        choose(&all, wanted, "t.exr").map(|c| c.channels.into_iter().map(|c| c.name).collect())
    }

    #[test]
    fn the_picture_is_found_by_the_names_of_programs() {
        for (names, expected) in [
            (&["A", "B", "G", "R"][..], &["R", "G", "B", "A"][..]),
            (&["B", "G", "R", "Z", "n.B", "n.G", "n.R"], &["R", "G", "B"]),
            (&["Y"], &["Y"]),
            (&["A", "Y"], &["Y", "A"]),
            (&["BY", "RY", "Y"], &["Y", "RY", "BY"]),
            (&["height"], &["height"]),
            (&["A", "v"], &["v", "A"]),
            (&["A"], &["A"]),
            (&["b", "g", "r"], &["r", "g", "b"]),
            (&["N.X", "N.Y", "N.Z"], &["N.X", "N.Y", "N.Z"]),
            (&["G", "R"], &["R", "G"]),
            (
                &[
                    "V.Combined.A",
                    "V.Combined.B",
                    "V.Combined.G",
                    "V.Combined.R",
                    "V.Depth.Z",
                    "V.Dif.B",
                    "V.Dif.G",
                    "V.Dif.R",
                ],
                &["V.Combined.R", "V.Combined.G", "V.Combined.B", "V.Combined.A"],
            ),
            (&["L.B", "L.G", "L.R", "D.Z"], &["L.R", "L.G", "L.B"]),
        ] {
            assert_eq!(chosen(names, None).unwrap(), expected, "{names:?}");
        }
    }

    #[test]
    fn what_is_not_clear_is_listed_and_can_be_named() {
        let names = ["a.B", "a.G", "a.R", "b.B", "b.G", "b.R", "b.Z"];
        let message = chosen(&names, None).unwrap_err();
        assert!(message.contains("a.R, b.B") && message.contains("t.exr:a"), "{message}");
        assert_eq!(chosen(&names, Some("B")).unwrap(), ["b.R", "b.G", "b.B"]);
        assert_eq!(chosen(&names, Some("b.z")).unwrap(), ["b.Z"]);
        assert!(chosen(&names, Some("c")).unwrap_err().contains("\"c\""));
        assert!(chosen(&["u.Z", "v.Z"], None).unwrap_err().contains("not clear"));
        assert_eq!(chosen(&["View.Depth.Z", "View.Mist.Z"], Some("mist")).unwrap(), ["View.Mist.Z"]);
    }
}
