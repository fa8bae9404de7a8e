//! The letters of a drawing: `DejaVu Sans`, cut down to Latin-1. SVG names the whole one and leaves the choice to the viewer.

use super::drawing::Point;
use ttf_parser::{Face, GlyphId, OutlineBuilder};

/// See fonts/LICENSE-DejaVu.
const FONT: &[u8] = include_bytes!("../../fonts/DejaVuSans-Latin.ttf");

/// What draws the outline of letters.
pub(super) trait Pen {
    /// Begins a contour.
    fn begin(&mut self, at: Point);
    /// Draws a line.
    fn line(&mut self, to: Point);
    /// Draws a quadratic curve.
    fn bend(&mut self, by: Point, to: Point);
    /// Ends a contour.
    fn close(&mut self);
}

/// How wide a text is, in pixels, at a size in pixels.
pub(super) fn width(text: &str, size: f64) -> f64 {
    let Some((face, scale)) = scaled(size) else { return 0.0 };
    text.chars().map(|letter| advance(&face, glyph(&face, letter)) * scale).sum()
}

/// Draws a text that begins at (0, 0), with y downwards.
pub(super) fn outline(text: &str, size: f64, pen: &mut impl Pen) {
    let Some((face, scale)) = scaled(size) else { return };
    let mut left = 0.0;
    for letter in text.chars() {
        let glyph = glyph(&face, letter);
        face.outline_glyph(glyph, &mut Scaled { pen, scale, left });
        left += advance(&face, glyph) * scale;
    }
}

fn scaled(size: f64) -> Option<(Face<'static>, f64)> {
    let face = Face::parse(FONT, 0).ok()?;
    let scale = size / f64::from(face.units_per_em());
    Some((face, scale))
}

/// The letter, or the box that stands for those that the font has not.
fn glyph(face: &Face<'_>, letter: char) -> GlyphId {
    face.glyph_index(letter).unwrap_or(GlyphId(0))
}

fn advance(face: &Face<'_>, glyph: GlyphId) -> f64 {
    face.glyph_hor_advance(glyph).map_or(0.0, f64::from)
}

/// The font's units made pixels.
struct Scaled<'a, P> {
    pen: &'a mut P,
    scale: f64,
    left: f64,
}

impl<P> Scaled<'_, P> {
    fn at(&self, x: f32, y: f32) -> Point {
        (self.left + f64::from(x) * self.scale, -f64::from(y) * self.scale)
    }
}

impl<P: Pen> OutlineBuilder for Scaled<'_, P> {
    fn move_to(&mut self, x: f32, y: f32) {
        self.pen.begin(self.at(x, y));
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.pen.line(self.at(x, y));
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        self.pen.bend(self.at(x1, y1), self.at(x, y));
    }

    fn curve_to(&mut self, _: f32, _: f32, _: f32, _: f32, x: f32, y: f32) {
        // A TrueType font has none.
        self.pen.line(self.at(x, y));
    }

    fn close(&mut self) {
        self.pen.close();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_font_has_what_units_and_numbers_need() {
        let face = Face::parse(FONT, 0).expect("a font");
        for letter in "0123456789.-−+/[]()° µΩ²Å\u{a0}azAZ".chars() {
            assert!(face.glyph_index(letter).is_some(), "{letter:?}");
        }
    }

    #[test]
    fn a_text_is_as_wide_as_its_letters() {
        let digit = width("0", 100.0);
        assert!((60.0..70.0).contains(&digit), "{digit}");
        assert!((width("00", 50.0) - digit).abs() < 1e-9);
        assert!(width("\u{4e2d}", 100.0) > 0.0, "what the font has not is a box");
    }
}
