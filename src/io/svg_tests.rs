use proptest::prelude::*;

use super::super::outline::Vertex;
use super::*;

/// Images under `map`, each segment cut into four.
fn mapped(shapes: &[Shape], map: impl Fn(DVec2) -> DVec2) -> Vec<Option<MappedShape>> {
    let part = |part: &Part| {
        let mut vertices = vec![Vertex { point: map(part.start), from: (0, 0.0) }];
        let mut at = part.start;
        for (i, s) in part.segments.iter().enumerate() {
            vertices
                .extend((1..=4).map(|k| f64::from(k) / 4.0).map(|t| Vertex { point: map(s.at(at, t)), from: (i, t) }));
            at = s.end();
        }
        vertices
    };
    shapes.iter().map(|s| Some(s.parts.iter().map(part).collect())).collect()
}

const DRAWING: &str = r##"<?xml version="1.0"?>
<!DOCTYPE svg PUBLIC "-//W3C//DTD SVG 1.1//EN" "x.dtd">
<svg xmlns="http://www.w3.org/2000/svg" xmlns:k="urn:k" viewBox="0 0 10 10"><!-- note -->
  <defs><path d="M0 0L9 9"/></defs>
  <g transform="translate(1 2) scale(2)" k:keep="&lt;"><path id="a" class='c' d="m0 0 1 0 0 1z" style="fill:red"/></g>
  <polygon points="0,0 4,0 4,4"/><polyline points='1 1 2 2'/>
  <line x1="1" x2="5" stroke="red" fill="blue"/>
  <rect x="1" y="2" width="3" height="4"></rect>
  <rect width="3px" height="4" rx="1"/><rect width="10%" height="1"/>
  <circle r="2" cx="5"/><ellipse rx="2" ry="1"/><text>hi</text><k:path d="M0 0"/>
  <path d=""/><path/><path d="M1 1 M2 2 L3 3"/>
</svg>
"##;

#[test]
fn outlines_move_and_every_other_byte_stays() {
    let svg = Svg::parse(DRAWING.into(), "d.svg").unwrap();
    let shapes = svg.shapes();
    let names: Vec<&str> = shapes.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(names, ["path \"a\"", "polygon", "polyline", "line", "rect", "rect", "circle", "ellipse", "path"]);
    assert_eq!(svg.warnings().len(), 3, "{:?}", svg.warnings());
    // The triangle in the document's coordinates.
    assert_eq!(shapes[0].parts[0].start, DVec2::new(1.0, 2.0));
    assert_eq!(shapes[0].parts[0].segments[0].end(), DVec2::new(3.0, 2.0));
    let text = svg.replaced(&mapped(&shapes, |p| p + DVec2::new(10.0, 0.0)));
    assert!(text.contains(r#"class='c' d="M5 0 L5.25 0"#), "{text}");
    assert!(text.contains(r#"k:keep="&lt;""#) && text.contains("<!-- note -->") && text.contains("<text>hi</text>"));
    assert!(
        text.contains(r#"<defs><path d="M0 0L9 9"/></defs>"#) && text.contains(r#"<rect width="10%" height="1"/>"#)
    );
    assert!(text.contains(r#"<path d="M11 0 L12 0 L13 0 L14 0 L15 0" fill="none"  stroke="red" />"#), "{text}");
    assert_eq!((text.matches("</rect>").count(), text.matches("</path>").count()), (0, 1));
    // What is written is read, and lies where it should.
    let again = Svg::parse(text, "d.svg").unwrap();
    let there = again.shapes();
    assert_eq!(there.len(), shapes.len());
    for (a, b) in shapes.iter().zip(&there) {
        assert_eq!(a.parts.len(), b.parts.len());
        for (a, b) in a.parts.iter().zip(&b.parts) {
            assert_eq!((b.segments.len(), a.closed), (4 * a.segments.len(), b.closed), "{a:?} {b:?}");
            assert!(b.start.distance(a.start + DVec2::new(10.0, 0.0)) < 1e-8);
        }
    }
    // Undone, it draws the same corners.
    let back = Svg::parse(again.replaced(&mapped(&there, |p| p - DVec2::new(10.0, 0.0))), "d").unwrap();
    assert!(back.shapes()[0].parts[0].start.distance(shapes[0].parts[0].start) < 1e-8);
    let none = svg.replaced(&vec![None; shapes.len()]);
    assert!(
        none.contains(r#"<path id="a" class='c' d="" style="#) && Svg::parse(none, "d").unwrap().shapes().is_empty()
    );
}

#[test]
fn circles_are_round_under_transforms() {
    let text = r#"<svg><g transform="rotate(30) scale(2 3)"><circle cx="1" cy="1" r="1"/></g></svg>"#;
    let svg = Svg::parse(text.into(), "c").unwrap();
    let shape = &svg.shapes()[0];
    let (mut at, turn) = (shape.parts[0].start, 30.0_f64.to_radians());
    for s in &shape.parts[0].segments {
        for k in 0..=10 {
            let p = s.at(at, f64::from(k) / 10.0);
            let q = DVec2::new(p.x * turn.cos() + p.y * turn.sin(), p.y * turn.cos() - p.x * turn.sin());
            assert!((DVec2::new(q.x / 2.0 - 1.0, q.y / 3.0 - 1.0).length() - 1.0).abs() < 1e-12);
        }
        at = s.end();
    }
}

#[test]
fn transforms_in_styles_are_applied() {
    let drawing = |group: &str, shape: &str| {
        format!("<svg viewBox='0 0 200 100'><g {group}><path id='p' {shape} d='M1 2 L3 4'/></g></svg>")
    };
    let attribute = drawing("transform='translate(5 6)'", "transform='rotate(30 100 50) scale(2)'");
    let expected = Svg::parse(attribute, "d").unwrap().shapes();
    for (group, shape) in [
        ("style='transform:translate(5px,6px)'", "transform='rotate(30 100 50) scale(2)'"),
        (
            "style='translate:5px 6px'",
            "style='transform:translate(100px,50px) rotate(30deg) translate(-100px,-50px) scale(2)'",
        ),
        (
            "transform='translate(1)' style='fill:red;transform:translate(5px,6px)'",
            "transform='translate(100 50) rotate(30) translate(-100 -50) scale(2)'",
        ),
    ] {
        let svg = Svg::parse(drawing(group, shape), "d").unwrap();
        let shapes = svg.shapes();
        assert!(shapes[0].parts[0].start.distance(expected[0].parts[0].start) < 1e-9, "{group} {shape}: {shapes:?}");
        assert_eq!(svg.warnings(), [""; 0]);
        // What is written lies where the map puts it, the transform staying as it was.
        let moved = svg.replaced(&mapped(&shapes, |p| p + DVec2::new(3.0, -2.0)));
        assert!(moved.contains(group) && moved.contains(shape));
        let again = Svg::parse(moved, "d").unwrap().shapes();
        assert!(again[0].parts[0].start.distance(expected[0].parts[0].start + DVec2::new(3.0, -2.0)) < 1e-6);
    }
    // About the middle of the drawing.
    let centred = "style='transform:rotate(90deg);transform-origin:center'";
    let start = Svg::parse(drawing("", centred), "d").unwrap().shapes()[0].parts[0].start;
    assert!(start.distance(DVec2::new(100.0 + 48.0, 50.0 - 99.0)) < 1e-9, "{start}");
    let boxed = "style='transform:rotate(90deg);transform-box:fill-box;transform-origin:center'";
    let svg = Svg::parse(drawing("", boxed), "d").unwrap();
    assert!(
        svg.shapes().is_empty() && svg.warnings()[0].contains("1 outlines whose transform"),
        "{:?}",
        svg.warnings()
    );
    let sheet = "<svg><style>.a{transform:scale(2)}</style><path class='a' d='M1 2 L3 4'/></svg>";
    assert!(Svg::parse(sheet.into(), "d").unwrap().warnings()[0].contains("style sheet has transforms"));
    // Absolute units of lengths.
    let units = "<svg><rect x='1in' y='25.4mm' width='72pt' height='6pc'/></svg>";
    let shapes = Svg::parse(units.into(), "d").unwrap().shapes();
    assert!(shapes[0].parts[0].start.distance(DVec2::splat(96.0)) < 1e-9);
    assert!(shapes[0].parts[0].segments[1].end().distance(DVec2::splat(192.0)) < 1e-9);
}

#[test]
fn mistakes_name_the_line() {
    for (text, expected) in [
        ("", "not XML"),
        ("<svg>", "line 1"),
        ("<html/>", "html"),
        ("<svg>\n<path id='p' d='M0 0 L1'/></svg>", "line 2: path \"p\""),
        ("<svg><path d='M0 0 L1e400 0'/></svg>", "path data"),
        ("<svg><path d='L1 1'/></svg>", "path data"),
        ("<svg>\n\n<g transform='turn(3)'><path d='M0 0 L1 1'/></g></svg>", "line 3: path: the transform"),
        ("<!DOCTYPE svg [<!ENTITY p \"<path d='M0 0L1 1'/>\">]><svg>&p;&p;</svg>", "entities"),
    ] {
        let message = Svg::parse(text.into(), "d.svg").unwrap_err().to_string();
        assert!(message.contains(expected) && message.contains("d.svg"), "{text}: {message}");
    }
    let flat = Svg::parse("<svg><path transform='scale(0)' d='M0 0L1 1'/></svg>".into(), "d").unwrap();
    assert!(flat.shapes().is_empty() && flat.warnings().len() == 1);
    let bomb = format!(
        "<!DOCTYPE svg [<!ENTITY a \"{}\">{}]><svg><path d='&j;'/></svg>",
        "M0 0 ".repeat(10),
        ('b'..='j')
            .map(|c| {
                let before = char::from(c as u8 - 1);
                format!("<!ENTITY {c} \"{}\">", format!("&{before};").repeat(10))
            })
            .collect::<String>()
    );
    assert!(Svg::parse(bomb, "d").is_err());
}

proptest! {
    #[test]
    fn broken_documents_are_refused(cut in 0..DRAWING.len(), with in "[<>/\"'=a-d0-9 &;]{0,4}") {
        let text = format!("{}{with}{}", &DRAWING[..cut], &DRAWING[cut + 1..]);
        if let Ok(svg) = Svg::parse(text, "x") {
            let images = mapped(&svg.shapes(), |p| p * 2.0);
            svg.replaced(&images);
        }
    }
}
