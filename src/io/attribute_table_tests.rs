use glam::DVec3;

use super::*;

fn parse(text: &str) -> Result<AttributeTable> {
    from_table(Table::parse_text(text, "a.csv").unwrap(), &Columns::Data)
}

#[test]
fn csv_with_and_without_header_and_index() {
    let plain = parse("1,2\n3,4\n").unwrap();
    assert_eq!((plain.columns, plain.values), (vec!["c0".to_owned(), "c1".to_owned()], vec![1.0, 2.0, 3.0, 4.0]));
    let table = parse("\u{feff}vertex, hip ,\"knee\",status\n1,0.5,2e-1,valid\n\n0,1,0,failed\n").unwrap();
    assert_eq!((table.columns, table.values), (vec!["hip".to_owned(), "knee".to_owned()], vec![1.0, 0.0, 0.5, 0.2]));
}

#[test]
fn mistakes_are_named_by_line() {
    for (text, words) in [
        ("", "empty"),
        ("a,b\n1,2\n3\n", "line 3: 1 cells of 2"),
        ("a,b\n1,2\n1,x\n", "line 3: \"x\" is not a number"),
        ("a;b\n1,5;2\n1;2.5\n", "line 3: \"2.5\" has a decimal point"),
        ("index,a\n0,1\n0,2\n", "vertex 0 comes twice"),
        ("index,a\n0,1\n7,2\n", "vertex 7 in a table of 2 rows"),
        ("index,a\n-1,1\n", "no vertex index"),
        ("index,status\n0,valid\n", "no column of data"),
    ] {
        let message = parse(text).unwrap_err().to_string();
        assert!(message.contains(words), "{message}");
    }
}

#[test]
fn every_format_comes_back() {
    let dir = tempfile::tempdir().unwrap();
    let mesh = Mesh::of_triangles("one", vec![DVec3::ZERO, DVec3::X, DVec3::Y], &[[0, 1, 2]]);
    let table = AttributeTable {
        columns: vec!["a".into(), "b".into()],
        values: vec![0.1, 1.0 / 3.0, -2.0, 1e300, 7.0, 0.0],
        ..AttributeTable::default()
    };
    let status = [RowStatus { word: "valid", number: 2, confidence: 0.5 }; 3];
    let style = AttributeStyle { colors: false };
    for name in ["a.csv", "a.npy", "a.ply"] {
        let path = dir.path().join(name);
        write_attributes(&path, &mesh, &table, &status, style).unwrap();
        let back = read_attributes(&path, &Columns::Data).unwrap();
        assert_eq!(back.values, table.values, "{name}");
        let first = if name == "a.npy" { "c0" } else { "a" };
        let one = read_attributes(&path, &Columns::Named(vec![first.into()])).unwrap();
        assert_eq!(one.values, [0.1, -2.0, 7.0]);
        let message = read_attributes(&path, &Columns::Named(vec!["zz".into()])).unwrap_err().to_string();
        assert!(message.contains("no column \"zz\""), "{message}");
    }
    assert!(write_attributes(dir.path().join("a.csv"), &mesh, &table, &status[1..], style).is_err());
    assert!(write_attributes(dir.path().join("a.xyz"), &mesh, &table, &status, style).is_err());
    let hidden = AttributeTable { columns: vec!["x".into(), "b".into()], ..table };
    assert!(write_attributes(dir.path().join("a.ply"), &mesh, &hidden, &status, style).is_err());
}

#[test]
fn colours_are_bytes_in_ply() {
    let dir = tempfile::tempdir().unwrap();
    let mesh = Mesh::of_triangles("one", vec![DVec3::ZERO, DVec3::X, DVec3::Y], &[[0, 1, 2]]);
    let columns = ["red", "green", "blue"].map(str::to_owned).to_vec();
    let table = AttributeTable {
        columns,
        values: vec![0.0, 1.0, 128.0 / 255.0, 0.2, 0.4, 0.6, f64::NAN, 3.0, -1.0],
        ..AttributeTable::default()
    };
    let mut status = [RowStatus { word: "valid", number: 2, confidence: 1.0 }; 3];
    let path = dir.path().join("c.ply");
    let refused = write_attributes(&path, &mesh, &table, &status, AttributeStyle { colors: true }).unwrap_err();
    assert!(refused.to_string().contains("red of vertex 2 would be NaN"), "{refused}");
    status[2] = RowStatus { word: "failed", number: 0, confidence: 0.0 };
    write_attributes(&path, &mesh, &table, &status, AttributeStyle { colors: true }).unwrap();
    let back = read_colors(&path).unwrap();
    assert_eq!(back.columns, table.columns);
    assert_eq!(back.values[..6], table.values[..6]);
    assert_eq!(back.values[6..], [0.0, 1.0, 0.0]);
    assert!(read_attributes(&path, &Columns::Data).unwrap_err().to_string().contains("no properties"));
}

#[test]
fn dialects_texts_and_whole_numbers_come_back() {
    let dir = tempfile::tempdir().unwrap();
    let mesh = Mesh::of_triangles("one", vec![DVec3::ZERO, DVec3::X, DVec3::Y], &[[0, 1, 2]]);
    let status = [RowStatus { word: "valid", number: 2, confidence: 0.5 }; 3];
    let style = AttributeStyle { colors: false };
    // Columns in any order and case; the rows as well.
    let given = "Part;Hüfte;VERTEX;Knie;Status\nleg;0,25;2;0,75;x\nfoot;1;0;0;y\nleg;0;1;1;z\n";
    let table = parse(given).unwrap();
    assert_eq!(
        (table.columns.join(" "), &table.values[..]),
        ("Hüfte Knie".into(), &[1.0, 0.0, 0.0, 1.0, 0.25, 0.75][..])
    );
    let text = &table.texts[0];
    assert_eq!((text.place, text.words.join(" "), &text.values[..]), (0, "foot leg".into(), &[0.0, 1.0, 1.0][..]));
    let path = dir.path().join("a.csv");
    write_attributes(&path, &mesh, &table, &status, style).unwrap();
    let written = std::fs::read_to_string(&path).unwrap();
    let rows = "0;foot;1;0;valid;0,5\n1;leg;0;1;valid;0,5\n2;leg;0,25;0,75;valid;0,5\n";
    assert_eq!(written, format!("index;Part;Hüfte;Knie;status;confidence\n{rows}"));
    assert_eq!(read_attributes(&path, &Columns::Data).unwrap(), table);
    let named = read_attributes(&path, &Columns::Named(vec!["knie".into(), "part".into()])).unwrap();
    assert_eq!((named.columns.join(" "), named.texts[0].place), ("Knie".into(), 1));

    let path = dir.path().join("a.npy");
    let labels = AttributeTable {
        columns: numbered(1),
        values: vec![-7.0, 0.0, 9e15],
        storage: Storage { integers: Some(IntegerType::I64), ..Storage::default() },
        ..AttributeTable::default()
    };
    write_attributes(&path, &mesh, &labels, &status, style).unwrap();
    assert_eq!(read_attributes(&path, &Columns::Data).unwrap(), labels);
    let texts = AttributeTable { columns: Vec::new(), values: Vec::new(), ..table };
    assert!(write_attributes(&path, &mesh, &texts, &status, style).unwrap_err().to_string().contains("texts only"));
}
