//! Tables as spreadsheets and programs write them, through the commands: the same numbers,
//! everything else kept.

use barymap::io::attribute_table::{Columns, read_attributes};
use barymap::io::npy::{IntegerType, read_npy, write_npy_integers};
use barymap::io::read_mesh;

use crate::support::Folder;

const WARP: &str = "warp-points --backend cpu --cage cage.json";
const ATTRIBUTES: &str = "attributes --backend cpu --source s.obj --target s.obj --anchors a.json";

/// A cage that shifts the plane by (10, 5).
fn shift() -> Folder {
    let folder = Folder::empty();
    let cage =
        r#"{"source": [[0, 0], [100, 0], [100, 100], [0, 100]], "target": [[10, 5], [110, 5], [110, 105], [10, 105]]}"#;
    folder.write("cage.json", cage);
    folder
}

/// The numbers of `text` rounded to nine digits, so that the last ones do not count.
fn rounded(text: &str, separator: char) -> Vec<Vec<String>> {
    let cell = |c: &str| match c.replace(',', ".").parse::<f64>() {
        Ok(x) if c.contains(['.', ',']) => format!("{:.9}", x),
        _ => c.to_owned(),
    };
    text.lines().map(|l| l.split(separator).map(cell).collect()).collect()
}

#[test]
fn points_keep_their_dialect_and_their_other_columns() {
    let f = shift();
    for (given, separator, expected) in [
        ("id,x,y,name\n7,10.5,10,a\n3,1,2,b\n", ',', "id,x,y,name,status\n7,20.5,15.0,a,ok\n3,11.0,7.0,b,ok\n"),
        ("Name;Y;X\nü;10,5;10\nb;2;1\n", ';', "Name;Y;X;status\nü;15,5;20,0;ok\nb;7,0;11,0;ok\n"),
        ("y\tx\n10\t10.5\n2\t1\n", '\t', "y\tx\tstatus\n15.0\t20.5\tok\n7.0\t11.0\tok\n"),
        ("sep=;\r\nx;y\r\n10,5;10\r\n", ';', "sep=;\nx;y;status\n20,5;15,0;ok\n"),
        ("x,y\r10.5,10\r1,2\r", ',', "x,y,status\n20.5,15.0,ok\n11.0,7.0,ok\n"),
        ("# x y\n10.5 10\n1 2\n", ',', "x,y,status\n20.5,15.0,ok\n11.0,7.0,ok\n"),
    ] {
        f.write("p.csv", given);
        let ran = f.run(&format!("{WARP} p.csv -o out.csv")).succeeds();
        assert_eq!(rounded(&f.read("out.csv"), separator), rounded(expected, separator), "{given:?}");
        assert!(!ran.stderr.contains("note: p.csv"), "{}", ran.stderr);
    }
    // A cell with a separator and a line end; bytes that are not UTF-8.
    std::fs::write(f.path("p.csv"), b"x,y,note\n1,2,\"a, b\nF\xfc\xdfe\"\n").unwrap();
    let ran = f.run(&format!("{WARP} p.csv -o out.csv --jacobian")).succeeds();
    assert!(ran.stderr.contains("note: p.csv: the text is not UTF-8"), "{}", ran.stderr);
    let out = f.read("out.csv");
    assert!(out.starts_with("x,y,note,j,status\n11.") && out.contains(",\"a, b\nFüße\","), "{out}");
    // Back and forth.
    f.write("p.csv", "x;y;name\n10,25;20,5;a\n");
    f.run(&format!("{WARP} p.csv -o there.csv")).succeeds();
    f.run(&format!("{WARP} there.csv --inverse -o back.csv")).succeeds();
    let back = rounded(&f.read("back.csv"), ';');
    assert_eq!(back[0], ["x", "y", "name", "status", "status_2"]);
    assert_eq!(back[1], ["10.250000000", "20.500000000", "a", "ok", "ok"]);
}

#[test]
fn tables_that_cannot_be_read_name_their_line() {
    let f = shift();
    for (text, words) in [
        ("", ["p.csv", "empty"]),
        ("id,name\n1,a\n", ["line 1", "id,name"]),
        ("x;y\n1,5;2\n1.5;2\n", ["line 3", "decimal point"]),
        ("x;y\n1.234,5;2\n", ["line 2", "groups"]),
        ("x,y\n\"1,234\",2\n", ["line 2", "thousands"]),
        ("x,y,name\n1,2,\"a\n3,4,b\n", ["line 2", "never closed"]),
        ("x,y\n1,2\n3\n", ["line 3", "1 cells of 2"]),
        ("x,y\n1,\n", ["line 2", "finite number"]),
    ] {
        f.write("p.csv", text);
        f.run(&format!("{WARP} p.csv -o out.csv")).fails(1, &words);
        assert!(!f.path("out.csv").exists());
    }
    // Nothing but a header is a table without points.
    f.write("p.csv", "x;y;name\n");
    f.run(&format!("{WARP} p.csv -o out.csv")).succeeds();
    assert_eq!(f.read("out.csv"), "x;y;name;status\n");
}

#[test]
fn names_of_parts_go_with_the_numbers() {
    let f = Folder::spheres();
    f.anchors("a.json", 40, |p| p);
    // Source and target are one mesh.
    let anchors: Vec<usize> = (0..60).map(|k| 5 * k).collect();
    f.write("a.json", &serde_json::json!({"source": anchors, "target": anchors}).to_string());
    let mesh = read_mesh(f.path("s.obj")).unwrap().mesh;
    let side = |v: usize| if mesh.positions[v].y > 0.0 { "upper; \"half\"" } else { "lower" };
    let quoted = |v: usize| format!("\"{}\"", side(v).replace('"', "\"\""));
    let height = |v: usize| format!("{}", mesh.positions[v].y).replace('.', ",");
    let rows: String = (0..mesh.vertex_count()).rev().map(|v| format!("{};{};{v}\n", quoted(v), height(v))).collect();
    f.write("t.csv", &format!("Part;Height;Vertex\n{rows}"));
    f.run(&format!("{ATTRIBUTES} --attributes t.csv -o o.csv --report r.json")).succeeds();
    let table = read_attributes(f.path("o.csv"), &Columns::Data).unwrap();
    assert!(f.read("o.csv").starts_with("index;Part;Height;status;confidence\n0;"), "{}", &f.read("o.csv")[..80]);
    assert_eq!((table.columns.join(" "), table.texts.len()), ("Height".into(), 1));
    let mut right = 0;
    for v in 0..mesh.vertex_count() {
        assert!((table.values[v] - mesh.positions[v].y).abs() < 0.02, "vertex {v}: {}", table.values[v]);
        right += usize::from(table.texts[0].words[table.texts[0].values[v] as usize] == side(v));
    }
    assert!(100 * right >= 98 * mesh.vertex_count(), "{right} of {}", mesh.vertex_count());
    // Other formats hold numbers only, and say so.
    let ran = f.run(&format!("{ATTRIBUTES} --attributes t.csv -o o.npy")).succeeds();
    assert!(ran.stderr.contains("columns of text are left out: Part"), "{}", ran.stderr);
    f.run(&format!("{ATTRIBUTES} --attributes t.csv --columns part -o o.npy")).fails(1, &["texts only", "CSV"]);
}

#[test]
fn whole_numbers_come_back_as_they_were_stored() {
    let f = Folder::spheres();
    let mesh = read_mesh(f.path("s.obj")).unwrap().mesh;
    let anchors: Vec<usize> = (0..60).map(|k| 5 * k).collect();
    f.write("a.json", &serde_json::json!({"source": anchors, "target": anchors}).to_string());
    let labels: Vec<f64> = mesh.positions.iter().map(|p| if p.y > 0.0 { 200.0 } else { 7.0 }).collect();
    for kind in [IntegerType::U8, IntegerType::I64, IntegerType::U32] {
        write_npy_integers(f.path("l.npy"), 1, &labels, kind).unwrap();
        f.run(&format!("{ATTRIBUTES} --attributes l.npy --kind labels -o o.npy")).succeeds();
        let out = read_npy(f.path("o.npy")).unwrap();
        assert_eq!((out.columns, out.integers), (1, Some(kind)));
        let right = out.values.iter().zip(&labels).filter(|(a, b)| a == b).count();
        assert!(100 * right >= 98 * labels.len(), "{right} of {}", labels.len());
        // Amounts lie in between.
        f.run(&format!("{ATTRIBUTES} --attributes l.npy -o s.npy")).succeeds();
        assert_eq!(read_npy(f.path("s.npy")).unwrap().integers, None);
    }
}

#[test]
fn maps_and_averages_answer_in_the_table_s_dialect() {
    let f = Folder::spheres();
    f.write("p.csv", "Name;B0;B1;B2;Face\nknee;0,25;0,5;0,25;40\n\"a;b\";0;1;0;300\n");
    f.run("map --backend cpu --source s.obj --target t.obj --anchors a.json --points p.csv -o m.csv").succeeds();
    let text = f.read("m.csv");
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines[0], "index;face;b0;b1;b2;x;y;z;status;confidence;Name");
    assert!(
        lines[1].starts_with("0;") && lines[1].ends_with(";knee") && lines[1].contains(",") && !lines[1].contains('.')
    );
    assert!(lines[2].starts_with("1;") && lines[2].ends_with(";\"a;b\""));
    // The same numbers as from the plain table.
    f.write("q.csv", "face,b0,b1,b2\n40,0.25,0.5,0.25\n300,0,1,0\n");
    f.run("map --backend cpu --source s.obj --target t.obj --anchors a.json --points q.csv -o n.csv").succeeds();
    let plain = f.read("n.csv");
    let same = lines[1].replace(',', ".").replace(';', ",");
    assert_eq!(same, format!("{},knee", plain.lines().nth(1).unwrap()));

    f.write("single.json", &serde_json::json!({"anchors": (0..10).map(|k| 30 * k).collect::<Vec<_>>()}).to_string());
    let ran = f.run("weights s.obj --backend cpu --anchors single.json --points p.csv -o w.npy").succeeds();
    assert!(ran.stderr.contains("columns that are not read: Name"), "{}", ran.stderr);
    let row = |separator: &str, half: &str| [vec![half, half], vec!["0"; 8]].concat().join(separator);
    f.write("w.csv", &format!("{}\n", row(",", "0.5")));
    f.write("g.csv", &format!("{};{}\n{};middle\n", "a;b;c;d;e;f;g;h;i;j", "name", row(";", "0,5")));
    f.run("average s.obj --backend cpu --anchors single.json --weights w.csv -o one.csv").succeeds();
    f.run("average s.obj --backend cpu --anchors single.json --weights g.csv -o two.csv").succeeds();
    let (one, two) = (f.read("one.csv"), f.read("two.csv"));
    assert_eq!(
        two.replace(',', ".").replace(';', ","),
        one.replace("b2\n", "b2,name\n").replacen("\n", "\u{1}", 1).replace('\n', ",middle\n").replace('\u{1}', "\n")
    );
}
