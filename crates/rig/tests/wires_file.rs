//! Wires in rig files: what they give, how they group the drives, and what a person is told about mistakes.
#![allow(clippy::needless_pass_by_value, reason = "an `Expect` is written in place")]

use expect_test::{Expect, expect};
use proptest::prelude::*;
use std::time::Duration;
use stepdrive_rig::file::{RigFile, WireSection};
use stepdrive_rig::names::AnySignal;
use stepdrive_spec::smd3::signals::Signal;
use stepdrive_spec::smsd::inputs::Input;

/// Two SMSDs, `a` and `b`, and an SMD3 named `uhv`.
const THREE: &str = "drive = [\n\
    { name = \"a\", model = \"SMSD-4.2LAN\", modbus_tcp = \"127.0.0.1:0\" },\n\
    { name = \"b\", model = \"SMSD-4.2LAN\", modbus_tcp = \"127.0.0.1:0\" },\n\
    { name = \"uhv\", model = \"SMD3\", serial = \"pty\" },\n]\n";

fn wires(lines: &str) -> Vec<WireSection> {
    let text = format!("{THREE}{lines}");
    RigFile::parse(&text).unwrap_or_else(|error| panic!("{}", error.render("rig.toml"))).wires
}

fn wire(from: &str, to: &str) -> String {
    format!("[[wire]]\nfrom = \"{from}\"\nto = \"{to}\"\n")
}

/// What a person reads about the first mistake in a file with these lines.
fn check(lines: &str, expect: Expect) {
    let text = format!("{THREE}{lines}");
    expect.assert_eq(&RigFile::parse(&text).expect_err(lines).render("rig.toml"));
}

#[test]
fn a_wire_needs_only_its_ends() {
    let expected = WireSection {
        from: 0,
        output: 0,
        to: 1,
        input: AnySignal::Smsd(Input::Continue),
        delay: Duration::ZERO,
        invert: false,
    };
    assert_eq!(wires(&wire("a.relay", "b.CONTINUE")), [expected]);
    assert_eq!(wires(&wire("A.RELAY", "B.continue")), [expected]);
}

#[test]
fn every_key_of_a_wire_is_taken() {
    let lines = wire("b.relay", "uhv.LIMIT_POSITIVE") + "delay = \"1.5us\"\ninvert = true\n";
    let expected = WireSection {
        from: 1,
        output: 0,
        to: 2,
        input: AnySignal::Smd3(Signal::LimitPositive),
        delay: Duration::from_nanos(1_500),
        invert: true,
    };
    assert_eq!(wires(&lines), [expected]);
}

#[test]
fn wires_may_stand_before_the_drives() {
    let file = RigFile::parse(&format!(
        "{}[[drive]]\nname = \"a\"\nmodel = \"SMSD-4.2LAN\"\nmodbus_tcp = \"127.0.0.1:0\"\n\
         [[drive]]\nname = \"b\"\nmodel = \"SMD3\"\nserial = \"pty\"\n",
        wire("a.relay", "b.ENABLE")
    ));
    assert_eq!(file.expect("valid").wires.len(), 1);
}

#[test]
fn an_output_may_lead_to_several_inputs_and_an_input_may_have_several_wires() {
    let ends = [("a.relay", "b.IN0"), ("a.relay", "b.IN1"), ("a.relay", "uhv.DIR"), ("b.relay", "uhv.DIR")];
    let lines: String = ends.into_iter().map(|(from, to)| wire(from, to)).collect();
    assert_eq!(wires(&lines).len(), 4);
}

#[test]
fn two_controllers_may_each_drive_the_other() {
    assert_eq!(wires(&(wire("a.relay", "b.CONTINUE") + &wire("b.relay", "a.CONTINUE"))).len(), 2);
}

#[test]
fn the_ends_of_a_wire_are_drives_and_their_parts() {
    check(
        &wire("c.relay", "b.CONTINUE"),
        expect![[r#"
        rig.toml:7:8: unknown drive `c`; there are a, b, uhv
          |
        7 | from = "c.relay"
          |        ^^^^^^^^^"#]],
    );
    check(
        &wire("a.relay", "d.CONTINUE"),
        expect![[r#"
        rig.toml:8:6: unknown drive `d`; there are a, b, uhv
          |
        8 | to = "d.CONTINUE"
          |      ^^^^^^^^^^^^"#]],
    );
    check(
        &wire("relay", "b.CONTINUE"),
        expect![[r#"
        rig.toml:7:8: `relay` is not a drive and a part of it, as in stage.IN0
          |
        7 | from = "relay"
          |        ^^^^^^^"#]],
    );
    check(
        &wire("a.relay", "b."),
        expect![[r#"
        rig.toml:8:6: `b.` is not a drive and a part of it, as in stage.IN0
          |
        8 | to = "b."
          |      ^^^^"#]],
    );
}

#[test]
fn a_wire_begins_at_an_output() {
    check(
        &wire("a.CONTINUE", "b.CONTINUE"),
        expect![[r#"
        rig.toml:7:8: CONTINUE is an input; a wire begins at an output: relay
          |
        7 | from = "a.CONTINUE"
          |        ^^^^^^^^^^^^"#]],
    );
    check(
        &wire("a.realy", "b.CONTINUE"),
        expect![[r#"
        rig.toml:7:8: unknown output `realy` of `a`; there is only relay
          |
        7 | from = "a.realy"
          |        ^^^^^^^^^"#]],
    );
    check(
        &wire("uhv.relay", "b.CONTINUE"),
        expect![[r#"
        rig.toml:7:8: `uhv` is an SMD3, which has no outputs
          |
        7 | from = "uhv.relay"
          |        ^^^^^^^^^^^"#]],
    );
}

#[test]
fn a_wire_ends_at_an_input() {
    check(
        &wire("a.relay", "b.relay"),
        expect![[r#"
        rig.toml:8:6: relay is an output; an input is one of IN0, IN1, SET_ZERO, SW, EN, STEP, DIR, CONTINUE
          |
        8 | to = "b.relay"
          |      ^^^^^^^^^"#]],
    );
    check(
        &wire("a.relay", "b.CONTINU"),
        expect![[r#"
        rig.toml:8:6: unknown input `CONTINU` of `b`; there are IN0, IN1, SET_ZERO, SW, EN, STEP, DIR, CONTINUE
          |
        8 | to = "b.CONTINU"
          |      ^^^^^^^^^^^"#]],
    );
    check(
        &wire("a.relay", "uhv.CONTINUE"),
        expect![[r#"
        rig.toml:8:6: unknown input `CONTINUE` of `uhv`; there are LIMIT_NEGATIVE, LIMIT_POSITIVE, ENABLE, RESET_FAULT, STEP, DIR, JOYSTICK, JOYSTICK_CW, JOYSTICK_CCW
          |
        8 | to = "uhv.CONTINUE"
          |      ^^^^^^^^^^^^^^"#]],
    );
}

#[test]
fn a_wire_joins_two_drives() {
    check(
        &wire("a.relay", "A.CONTINUE"),
        expect![[r#"
        rig.toml:8:6: a wire loop: a.relay to A.CONTINUE; a wire joins two different drives
          |
        8 | to = "A.CONTINUE"
          |      ^^^^^^^^^^^^"#]],
    );
}

#[test]
fn a_wire_is_there_once() {
    let other = wire("A.relay", "b.continue") + "delay = \"5ms\"\ninvert = true\n";
    check(
        &(wire("a.relay", "b.CONTINUE") + &other),
        expect![[r#"
        rig.toml:10:8: a wire from A.relay to b.continue is there already
           |
        10 | from = "A.relay"
           |        ^^^^^^^^^"#]],
    );
}

#[test]
fn a_delay_is_a_duration() {
    let delayed = |delay: &str| wire("a.relay", "b.CONTINUE") + &format!("delay = {delay}\n");
    check(
        &delayed("\"5 parsec\""),
        expect![[r#"
        rig.toml:9:9: delay is `5 parsec`; the unit `parsec` is unknown; it is one of ns, us, ms, s, min, h
          |
        9 | delay = "5 parsec"
          |         ^^^^^^^^^^"#]],
    );
    check(
        &delayed("\"-5ms\""),
        expect![[r#"
        rig.toml:9:9: delay is `-5ms`; a duration is not negative
          |
        9 | delay = "-5ms"
          |         ^^^^^^"#]],
    );
    check(
        &delayed("\"0.5ns\""),
        expect![[r#"
        rig.toml:9:9: delay is `0.5ns`; a duration is a whole number of nanoseconds
          |
        9 | delay = "0.5ns"
          |         ^^^^^^^"#]],
    );
    check(
        &delayed("5"),
        expect![[r#"
        rig.toml:9:9: found integer `5`, expected a string
          |
        9 | delay = 5
          |         ^"#]],
    );
}

#[test]
fn a_wire_has_two_ends_and_no_other_keys() {
    check(
        "[[wire]]\nfrom = \"a.relay\"\n",
        expect![[r#"
        rig.toml:6:1: missing field `to`
          |
        6 | [[wire]]
          | ^^^^^^^^"#]],
    );
    check(
        "[[wire]]\nto = \"b.CONTINUE\"\n",
        expect![[r#"
        rig.toml:6:1: missing field `from`
          |
        6 | [[wire]]
          | ^^^^^^^^"#]],
    );
    check(
        &(wire("a.relay", "b.CONTINUE") + "colour = \"red\"\n"),
        expect![[r#"
        rig.toml:9:1: unknown field `colour`, expected one of `from`, `to`, `delay`, `invert`
          |
        9 | colour = "red"
          | ^^^^^^"#]],
    );
    check(
        "[wire]\nfrom = \"a.relay\"\nto = \"b.CONTINUE\"\n",
        expect![[r#"
        rig.toml:6:1: found one table where there may be several; its name stands in double brackets
          |
        6 | [wire]
          | ^^^^^^"#]],
    );
}

/// So many SMSDs named `d0`, `d1` and so on, with wires between these.
fn rig(drives: usize, ends: &[(usize, usize)]) -> RigFile {
    let drives = (0..drives).map(|number| {
        format!("[[drive]]\nname = \"d{number}\"\nmodel = \"SMSD-4.2LAN\"\nmodbus_tcp = \"127.0.0.1:0\"\n")
    });
    let wires = ends.iter().map(|(from, to)| wire(&format!("d{from}.relay"), &format!("d{to}.IN0")));
    let text: String = drives.chain(wires).collect();
    RigFile::parse(&text).unwrap_or_else(|error| panic!("{}", error.render("rig.toml")))
}

#[test]
fn drives_without_wires_are_groups_by_themselves() {
    assert_eq!(rig(3, &[]).groups(), [[0], [1], [2]]);
}

#[test]
fn wires_join_drives_directly_and_by_others_whichever_way_they_lead() {
    assert_eq!(rig(6, &[(5, 1), (3, 1), (4, 0)]).groups(), [vec![0, 4], vec![1, 3, 5], vec![2]]);
    assert_eq!(rig(4, &[(0, 1), (1, 0), (2, 3), (3, 0)]).groups(), [[0, 1, 2, 3]]);
}

/// Whom a drive reaches, found the slow way.
fn reached(drive: usize, drives: usize, ends: &[(usize, usize)]) -> Vec<usize> {
    let mut group = vec![drive];
    for _ in 0..drives {
        for &(from, to) in ends {
            let joined = [(from, to), (to, from)];
            group.extend(
                joined
                    .into_iter()
                    .filter(|(one, _)| group.contains(one))
                    .map(|(_, other)| other)
                    .collect::<Vec<_>>(),
            );
            group.sort_unstable();
            group.dedup();
        }
    }
    group
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn a_group_is_whoever_can_be_reached(ends in prop::collection::btree_set((0..12_usize, 0..12_usize), 0..14)) {
        let ends: Vec<_> = ends.into_iter().filter(|(from, to)| from != to).collect();
        let groups = rig(12, &ends).groups();
        prop_assert_eq!(groups.iter().map(Vec::len).sum::<usize>(), 12);
        prop_assert!(groups.is_sorted_by_key(|group| group[0]));
        for group in groups {
            prop_assert_eq!(&reached(group[0], 12, &ends), &group);
        }
    }
}
