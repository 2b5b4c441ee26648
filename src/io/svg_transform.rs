//! Where SVG elements are placed: the attribute `transform`, the same property in `style`, its
//! origin, and `translate`, `rotate` and `scale`.
//!
//! A property wins over the attribute (SVG 2, section 6). Lengths may have absolute units of CSS,
//! at 96 pixels an inch; per cents are of the drawing's `viewBox`, as `transform-box: view-box`
//! says, which is what SVG elements have unless they say otherwise.

use std::str::FromStr;

use glam::{DMat2, DVec2};
use roxmltree::Node;

/// An affine map of the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Affine {
    pub(super) linear: DMat2,
    pub(super) shift: DVec2,
}

impl Affine {
    pub(super) const IDENTITY: Self = Self { linear: DMat2::IDENTITY, shift: DVec2::ZERO };

    fn shift(x: f64, y: f64) -> Self {
        Self { shift: DVec2::new(x, y), ..Self::IDENTITY }
    }

    fn linear(a: f64, b: f64, c: f64, d: f64) -> Self {
        Self { linear: DMat2::from_cols(DVec2::new(a, b), DVec2::new(c, d)), ..Self::IDENTITY }
    }

    /// First `inner`, then this.
    pub(super) fn after(self, inner: Self) -> Self {
        Self { linear: self.linear * inner.linear, shift: self.linear * inner.shift + self.shift }
    }
}

/// What the placement of an element depends on that is not read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Unknown;

/// A length in CSS pixels: a number alone or with an absolute unit.
pub(super) fn length(text: &str) -> Option<f64> {
    let text = text.trim();
    let units = [
        ("px", 1.0),
        ("mm", 96.0 / 25.4),
        ("cm", 96.0 / 2.54),
        ("in", 96.0),
        ("pt", 4.0 / 3.0),
        ("pc", 16.0),
        ("q", 96.0 / 101.6),
    ];
    let lower = text.to_ascii_lowercase();
    let (number, scale) =
        units.iter().find_map(|(unit, scale)| Some((lower.strip_suffix(unit)?, *scale))).unwrap_or((&lower, 1.0));
    number.trim_end().parse::<f64>().ok().map(|v| v * scale).filter(|v| v.is_finite())
}

/// An angle in radians; only 0 may be without a unit.
fn angle(text: &str) -> Option<f64> {
    let lower = text.trim().to_ascii_lowercase();
    let turn = std::f64::consts::TAU;
    let units = [("grad", turn / 400.0), ("deg", turn / 360.0), ("rad", 1.0), ("turn", turn)];
    match units.iter().find_map(|(unit, scale)| Some((lower.strip_suffix(unit)?, *scale))) {
        Some((number, scale)) => number.parse::<f64>().ok().map(|v| v * scale),
        None => lower.parse::<f64>().ok().filter(|v| *v == 0.0),
    }
    .filter(|v| v.is_finite())
}

/// A length along an axis whose whole is `whole`.
fn along(text: &str, whole: Option<f64>) -> Option<f64> {
    match text.trim().strip_suffix('%') {
        Some(share) => Some(share.trim().parse::<f64>().ok()? / 100.0 * whole?),
        None => length(text),
    }
}

/// The value of a property in `style`; the last one counts.
fn property<'a>(style: &'a str, name: &str) -> Option<&'a str> {
    let (mut depth, mut quote, mut begin) = (0usize, None, 0);
    let mut found = None;
    let mut declare = |text: &'a str| {
        if let Some((key, value)) = text.split_once(':')
            && key.trim().eq_ignore_ascii_case(name)
        {
            let value = value.trim();
            let plain = value
                .len()
                .checked_sub("!important".len())
                .filter(|&at| value.get(at..).is_some_and(|tail| tail.eq_ignore_ascii_case("!important")));
            found = Some(plain.map_or(value, |at| value[..at].trim_end()));
        }
    };
    for (at, c) in style.char_indices() {
        match (quote, c) {
            (Some(q), c) if q == c => quote = None,
            (Some(_), _) => {}
            (None, '"' | '\'') => quote = Some(c),
            (None, '(') => depth += 1,
            (None, ')') => depth = depth.saturating_sub(1),
            (None, ';') if depth == 0 => {
                declare(&style[begin..at]);
                begin = at + 1;
            }
            _ => {}
        }
    }
    declare(&style[begin..]);
    found
}

/// The functions of a CSS transform, in their order.
fn functions(text: &str, view: Option<DVec2>) -> Option<Affine> {
    let mut rest = text.trim();
    let mut all = Affine::IDENTITY;
    while !rest.is_empty() {
        let (name, tail) = rest.split_once('(')?;
        let (arguments, tail) = tail.split_once(')')?;
        rest = tail.trim_start_matches([' ', '\t', '\n', '\r', ',']);
        let arguments: Vec<&str> = arguments.split([',', ' ', '\t', '\n', '\r']).filter(|a| !a.is_empty()).collect();
        all = all.after(function(name.trim(), &arguments, view)?);
    }
    Some(all)
}

fn function(name: &str, arguments: &[&str], view: Option<DVec2>) -> Option<Affine> {
    let number = |k: usize| arguments.get(k)?.parse::<f64>().ok();
    let x = |k: usize| along(arguments.get(k)?, view.map(|v| v.x));
    let y = |k: usize| along(arguments.get(k)?, view.map(|v| v.y));
    let angle = |k: usize| angle(arguments.get(k)?);
    let factor = |k: usize| {
        let text = arguments.get(k)?;
        text.strip_suffix('%').map_or_else(|| text.parse().ok(), |share| Some(share.parse::<f64>().ok()? / 100.0))
    };
    let skew = |a: f64, b: f64| Affine::linear(1.0, b.tan(), a.tan(), 1.0);
    let turn = |a: f64| Affine::linear(a.cos(), a.sin(), -a.sin(), a.cos());
    Some(match (name.to_ascii_lowercase().as_str(), arguments.len()) {
        ("matrix", 6) => {
            Affine { shift: DVec2::new(x(4)?, y(5)?), ..Affine::linear(number(0)?, number(1)?, number(2)?, number(3)?) }
        }
        ("translate", 2) => Affine::shift(x(0)?, y(1)?),
        ("translate" | "translatex", 1) => Affine::shift(x(0)?, 0.0),
        ("translatey", 1) => Affine::shift(0.0, y(0)?),
        ("scale", 2) => Affine::linear(factor(0)?, 0.0, 0.0, factor(1)?),
        ("scale", 1) => Affine::linear(factor(0)?, 0.0, 0.0, factor(0)?),
        ("scalex", 1) => Affine::linear(factor(0)?, 0.0, 0.0, 1.0),
        ("scaley", 1) => Affine::linear(1.0, 0.0, 0.0, factor(0)?),
        ("rotate" | "rotatez", 1) => turn(angle(0)?),
        ("skew", 2) => skew(angle(0)?, angle(1)?),
        ("skew" | "skewx", 1) => skew(angle(0)?, 0.0),
        ("skewy", 1) => skew(0.0, angle(0)?),
        _ => return None,
    })
}

/// The point about which an element is transformed.
fn origin(text: &str, view: Option<DVec2>) -> Option<DVec2> {
    let words: Vec<&str> = text.split_whitespace().collect();
    let keyword = |word: &str| -> Option<(Option<usize>, &'static str)> {
        Some(match word.to_ascii_lowercase().as_str() {
            "left" => (Some(0), "0%"),
            "right" => (Some(0), "100%"),
            "top" => (Some(1), "0%"),
            "bottom" => (Some(1), "100%"),
            "center" => (None, "50%"),
            _ => return None,
        })
    };
    let axis = |word: &str| keyword(word).and_then(|k| k.0);
    let (mut first, mut second) = match words[..] {
        [one] => (one, "center"),
        [one, two] | [one, two, _] => (one, two),
        _ => return None,
    };
    // `top left` is as good as `left top`.
    if axis(first) == Some(1) || axis(second) == Some(0) {
        (first, second) = (second, first);
    }
    let value = |word: &str, whole: Option<f64>| along(keyword(word).map_or(word, |k| k.1), whole);
    Some(DVec2::new(value(first, view.map(|v| v.x))?, value(second, view.map(|v| v.y))?))
}

/// How an element by itself is placed within what is around it; `view` is the size of the drawing's
/// `viewBox`.
///
/// # Errors
/// What is wrong with the attribute `transform`.
fn own(node: Node<'_, '_>, view: Option<DVec2>) -> std::result::Result<std::result::Result<Affine, Unknown>, String> {
    let style = node.attribute("style").unwrap_or_default();
    let property = |name: &str| property(style, name).filter(|v| !v.eq_ignore_ascii_case("none"));
    let attribute = |name: &str| node.attribute(name).filter(|v| !v.trim().is_empty());
    let placed = match (self::property(style, "transform"), attribute("transform")) {
        (Some(value), _) if value.eq_ignore_ascii_case("none") => Some(Affine::IDENTITY),
        (Some(value), _) => functions(value, view),
        (None, Some(text)) => match svgtypes::Transform::from_str(text) {
            Ok(t) => Some(Affine { shift: DVec2::new(t.e, t.f), ..Affine::linear(t.a, t.b, t.c, t.d) }),
            // SVG 2 takes what CSS takes.
            Err(e) => match functions(text, view) {
                Some(placed) => Some(placed),
                None if text.trim().eq_ignore_ascii_case("none") => Some(Affine::IDENTITY),
                None => return Err(format!("the transform {:?} has a mistake: {e}", super::obj::shortened(text))),
            },
        },
        (None, None) => Some(Affine::IDENTITY),
    };
    // Single properties act before the functions: shift, then turn, then scale.
    let single = |name: &str| {
        let words = property(name).map(|v| v.split_whitespace().collect::<Vec<_>>());
        words.map_or(Some(Affine::IDENTITY), |words| function(name, &words, view))
    };
    let all = || Some(single("translate")?.after(single("rotate")?).after(single("scale")?).after(placed?));
    let Some(all) = all() else { return Ok(Err(Unknown)) };
    if all == Affine::IDENTITY {
        return Ok(Ok(all));
    }
    let framed =
        property("transform-box").or(attribute("transform-box")).is_none_or(|b| b.eq_ignore_ascii_case("view-box"));
    let about = match property("transform-origin").or(attribute("transform-origin")) {
        Some(text) => origin(text, view).filter(|_| framed),
        None if framed => Some(DVec2::ZERO),
        // Without an origin such boxes are turned about their corner, which depends on the outline.
        None => None,
    };
    Ok(about.map_or(Err(Unknown), |o| Ok(Affine::shift(o.x, o.y).after(all).after(Affine::shift(-o.x, -o.y)))))
}

/// The transforms of an element and all around it; `None` if one depends on more than the drawing's
/// coordinates.
pub(super) fn placement(node: Node<'_, '_>, view: Option<DVec2>) -> std::result::Result<Option<Affine>, String> {
    let mut all = Affine::IDENTITY;
    for ancestor in node.ancestors().filter(Node::is_element) {
        match own(ancestor, view)? {
            Ok(outer) => all = outer.after(all),
            Err(_) => return Ok(None),
        }
    }
    Ok(Some(all))
}

/// The size of the drawing in its own coordinates, which per cents refer to.
pub(super) fn view_size(root: Node<'_, '_>) -> Option<DVec2> {
    let size = match root.attribute("viewBox") {
        Some(text) => {
            let words = text.split([',', ' ', '\t', '\n', '\r']).filter(|w| !w.is_empty());
            let numbers: Vec<f64> = words.map(|w| w.parse().ok()).collect::<Option<_>>()?;
            let [_, _, width, height] = numbers[..] else { return None };
            DVec2::new(width, height)
        }
        None => DVec2::new(length(root.attribute("width")?)?, length(root.attribute("height")?)?),
    };
    size.is_finite().then_some(size)
}

#[cfg(test)]
#[path = "svg_transform_tests.rs"]
mod tests;
