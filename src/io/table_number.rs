//! Numbers in cells of tables, with decimal points or decimal commas.

/// What a cell looks like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shape {
    /// A number without point and comma.
    Whole,
    /// A number with a decimal point.
    Point,
    /// A number with a decimal comma.
    Comma,
    /// Digits with one comma before three of them: `1,234` may be either.
    Group,
    /// Digits in groups of three, which cannot be anything else: `1.234,5`, `1,234,567`.
    Groups,
    /// No number.
    Word,
}

/// What `cell` looks like.
pub(super) fn shape(cell: &str) -> Shape {
    let commas = cell.bytes().filter(|b| *b == b',').count();
    let points = cell.bytes().filter(|b| *b == b'.').count();
    match (commas, points) {
        (0, 0 | 1) => match cell.parse::<f64>() {
            Ok(_) if points == 1 => Shape::Point,
            Ok(_) => Shape::Whole,
            Err(_) => Shape::Word,
        },
        (1, 0) if number(cell, true).is_none() => Shape::Word,
        (1, 0) if grouped(cell, ",") => Shape::Group,
        (1, 0) => Shape::Comma,
        _ => {
            // The last sign may be the decimal one.
            let last = cell.rfind([',', '.']).unwrap_or(0);
            let decimal = (commas == 1 || points == 1) && commas + points > 1 && commas.min(points) > 0;
            let head = if decimal { &cell[..last] } else { cell };
            let sign = if decimal == (cell[last..].starts_with(',')) { "." } else { "," };
            let tail = cell[last + 1..].bytes().all(|b| b.is_ascii_digit());
            if grouped(head, sign) && tail { Shape::Groups } else { Shape::Word }
        }
    }
}

/// Whether `text` is digits in groups of three, set apart by `sign`.
fn grouped(text: &str, sign: &str) -> bool {
    let mut groups = text.trim_start_matches(['+', '-']).split(sign);
    let digits = |g: &str| !g.is_empty() && g.bytes().all(|b| b.is_ascii_digit());
    let first = groups.next().is_some_and(|g| digits(g) && g.len() <= 3 && !g.starts_with('0'));
    let mut rest = groups.peekable();
    first && rest.peek().is_some() && rest.all(|g| digits(g) && g.len() == 3)
}

/// The value of a cell.
pub(super) fn number(cell: &str, decimal_comma: bool) -> Option<f64> {
    if decimal_comma && cell.contains(',') {
        return if cell.contains('.') { None } else { cell.replacen(',', ".", 1).parse().ok() };
    }
    cell.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_of_numbers() {
        for (cell, expected) in [
            ("12", Shape::Whole),
            ("-1e5", Shape::Whole),
            ("nan", Shape::Whole),
            ("1.5", Shape::Point),
            ("1.234", Shape::Point),
            (".5", Shape::Point),
            ("0,5", Shape::Comma),
            ("-1,25e-3", Shape::Comma),
            ("1,2345", Shape::Comma),
            ("0,125", Shape::Comma),
            ("1234,567", Shape::Comma),
            (",5", Shape::Comma),
            ("1,234", Shape::Group),
            ("-12,345", Shape::Group),
            ("1.234,5", Shape::Groups),
            ("1,234.5", Shape::Groups),
            ("1,234,567", Shape::Groups),
            ("1.234.567", Shape::Groups),
            ("12.345.678,90", Shape::Groups),
            ("1,234,567.5", Shape::Groups),
            ("", Shape::Word),
            ("a", Shape::Word),
            ("1,a", Shape::Word),
            ("1,2,3", Shape::Word),
            ("1.2.3", Shape::Word),
            ("1..2", Shape::Word),
            ("0x10", Shape::Word),
            (",", Shape::Word),
            (".,", Shape::Word),
        ] {
            assert_eq!(shape(cell), expected, "{cell:?}");
        }
        assert_eq!((number("1,5", true), number("1,5", false), number("1,5.", true)), (Some(1.5), None, None));
    }
}
