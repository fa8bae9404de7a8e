//! What has to be set so that a controller is as it is wanted.

use super::key::{Key, printed, resolution_of, same};
use stepdrive_spec::smd3::commands::Command;

/// A setting and its value.
pub type Setting = (Key, f64);

/// A setting that is to be changed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    /// Which.
    pub key: Key,
    /// What it is now; `None` where that cannot be read.
    pub now: Option<f64>,
    /// What is sent.
    pub to: f64,
}

/// A setting that is not as it should be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// Which.
    pub key: Key,
    /// What is wanted.
    pub wanted: f64,
    /// What the controller has.
    pub found: f64,
}

const RES: Key = Key::Smd3(Command::Res);
const VSTART: Key = Key::Smd3(Command::Vstart);
const VSTOP: Key = Key::Smd3(Command::Vstop);

/// The resolution that there is when what is wanted is in force over what there is now.
pub fn resolution(wanted: &[Setting], now: &[Setting]) -> u16 {
    let res = value(wanted, RES).or_else(|| value(now, RES));
    res.map_or(0, resolution_of)
}

/// The first setting that cannot be as it is wanted, at the resolution that there will be, and why.
pub fn objection(wanted: &[Setting], now: &[Setting]) -> Option<(Key, String)> {
    let resolution = resolution(wanted, now);
    let refused = |(key, value): &Setting| {
        let why = key.refuses(*value, None, resolution)?;
        Some((*key, format!("{} {why}, not {value}", key.name())))
    };
    wanted.iter().find_map(refused).or_else(|| out_of_order(wanted, now, resolution))
}

/// `VSTART` may not be above `VSTOP`, wherever the two come from.
fn out_of_order(wanted: &[Setting], now: &[Setting], resolution: u16) -> Option<(Key, String)> {
    let key = wanted.iter().map(|(key, _)| *key).find(|key| matches!(*key, VSTART | VSTOP))?;
    let then =
        |key: Key| value(wanted, key).or_else(|| value(now, key)).map(|value| key.made(value, resolution));
    let (start, stop) = (then(VSTART)?, then(VSTOP)?);
    let text = || {
        let (start, stop) = (printed(start), printed(stop));
        format!("VSTART would be {start} Hz and VSTOP {stop} Hz; VSTART may not be above VSTOP")
    };
    (start > stop && !same(start, stop)).then(|| (key, text()))
}

/// What has to be sent, in an order in which the controller takes it.
pub fn changes(wanted: &[Setting], now: &[Setting]) -> Vec<Change> {
    let resolution = resolution(wanted, now);
    let has_new_res = value(now, RES).is_some_and(|res| resolution_of(res) != resolution);
    let mut changes: Vec<Change> = wanted
        .iter()
        .filter_map(|(key, wanted)| {
            let now = value(now, *key)?;
            // A new resolution comes first, and rounds what is there.
            let is_rounded = has_new_res && key.is_shaped_by_res();
            let before = if is_rounded { key.made(now, resolution) } else { now };
            let is_so = key.is_as_wanted(*wanted, before, resolution);
            (!is_so).then(|| Change { key: *key, now: Some(now), to: key.sendable(*wanted, resolution) })
        })
        .collect();
    changes.sort_by_key(|change| change.key != RES);
    stop_before_start(&mut changes, now, resolution);
    changes
}

/// `VSTART` comes before `VSTOP` in the table. Where it is to rise above what `VSTOP` is now, that has to rise first.
fn stop_before_start(changes: &mut [Change], now: &[Setting], resolution: u16) {
    let place = |changes: &[Change], key| changes.iter().position(|change| change.key == key);
    let Some((start, stop)) = place(changes, VSTART).zip(place(changes, VSTOP)) else { return };
    let stop_now = value(now, VSTOP).map_or(0.0, |value| VSTOP.made(value, resolution));
    if changes.get(start).is_some_and(|change| change.to > stop_now) {
        changes.swap(start, stop);
    }
}

/// What is not as it is wanted, among what is known.
pub fn differences(wanted: &[Setting], now: &[Setting]) -> Vec<Difference> {
    let resolution = resolution(wanted, now);
    let differing = |(key, wanted): &Setting| {
        let found = value(now, *key)?;
        let is_so = key.is_as_wanted(*wanted, found, resolution);
        (!is_so).then_some(Difference { key: *key, wanted: *wanted, found })
    };
    wanted.iter().filter_map(differing).collect()
}

fn value(settings: &[Setting], key: Key) -> Option<f64> {
    settings.iter().find(|(other, _)| *other == key).map(|(_, value)| *value)
}

#[cfg(test)]
mod tests {
    use super::super::key::Family;
    use super::*;

    fn factory() -> Vec<Setting> {
        Key::all(Family::Smd3).into_iter().map(|key| (key, key.made(key.default(), 256))).collect()
    }

    fn smd3(settings: &[(Command, f64)]) -> Vec<Setting> {
        settings.iter().map(|(command, value)| (Key::Smd3(*command), *value)).collect()
    }

    fn names(wanted: &[(Command, f64)]) -> Vec<&'static str> {
        changes(&smd3(wanted), &factory()).iter().map(|change| change.key.name()).collect()
    }

    #[test]
    fn nothing_is_sent_for_what_is_so_already() {
        let as_typed: Vec<Setting> =
            Key::all(Family::Smd3).into_iter().map(|key| (key, key.default())).collect();
        assert_eq!(changes(&as_typed, &factory()), []);
        assert_eq!(differences(&as_typed, &factory()), []);
    }

    #[test]
    fn a_drive_that_rounds_otherwise_or_not_at_all_is_as_its_own_profile_says() {
        let exact = smd3(&[(Command::Amax, 500.0), (Command::Thigh, 400.0), (Command::Vmax, 499.9)]);
        assert_eq!(changes(&exact, &exact), []);
        assert_eq!(differences(&exact, &exact), []);
        let more = smd3(&[(Command::Thigh, 500.0)]);
        assert_eq!(changes(&more, &exact).len(), 1);
        assert_eq!(differences(&more, &exact).len(), 1);
    }

    #[test]
    fn what_differs_is_sent_and_what_is_sent_differs() {
        let rounded = |value: f64| Key::Smd3(Command::Amax).made(value, 256);
        for (wanted, now) in
            [(500.0, 500.0), (rounded(500.0), 500.0), (500.0, rounded(500.0)), (700.0, 500.0)]
        {
            let (wanted, now) =
                (smd3(&[(Command::Amax, wanted)]), smd3(&[(Command::Res, 256.0), (Command::Amax, now)]));
            assert_eq!(changes(&wanted, &now).len(), differences(&wanted, &now).len(), "{wanted:?} {now:?}");
        }
    }

    #[test]
    fn the_resolution_comes_first_and_what_it_spoils_is_set_again() {
        let wanted = [(Command::Vmax, 500.0), (Command::Res, 8.0)];
        assert_eq!(names(&wanted), ["RES", "VMAX"]);
        let low = smd3(&[(Command::Res, 8.0), (Command::Amax, 500_000.0)]);
        let high = smd3(&[(Command::Amax, 10_000.0), (Command::Res, 256.0)]);
        let changed = changes(&high, &low);
        assert_eq!(
            changed.iter().map(|change| change.key).collect::<Vec<_>>(),
            [RES, Key::Smd3(Command::Amax)]
        );
    }

    #[test]
    fn start_and_stop_are_set_in_the_order_that_the_drive_takes() {
        assert_eq!(names(&[(Command::Vstart, 50.0), (Command::Vstop, 60.0)]), ["VSTOP", "VSTART"]);
        assert_eq!(names(&[(Command::Vstart, 5.0), (Command::Vstop, 6.0)]), ["VSTART", "VSTOP"]);
        let refused = |wanted: &[(Command, f64)]| objection(&smd3(wanted), &factory()).map(|(key, _)| key);
        assert_eq!(refused(&[(Command::Vstart, 50.0)]), Some(VSTART));
        assert_eq!(refused(&[(Command::Vstop, 5.0)]), Some(VSTOP));
        assert_eq!(refused(&[(Command::Vstop, 10.0)]), None);
    }

    #[test]
    fn what_the_resolution_forbids_is_found_before_anything_is_sent() {
        let refused = |wanted: &[(Command, f64)]| objection(&smd3(wanted), &factory());
        let (_, why) = refused(&[(Command::Amax, 20_000.0)]).expect("refused");
        assert!(why.starts_with("AMAX goes up to 16763"), "{why}");
        assert_eq!(refused(&[(Command::Amax, 20_000.0), (Command::Res, 8.0)]), None);
    }

    #[test]
    fn what_differs_is_told_with_both_values() {
        let found = differences(&smd3(&[(Command::Vmax, 500.0)]), &factory());
        let [difference] = found.as_slice() else { panic!("one: {found:?}") };
        assert!(same(difference.wanted, 500.0) && same(difference.found, 1000.0));
    }
}
