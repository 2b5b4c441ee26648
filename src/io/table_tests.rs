use proptest::prelude::*;

use super::*;

fn table(text: &str) -> Table {
    let mut table = Table::parse_text(text, "t.csv").unwrap();
    table.lift_header(|t, row| (0..t.cells(row)).any(|c| !t.is_number(row, c)));
    table
}

fn numbers(table: &mut Table, columns: &[usize]) -> Result<Vec<f64>> {
    table.settle_decimals(columns)?;
    Ok((0..table.len())
        .flat_map(|r| columns.iter().map(move |&c| (r, c)))
        .map(|(r, c)| table.number(r, c).unwrap())
        .collect())
}

#[test]
fn the_same_numbers_in_every_dialect() {
    for text in [
        "x,y\n0.5,-1\n1e-3,2.25\n",
        "x;y\n0,5;-1\n1e-3;2,25\n",
        "x;y\n0.5;-1\n1e-3;2.25\n",
        "x\ty\n0,5\t-1\n1e-3\t2,25\n",
        "x\ty\n0.5\t-1\n1e-3\t2.25\n",
        "x y\n0.5   -1\n 1e-3 2.25 \n",
        "\"x\",\"y\"\n\"0,5\",\"-1\"\n\"1e-3\",\"2,25\"\n",
        "\u{feff}x,y\r\n0.5,-1\r\n\r\n1e-3,2.25\r\n",
        "x,y\r0.5,-1\r1e-3,2.25\r",
        "sep=;\nx;y\n0,5;-1\n1e-3;2,25\n",
        "# numpy.savetxt\n# x,y\n0.5,-1\n1e-3,2.25\n",
        "# x y\n0.5 -1\n1e-3 2.25\n",
        "x,y\n# between, the rows\n0.5,-1\n\n1e-3,2.25\n # after\n",
        "x,y,\n0.5,-1,\n1e-3,2.25,\n,,\n,,\n",
    ] {
        let mut table = table(text);
        assert_eq!((table.column("X"), table.column("y"), table.len()), (Some(0), Some(1), 2), "{text:?}");
        assert_eq!(numbers(&mut table, &[0, 1]).unwrap(), [0.5, -1.0, 1e-3, 2.25], "{text:?}");
    }
}

#[test]
fn quoted_cells_hold_anything() {
    let table = table("id,name,x\n1,\"a, \"\"b\"\"\nand, c\",2\n\n2,\"#3\",4\n\"#5\",\"\",6\n");
    assert_eq!((table.len(), table.raw(0, 1), table.cell(1, 1)), (3, "a, \"b\"\nand, c", "#3"));
    assert_eq!((table.line(0), table.line(1), table.line(2)), (2, 5, 6));
    assert_eq!((table.raw(2, 0), table.raw(2, 1), table.notes().len()), ("#5", "", 0));
    // A hash that begins a row as wide as the others begins no comment.
    let hashed = super::tests::table("colour,x\n#ff0000,1\n#00ff00,2\n# two colours\n");
    assert_eq!((hashed.len(), hashed.cell(1, 0)), (2, "#00ff00"));
    assert!(hashed.notes()[0].contains("1 lines"), "{:?}", hashed.notes());
    for text in ["a,b\n1,\"two\n3,4\n", "a,b\n1,\"two", "a,b\n1,\"", "a;b\n1;\"say \"\"x\"\"\n"] {
        let message = Table::parse_text(text, "t.csv").unwrap_err().to_string();
        assert!(message.contains("t.csv, line 2") && message.contains("never closed"), "{text:?}: {message}");
    }
    for text in ["a,b\n1,\"\"", "a,b\n1,5\"", "a,b\n1,\"\"\"\"", "a,b\n1,x\"y", "\"\""] {
        assert!(Table::parse_text(text, "t.csv").is_ok(), "{text:?}");
    }
}

#[test]
fn decimal_signs_that_contradict_are_refused_by_line() {
    for (text, expected) in [
        ("x;y\n1,5;2\n1;2.5\n", "line 3: \"2.5\" has a decimal point, \"1,5\" on line 2 a comma"),
        ("x;y\n1,234;2.5\n", "line 2: \"2.5\" has a decimal point"),
        ("x;y\n1;2\n1.234,5;2\n", "line 3: \"1.234,5\" sets its digits apart"),
        ("x,y\n\"1,234.5\",2\n", "line 2: \"1,234.5\" sets"),
        ("x,y\n\"1,234\",2\n", "line 2: \"1,234\" may be a decimal fraction or thousands"),
        ("x\ty\n1\t2\n1,234\t2\n", "line 3: \"1,234\" may be"),
        ("x;y\n1.234.567;2\n", "line 2: \"1.234.567\" sets"),
    ] {
        let mut table = table(text);
        let message = numbers(&mut table, &[0, 1]).unwrap_err().to_string();
        assert!(message.contains(expected), "{text:?}: {message}");
    }
    // Behind semicolons a comma is a decimal sign, as spreadsheets write it.
    assert_eq!(numbers(&mut table("x;y\n1,234;5,678\n"), &[0, 1]).unwrap(), [1.234, 5.678]);
    // Beside a fraction that is no group of thousands, too.
    assert_eq!(numbers(&mut table("x\ty\n1,234\t5,5\n"), &[0, 1]).unwrap(), [1.234, 5.5]);
}

#[test]
fn the_decimal_sign_of_what_is_written() {
    for (text, columns, comma) in [
        ("x;y\n1;2\n", vec![0, 1], true),
        ("x;y\n1;2.5\n", vec![0, 1], false),
        ("x;y;z\n1;2;2.5\n", vec![0, 1], false),
        ("x;y;z\n1;2;2,5\n", vec![0, 1], true),
        ("x,y\n1,2\n", vec![0, 1], false),
        ("x\ty\n1\t2\n", vec![0, 1], false),
        ("x\ty\n1\t2,5\n", vec![0, 1], true),
        // Text with commas says nothing.
        ("x\ty\tnote\n1\t2\ta,b\n", vec![0, 1], false),
    ] {
        let mut table = table(text);
        table.settle_decimals(&columns).unwrap();
        assert_eq!(table.dialect().decimal_comma, comma, "{text:?}");
    }
}

#[test]
fn widths_are_checked_by_line() {
    let message = table("a,b\n1,2\n3\n").check_widths("r").unwrap_err().to_string();
    assert!(message.contains("line 3: 1 cells of 2"), "{message}");
    let message = table("a;b\n1;2\n3;4;5\n").check_widths("r").unwrap_err().to_string();
    assert!(message.contains("line 3: 3 cells of 2"), "{message}");
    table("a,b\n1,2,\n3,4,,\n").check_widths("r").unwrap();
    assert_eq!(table("").width(), 0);
    table("a,b\n").check_widths("r").unwrap();
}

/// Rows of cells of any text, quoted.
fn quoted(rows: &[Vec<String>], separator: char) -> String {
    let cell = |c: &String| format!("\"{}\"", c.replace('"', "\"\""));
    rows.iter().map(|r| r.iter().map(cell).collect::<Vec<_>>().join(&separator.to_string()) + "\n").collect()
}

proptest! {
    #[test]
    fn any_text_is_read_or_refused(text in "[-xy,;\t\"#0-9eE.\n\r a\u{feff}]{0,80}") {
        if let Ok(mut table) = Table::parse_text(&text, "t") {
            let columns: Vec<usize> = (0..table.width()).collect();
            let _ = table.settle_decimals(&columns);
            let lines = text.matches(['\n', '\r']).count() + 1;
            for row in 0..table.len() {
                prop_assert!(table.line(row) <= lines && (row == 0 || table.line(row - 1) <= table.line(row)));
            }
        }
    }

    #[test]
    fn cells_of_any_text_survive(
        rows in prop::collection::vec(prop::collection::vec("[-xy,;\t\"#0-9. \nü]{0,8}", 3), 1..12),
        separator in prop::sample::select(vec![',', ';', '\t']),
    ) {
        // A header without separators in it shows which one it is.
        let header = vec!["p".to_owned(), "q".to_owned(), "r".to_owned()];
        let all: Vec<Vec<String>> = std::iter::once(header).chain(rows).collect();
        let table = Table::parse_text(&quoted(&all, separator), "t").unwrap();
        let last = all.iter().rposition(|r| r.iter().any(|c| !c.trim().is_empty())).unwrap();
        prop_assert_eq!(table.len(), last + 1);
        for (row, cells) in all[..=last].iter().enumerate() {
            for (column, cell) in cells.iter().enumerate() {
                prop_assert_eq!(table.raw(row, column), cell);
            }
        }
    }
}
