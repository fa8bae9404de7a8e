//! What the rotor moves: a carriage on a travel, and the switches along it.
//!
//! Places are whole numbers of [`ROTOR_UNITS`] to the full step, the finest microstep of either family of
//! controllers, so that every microstep is represented exactly.

use stepdrive_drive::controller::ROTOR_UNITS;
use stepdrive_motion::Direction;

/// A travel with hard ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Travel {
    low: i64,
    high: i64,
}

impl Travel {
    /// The travel between two places in full steps; `None` when they leave nothing between them.
    pub fn between([low, high]: [f64; 2]) -> Option<Travel> {
        interval([low, high]).map(|(low, high)| Travel { low, high })
    }
}

/// A switch that is closed along part of the travel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Switch<S> {
    /// The input it is wired to.
    pub input: S,
    low: i64,
    high: i64,
}

impl<S> Switch<S> {
    /// A switch closed between two places in full steps, both included; `None` when no microstep lies between them.
    pub fn new(input: S, closed: [f64; 2]) -> Option<Switch<S>> {
        interval(closed).map(|(low, high)| Switch { input, low, high })
    }

    /// Whether it is closed with the carriage at `place`.
    pub fn closed(&self, place: i64) -> bool {
        (self.low..=self.high).contains(&place)
    }

    /// The next place in `direction` from `place` at which it opens or closes.
    fn next_edge(&self, place: i64, direction: Direction) -> Option<i64> {
        let (entry, exit) = match direction {
            Direction::Forward => (self.low, self.high + 1),
            Direction::Reverse => (self.high, self.low - 1),
        };
        [entry, exit].into_iter().find(|edge| ahead(place, *edge, direction))
    }
}

/// The whole units within an interval in full steps.
fn interval([low, high]: [f64; 2]) -> Option<(i64, i64)> {
    let units = ROTOR_UNITS as f64;
    #[allow(
        clippy::cast_possible_truncation,
        reason = "`as` saturates; rig files allow up to 1e9 full steps"
    )]
    let (low, high) = (libm::ceil(low * units) as i64, libm::floor(high * units) as i64);
    (low <= high).then_some((low, high))
}

fn ahead(from: i64, to: i64, direction: Direction) -> bool {
    match direction {
        Direction::Forward => to > from,
        Direction::Reverse => to < from,
    }
}

/// How a carriage followed its rotor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// The rotor was not driven.
    None,
    /// All the way.
    Free,
    /// At first, and then not: the last steps were lost.
    CutShort,
    /// Not at all: every step was lost.
    Held,
}

/// A carriage that follows the rotor between the ends of its travel.
///
/// At an end it stays while the rotor is driven further: the rotor stalls and the steps are lost. It comes away as soon
/// as the rotor turns back.
#[derive(Clone, Copy, Debug)]
pub struct Mechanics {
    travel: Option<Travel>,
    /// Whether the carriage is held where it is.
    blocked: bool,
    /// A place of the carriage, and the rotor's place there.
    place: i64,
    rotor: i64,
}

impl Mechanics {
    /// A carriage at `start` full steps, moved into the travel if it has one, with the rotor at its place 0.
    pub fn new(travel: Option<Travel>, start: f64) -> Mechanics {
        #[allow(
            clippy::cast_possible_truncation,
            reason = "`as` saturates; rig files allow up to 1e9 full steps"
        )]
        let place = libm::round(start * ROTOR_UNITS as f64) as i64;
        let mechanics = Mechanics { travel, blocked: false, place, rotor: 0 };
        Mechanics { place: mechanics.clamp(place), ..mechanics }
    }

    /// The carriage's place with the rotor at `rotor`. Since [`Mechanics::follow`] was last called the rotor must have
    /// gone one way only.
    pub fn place(&self, rotor: i64) -> i64 {
        if self.blocked {
            return self.place;
        }
        self.clamp(self.place.saturating_add(rotor.saturating_sub(self.rotor)))
    }

    /// Takes the carriage along to where the rotor is now, and says how it went.
    pub fn follow(&mut self, rotor: i64) -> Way {
        let place = self.place(rotor);
        let driven = rotor.saturating_sub(self.rotor);
        let gone = place.saturating_sub(self.place);
        (self.place, self.rotor) = (place, rotor);
        match (driven, gone) {
            (0, _) => Way::None,
            (_, 0) => Way::Held,
            _ if driven == gone => Way::Free,
            _ => Way::CutShort,
        }
    }

    /// Holds the carriage where it was last taken along to, or lets it go.
    pub fn block(&mut self, blocked: bool) {
        self.blocked = blocked;
    }

    /// The rotor's place counts from `rotor` on, with the carriage where it is: the controller was switched on anew.
    pub fn restart(&mut self, rotor: i64) {
        self.rotor = rotor;
    }

    /// Whether the rotor, turning in `direction`, is held or being driven against an end.
    pub fn stalled(&self, rotor: i64, direction: Direction) -> bool {
        let place = self.place(rotor);
        let at_end = self.travel.is_some_and(|travel| match direction {
            Direction::Forward => place >= travel.high,
            Direction::Reverse => place <= travel.low,
        });
        at_end || self.blocked
    }

    /// The rotor's place at which the next of `switches` changes, turning in `direction` from `rotor`.
    pub fn next_edge<S>(&self, switches: &[Switch<S>], rotor: i64, direction: Direction) -> Option<i64> {
        if self.blocked {
            return None;
        }
        let place = self.place(rotor);
        let edges = switches.iter().filter_map(|switch| switch.next_edge(place, direction));
        let nearest = edges.min_by_key(|edge| edge.abs_diff(place))?;
        (self.clamp(nearest) == nearest).then_some(rotor.saturating_add(nearest.saturating_sub(place)))
    }

    fn clamp(&self, place: i64) -> i64 {
        self.travel.map_or(place, |travel| place.clamp(travel.low, travel.high))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Direction::{Forward, Reverse};
    use stepdrive_spec::smsd::inputs::Input;

    const STEP: i64 = ROTOR_UNITS;

    fn stage() -> Mechanics {
        Mechanics::new(Travel::between([-10.0, 10.0]), 0.0)
    }

    #[test]
    fn the_carriage_stops_at_an_end_and_leaves_it_as_soon_as_the_rotor_turns_back() {
        let mut stage = stage();
        stage.follow(15 * STEP);
        assert_eq!(stage.place(15 * STEP), 10 * STEP);
        assert!(stage.stalled(15 * STEP, Forward));
        assert_eq!(stage.place(12 * STEP), 7 * STEP);
        assert!(!stage.stalled(15 * STEP, Reverse));
    }

    #[test]
    fn steps_beyond_an_end_are_lost_and_told() {
        let mut stage = stage();
        assert_eq!(stage.follow(10 * STEP), Way::Free);
        assert_eq!(stage.follow(10 * STEP), Way::None);
        assert_eq!(stage.follow(10 * STEP + 1), Way::Held);
        assert_eq!(stage.follow(10 * STEP), Way::Free);
        assert_eq!(stage.follow(-11 * STEP), Way::CutShort);
    }

    #[test]
    fn a_start_outside_the_travel_is_moved_to_its_end() {
        let stage = Mechanics::new(Travel::between([-10.0, 10.0]), 99.0);
        assert_eq!(stage.place(0), 10 * STEP);
    }

    #[test]
    fn a_carriage_that_is_held_loses_steps_both_ways_and_meets_no_switch() {
        let mut stage = stage();
        stage.follow(2 * STEP);
        stage.block(true);
        assert!(stage.stalled(2 * STEP, Forward) && stage.stalled(2 * STEP, Reverse));
        let ahead = [Switch::new(Input::In0, [3.0, 4.0]).expect("not empty")];
        assert_eq!(stage.next_edge(&ahead, 2 * STEP, Forward), None);
        stage.follow(5 * STEP);
        stage.block(false);
        assert_eq!(stage.place(6 * STEP), 3 * STEP);
    }

    #[test]
    fn the_next_edge_is_the_nearest_that_lies_ahead() {
        let stage = stage();
        let near = Switch::new(Input::In0, [2.0, 3.0]).expect("not empty");
        let far = Switch::new(Input::In1, [5.0, 6.0]).expect("not empty");
        let both = [far, near];
        assert_eq!(stage.next_edge(&both, 0, Forward), Some(2 * STEP));
        assert_eq!(stage.next_edge(&both, 2 * STEP, Forward), Some(3 * STEP + 1));
        assert_eq!(stage.next_edge(&both, 4 * STEP, Reverse), Some(3 * STEP));
        assert_eq!(stage.next_edge(&both, 7 * STEP, Forward), None);
    }

    #[test]
    fn an_edge_beyond_the_end_of_the_travel_never_comes() {
        let beyond = [Switch::new(Input::In0, [8.0, 12.0]).expect("not empty")];
        assert_eq!(stage().next_edge(&beyond, 0, Forward), Some(8 * STEP));
        assert_eq!(stage().next_edge(&beyond, 9 * STEP, Forward), None);
    }

    #[test]
    fn an_interval_that_no_microstep_meets_makes_no_switch() {
        assert_eq!(Switch::new(Input::In0, [0.001, 0.002]), None);
        assert!(Switch::new(Input::In0, [0.0, 0.002]).is_some());
    }
}
