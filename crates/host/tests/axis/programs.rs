//! A stop beside a user program, over both protocols of an SMSD.
#![allow(clippy::float_cmp, reason = "whole steps are exact")]

use crate::stage::{MS, SECOND, Stage, suite};
use crate::stopping::{WAYS, at, stop_and_watch};
use crate::suite::{amount, energise, told};
use stepdrive_host::axis::{Axis, DriveAxis, MoveOptions, SmsdMotor, Stop};
use stepdrive_host::units::{Goal, Speed};
use stepdrive_host::{Direction, Error};
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};
use stepdrive_spec::smsd::registers::Reg;
use tokio::time::sleep;

const HERE: MoveOptions = MoveOptions { speed: None, no_wait: false, override_trust: false, timeout: None };

/// Commands that end something.
pub(crate) const ENDS: [Opcode; 4] =
    [Opcode::SoftStop, Opcode::HardStop, Opcode::SoftHiZ, Opcode::StopProgramMem];

/// An SMSD on the bench.
pub(crate) trait Controller: Stage<Motor = SmsdMotor> {
    /// The commands, and the coils that stop, since this was last asked.
    fn acts(&self) -> Vec<Opcode>;

    /// How many requests there were since this was last asked.
    fn requests(&self) -> u64;

    /// Ends the connection when so many requests more were answered. There is no other then.
    fn lose_line_behind(&self, requests: usize);
}

suite! { $ hold of programs:
    a_stop_ends_a_program_at_any_moment
    a_stop_ends_a_program_whatever_is_lost
    a_stop_halts_what_a_program_moved_last
    a_stop_goes_out_first_and_costs_little
    a_program_that_could_not_be_ended_is_told
    homing_that_somebody_stops_on_the_way_off_the_switch_finds_nothing
    a_stop_by_another_program_that_ends_off_the_switch_is_not_taken_for_the_way_off
    a_stop_while_it_goes_off_the_switch_is_not_taken_for_the_way_off
    a_free_stop_just_before_homing_gives_up_stays_one
    a_speed_that_is_too_low_is_refused_with_what_was_asked_for
}

fn line(opcode: Opcode, data: u32) -> Instruction {
    Instruction { opcode, data }
}

/// Starts a program.
async fn start(axis: &DriveAxis<SmsdMotor>, program: &[Instruction]) {
    energise(axis).await;
    let client = axis.motor().client();
    client.store_program(0, program).await.expect("stored");
    client.start_program(0).await.expect("started");
}

/// There and back, with a rest between.
fn shuttle() -> Vec<Instruction> {
    let body = [line(Opcode::GoTo, 800), line(Opcode::SetWait, 50), line(Opcode::GoTo, 0)];
    [vec![line(Opcode::LoopProgram, 500 << 10 | 3)], body.to_vec(), vec![line(Opcode::End, 0)]].concat()
}

/// Looks whether the motor stands, and goes on to.
async fn stands<S: Controller>(rig: &S, when: &str) {
    sleep(SECOND).await;
    let place = rig.carriage();
    sleep(5 * SECOND).await;
    assert_eq!((rig.carriage(), rig.speed()), (place, 0.0), "{when}");
}

pub(crate) async fn a_stop_ends_a_program_at_any_moment<S: Controller>() {
    for how in [Stop::Soft, Stop::Hard, Stop::Free] {
        for after in (0..900).step_by(37) {
            let rig = S::new().await;
            let axis = rig.axis();
            start(&axis, &shuttle()).await;
            rig.slow_down(30 * MS);
            sleep(after * MS).await;
            axis.stop(how).await.expect("stopped");
            let when = format!("{how:?} after {after} ms");
            stands(&rig, &when).await;
            let state = axis.state().await.expect("a state");
            assert_eq!((state.moving, state.energised), (false, how != Stop::Free), "{when}");
            let running = axis.motor().client().program().await.expect("a state").running;
            assert_ne!(running, Some(true), "{when}");
        }
    }
}

pub(crate) async fn a_stop_ends_a_program_whatever_is_lost<S: Controller>() {
    for number in 0..8 {
        let rig = S::new().await;
        let axis = rig.axis();
        start(&axis, &shuttle()).await;
        sleep(100 * MS).await;
        rig.lose_reply(number);
        axis.stop(Stop::Soft).await.expect("stopped");
        stands(&rig, &format!("reply {number} was lost")).await;
    }
}

pub(crate) async fn a_stop_halts_what_a_program_moved_last<S: Controller>() {
    // The program ends by itself between the stop and the look for it.
    for after in (0..120).step_by(3) {
        let rig = S::new().await;
        let axis = rig.axis();
        let program =
            [(Opcode::SetAcc, 50_000), (Opcode::SetWait, 100), (Opcode::RunF, 100), (Opcode::End, 0)];
        start(&axis, &program.map(|(opcode, data)| line(opcode, data))).await;
        rig.slow_down(30 * MS);
        sleep(after * MS).await;
        axis.stop(Stop::Soft).await.expect("stopped");
        stands(&rig, &format!("after {after} ms")).await;
    }
}

pub(crate) async fn a_stop_goes_out_first_and_costs_little<S: Controller>() {
    let rig = S::new().await;
    let axis = rig.axis();
    energise(&axis).await;
    axis.run(Direction::Positive, HERE).await.expect("started");
    sleep(SECOND).await;
    let _ = (rig.acts(), rig.requests());
    axis.stop(Stop::Soft).await.expect("stopped");
    assert_eq!(rig.requests(), 3);
    assert_eq!(rig.acts().first(), Some(&Opcode::SoftStop));
    start(&axis, &shuttle()).await;
    rig.acts();
    axis.stop(Stop::Free).await.expect("stopped");
    assert_eq!(rig.acts(), [Opcode::SoftHiZ, Opcode::StopProgramMem, Opcode::SoftHiZ]);
}

pub(crate) async fn a_program_that_could_not_be_ended_is_told<S: Controller>() {
    let rig = S::new().await;
    let axis = rig.axis();
    start(&axis, &shuttle()).await;
    rig.lose_line_behind(1);
    let failed = axis.stop(Stop::Soft).await.expect_err("the line is gone");
    let words = failed.to_string();
    let told = "the motor of stage was stopped, but a user program may run there and move it again";
    assert!(words.ends_with(told) && matches!(failed, Error::Partly { .. }), "{words}");
    assert_eq!(failed.exit_code(), 5);
}

pub(crate) async fn homing_that_somebody_stops_on_the_way_off_the_switch_finds_nothing<S: Controller>() {
    let rig = S::new().await;
    let axis = rig.axis();
    energise(&axis).await;
    axis.move_by(amount("-108 steps"), HERE).await.expect("it is there");
    let stopped = async {
        sleep(50 * MS).await;
        rig.stop_behind_its_back().await;
    };
    let slowly = MoveOptions { speed: Some(Speed::parse("20 steps/s").expect("a speed")), ..HERE };
    let (homed, ()) = tokio::join!(axis.home(Direction::Negative, slowly), stopped);
    let words = told(homed);
    assert!(words.contains("on its way off SET_ZERO: somebody or something stopped it"), "{words}");
    assert!(rig.carriage() > -108.0 && rig.carriage() < -100.0, "{}", rig.carriage());
}

pub(crate) async fn a_stop_by_another_program_that_ends_off_the_switch_is_not_taken_for_the_way_off<
    S: Controller,
>() {
    for (number, how) in (3..12).zip(WAYS.into_iter().cycle()) {
        let when = format!("{how:?} after {number} x 20 ms");
        let rig = S::new().await;
        let (axis, other) = (rig.axis(), rig.axis());
        energise(&axis).await;
        axis.motor().client().write(Reg::Dec, 100).await.expect("taken");
        axis.motor().client().write(Reg::Acc, 100).await.expect("taken");
        axis.move_by(amount("-109.5 steps"), HERE).await.expect("it is there");
        other.state().await.expect("a state");
        // It takes 0.4 s to be off the switch, and as long to brake.
        let homing = axis.home(Direction::Negative, at("200 steps/s"));
        let (homed, ()) = tokio::join!(homing, stop_and_watch(&other, &rig, number * 20 * MS, how));
        let words = told(homed);
        assert!(
            words.contains("on its way off SET_ZERO: somebody or something stopped it"),
            "{when}: {words}"
        );
        let energised = axis.state().await.expect("a state").energised;
        assert_eq!(energised, how != Stop::Free, "{when}");
    }
}

pub(crate) async fn a_stop_while_it_goes_off_the_switch_is_not_taken_for_the_way_off<S: Controller>() {
    let rig = S::new().await;
    let axis = rig.axis();
    energise(&axis).await;
    axis.motor().client().write(Reg::Dec, 100).await.expect("taken");
    axis.move_by(amount("-108 steps"), HERE).await.expect("it is there");
    let fast = MoveOptions { speed: Some(Speed::parse("200 steps/s").expect("a speed")), ..HERE };
    let stopped = async {
        sleep(70 * MS).await;
        axis.stop(Stop::Soft).await.expect("stopped");
        rig.starts();
    };
    let (homed, ()) = tokio::join!(axis.home(Direction::Negative, fast), stopped);
    assert!(told(homed).contains("was told to stop while it looked for home"));
    stands(&rig, "behind the stop").await;
    assert_eq!(rig.starts(), 0);
}

pub(crate) async fn a_free_stop_just_before_homing_gives_up_stays_one<S: Controller>() {
    let rig = S::new().await;
    let axis = rig.axis();
    energise(&axis).await;
    axis.motor().client().write(Reg::Dec, 100).await.expect("taken");
    let fast = MoveOptions {
        speed: Some(Speed::parse("500 steps/s").expect("a speed")),
        timeout: Some(SECOND),
        ..HERE
    };
    let stopped = async {
        sleep(900 * MS).await;
        axis.stop(Stop::Free).await.expect("stopped");
    };
    let (homed, ()) = tokio::join!(axis.home(Direction::Positive, fast), stopped);
    assert!(told(homed).contains("was told to stop while it looked for home"));
    sleep(10 * SECOND).await;
    let state = axis.state().await.expect("a state");
    assert_eq!((state.moving, state.energised), (false, false));
}

pub(crate) async fn a_speed_that_is_too_low_is_refused_with_what_was_asked_for<S: Controller>() {
    let rig = S::new().await;
    let axis = rig.axis();
    for (speed, shown) in [("0.000000001 steps/s", "1e-9"), ("15.4 steps/s", "15.4")] {
        let slowly = MoveOptions { speed: Some(Speed::parse(speed).expect("a speed")), ..HERE };
        let goal = Goal::By(amount("5 steps"));
        let words = format!("MAX_SPEED {shown} is out of range: 16 to 15600 full steps/s; nothing was sent");
        assert_eq!(axis.plan(goal, slowly).await, Err(Error::Usage(words)));
    }
    let slowly = MoveOptions { speed: Some(Speed::parse("14 steps/s").expect("a speed")), ..HERE };
    let words = "TARGET_SPEED 14 is out of range: 15 to 15600 full steps/s; nothing was sent".to_owned();
    assert_eq!(axis.home(Direction::Negative, slowly).await, Err(Error::Usage(words)));
    assert_eq!(rig.starts(), 0);
}
