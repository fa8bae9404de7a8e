//! The four ways to stop, from every state; and the reset of the motor chip.

use crate::bench::{Bench, MS, SECOND};
use stepdrive_spec::modbus::Table;
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::Opcode;
use stepdrive_spec::smsd::registers::Reg;

const STOPS: [(Opcode, Reg); 4] = [
    (Opcode::SoftStop, Reg::SoftStop),
    (Opcode::HardStop, Reg::HardStop),
    (Opcode::SoftHiZ, Reg::SoftHiZ),
    (Opcode::HardHiZ, Reg::HardHiZ),
];

fn at_rest(de_energised: bool) -> &'static str {
    if de_energised { "HiZ STOP READY DIR" } else { "STOP READY DIR" }
}

fn is_soft(stop: Opcode) -> bool {
    matches!(stop, Opcode::SoftStop | Opcode::SoftHiZ)
}

fn de_energises(stop: Opcode) -> bool {
    matches!(stop, Opcode::SoftHiZ | Opcode::HardHiZ)
}

/// The motor at constant speed.
fn running() -> Bench {
    let mut bench = Bench::new();
    bench.order(Opcode::RunF, 800);
    bench.run_for(2 * SECOND);
    bench
}

/// The motor in each state in which it moves forward.
fn moving() -> Vec<(&'static str, Bench)> {
    let mut accelerating = Bench::new();
    accelerating.order(Opcode::RunF, 800);
    accelerating.run_for(100 * MS);
    let mut braking = running();
    braking.order(Opcode::RunF, 100);
    braking.run_for(100 * MS);
    let mut reversing = running();
    reversing.order(Opcode::RunR, 800);
    reversing.run_for(100 * MS);
    let mut seeking = Bench::new();
    seeking.order(Opcode::GoUntilF, 0);
    seeking.run_for(2 * SECOND);
    let mut moving = Bench::new();
    moving.order(Opcode::MoveF, 100_000);
    moving.run_for(2 * SECOND);
    vec![
        ("accelerating", accelerating),
        ("at constant speed", running()),
        ("braking", braking),
        ("reversing", reversing),
        ("seeking", seeking),
        ("moving", moving),
    ]
}

#[test]
fn at_standstill_a_stop_only_energises_or_releases() {
    for (stop, _) in STOPS {
        let mut released = Bench::new();
        released.command(stop);
        assert_eq!(released.flags(), at_rest(de_energises(stop)), "{stop} in HiZ");
        let mut holding = Bench::new();
        holding.command(Opcode::HardStop);
        holding.command(stop);
        assert_eq!(holding.flags(), at_rest(de_energises(stop)), "{stop} while holding");
        assert_eq!(holding.position(), 0);
    }
}

#[test]
fn a_hard_stop_stands_at_once_where_it_is() {
    for (stop, _) in STOPS.into_iter().filter(|(stop, _)| !is_soft(*stop)) {
        for (state, mut bench) in moving() {
            let position = bench.position();
            bench.command(stop);
            assert_eq!(bench.flags(), at_rest(de_energises(stop)), "{stop} while {state}");
            bench.run_for(SECOND);
            assert_eq!((bench.position(), bench.speed()), (position, 0), "{stop} while {state}");
            assert_eq!(bench.drive.next_wake(), None);
        }
    }
}

#[test]
fn a_soft_stop_brakes_with_dec() {
    for (stop, _) in STOPS.into_iter().filter(|(stop, _)| is_soft(*stop)) {
        for (state, mut bench) in moving() {
            let speed = bench.drive.speed(bench.now);
            bench.command(stop);
            assert_eq!(bench.flags(), "DEC DIR", "{stop} while {state}");
            let time = bench.run_until_ready().as_secs_f64();
            let seconds = speed / (69.0 / 0.068_719_476_736);
            assert!((time - seconds).abs() < 1e-8, "{stop} while {state} took {time} s, not {seconds} s");
            assert_eq!(bench.flags(), at_rest(de_energises(stop)), "{stop} while {state}");
            assert_eq!(bench.drive.next_wake(), None);
        }
    }
}

#[test]
fn coils_and_commands_stop_alike() {
    for (stop, coil) in STOPS {
        for (state, bench) in moving() {
            let [mut by_command, mut by_coil] = [bench.clone(), bench];
            by_command.command(stop);
            by_coil.trigger(coil);
            for bench in [&mut by_command, &mut by_coil] {
                bench.run_for(SECOND);
            }
            assert_eq!(by_command.position(), by_coil.position(), "{stop} while {state}");
            assert_eq!(by_command.flags(), by_coil.flags(), "{stop} while {state}");
        }
    }
}

#[test]
fn a_hard_stop_cuts_a_soft_one_short() {
    let mut bench = running();
    bench.command(Opcode::SoftHiZ);
    bench.run_for(100 * MS);
    bench.command(Opcode::HardStop);
    assert_eq!(bench.flags(), "STOP READY DIR");
    bench.run_for(SECOND);
    assert_eq!(bench.flags(), "STOP READY DIR", "the release was given up with the soft stop");
}

#[test]
fn a_run_takes_back_a_soft_release() {
    let mut bench = running();
    bench.command(Opcode::SoftHiZ);
    bench.run_for(100 * MS);
    bench.order(Opcode::RunF, 800);
    bench.run_until_ready();
    bench.run_for(SECOND);
    assert_eq!(bench.flags(), "CONST_SPEED READY DIR");
}

#[test]
fn a_soft_stop_above_a_lowered_max_speed_goes_on_braking() {
    let mut bench = running();
    bench.command(Opcode::SoftStop);
    bench.run_for(100 * MS);
    bench.write(Reg::MaxSpeed, 100);
    assert_eq!(bench.flags_until_ready(), ["DEC DIR", "STOP READY DIR"]);
}

#[test]
fn a_stop_ends_a_seek_so_that_its_signal_does_nothing() {
    for (stop, _) in STOPS {
        for scan in [Opcode::ScanZeroF, Opcode::ScanMarkF, Opcode::ScanMark2F] {
            let mut bench = Bench::new();
            bench.order(scan, 500);
            bench.run_for(SECOND);
            bench.command(stop);
            bench.run_until_ready();
            assert_eq!(bench.read(Reg::Wait), 0);
            let position = bench.position();
            bench.input(Input::SetZero, true);
            bench.input(Input::In1, true);
            assert_eq!(bench.position(), position);
            assert_eq!(bench.flags(), at_rest(de_energises(stop)));
        }
    }
}

#[test]
fn a_stop_from_min_speed_is_over_at_once() {
    for (stop, _) in STOPS {
        let mut bench = Bench::tuned(4, 300, 1000, 1000, 1000);
        bench.order(Opcode::RunF, 15);
        bench.run_for(SECOND);
        assert_eq!(bench.speed(), 300);
        bench.command(stop);
        assert_eq!(bench.flags(), at_rest(de_energises(stop)));
    }
}

#[test]
fn resetting_the_motor_chip_is_accepted_in_every_state() {
    let mut states = moving();
    states.push(("de-energised", Bench::new()));
    let mut holding = Bench::new();
    holding.command(Opcode::HardStop);
    states.push(("holding", holding));
    for (state, mut bench) in states {
        bench.trigger(Reg::ResetPowerstep01);
        assert_eq!(bench.flags(), "HiZ STOP READY DIR", "{state}");
        assert_eq!((bench.position(), bench.speed(), bench.read(Reg::ElPos)), (0, 0, 0), "{state}");
        assert_eq!((bench.read(Reg::Wait), bench.drive.next_wake()), (0, None), "{state}");
    }
}

#[test]
fn a_reset_sets_the_drive_parameters_and_flags_of_the_chip_back_and_nothing_else() {
    let mut bench = Bench::tuned(2, 10, 2000, 3000, 4000);
    bench.write(Reg::FsSpeed, 500);
    bench.write(Reg::Mask, 0x0F);
    bench.write(Reg::Relay, 1);
    bench.order(Opcode::MoveR, 77);
    bench.input(Input::Sw, true);
    bench.order(Opcode::MoveR, 5);
    assert!(bench.cmd_error());
    let targets = bench.read_at(Table::HoldingRegisters, 0x1105, 12);
    bench.trigger(Reg::ResetPowerstep01);
    let parameters = bench.read_at(Table::HoldingRegisters, 0x1100, 5);
    assert_eq!(parameters, Ok(vec![0, 1000, 1000, 1000, 15_600]));
    assert_eq!(bench.flags(), "HiZ STOP READY SW_F DIR");
    assert_eq!(bench.read_at(Table::HoldingRegisters, 0x1105, 12), targets);
    assert_eq!((bench.read(Reg::Relay), bench.read(Reg::Microstepping)), (1, 2));
}

#[test]
fn a_reset_forgets_the_mark() {
    let mut bench = Bench::new();
    bench.order(Opcode::MoveF, 500);
    bench.run_until_ready();
    bench.input(Input::In1, true);
    bench.order(Opcode::ScanMarkF, 500);
    bench.trigger(Reg::ResetPowerstep01);
    bench.order(Opcode::MoveF, 100);
    bench.run_until_ready();
    bench.command(Opcode::GoMark);
    bench.run_until_ready();
    assert_eq!(bench.position(), 0);
}

#[test]
fn after_a_reset_in_motion_the_rotor_stays_where_it_was() {
    for (state, mut bench) in moving() {
        let rotor = bench.drive.rotor(bench.now);
        bench.trigger(Reg::ResetPowerstep01);
        assert_eq!(bench.drive.rotor(bench.now), rotor, "{state}");
        bench.order(Opcode::MoveF, 16);
        bench.run_until_ready();
        assert_eq!((bench.position(), bench.drive.rotor(bench.now)), (16, rotor + 256), "{state}");
    }
}

#[test]
fn the_position_may_be_reset_in_every_state() {
    for (state, mut bench) in moving() {
        let flags = bench.flags();
        bench.trigger(Reg::ResetPos);
        assert_eq!((bench.position(), bench.flags()), (0, flags), "{state}");
    }
}
