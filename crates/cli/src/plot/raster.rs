//! A drawing as PNG.

use super::drawing::{Anchor, Colour, Drawing, Point, Shape, Text};
use super::font;
use tiny_skia::{Color, FillRule, LineCap, LineJoin, Paint, PathBuilder, Pixmap, Stroke, Transform};

/// Pixels to a pixel of the drawing, each way, so that it looks well on dense screens and in print.
const DENSITY: u8 = 2;

/// The drawing as the bytes of a PNG.
pub(super) fn png(drawing: &Drawing) -> Result<Vec<u8>, String> {
    let (width, height) = (drawing.width * u32::from(DENSITY), drawing.height * u32::from(DENSITY));
    let mut pixmap =
        Pixmap::new(width, height).ok_or_else(|| format!("{width}x{height} pixels are too many"))?;
    pixmap.fill(Color::WHITE);
    for shape in &drawing.shapes {
        draw(&mut pixmap, shape);
    }
    pixmap.encode_png().map_err(|error| error.to_string())
}

fn draw(pixmap: &mut Pixmap, shape: &Shape) {
    let dense = Transform::from_scale(f32::from(DENSITY), f32::from(DENSITY));
    match shape {
        Shape::Line { points, colour, width } => {
            let stroke = Stroke {
                width: single(*width),
                line_cap: LineCap::Round,
                line_join: LineJoin::Round,
                ..Stroke::default()
            };
            if let Some(path) = line(points) {
                pixmap.stroke_path(&path, &paint(*colour), &stroke, dense, None);
            }
        }
        Shape::Area { from, to, colour } => {
            let mut path = PathBuilder::new();
            path.move_to(single(from.0), single(from.1));
            path.line_to(single(to.0), single(from.1));
            path.line_to(single(to.0), single(to.1));
            path.line_to(single(from.0), single(to.1));
            path.close();
            if let Some(path) = path.finish() {
                pixmap.fill_path(&path, &paint(*colour), FillRule::Winding, dense, None);
            }
        }
        Shape::Text(text) => draw_text(pixmap, text, dense),
    }
}

fn draw_text(pixmap: &mut Pixmap, text: &Text, dense: Transform) {
    let width = font::width(&text.words, text.size);
    let before = match text.anchor {
        Anchor::Start => 0.0,
        Anchor::Middle => width / 2.0,
        Anchor::End => width,
    };
    let mut path = PathBuilder::new();
    font::outline(&text.words, text.size, &mut Letters { path: &mut path, left: -before });
    let turn = if text.upward { Transform::from_rotate(-90.0) } else { Transform::identity() };
    let placed = turn.post_translate(single(text.at.0), single(text.at.1)).post_concat(dense);
    if let Some(path) = path.finish() {
        pixmap.fill_path(&path, &paint(text.colour), FillRule::Winding, placed, None);
    }
}

/// Letters that become a path.
struct Letters<'a> {
    path: &'a mut PathBuilder,
    /// Where the text begins.
    left: f64,
}

impl Letters<'_> {
    fn at(&self, point: Point) -> (f32, f32) {
        (single(point.0 + self.left), single(point.1))
    }
}

impl font::Pen for Letters<'_> {
    fn begin(&mut self, at: Point) {
        let (x, y) = self.at(at);
        self.path.move_to(x, y);
    }

    fn line(&mut self, to: Point) {
        let (x, y) = self.at(to);
        self.path.line_to(x, y);
    }

    fn bend(&mut self, by: Point, to: Point) {
        let ((x1, y1), (x, y)) = (self.at(by), self.at(to));
        self.path.quad_to(x1, y1, x, y);
    }

    fn close(&mut self) {
        self.path.close();
    }
}

fn line(points: &[Point]) -> Option<tiny_skia::Path> {
    let mut path = PathBuilder::new();
    let (first, rest) = points.split_first()?;
    path.move_to(single(first.0), single(first.1));
    if rest.is_empty() {
        path.line_to(single(first.0), single(first.1));
    }
    for point in rest {
        path.line_to(single(point.0), single(point.1));
    }
    path.finish()
}

fn paint(colour: Colour) -> Paint<'static> {
    let [_, red, green, blue] = colour.to_be_bytes();
    let mut paint = Paint { anti_alias: true, ..Paint::default() };
    paint.set_color_rgba8(red, green, blue, 255);
    paint
}

#[allow(clippy::cast_possible_truncation, reason = "pixels need no more")]
fn single(value: f64) -> f32 {
    value as f32
}
