//! Rows of text in columns.

/// A column: its heading, and whether it holds numbers.
pub(crate) type Column = (&'static str, Align);

/// Where the cells of a column stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Align {
    /// Text, at the left.
    Left,
    /// Numbers, at the right.
    Right,
}

/// The heading and the rows as lines, two spaces between columns and none at the end.
pub(crate) fn table<const N: usize>(columns: [Column; N], rows: &[[String; N]]) -> Vec<String> {
    let heading = columns.map(|(heading, _)| heading.to_owned());
    let widths: [usize; N] = std::array::from_fn(|column| {
        let cells = rows.iter().map(|row| width(&row[column]));
        cells.max().unwrap_or(0).max(width(&heading[column]))
    });
    let lines = std::iter::once(&heading).chain(rows);
    lines.map(|cells| line(columns, widths, cells)).collect()
}

fn line<const N: usize>(columns: [Column; N], widths: [usize; N], cells: &[String; N]) -> String {
    let padded: [String; N] = std::array::from_fn(|column| {
        let cell = &cells[column];
        let pad = " ".repeat(widths[column] - width(cell));
        match columns[column].1 {
            Align::Left => format!("{cell}{pad}"),
            Align::Right => format!("{pad}{cell}"),
        }
    });
    padded.join("  ").trim_end().to_owned()
}

/// The lines as one text.
pub(crate) fn text(lines: &[String]) -> String {
    lines.iter().flat_map(|line| [line, "\n"]).collect()
}

/// How many characters of a terminal a text takes. Names and makers' terms are in letters that take one each.
fn width(text: &str) -> usize {
    text.chars().count()
}

/// A number in as few digits as say it, up to three decimals.
pub(crate) fn number(value: f64) -> String {
    let text = format!("{value:.3}");
    let short = text.trim_end_matches('0').trim_end_matches('.');
    if short == "-0" { "0".to_owned() } else { short.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(name: &str, count: &str) -> [String; 2] {
        [name.to_owned(), count.to_owned()]
    }

    #[test]
    fn columns_are_as_wide_as_their_widest_cell() {
        let columns = [("NAME", Align::Left), ("N", Align::Right)];
        let lines = table(columns, &[row("µ", "10"), row("stage", "7")]);
        assert_eq!(lines, ["NAME    N", "µ      10", "stage   7"]);
        assert_eq!(table(columns, &[]), ["NAME  N"]);
    }

    #[test]
    fn an_empty_cell_at_the_end_leaves_no_spaces() {
        let lines = table([("A", Align::Left), ("B", Align::Left)], &[row("a", "")]);
        assert_eq!(lines, ["A  B", "a"]);
    }

    #[test]
    fn numbers_have_no_more_digits_than_say_them() {
        for (value, text) in
            [(0.0, "0"), (-0.0001, "0"), (100.0, "100"), (-2.5, "-2.5"), (1.0 / 3.0, "0.333")]
        {
            assert_eq!(number(value), text);
        }
    }
}
