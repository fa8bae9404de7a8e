//! A table as a drawing: a panel for each unit, one above the other, over the same time.

use super::drawing::{Anchor, Colour, Drawing, Point, Shape, Text};
use super::font;
use super::thin::thin;
use super::ticks::Ticks;
use crate::table::{Series, Table};
use std::collections::BTreeSet;

/// What can be chosen.
#[derive(Clone, Debug)]
pub(super) struct Style {
    pub(super) title: String,
    /// In pixels.
    pub(super) width: u32,
    /// Of the whole; by default as many panels need.
    pub(super) height: Option<u32>,
}

/// The most panels that are drawn.
const MOST_PANELS: u32 = 24;

/// Okabe and Ito's colours, which people who see colours otherwise can tell from each other.
const COLOURS: [Colour; 7] = [0x00_72b2, 0xd5_5e00, 0x00_9e73, 0xcc_79a7, 0xe6_9f00, 0x56_b4e9, 0x22_2222];

const INK: Colour = 0x22_2222;
const FAINT: Colour = 0x66_6666;
const GRID: Colour = 0xe4_e4e4;
const FRAME: Colour = 0x99_9999;
const PAPER: Colour = 0xff_ffff;

const TITLE: f64 = 19.0;
const LETTERS: f64 = 13.0;
/// From one line of letters to the next.
const LINE: f64 = 20.0;

/// Room beside the panels: for labels on the left.
const LEFT: f64 = 104.0;
const RIGHT: f64 = 28.0;
const TOP: f64 = 62.0;
const BOTTOM: f64 = 54.0;
/// Room above a panel, for its legend.
const LEGEND: f64 = 30.0;
/// How high a panel is with its legend, where no height is given.
const PANEL: u32 = 270;

/// Draws a table.
pub(super) fn picture(table: &Table, style: &Style) -> Result<Drawing, String> {
    let panels = panels(&table.series);
    let count = u32::try_from(panels.len()).unwrap_or(u32::MAX);
    if count > MOST_PANELS {
        return Err(format!(
            "there are {count} units, and each is a panel of its own; choose with --columns"
        ));
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a constant")]
    let height = style.height.unwrap_or(count * PANEL + (TOP + BOTTOM) as u32);
    let time = TimeAxis::of(&table.times, f64::from(style.width))?;
    let mut shapes = vec![Shape::Area {
        from: (0.0, 0.0),
        to: (f64::from(style.width), f64::from(height)),
        colour: PAPER,
    }];
    shapes.push(text((LEFT, 30.0), Anchor::Start, TITLE, INK, &style.title));
    if let Some(started) = &table.started {
        shapes.push(text((LEFT, 50.0), Anchor::Start, LETTERS, FAINT, &format!("from {started}")));
    }
    let each = (f64::from(height) - TOP - BOTTOM) / f64::from(count.max(1));
    for (number, panel) in (0_u32..).zip(&panels) {
        let top = TOP + f64::from(number) * each;
        let frame = Frame { top: top + LEGEND, bottom: top + each, time: &time };
        frame.draw(panel, &mut shapes)?;
        if number + 1 == count {
            frame.draw_time(&mut shapes);
        }
    }
    Ok(Drawing { width: style.width, height, shapes })
}

/// Quantities of one unit, with their colours.
struct Panel<'a> {
    unit: &'a str,
    series: Vec<(&'a Series, Colour)>,
}

impl Panel<'_> {
    /// The colour of the axis with this number, which it has in all panels; another when that is taken here.
    fn free_colour(&self, number: usize) -> Colour {
        let taken = |colour: &Colour| self.series.iter().any(|(_, taken)| taken == colour);
        let mut colours = (number..number + COLOURS.len()).map(|place| COLOURS[place % COLOURS.len()]);
        colours.find(|colour| !taken(colour)).unwrap_or(COLOURS[self.series.len() % COLOURS.len()])
    }

    /// What stands beside it: the quantity when there is but one, and the unit.
    fn label(&self) -> String {
        let names = self.series.iter().map(|(series, _)| quantity(&series.column.name));
        let mut names: Vec<&str> = names.collect();
        names.dedup();
        match (names.as_slice(), self.unit) {
            ([name], "") => (*name).to_owned(),
            ([name], unit) => format!("{name} [{unit}]"),
            (_, unit) => unit.to_owned(),
        }
    }
}

/// The axis of a name.
fn axis(name: &str) -> &str {
    name.rsplit_once('.').map_or("", |(axis, _)| axis)
}

/// A name without the axis'.
fn quantity(name: &str) -> &str {
    name.rsplit_once('.').map_or(name, |(_, quantity)| quantity)
}

/// Series by unit, in the order in which the units come first.
fn panels(all: &[Series]) -> Vec<Panel<'_>> {
    let mut axes: Vec<&str> = all.iter().map(|series| axis(&series.column.name)).collect();
    let mut before = BTreeSet::new();
    axes.retain(|axis| before.insert(*axis));
    let mut panels: Vec<Panel<'_>> = Vec::new();
    for series in all {
        let unit = series.column.unit.as_str();
        let place = panels.iter().position(|panel| panel.unit == unit).unwrap_or_else(|| {
            panels.push(Panel { unit, series: Vec::new() });
            panels.len() - 1
        });
        let number = axes.iter().position(|other| *other == axis(&series.column.name)).unwrap_or(0);
        if let Some(panel) = panels.get_mut(place) {
            let colour = panel.free_colour(number);
            panel.series.push((series, colour));
        }
    }
    panels
}

/// Time, from left to right.
struct TimeAxis<'a> {
    times: &'a [f64],
    /// Seconds in its unit.
    unit: f64,
    name: &'static str,
    from: f64,
    to: f64,
    left: f64,
    right: f64,
    ticks: Ticks,
}

impl TimeAxis<'_> {
    fn of(times: &[f64], width: f64) -> Result<TimeAxis<'_>, String> {
        let (Some(first), Some(last)) = (times.first(), times.last()) else {
            return Err("there are no rows in it".to_owned());
        };
        let (unit, name) = match last - first {
            span if span > 3.0 * 3600.0 => (3600.0, "h"),
            span if span > 180.0 => (60.0, "min"),
            _ => (1.0, "s"),
        };
        // The first row is a moment after the beginning.
        let first = if (0.0..(last - first) * 0.02).contains(first) { &0.0 } else { first };
        let (from, to) = (first / unit, last / unit);
        let to = if to > from { to } else { from + 1.0 };
        let (left, right) = (LEFT, width - RIGHT);
        let ticks = Ticks::between(from, to, ((right - left) / 90.0).max(2.0));
        Ok(TimeAxis { times, unit, name, from, to, left, right, ticks })
    }

    /// Where a time in its unit is.
    fn x(&self, time: f64) -> f64 {
        self.left + (time - self.from) / (self.to - self.from) * (self.right - self.left)
    }
}

/// A panel's place.
struct Frame<'a> {
    top: f64,
    bottom: f64,
    time: &'a TimeAxis<'a>,
}

impl Frame<'_> {
    fn draw(&self, panel: &Panel<'_>, shapes: &mut Vec<Shape>) -> Result<(), String> {
        let (low, high) = range(panel)?;
        let y = |value: f64| self.bottom - (value - low) / (high - low) * (self.bottom - self.top);
        let ticks = Ticks::between(low, high, ((self.bottom - self.top) / 42.0).max(2.0));
        let (left, right) = (self.time.left, self.time.right);
        for time in &self.time.ticks.values {
            shapes.push(thin_line((self.time.x(*time), self.top), (self.time.x(*time), self.bottom), GRID));
        }
        for value in &ticks.values {
            shapes.push(thin_line((left, y(*value)), (right, y(*value)), GRID));
            let label = ticks.label(*value);
            shapes.push(text((left - 8.0, y(*value) + 4.5), Anchor::End, LETTERS, INK, &label));
        }
        let corners = [
            (left, self.top),
            (right, self.top),
            (right, self.bottom),
            (left, self.bottom),
            (left, self.top),
        ];
        shapes.push(Shape::Line { points: corners.to_vec(), colour: FRAME, width: 1.0 });
        shapes.push(Shape::Text(Text {
            at: (24.0, f64::midpoint(self.top, self.bottom)),
            anchor: Anchor::Middle,
            size: LETTERS,
            colour: INK,
            upward: true,
            words: panel.label(),
        }));
        for (series, colour) in &panel.series {
            self.draw_series(series, *colour, y, shapes);
        }
        self.draw_legend(panel, shapes);
        Ok(())
    }

    /// Draws a line through what is there; where nothing is, the line has a gap.
    fn draw_series(&self, series: &Series, colour: Colour, y: impl Fn(f64) -> f64, shapes: &mut Vec<Shape>) {
        let points = self.time.times.iter().zip(&series.values);
        let points: Vec<Option<Point>> = points
            .map(|(time, value)| value.map(|value| (self.time.x(time / self.time.unit), y(value))))
            .collect();
        for run in points.split(Option::is_none).filter(|run| !run.is_empty()) {
            let points = thin(run.iter().copied().flatten().collect());
            let width = if points.len() == 1 { 3.0 } else { 1.8 };
            shapes.push(Shape::Line { points, colour, width });
        }
    }

    /// The legend above the panel, as far as there is room.
    fn draw_legend(&self, panel: &Panel<'_>, shapes: &mut Vec<Shape>) {
        let (mut left, line) = (self.time.left, self.top - 9.0);
        for (number, (series, colour)) in panel.series.iter().enumerate() {
            let name = &series.column.name;
            let width = 26.0 + font::width(name, LETTERS) + 22.0;
            if number > 0 && left + width > self.time.right {
                let more = format!("and {} more", panel.series.len() - number);
                shapes.push(text((left, line), Anchor::Start, LETTERS, FAINT, &more));
                return;
            }
            let sample = vec![(left + 1.0, line - 4.5), (left + 19.0, line - 4.5)];
            shapes.push(Shape::Line { points: sample, colour: *colour, width: 2.6 });
            shapes.push(text((left + 26.0, line), Anchor::Start, LETTERS, INK, name));
            left += width;
        }
    }

    fn draw_time(&self, shapes: &mut Vec<Shape>) {
        let time = self.time;
        for value in &time.ticks.values {
            let at = (time.x(*value), self.bottom + LINE);
            shapes.push(text(at, Anchor::Middle, LETTERS, INK, &time.ticks.label(*value)));
        }
        let at = (f64::midpoint(time.left, time.right), self.bottom + 2.0 * LINE);
        shapes.push(text(at, Anchor::Middle, LETTERS, INK, &format!("time [{}]", time.name)));
    }
}

/// From where to where a panel goes: what its quantities do, and a little more.
fn range(panel: &Panel<'_>) -> Result<(f64, f64), String> {
    let values = || panel.series.iter().flat_map(|(series, _)| series.values.iter().copied().flatten());
    let (Some(low), Some(high)) = (values().reduce(f64::min), values().reduce(f64::max)) else {
        return Ok((0.0, 1.0));
    };
    let more = match high - low {
        span if span > low.abs().max(high.abs()) * 1e-9 => span * 0.06,
        _ => high.abs().max(low.abs()).mul_add(0.1, f64::from(u8::from(high == 0.0 && low == 0.0))),
    };
    let (low, high) = (low - more, high + more);
    let can_be_drawn = (high - low).is_finite() && high > low;
    if can_be_drawn {
        Ok((low, high))
    } else {
        Err(format!("the values in `{}` cannot be drawn", panel.label()))
    }
}

fn thin_line(from: Point, to: Point, colour: Colour) -> Shape {
    Shape::Line { points: vec![from, to], colour, width: 1.0 }
}

fn text(at: Point, anchor: Anchor, size: f64, colour: Colour, words: &str) -> Shape {
    Shape::Text(Text { at, anchor, size, colour, upward: false, words: words.to_owned() })
}
