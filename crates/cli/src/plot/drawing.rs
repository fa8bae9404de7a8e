//! A drawing: shapes in the order in which they are drawn, and how SVG writes them.

use std::fmt::Write as _;

/// A place, in pixels from the upper left corner.
pub(super) type Point = (f64, f64);

/// A colour as 0xRRGGBB.
pub(super) type Colour = u32;

/// Which part of a text stands at its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// A line of text.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Text {
    /// Where it stands: its anchor, on the line that the letters stand on.
    pub(super) at: Point,
    pub(super) anchor: Anchor,
    /// In pixels.
    pub(super) size: f64,
    pub(super) colour: Colour,
    /// Whether it is read from below.
    pub(super) upward: bool,
    pub(super) words: String,
}

/// Something that is drawn.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Shape {
    /// A line through points; a dot where there is one.
    Line {
        points: Vec<Point>,
        colour: Colour,
        width: f64,
    },
    /// A filled rectangle: two opposite corners.
    Area {
        from: Point,
        to: Point,
        colour: Colour,
    },
    Text(Text),
}

/// A drawing.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Drawing {
    /// In pixels.
    pub(super) width: u32,
    /// In pixels.
    pub(super) height: u32,
    pub(super) shapes: Vec<Shape>,
}

impl Drawing {
    /// The drawing as SVG.
    pub(super) fn svg(&self) -> String {
        let (width, height) = (self.width, self.height);
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" \
             font-family=\"DejaVu Sans, Verdana, sans-serif\" fill=\"none\" stroke-linecap=\"round\" \
             stroke-linejoin=\"round\">\n"
        );
        for shape in &self.shapes {
            // Writing to a String does not fail.
            let _ = match shape {
                Shape::Line { points, colour, width } => writeln!(
                    svg,
                    "<path d=\"{}\" stroke=\"#{colour:06x}\" stroke-width=\"{width}\"/>",
                    path(points)
                ),
                Shape::Area { from, to, colour } => writeln!(
                    svg,
                    "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"#{colour:06x}\"/>",
                    number(from.0.min(to.0)),
                    number(from.1.min(to.1)),
                    number((to.0 - from.0).abs()),
                    number((to.1 - from.1).abs())
                ),
                Shape::Text(text) => writeln!(svg, "{}", text_element(text)),
            };
        }
        svg + "</svg>\n"
    }
}

fn path(points: &[Point]) -> String {
    let mut path = String::new();
    for (number, point) in points.iter().enumerate() {
        path.push(if number == 0 { 'M' } else { 'L' });
        path.push_str(&place(*point));
    }
    if points.len() == 1 {
        // A line of no length with round ends is a dot.
        path.push_str("h0");
    }
    path
}

fn text_element(text: &Text) -> String {
    let anchor = match text.anchor {
        Anchor::Start => "start",
        Anchor::Middle => "middle",
        Anchor::End => "end",
    };
    let (x, y) = (number(text.at.0), number(text.at.1));
    let turned = if text.upward { format!(" transform=\"rotate(-90 {x} {y})\"") } else { String::new() };
    format!(
        "<text x=\"{x}\" y=\"{y}\" font-size=\"{}\" text-anchor=\"{anchor}\" fill=\"#{:06x}\"{turned}>{}</text>",
        text.size,
        text.colour,
        escaped(&text.words)
    )
}

fn place(point: Point) -> String {
    format!("{} {}", number(point.0), number(point.1))
}

/// A coordinate to the hundredth of a pixel.
fn number(value: f64) -> String {
    let text = format!("{value:.2}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// A text as XML has it. Characters that XML has no room for become a mark.
fn escaped(text: &str) -> String {
    let mut escaped = String::new();
    for letter in text.chars() {
        match letter {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            letter if letter.is_control() || matches!(letter, '\u{fffe}' | '\u{ffff}') => {
                escaped.push('\u{fffd}');
            }
            letter => escaped.push(letter),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_others_cannot_break_the_drawing() {
        assert_eq!(escaped("a<b>&\"c\"\u{0}\n"), "a&lt;b&gt;&amp;\"c\"\u{fffd}\u{fffd}");
    }

    #[test]
    fn coordinates_are_short() {
        assert_eq!(path(&[(1.0, 2.5), (1.0 / 3.0, -0.001)]), "M1 2.5L0.33 -0");
        assert_eq!(path(&[(1.0, 2.0)]), "M1 2h0");
    }
}
