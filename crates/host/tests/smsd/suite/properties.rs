//! Random operations on a random line: what must hold whatever happens.
//!
//! `PROPTEST_CASES=2500` makes about 100,000 operations.

use super::words;
use crate::common::link::Fault;
use crate::line::{ActOf, BenchOf, Line};
use proptest::collection::vec;
use proptest::prelude::*;
use std::time::Duration;
use stepdrive_host::smsd::{Smsd, Way};
use stepdrive_host::{Direction, Error};
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::{Access, REGISTERS, Reg};

/// Behind this, everything that has gone out has arrived, unless the line is choked.
const LONGEST: Duration = Duration::from_mins(1);
/// What is said of a state that may be older than what it is about.
const MAY_ARRIVE: &str = "so what was sent may still arrive";

/// Something that somebody wants of a controller.
#[derive(Clone, Debug)]
enum Operation {
    Read(Reg),
    ReadAll,
    Snapshot,
    Write(Reg, i64),
    Run(Direction, i64),
    MoveTo(i64),
    MoveBy(i64),
    Trigger(Reg),
    Command(Opcode),
    Store(u8, Vec<Instruction>),
    Fetch(u8),
    Start(u8),
    Password(u64),
    Identity,
    /// The line is cut.
    Cut,
    /// The next connections are refused.
    Refuse(u32),
    /// Time passes.
    Pass(Duration),
}

/// One of them, with what becomes of its requests, and when somebody stops waiting for it.
#[derive(Clone, Debug)]
pub(crate) struct Step {
    operation: Operation,
    faults: Vec<Fault>,
    patience: Option<Duration>,
}

fn millis(range: std::ops::Range<u64>) -> impl Strategy<Value = Duration> {
    range.prop_map(Duration::from_millis)
}

/// What may become of a request.
fn fault<L: Line>() -> impl Strategy<Value = Fault> {
    let (weight, own) = L::own_fault();
    prop_oneof![
        10 => Just(Fault::None),
        1 => Just(Fault::LoseRequest),
        2 => Just(Fault::LoseReply),
        1 => millis(0..3000).prop_map(Fault::Delay),
        1 => Just(Fault::Postpone),
        1 => Just(Fault::Twice),
        1 => Just(Fault::StaleFirst),
        1 => Just(Fault::WrongNumber),
        1 => vec(any::<u8>(), 0..40).prop_map(Fault::Garbage),
        1 => (0..20_usize).prop_map(Fault::Break),
        1 => (0..20_usize, millis(0..3000)).prop_map(|(place, pause)| Fault::Halves(place, pause)),
        1 => Just(Fault::Close),
        weight => own,
    ]
}

/// Registers that hold a value and take any within their range at any time, whatever the model.
fn held<L: Line>() -> impl Strategy<Value = (Reg, i64)> {
    prop::sample::select(L::HELD).prop_flat_map(|reg| {
        let (min, max) = reg.info().range(Model::Smsd42);
        (Just(reg), min..=max)
    })
}

fn told() -> impl Strategy<Value = Reg> {
    let rows = REGISTERS.iter().filter(|row| matches!(row.access, Access::Read | Access::ReadWrite));
    prop::sample::select(rows.map(|row| row.id).collect::<Vec<Reg>>())
}

fn direction() -> impl Strategy<Value = Direction> {
    prop::sample::select(vec![Direction::Positive, Direction::Negative])
}

fn operation<L: Line>() -> impl Strategy<Value = Operation> {
    let coils = [
        Reg::Clr,
        Reg::ResetPos,
        Reg::SoftStop,
        Reg::HardStop,
        Reg::SoftHiZ,
        Reg::HardHiZ,
        Reg::ResetPowerstep01,
    ];
    let plain = [Opcode::SoftStop, Opcode::HardHiZ, Opcode::GoZero, Opcode::GoMark, Opcode::StopProgramMem];
    let lines = vec((-500..500).prop_map(|by| Instruction::with_position(Opcode::MoveF, by)), 0..70);
    prop_oneof![
        4 => told().prop_map(Operation::Read),
        1 => Just(Operation::ReadAll),
        3 => Just(Operation::Snapshot),
        5 => held::<L>().prop_map(|(reg, value)| Operation::Write(reg, value)),
        2 => (direction(), 15..2000_i64).prop_map(|(direction, speed)| Operation::Run(direction, speed)),
        2 => (-5000..5000_i64).prop_map(Operation::MoveTo),
        2 => (-5000..5000_i64).prop_map(Operation::MoveBy),
        5 => prop::sample::select(coils.to_vec()).prop_map(Operation::Trigger),
        3 => prop::sample::select(plain.to_vec()).prop_map(Operation::Command),
        1 => (0..4_u8, lines).prop_map(|(area, program)| Operation::Store(area, program)),
        1 => (0..4_u8).prop_map(Operation::Fetch),
        1 => (0..4_u8).prop_map(Operation::Start),
        1 => (0..3_u64).prop_map(|number| Operation::Password(0x0123_4567_89AB_CDEF + number)),
        1 => Just(Operation::Identity),
        1 => Just(Operation::Cut),
        1 => (0..5_u32).prop_map(Operation::Refuse),
        3 => millis(0..20_000).prop_map(Operation::Pass),
    ]
}

pub(crate) fn step<L: Line>() -> impl Strategy<Value = Step> {
    let faults = prop_oneof![vec(fault::<L>(), 0..1), vec(fault::<L>(), 0..12)];
    let patience = prop::option::weighted(0.2, prop_oneof![millis(0..50), millis(0..5000)]);
    (operation::<L>(), faults, patience).prop_map(|(operation, faults, patience)| Step {
        operation,
        faults,
        patience,
    })
}

/// Carries out an operation, and says what it asked to act.
async fn carry_out<L: Line>(
    bench: &BenchOf<L>,
    operation: &Operation,
) -> (Option<ActOf<L>>, Result<(), Error>) {
    let client = &bench.client;
    match operation {
        Operation::Read(reg) => (None, read::<L>(bench, *reg).await),
        Operation::ReadAll => (None, client.read_all().await.map(drop)),
        Operation::Snapshot => (None, client.snapshot().await.map(drop)),
        Operation::Write(reg, value) => {
            let written = client.write(*reg, *value).await;
            if written.is_ok() {
                assert_eq!(L::holds(bench, *reg, 0), *value, "{reg:?}");
            }
            (None, written)
        }
        Operation::Run(direction, speed) => {
            let opcode = if *direction == Direction::Positive { Opcode::RunF } else { Opcode::RunR };
            (Some(L::command(opcode)), client.run(*direction, *speed).await)
        }
        Operation::MoveTo(position) => {
            (Some(L::command(Opcode::GoTo)), client.move_to(*position, Way::Shortest).await)
        }
        Operation::MoveBy(by) => (Some(L::command(Opcode::MoveF)), client.move_by(*by).await),
        Operation::Trigger(coil) => (Some(L::coil(*coil)), client.trigger(*coil).await),
        Operation::Command(opcode) => (Some(L::command(*opcode)), client.command(*opcode, None).await),
        Operation::Store(area, program) => {
            let stored = client.store_program(*area, program).await;
            if stored.is_ok() {
                assert_eq!(bench.held(*area), words(program));
            }
            (None, stored)
        }
        Operation::Fetch(area) => {
            let fetched = client.fetch_program(*area).await;
            if let Ok(program) = &fetched {
                assert_eq!(bench.held(*area), words(program));
            }
            (None, fetched.map(drop))
        }
        Operation::Start(area) => {
            let code = u16::from(Opcode::StartProgramMem0.code() + area);
            let opcode = Opcode::from_cmd(code).expect("four of them");
            (Some(L::command(opcode)), client.start_program(*area).await)
        }
        Operation::Password(password) => {
            let changed = client.change_password(*password).await;
            if changed.is_ok() {
                assert_eq!(bench.change(|drive, _| drive.memory().password), *password);
            }
            (Some(L::password()), changed)
        }
        Operation::Identity => (None, client.identity().await.map(drop)),
        Operation::Cut | Operation::Refuse(_) | Operation::Pass(_) => {
            happen::<L>(bench, operation).await;
            (None, Ok(()))
        }
    }
}

/// Only what does not change by itself can be compared with what is there now.
async fn read<L: Line>(bench: &BenchOf<L>, reg: Reg) -> Result<(), Error> {
    let rested = bench.open() <= 1 && rests::<L>(bench);
    let by_itself = [Reg::AccessFlag, Reg::BComplete].contains(&reg);
    let read = bench.client.read(reg).await;
    if let Err(Error::Usage(why)) = &read {
        let standard = reg == Reg::LanId && why == "stage has no ID: it has the standard firmware";
        let expected = if standard { Ok(()) } else { Err(Error::Usage(why.clone())) };
        assert_eq!(bench.client.check_readable(reg), expected, "{reg:?}");
        return Ok(());
    }
    if let (Ok(read), true) = (&read, rested && rests::<L>(bench) && !by_itself) {
        assert_eq!(*read, bench.look(reg, 0), "{reg:?}");
    }
    read.map(drop)
}

/// What comes from outside.
async fn happen<L: Line>(bench: &BenchOf<L>, operation: &Operation) {
    if let Operation::Refuse(count) = operation {
        bench.refuse_connections(*count);
    } else if let Operation::Pass(time) = operation {
        tokio::time::sleep(*time).await;
    } else {
        bench.cut();
    }
}

/// Whether nothing changes in the controller by itself.
fn rests<L: Line>(bench: &BenchOf<L>) -> bool {
    bench.look(Reg::Stop, 0) == 1 && bench.look(Reg::ProgramRun, 0) == 0
}

/// Waits until everything that has gone out has arrived.
async fn settle<L: Line>(bench: &BenchOf<L>) {
    tokio::time::sleep(LONGEST).await;
    while bench.is_choked() {
        let _ = bench.client.read(Reg::Speed).await;
        tokio::time::sleep(LONGEST).await;
    }
}

/// What has acted is what was asked, once at most; once exactly when that was said, never when the contrary was.
async fn check_acts<L: Line>(bench: &BenchOf<L>, wanted: Option<ActOf<L>>, outcome: &Result<(), Error>) {
    let mut acts = L::acts(bench);
    if let Err(Error::Uncertain { state, .. }) = outcome {
        check_state::<L>(bench, wanted, acts.len(), state);
        settle::<L>(bench).await;
        let late = L::acts(bench);
        let said = state.contains(MAY_ARRIVE) || state.contains("could not be");
        assert!(late.is_empty() || said, "{late:?}, {state}");
        acts.extend(late);
    }
    let Some(wanted) = wanted else { return assert_eq!(acts, [], "{outcome:?}") };
    match outcome {
        // A change to the password that is in force already need not have arrived to be true.
        Ok(()) if wanted == L::password() && acts.is_empty() => {
            settle::<L>(bench).await;
            bench.acts();
        }
        Ok(()) => assert_eq!(acts, [wanted]),
        Err(Error::Partly { done, .. }) if done.contains("was accepted") => assert_eq!(acts, [wanted]),
        Err(Error::Refused(why)) if why.contains("(CMD_ERROR is set)") => assert_eq!(acts, [wanted], "{why}"),
        Err(Error::Uncertain { .. }) => assert!(acts.is_empty() || acts == [wanted], "{acts:?}"),
        outcome => assert_eq!(acts, [], "{outcome:?}"),
    }
}

/// What an uncertain outcome tells of the controller is so.
fn check_state<L: Line>(bench: &BenchOf<L>, wanted: Option<ActOf<L>>, times: usize, state: &str) {
    if state.contains(MAY_ARRIVE) {
        return;
    }
    let Some(last) = state.strip_prefix("the last command it took is ") else { return };
    let last = last.split(';').next().expect("a name");
    let code = u16::try_from(bench.look(Reg::Cmd, 0)).expect("a code");
    let opcode = Opcode::from_cmd(code).expect("it was taken");
    assert_eq!(opcode.name(), last);
    assert!(times == 0 || Some(L::command(opcode)) == wanted, "{state}");
}

/// With the line good again, the client sees what is there.
async fn check_view<L: Line>(bench: &BenchOf<L>) {
    bench.heal();
    settle::<L>(bench).await;
    bench.client.log_in().await.expect("the line is good");
    bench.client.stop_program().await.expect("always taken");
    bench.client.hard_stop().await.expect("always taken");
    tokio::time::sleep(Duration::from_secs(1)).await;
    let readings = bench.client.read_all().await.expect("the line is good");
    assert!(readings.len() > 50, "{}", readings.len());
    for reading in readings.into_iter().filter(|reading| reading.reg != Reg::AccessFlag) {
        assert_eq!(reading.value, bench.look(reading.reg, reading.index), "{reading:?}");
    }
    assert_eq!(bench.acts(), [L::command(Opcode::StopProgramMem), L::coil(Reg::HardStop)]);
}

async fn play<L: Line>(kind: usize, steps: &[Step]) {
    let bench = L::kinds().swap_remove(kind);
    for step in steps {
        bench.faults(step.faults.iter().cloned());
        match step.patience {
            None => {
                let (wanted, outcome) = carry_out::<L>(&bench, &step.operation).await;
                check_acts::<L>(&bench, wanted, &outcome).await;
            }
            Some(patience) => {
                let _ = tokio::time::timeout(patience, carry_out::<L>(&bench, &step.operation)).await;
                bench.faults([]);
                settle::<L>(&bench).await;
                assert!(L::acts(&bench).len() <= 1, "{step:?}");
            }
        }
    }
    check_view::<L>(&bench).await;
}

/// Plays through all that, on virtual time.
pub(crate) fn play_through<L: Line>(kind: usize, steps: &[Step]) {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_time().start_paused(true).build();
    runtime.expect("a runtime").block_on(async {
        // On virtual time ten hours are nothing: whoever is not done by then never will be.
        let long = Duration::from_hours(10);
        tokio::time::timeout(long, play::<L>(kind, steps)).await.expect("a deadlock");
    });
}

/// The property as a test of a line.
macro_rules! hold {
    ($line:ty) => {
        mod properties {
            use crate::line::Line;
            use crate::suite::properties::{play_through, step};
            use proptest::collection::vec;
            use proptest::prelude::*;

            proptest! {
                #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

                #[test]
                fn whatever_the_line_does_the_client_sees_what_is_there_and_nothing_is_done_twice(
                    kind in 0..<$line as Line>::KINDS,
                    steps in vec(step::<$line>(), 1..80),
                ) {
                    play_through::<$line>(kind, &steps);
                }
            }
        }
    };
}

pub(crate) use hold;
