//! What holds whatever is done to a rig.

use crate::bench::{Bench, STAGE_AND_UHV};
use proptest::prelude::*;
use std::time::Duration;
use stepdrive_spec::smsd::instructions::Opcode;
use stepdrive_spec::time::Instant;

/// Something done to the rig.
#[derive(Clone, Debug)]
enum Deed {
    Act(&'static str),
    Line(&'static str),
    Command(Opcode),
    Pass(Duration),
}

const ACTIONS: [&str; 24] = [
    "input stage.IN0 1",
    "input stage.IN0 0",
    "input stage.IN0 release",
    "input stage.SW pulse 5ms",
    "input stage.STEP pulse 100us x50 every 1ms",
    "input uhv.ENABLE 1 for 200ms",
    "input uhv.JOYSTICK 1 for 1s",
    "input uhv.JOYSTICK_CW pulse 300ms",
    "fault stage.IN0 bounce",
    "fault stage.IN0 stuck-closed for 50ms",
    "fault stage.IN0 off",
    "fault stage.rotor blocked for 300ms",
    "fault stage.motor short for 100ms",
    "fault stage.temperature high for 1s",
    "fault uhv.LIMIT_POSITIVE bounce",
    "fault uhv.LIMIT_POSITIVE stuck-open",
    "fault uhv.rotor blocked",
    "fault uhv.rotor off",
    "fault uhv.thermocouple open for 2s",
    "fault uhv.temperature high for 30s",
    "power stage off for 20ms",
    "power uhv off for 1s",
    "power uhv on",
    "panel stage bF 1",
];

const LINES: [&str; 12] = [
    "MODE,2",
    "RUNV,+",
    "RUNV,-",
    "RUNR,1700",
    "RUNR,-300",
    "STOP",
    "SSTOP",
    "CLR",
    "MODE,4",
    "RUNB",
    "MODE,5",
    "RUNH,+",
];

const COMMANDS: [Opcode; 7] = [
    Opcode::RunF,
    Opcode::RunR,
    Opcode::SoftStop,
    Opcode::HardStop,
    Opcode::GoUntilF,
    Opcode::GoTo,
    Opcode::SoftHiZ,
];

fn deed() -> impl Strategy<Value = Deed> {
    prop_oneof![
        3 => prop::sample::select(&ACTIONS[..]).prop_map(Deed::Act),
        2 => prop::sample::select(&LINES[..]).prop_map(Deed::Line),
        2 => prop::sample::select(&COMMANDS[..]).prop_map(Deed::Command),
        4 => (0_u64..3_000_000_000).prop_map(|nanos| Deed::Pass(Duration::from_nanos(nanos))),
    ]
}

/// Does it; time passes in pieces that are at most `longest`.
fn perform(bench: &mut Bench, deed: &Deed, longest: Duration) {
    match deed {
        Deed::Act(action) => bench.act(action),
        Deed::Line(line) if bench.look("uhv.powered") > 0.0 => drop(bench.line("uhv", line)),
        Deed::Command(opcode) if bench.look("stage.powered") > 0.0 => bench.command("stage", *opcode),
        Deed::Line(_) | Deed::Command(_) => {}
        Deed::Pass(time) => {
            let end = bench.now + *time;
            while bench.now < end {
                let piece = end.since(bench.now).min(longest);
                bench.pass(piece);
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn nothing_is_due_in_the_past_and_no_carriage_leaves_its_travel(deeds in prop::collection::vec(deed(), 1..40)) {
        let mut bench = Bench::new(STAGE_AND_UHV, &[]);
        for deed in &deeds {
            perform(&mut bench, deed, Duration::MAX);
            for group in &bench.groups {
                prop_assert!(group.next_wake().is_none_or(|wake| wake > bench.now || matches!(deed, Deed::Act(_) | Deed::Line(_) | Deed::Command(_))), "{deed:?}");
                prop_assert_eq!(group.now(), bench.now);
            }
            prop_assert!(bench.look("stage.carriage").abs() <= 1000.0);
            prop_assert!(bench.look("uhv.carriage").abs() <= 2000.0);
        }
    }

    #[test]
    fn a_blocked_rotor_does_not_move_at_all(deeds in prop::collection::vec(deed(), 1..30)) {
        let mut bench = Bench::new(STAGE_AND_UHV, &[]);
        bench.pass(Duration::from_millis(1));
        bench.act("fault uhv.rotor blocked");
        for deed in deeds.iter().filter(|deed| !matches!(deed, Deed::Act(action) if action.contains("rotor"))) {
            perform(&mut bench, deed, Duration::MAX);
            prop_assert_eq!(bench.look("uhv.carriage"), 0.0);
        }
    }

    #[test]
    fn time_in_small_pieces_comes_to_the_same_bit_for_bit(deeds in prop::collection::vec(deed(), 1..25), piece in 1_u64..400) {
        let (mut whole, mut pieces) = (Bench::new(STAGE_AND_UHV, &[]), Bench::new(STAGE_AND_UHV, &[]));
        for deed in &deeds {
            perform(&mut whole, deed, Duration::MAX);
            perform(&mut pieces, deed, Duration::from_millis(piece));
            prop_assert_eq!(whole.state(), pieces.state(), "{:?}", deed);
            for (one, other) in whole.groups.iter().zip(&pieces.groups) {
                prop_assert_eq!(one.next_wake(), other.next_wake(), "{:?}", deed);
            }
        }
    }

    #[test]
    fn a_small_budget_gets_as_far_in_the_end(deeds in prop::collection::vec(deed(), 1..20), budget in 1_u32..5) {
        let (mut whole, mut bit_by_bit) = (Bench::new(STAGE_AND_UHV, &[]), Bench::new(STAGE_AND_UHV, &[]));
        for deed in &deeds {
            perform(&mut whole, deed, Duration::MAX);
            if let Deed::Pass(time) = deed {
                let end = bit_by_bit.now + *time;
                let mut last = vec![Instant::ZERO; bit_by_bit.groups.len()];
                for (group, last) in bit_by_bit.groups.iter_mut().zip(&mut last) {
                    while group.advance(end, &mut budget.clone()) < end {
                        prop_assert!(group.now() >= *last);
                        *last = group.now();
                    }
                }
            }
            perform(&mut bit_by_bit, deed, Duration::MAX);
            prop_assert_eq!(whole.state(), bit_by_bit.state());
        }
    }
}
