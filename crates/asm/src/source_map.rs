//! From words back to the text they come from.

use crate::diagnostic::Place;
use crate::source::Span;
use std::collections::BTreeMap;
use stepdrive_spec::smsd::instructions::PROGRAM_AREAS;

/// Which part of the text each instruction comes from, and what the labels are called.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SourceMap {
    areas: [Vec<Span>; PROGRAM_AREAS],
    labels: BTreeMap<Place, String>,
}

impl SourceMap {
    pub(crate) fn set_area(&mut self, memory: u8, spans: Vec<Span>) {
        if let Some(area) = self.areas.get_mut(usize::from(memory)) {
            *area = spans;
        }
    }

    pub(crate) fn name(&mut self, place: Place, label: &str) {
        self.labels.entry(place).or_insert_with(|| label.to_owned());
    }

    /// The statement that became the instruction at `place`.
    pub fn span(&self, place: Place) -> Option<Span> {
        self.areas.get(usize::from(place.memory))?.get(usize::from(place.line)).copied()
    }

    /// A label of that place, as written.
    pub fn label(&self, place: Place) -> Option<&str> {
        self.labels.get(&place).map(String::as_str)
    }

    /// Every place that has a label, with one of its labels.
    pub fn labels(&self) -> impl Iterator<Item = (Place, &str)> {
        self.labels.iter().map(|(place, name)| (*place, name.as_str()))
    }

    /// The nearest label at or above `place` in its memory, and how many instructions below it the place is.
    pub fn nearest_label(&self, place: Place) -> Option<(&str, u8)> {
        let first = Place { line: 0, ..place };
        let (at, name) = self.labels.range(first..=place).next_back()?;
        Some((name, place.line - at.line))
    }

    /// The instruction that comes from the statement around a byte of the text.
    pub fn place(&self, offset: usize) -> Option<Place> {
        (0..).zip(&self.areas).find_map(|(memory, spans)| {
            let after = spans.partition_point(|span| span.start <= offset);
            let line = after.checked_sub(1)?;
            let inside = spans.get(line).is_some_and(|span| offset < span.end);
            inside.then(|| Some(Place { memory, line: u8::try_from(line).ok()? })).flatten()
        })
    }
}
