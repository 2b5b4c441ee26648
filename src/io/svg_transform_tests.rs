use super::*;

/// Where (1, 0) and (0, 1) go.
fn placed(attributes: &str) -> std::result::Result<[DVec2; 2], Unknown> {
    let text = format!("<g {attributes}/>");
    let document = roxmltree::Document::parse(&text).unwrap();
    let affine = own(document.root_element(), Some(DVec2::new(200.0, 100.0))).unwrap()?;
    Ok([DVec2::X, DVec2::Y].map(|p| affine.linear * p + affine.shift))
}

#[test]
fn property_and_attribute_say_the_same() {
    let quarter = "translate(10 20) rotate(90) scale(2 3)";
    let expected = placed(&format!("transform='{quarter}'")).unwrap();
    assert!(
        expected[0].distance(DVec2::new(10.0, 22.0)) < 1e-12 && expected[1].distance(DVec2::new(7.0, 20.0)) < 1e-12
    );
    for attributes in [
        "style='transform: translate(10px, 20px) rotate(90deg) scale(2, 3)'",
        "style='fill:url(\"a;transform:b\"); TRANSFORM:translate(10px,20px)rotate(0.25turn)scale(200%,300%) !important;stroke:red'",
        "transform='scale(9)' style='transform:translateX(10px) translateY(20px) rotate(100grad) scaleX(2) scaleY(3)'",
        "transform='translate(10px, 20px) rotate(90deg) scale(2, 3)'",
        "style='transform:matrix(0, 2, -3, 0, 10, 20)'",
        "style='transform:translate(5%, 20%) rotate(1.5707963267948966rad) scale(2,3)'",
        "style='translate: 10px 20px; rotate: 90deg; scale: 2 3'",
        "style='translate:10px 20px;transform:rotate(90deg) scale(2,3)'",
        "style='transform:scale(7);transform:translate(0.10416666666666667in,15pt) rotate(90deg) scale(2,3)'",
    ] {
        let found = placed(attributes).unwrap();
        assert!(
            found[0].distance(expected[0]) < 1e-9 && found[1].distance(expected[1]) < 1e-9,
            "{attributes}: {found:?}"
        );
    }
    assert_eq!(placed("style='transform:none' transform='scale(3)'").unwrap(), [DVec2::X, DVec2::Y]);
    assert_eq!(placed("style='fill:none'").unwrap(), [DVec2::X, DVec2::Y]);
}

#[test]
fn origins_are_those_of_the_drawing() {
    let about = |x: f64, y: f64| placed(&format!("transform='rotate(30 {x} {y})'")).unwrap();
    for (origin, x, y) in [
        ("50px 20px", 50.0, 20.0),
        ("50% 50%", 100.0, 50.0),
        ("center", 100.0, 50.0),
        ("right bottom", 200.0, 100.0),
        ("bottom right", 200.0, 100.0),
        ("top", 100.0, 0.0),
        ("7px", 7.0, 50.0),
        ("left 30px", 0.0, 30.0),
        ("1px 2px 3px", 1.0, 2.0),
    ] {
        for attributes in [
            format!("style='transform:rotate(30deg);transform-origin:{origin}'"),
            format!("transform='rotate(30)' transform-origin='{origin}'"),
        ] {
            let (found, expected) = (placed(&attributes).unwrap(), about(x, y));
            assert!(found[0].distance(expected[0]) < 1e-9 && found[1].distance(expected[1]) < 1e-9, "{attributes}");
        }
    }
}

#[test]
fn what_depends_on_more_is_unknown() {
    for attributes in [
        "style='transform:rotate(45)'",
        "style='transform:rotate3d(1,0,0,45deg)'",
        "style='transform:translate(1em)'",
        "style='transform:scale(2'",
        "style='transform:var(--a)'",
        "style='transform:scale(2);transform-origin:1em 2px'",
        "style='transform:scale(2);transform-box:fill-box;transform-origin:center'",
        "style='transform:scale(2);transform-box:fill-box'",
    ] {
        assert_eq!(placed(attributes), Err(Unknown), "{attributes}");
    }
    for (text, value) in [
        ("1", 1.0),
        ("25.4mm", 96.0),
        ("2.54CM", 96.0),
        ("72pt", 96.0),
        ("6pc", 96.0),
        ("101.6Q", 96.0),
        (" 3px ", 3.0),
    ] {
        assert!((length(text).unwrap() - value).abs() < 1e-12, "{text}");
    }
    assert!(["1em", "10%", "px", "", "1e999", "nanpx"].iter().all(|t| length(t).is_none()));
}
