//! SVG: the outlines of a document, taken out and put back; every other byte stays.

use std::ops::Range;
use std::path::Path;

use glam::DVec2;
use roxmltree::{Attribute, Document, Node, ParsingOptions};

use super::obj::shortened;
use super::outline::{MappedShape, Part, Shape};
use super::svg_path::{parse_path, parse_points, write_path, write_points};
use super::svg_transform::{Affine, length, placement, view_size};
use super::{finite, output, source};
use crate::{Error, Result};

/// More elements than this are not read.
const MOST_NODES: u32 = 1 << 24;

/// What is drawn only where something else refers to it, in coordinates of that.
const ELSEWHERE: [&str; 7] = ["defs", "clipPath", "mask", "pattern", "marker", "symbol", "svg"];

/// An SVG document: paths, polylines, polygons, lines, rectangles, circles and ellipses are
/// outlines, in the coordinates of the document (transforms, as attributes and in `style`, are
/// applied, and undone in what is written).
#[derive(Clone, Debug)]
pub struct Svg {
    text: String,
    elements: Vec<Element>,
    warnings: Vec<String>,
}

/// An element with outlines.
#[derive(Clone, Debug)]
struct Element {
    name: String,
    /// From the element's coordinates to the document's.
    placed: Affine,
    /// In the document's coordinates.
    parts: Vec<Part>,
    edit: Edit,
}

/// Where the image of an element goes in the text.
#[derive(Clone, Debug)]
enum Edit {
    /// The value of `d`.
    Path(Range<usize>),
    /// The value of `points`.
    Points(Range<usize>),
    /// A basic shape, which becomes a path: its names, the attribute that is replaced and those
    /// that go, and what to add.
    Basic { names: Vec<Range<usize>>, first: Range<usize>, others: Vec<Range<usize>>, fill: bool },
}

impl Svg {
    /// Reads a document.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] naming the line: no XML, no SVG, path data or a transform
    /// with a mistake.
    pub fn read(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        Self::parse(source::read_text(path)?, path)
    }

    /// [`Svg::read`] of a text; `name` stands in messages.
    ///
    /// # Errors
    /// As [`Svg::read`].
    pub fn parse(text: String, name: impl AsRef<Path>) -> Result<Self> {
        let name = name.as_ref();
        let (elements, warnings) = {
            let options = ParsingOptions { allow_dtd: true, nodes_limit: MOST_NODES, ..ParsingOptions::default() };
            let document = Document::parse_with_options(&text, options).map_err(|e| {
                let line = Some(e.pos().row as usize).filter(|&row| row > 0);
                Error::format(name, line, format!("this is not XML: {e}"), "Give an SVG document")
            })?;
            if document.root_element().tag_name().name() != "svg" {
                let what =
                    format!("the document is {:?}, not svg", shortened(document.root_element().tag_name().name()));
                return Err(Error::format(name, None, what, "Give an SVG document"));
            }
            let fail = |node: Node<'_, '_>, what: String| {
                let line = document.text_pos_at(node.range().start).row as usize;
                let what = format!("{}: {what}", describe(node));
                Error::format(name, Some(line), what, "Mend it, or save the drawing again")
            };
            let mut elements = Vec::new();
            let view = view_size(document.root_element());
            let (mut elsewhere, mut lengths, mut unplaced) = (0, 0, 0);
            for node in document.descendants().filter(Node::is_element) {
                let Some(kind) = Kind::of(node) else { continue };
                if node
                    .ancestors()
                    .skip(1)
                    .any(|a| a.parent_element().is_some() && ELSEWHERE.contains(&a.tag_name().name()))
                {
                    elsewhere += 1;
                    continue;
                }
                match element(&text, node, kind, view).map_err(|what| fail(node, what))? {
                    Found::Element(element) => elements.push(element),
                    Found::Nothing => {}
                    Found::Length => lengths += 1,
                    Found::Unplaced => unplaced += 1,
                }
            }
            let mut warnings = Vec::new();
            if elsewhere > 0 {
                warnings.push(format!(
                    "{elsewhere} outlines inside definitions, symbols or inner drawings stay as they are"
                ));
            }
            if lengths > 0 {
                warnings.push(format!("{lengths} shapes whose lengths are relative (em, per cents), or whose transform flattens, stay as they are"));
            }
            if unplaced > 0 {
                let why = "whose transform depends on their own boxes or fonts, or is not of the plane,";
                warnings.push(format!(
                    "{unplaced} outlines {why} stay as they are: save the drawing with its transforms applied"
                ));
            }
            let sheets = document.descendants().filter(|n| n.tag_name().name() == "style");
            if sheets.filter_map(|n| n.text()).any(|t| t.contains("transform")) {
                warnings.push(
                    "a style sheet has transforms, which are not applied: save the drawing with its transforms applied"
                        .to_owned(),
                );
            }
            let untouched = |tag: &str| document.descendants().filter(|n| n.tag_name().name() == tag).count();
            for tag in ["text", "image", "use", "foreignObject"] {
                let count = untouched(tag);
                if count > 0 {
                    warnings.push(format!("{count} {tag} elements stay as they are: turn them into paths first"));
                }
            }
            (elements, warnings)
        };
        let svg = Self { text, elements, warnings };
        svg.check_ranges(name)?;
        Ok(svg)
    }

    /// What was passed over.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// The outlines in the order of the document, in its coordinates.
    pub fn shapes(&self) -> Vec<Shape> {
        self.elements.iter().map(|e| Shape { name: e.name.clone(), parts: e.parts.clone() }).collect()
    }

    /// The document with the images of the [shapes](Svg::shapes) in their places. An element
    /// without an image is not drawn: its data become empty.
    pub fn replaced(&self, images: &[Option<MappedShape>]) -> String {
        let mut edits: Vec<(Range<usize>, String)> = Vec::new();
        for (element, image) in self.elements.iter().zip(images) {
            let empty = Vec::new();
            element.edits(image.as_ref().unwrap_or(&empty), &mut edits);
        }
        edits.sort_by_key(|(range, _)| range.start);
        let mut text = String::with_capacity(self.text.len());
        let mut at = 0;
        for (range, new) in edits {
            text.push_str(&self.text[at..range.start]);
            text.push_str(&new);
            at = range.end;
        }
        text.push_str(&self.text[at..]);
        text
    }

    /// Writes [`Svg::replaced`], whole or not at all.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::NotFinite`] for a point that is not finite.
    pub fn write(&self, path: impl AsRef<Path>, images: &[Option<MappedShape>]) -> Result<()> {
        let path = path.as_ref();
        for (k, image) in images.iter().enumerate() {
            let points = image.iter().flatten().flatten();
            finite::numbers(path, points.flat_map(|v| v.point.to_array()), |i| {
                format!("point {} of shape {k}", i / 2)
            })?;
        }
        output::write_bytes(path, self.replaced(images).as_bytes())
    }

    /// Every edit has a place of its own in the text: not so if an element comes from an entity
    /// that is used twice.
    fn check_ranges(&self, name: &Path) -> Result<()> {
        let mut ranges: Vec<Range<usize>> = Vec::new();
        for element in &self.elements {
            match &element.edit {
                Edit::Path(range) | Edit::Points(range) => ranges.push(range.clone()),
                Edit::Basic { names, first, others, .. } => {
                    ranges.extend(names.iter().chain([first]).chain(others).cloned());
                }
            }
        }
        ranges.sort_by_key(|r| r.start);
        let fits = |r: &Range<usize>| self.text.get(r.clone()).is_some();
        if ranges.windows(2).any(|pair| pair[0].end > pair[1].start) || !ranges.iter().all(fits) {
            let what = "outlines come from entities that are used several times";
            return Err(Error::format(name, None, what, "Save the drawing again, without entities"));
        }
        Ok(())
    }
}

/// The elements that are outlines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Path,
    Polyline,
    Polygon,
    Line,
    Rect,
    Circle,
    Ellipse,
}

impl Kind {
    fn of(node: Node<'_, '_>) -> Option<Self> {
        if !matches!(node.tag_name().namespace(), None | Some("http://www.w3.org/2000/svg")) {
            return None;
        }
        Some(match node.tag_name().name() {
            "path" => Self::Path,
            "polyline" => Self::Polyline,
            "polygon" => Self::Polygon,
            "line" => Self::Line,
            "rect" => Self::Rect,
            "circle" => Self::Circle,
            "ellipse" => Self::Ellipse,
            _ => return None,
        })
    }

    /// The attributes that say where a basic shape is.
    fn attributes(self) -> &'static [&'static str] {
        match self {
            Self::Line => &["x1", "y1", "x2", "y2"],
            Self::Rect => &["x", "y", "width", "height", "rx", "ry"],
            Self::Circle => &["cx", "cy", "r"],
            Self::Ellipse => &["cx", "cy", "rx", "ry"],
            _ => &[],
        }
    }
}

/// What an element turned out to be.
enum Found {
    Element(Element),
    /// It draws nothing.
    Nothing,
    /// Its lengths depend on more than the document's coordinates.
    Length,
    /// Its transform does.
    Unplaced,
}

fn describe(node: Node<'_, '_>) -> String {
    match node.attribute("id") {
        Some(id) => format!("{} {:?}", node.tag_name().name(), shortened(id)),
        None => node.tag_name().name().to_owned(),
    }
}

fn element(text: &str, node: Node<'_, '_>, kind: Kind, view: Option<DVec2>) -> std::result::Result<Found, String> {
    let attribute = |name: &str| node.attributes().find(|a| a.name() == name && a.namespace().is_none());
    let (parts, edit) = match kind {
        Kind::Path => {
            let Some(d) = attribute("d") else { return Ok(Found::Nothing) };
            let parts = parse_path(d.value()).map_err(|what| format!("the path data have a mistake: {what}"))?;
            (parts, Edit::Path(value_range(text, &d)?))
        }
        Kind::Polyline | Kind::Polygon => {
            let Some(points) = attribute("points") else { return Ok(Found::Nothing) };
            (parse_points(points.value(), kind == Kind::Polygon), Edit::Points(value_range(text, &points)?))
        }
        basic => {
            let mut values = [None; 6];
            for (value, name) in values.iter_mut().zip(basic.attributes()) {
                if let Some(a) = attribute(name) {
                    match length(a.value()) {
                        Some(v) => *value = Some(v),
                        None => return Ok(Found::Length),
                    }
                }
            }
            let Some(data) = outline_of(basic, values) else { return Ok(Found::Nothing) };
            let mut ranges: Vec<Range<usize>> =
                basic.attributes().iter().filter_map(|name| attribute(name)).map(|a| a.range()).collect();
            let fill = basic == Kind::Line;
            ranges.extend(attribute("fill").filter(|_| fill).map(|a| a.range()));
            ranges.sort_by_key(|r| r.start);
            let first = ranges.remove(0);
            let names = tag_names(text, node)?;
            (parse_path(&data)?, Edit::Basic { names, first, others: ranges, fill })
        }
    };
    if parts.is_empty() {
        return Ok(Found::Nothing);
    }
    let Some(placed) = placement(node, view)? else { return Ok(Found::Unplaced) };
    let Affine { linear, shift } = placed;
    let size = linear.x_axis.length() * linear.y_axis.length();
    if !(linear.determinant().abs() > 1e-12 * size) || !shift.is_finite() || !size.is_finite() {
        return Ok(Found::Length);
    }
    let apply = |p: DVec2| linear * p + shift;
    let parts = parts
        .into_iter()
        .map(|p| Part {
            start: apply(p.start),
            segments: p.segments.iter().map(|s| s.affine(apply, |d| linear * d)).collect(),
            closed: p.closed,
        })
        .collect();
    Ok(Found::Element(Element { name: describe(node), placed, parts, edit }))
}

/// Path data of a basic shape; `None` if it draws nothing.
fn outline_of(kind: Kind, v: [Option<f64>; 6]) -> Option<String> {
    let at = |i: usize| v[i].unwrap_or(0.0);
    let ellipse = |cx: f64, cy: f64, rx: f64, ry: f64| {
        (rx > 0.0 && ry > 0.0).then(|| {
            let (left, right) = (cx - rx, cx + rx);
            format!("M{right} {cy}A{rx} {ry} 0 0 1 {left} {cy}A{rx} {ry} 0 0 1 {right} {cy}Z")
        })
    };
    match kind {
        Kind::Line if v.iter().any(Option::is_some) => Some(format!("M{} {}L{} {}", at(0), at(1), at(2), at(3))),
        Kind::Circle => ellipse(at(0), at(1), at(2), at(2)),
        Kind::Ellipse => ellipse(at(0), at(1), v[2].or(v[3])?, v[3].or(v[2])?),
        Kind::Rect => {
            let (x, y, w, h) = (at(0), at(1), at(2), at(3));
            if !(w > 0.0 && h > 0.0) {
                return None;
            }
            let rx = v[4].or(v[5]).unwrap_or(0.0).clamp(0.0, w / 2.0);
            let ry = v[5].or(v[4]).unwrap_or(0.0).clamp(0.0, h / 2.0);
            if rx <= 0.0 || ry <= 0.0 {
                return Some(format!("M{x} {y}L{} {y}L{} {}L{x} {}Z", x + w, x + w, y + h, y + h));
            }
            let corner = |x: f64, y: f64| format!("A{rx} {ry} 0 0 1 {x} {y}");
            Some(format!(
                "M{} {y}L{} {y}{}L{} {}{}L{} {}{}L{x} {}{}Z",
                x + rx,
                x + w - rx,
                corner(x + w, y + ry),
                x + w,
                y + h - ry,
                corner(x + w - rx, y + h),
                x + rx,
                y + h,
                corner(x, y + h - ry),
                y + ry,
                corner(x + rx, y),
            ))
        }
        _ => None,
    }
}

/// The text between the quotes of an attribute.
fn value_range(text: &str, attribute: &Attribute<'_, '_>) -> std::result::Result<Range<usize>, String> {
    let range = attribute.range_value();
    let quote =
        |at: Option<usize>| at.and_then(|at| text.as_bytes().get(at)).is_some_and(|b| matches!(b, b'"' | b'\''));
    let whole = range.start <= range.end && quote(range.start.checked_sub(1)) && quote(Some(range.end));
    if whole { Ok(range) } else { Err(format!("the attribute {} is written in an unusual way", attribute.name())) }
}

/// The name of an element in its start tag, and in its end tag if there is one.
fn tag_names(text: &str, node: Node<'_, '_>) -> std::result::Result<Vec<Range<usize>>, String> {
    let unusual = || "the tag is written in an unusual way".to_owned();
    let range = node.range();
    let whole = text.get(range.clone()).ok_or_else(unusual)?;
    let name = node.tag_name().name();
    let qualified = |at: usize| {
        let rest = &whole[at..];
        let length = rest.find(|c: char| c.is_whitespace() || matches!(c, '>' | '/')).unwrap_or(rest.len());
        let local = rest[..length].rsplit(':').next().unwrap_or_default();
        (local == name).then(|| range.start + at + length - name.len()..range.start + at + length)
    };
    let mut names = vec![whole.starts_with('<').then(|| qualified(1)).flatten().ok_or_else(unusual)?];
    if !whole.ends_with("/>") {
        let end = whole.rfind("</").ok_or_else(unusual)?;
        names.push(qualified(end + 2).ok_or_else(unusual)?);
    }
    Ok(names)
}

impl Element {
    fn edits(&self, image: &MappedShape, edits: &mut Vec<(Range<usize>, String)>) {
        let back = self.placed.linear.inverse();
        let mut parts = image.clone();
        let mut largest = 0.0_f64;
        for vertex in parts.iter_mut().flatten() {
            vertex.point = back * (vertex.point - self.placed.shift);
            largest = largest.max(vertex.point.abs().max_element());
        }
        // Ten digits in all: a millionth of a pixel in a drawing of thousands of them.
        let decimals = (9.0 - largest.max(1e-6).log10().floor()).clamp(0.0, 15.0) as usize;
        let closed: Vec<bool> = self.parts.iter().map(|p| p.closed).collect();
        match &self.edit {
            Edit::Path(range) => edits.push((range.clone(), write_path(&parts, &closed, decimals))),
            Edit::Points(range) => {
                let points = parts.first().map_or(String::new(), |p| write_points(p, closed[0], decimals));
                edits.push((range.clone(), points));
            }
            Edit::Basic { names, first, others, fill } => {
                edits.extend(names.iter().map(|name| (name.clone(), "path".to_owned())));
                // A line has no inside; the curve that it becomes has.
                let fill = if *fill { " fill=\"none\"" } else { "" };
                edits.push((first.clone(), format!("d=\"{}\"{fill}", write_path(&parts, &closed, decimals))));
                edits.extend(others.iter().map(|range| (range.clone(), String::new())));
            }
        }
    }
}

#[cfg(test)]
#[path = "svg_tests.rs"]
mod tests;
