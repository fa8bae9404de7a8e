//! Arbitrary scripts: time in one jump is the same as time in many, and the same script has the same outcome.

use crate::bench::{Bench, switch, travel};
use core::time::Duration;
use proptest::collection::vec;
use proptest::prelude::*;
use stepdrive_spec::modbus::{Exception, Reply, Request};
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::{INSTRUCTIONS, Instruction, Opcode};
use stepdrive_spec::smsd::registers::Reg;

/// One thing that a script does, after so many nanoseconds.
#[derive(Clone, Debug)]
enum Act {
    /// A command with its speed, its position in microsteps, and its input.
    Command(Opcode, u16, i16, u16),
    Coil(u16, bool),
    MaxSpeed(u16),
    Input(Input, bool),
    Look,
}

fn act() -> impl Strategy<Value = Act> {
    let codes: Vec<Opcode> = INSTRUCTIONS.iter().filter(|info| info.in_cmd).map(|info| info.opcode).collect();
    prop_oneof![
        6 => (prop::sample::select(codes), 15..1200_u16, -4000..4000_i16, 0..9_u16)
            .prop_map(|(opcode, speed, position, input)| Act::Command(opcode, speed, position, input)),
        1 => (0x1400..0x1408_u16, any::<bool>()).prop_map(|(address, value)| Act::Coil(address, value)),
        1 => (16..3000_u16).prop_map(Act::MaxSpeed),
        1 => (prop::sample::select(&Input::ALL[..]), any::<bool>()).prop_map(|(input, level)| Act::Input(input, level)),
        2 => Just(Act::Look),
    ]
}

fn script() -> impl Strategy<Value = Vec<(u64, Act)>> {
    let pause = prop_oneof![0..3_u64, 0..10_000_000_u64, 0..3_000_000_000_u64];
    vec((pause, act()), 1..25)
}

/// A stage with ends, and switches on four inputs, two of which overlap.
fn stage() -> Bench {
    let lines = travel(-150.0, 150.0, 0.0)
        + &switch("SET_ZERO", -120.0, -100.0)
        + &switch("IN1", 30.0, 32.0)
        + &switch("SW", 80.0, 90.0)
        + &switch("SW", 85.0, 100.0)
        + &switch("IN0", -3.01, 2.5);
    let mut bench = Bench::new(&lines);
    bench.store(&[
        Instruction::with_position(Opcode::ScanMarkF, 300),
        Instruction::with_position(Opcode::GotoProgramIfIn0, 4),
        Instruction::with_position(Opcode::GoTo, -320),
        Instruction::with_position(Opcode::SetWait2, 500),
        Instruction::with_position(Opcode::MoveR, 480),
        Instruction::with_position(Opcode::GotoProgram, 1),
    ]);
    bench
}

fn perform(bench: &mut Bench, act: &Act) -> Option<Result<Reply, Exception>> {
    let request = match act {
        Act::Command(opcode, speed, position, input) => {
            let position = i32::from(*position).to_le_bytes();
            let [low, high] =
                [[position[0], position[1]], [position[2], position[3]]].map(u16::from_le_bytes);
            let values = [*speed, low, high, *input, u16::from(opcode.code())].into_iter().collect();
            Request::WriteRegisters { address: Reg::TargetSpeed.info().address, values }
        }
        Act::Coil(address, value) => Request::WriteCoil { address: *address, value: *value },
        Act::MaxSpeed(value) => {
            Request::WriteRegister { address: Reg::MaxSpeed.info().address, value: *value }
        }
        Act::Input(input, level) => {
            bench.machine.set_signal(bench.now, *input, *level);
            return None;
        }
        Act::Look => Request::ReadWords { table: Reg::Speed.info().table, address: 0x1000, count: 6 },
    };
    Some(bench.request(&request))
}

/// All that can be seen of a machine.
fn sight(bench: &Bench) -> String {
    format!("{:?} {} {}", bench.machine, bench.carriage(), bench.stalled())
}

/// What the carriage and the switches may never do.
fn check(bench: &mut Bench) {
    let place = bench.carriage();
    assert!((-150.0..=150.0).contains(&place), "{place}");
    assert!(bench.machine.next_wake().is_none_or(|at| at >= bench.now));
    let levels = bench.read(Reg::Inputs);
    let closed = [
        (Input::SetZero, (-120.0..=-100.0).contains(&place)),
        (Input::In1, (30.0..=32.0).contains(&place)),
        (Input::Sw, (80.0..=100.0).contains(&place)),
        (Input::In0, (-3.01..=2.5).contains(&place)),
    ];
    for (input, closed) in closed {
        assert!(!closed || levels & i64::from(input.bit()) != 0, "{input} at {place} in {levels:08b}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn one_big_jump_in_time_is_as_good_as_many_small_steps(script in script(), cut in 1..400_000_000_u64) {
        let (mut jumps, mut steps) = (stage(), stage());
        for (pause, act) in &script {
            let end = jumps.now + Duration::from_nanos(*pause);
            jumps.now = end;
            while steps.now < end {
                let rest = end.since(steps.now).min(Duration::from_nanos(cut));
                steps.run_for(rest);
                check(&mut steps);
            }
            prop_assert_eq!(perform(&mut jumps, act), perform(&mut steps, act), "{:?}", act);
            check(&mut steps);
            jumps.machine.advance(end);
            steps.machine.advance(end);
            prop_assert_eq!(sight(&jumps), sight(&steps), "after {:?}", act);
        }
    }

    #[test]
    fn the_same_script_has_the_same_outcome(script in script()) {
        let run = || {
            let mut bench = stage();
            let mut replies = Vec::new();
            for (pause, act) in &script {
                bench.now = bench.now + Duration::from_nanos(*pause);
                replies.push(perform(&mut bench, act));
            }
            (replies, sight(&bench))
        };
        prop_assert_eq!(run(), run());
    }
}
