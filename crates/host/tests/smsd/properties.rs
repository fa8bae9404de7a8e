//! Random operations on a random line: what must hold whatever happens.
//!
//! `PROPTEST_CASES=2500` makes about 100,000 operations.

use crate::bench::{Act, Bench};
use crate::link::Fault;
use proptest::collection::vec;
use proptest::prelude::*;
use std::time::Duration;
use stepdrive_host::smsd::{Smsd, SmsdOptions, Way, WordOrder};
use stepdrive_host::{Direction, Error};
use stepdrive_spec::modbus::Exception;
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};
use stepdrive_spec::smsd::registers::{Access, REGISTERS, Reg};

/// Behind this, everything that has gone out has arrived.
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
struct Step {
    operation: Operation,
    faults: Vec<Fault>,
    patience: Option<Duration>,
}

fn millis(range: std::ops::Range<u64>) -> impl Strategy<Value = Duration> {
    range.prop_map(Duration::from_millis)
}

fn fault() -> impl Strategy<Value = Fault> {
    prop_oneof![
        10 => Just(Fault::None),
        1 => Just(Fault::LoseRequest),
        2 => Just(Fault::LoseReply),
        1 => millis(0..3000).prop_map(Fault::Delay),
        1 => Just(Fault::Postpone),
        1 => Just(Fault::Twice),
        1 => Just(Fault::StaleFirst),
        1 => Just(Fault::WrongTransaction),
        1 => Just(Fault::WrongUnit),
        1 => Just(Fault::ForeignFirst),
        1 => vec(any::<u8>(), 0..40).prop_map(Fault::Garbage),
        1 => (0..20_usize).prop_map(Fault::Cut),
        1 => (0..20_usize, millis(0..3000)).prop_map(|(place, pause)| Fault::Halves(place, pause)),
        1 => Just(Fault::Close),
        1 => Just(Fault::Except(Exception::ServerDeviceBusy)),
    ]
}

/// Registers that hold a value and take any within their range at any time, whatever the model.
fn held() -> impl Strategy<Value = (Reg, i64)> {
    let regs = [
        Reg::MaxSpeed,
        Reg::FsSpeed,
        Reg::TargetSpeed,
        Reg::TargetPos,
        Reg::TargetInput,
        Reg::Mask,
        Reg::LanPort,
    ];
    prop::sample::select(regs.to_vec()).prop_flat_map(|reg| {
        let (min, max) = reg.info().range(stepdrive_spec::smsd::models::Model::Smsd42);
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

fn operation() -> impl Strategy<Value = Operation> {
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
        5 => held().prop_map(|(reg, value)| Operation::Write(reg, value)),
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

fn step() -> impl Strategy<Value = Step> {
    let faults = prop_oneof![vec(fault(), 0..1), vec(fault(), 0..12)];
    let patience = prop::option::weighted(0.2, prop_oneof![millis(0..50), millis(0..5000)]);
    (operation(), faults, patience).prop_map(|(operation, faults, patience)| Step {
        operation,
        faults,
        patience,
    })
}

/// Carries out an operation, and says what it asked to act.
async fn carry_out(bench: &Bench, operation: &Operation) -> (Option<Act>, Result<(), Error>) {
    let rested = bench.open() <= 1 && rests(bench);
    let client = &bench.client;
    let command = |opcode: Opcode| Some((Reg::Cmd, u16::from(opcode.code())));
    match operation {
        Operation::Read(reg) => {
            let read = client.read(*reg).await;
            // Only what does not change by itself can be compared with what is there now.
            let by_itself = [Reg::AccessFlag, Reg::BComplete].contains(reg);
            if let (Ok(read), true) = (&read, rested && rests(bench) && !by_itself) {
                assert_eq!(*read, bench.look(*reg, 0), "{reg:?}");
            }
            (None, read.map(drop))
        }
        Operation::ReadAll => (None, client.read_all().await.map(drop)),
        Operation::Snapshot => (None, client.snapshot().await.map(drop)),
        Operation::Write(reg, value) => {
            let written = client.write(*reg, *value).await;
            if written.is_ok() {
                assert_eq!(bench.look(*reg, 0), *value, "{reg:?}");
            }
            (None, written)
        }
        Operation::Run(direction, speed) => {
            let opcode = if *direction == Direction::Positive { Opcode::RunF } else { Opcode::RunR };
            (command(opcode), client.run(*direction, *speed).await)
        }
        Operation::MoveTo(position) => {
            (command(Opcode::GoTo), client.move_to(*position, Way::Shortest).await)
        }
        Operation::MoveBy(by) => (command(Opcode::MoveF), client.move_by(*by).await),
        Operation::Trigger(coil) => (Some((*coil, 1)), client.trigger(*coil).await),
        Operation::Command(opcode) => (command(*opcode), client.command(*opcode, None).await),
        Operation::Store(area, program) => {
            let stored = client.store_program(*area, program).await;
            if stored.is_ok() {
                assert_eq!(words(bench, *area), program.iter().map(|line| line.word()).collect::<Vec<u32>>());
            }
            (None, stored)
        }
        Operation::Fetch(area) => {
            let fetched = client.fetch_program(*area).await;
            if let Ok(program) = &fetched {
                assert_eq!(words(bench, *area), program.iter().map(|line| line.word()).collect::<Vec<u32>>());
            }
            (None, fetched.map(drop))
        }
        Operation::Start(area) => {
            let opcode =
                Opcode::from_cmd(u16::from(Opcode::StartProgramMem0.code() + area)).expect("four of them");
            (command(opcode), client.start_program(*area).await)
        }
        Operation::Password(password) => {
            let changed = client.change_password(*password).await;
            if changed.is_ok() {
                assert_eq!(bench.change(|drive, _| drive.memory().password), *password);
            }
            (Some((Reg::PasswordCmd, 1)), changed)
        }
        Operation::Identity => (None, client.identity().await.map(drop)),
        Operation::Cut | Operation::Refuse(_) | Operation::Pass(_) => {
            happen(bench, operation).await;
            (None, Ok(()))
        }
    }
}

/// What comes from outside.
async fn happen(bench: &Bench, operation: &Operation) {
    if let Operation::Refuse(count) = operation {
        bench.refuse_connections(*count);
    } else if let Operation::Pass(time) = operation {
        tokio::time::sleep(*time).await;
    } else {
        bench.cut();
    }
}

/// Whether nothing changes in the controller by itself.
fn rests(bench: &Bench) -> bool {
    bench.look(Reg::Stop, 0) == 1 && bench.look(Reg::ProgramRun, 0) == 0
}

fn words(bench: &Bench, area: u8) -> Vec<u32> {
    bench.change(|drive, _| {
        let area = drive.memory().area(area.into());
        area.words()[..usize::from(area.size())].to_vec()
    })
}

/// What has acted is what was asked, once at most; once exactly when that was said, never when the contrary was.
async fn check_acts(bench: &Bench, wanted: Option<Act>, outcome: &Result<(), Error>) {
    let mut acts = bench.acts();
    if let Err(Error::Uncertain { state, .. }) = outcome {
        check_state(bench, wanted, acts.len(), state);
        tokio::time::sleep(LONGEST).await;
        let late = bench.acts();
        assert!(
            late.is_empty() || state.contains(MAY_ARRIVE) || state.contains("could not be"),
            "{late:?}, {state}"
        );
        acts.extend(late);
    }
    acts.retain(|act| act.0 != Reg::MemCmd);
    let Some(wanted) = wanted else { return assert_eq!(acts, [], "{outcome:?}") };
    match outcome {
        // A change to the password that is in force already need not have arrived to be true.
        Ok(()) if wanted.0 == Reg::PasswordCmd && acts.is_empty() => {
            tokio::time::sleep(LONGEST).await;
            bench.acts();
        }
        Ok(()) => assert_eq!(acts, [wanted]),
        Err(Error::Partly { done, .. }) if done.contains("was accepted") => assert_eq!(acts, [wanted]),
        Err(Error::Refused(why)) if why.contains("CMD_ERROR") => assert_eq!(acts, [wanted], "{why}"),
        Err(Error::Uncertain { .. }) => assert!(acts.is_empty() || acts == [wanted], "{acts:?}"),
        outcome => assert_eq!(acts, [], "{outcome:?}"),
    }
}

/// What an uncertain outcome tells of the controller is so.
fn check_state(bench: &Bench, wanted: Option<Act>, times: usize, state: &str) {
    if state.contains(MAY_ARRIVE) {
        return;
    }
    let Some(last) = state.strip_prefix("the last command it took is ") else { return };
    let last = last.split(';').next().expect("a name");
    let code = u16::try_from(bench.look(Reg::Cmd, 0)).expect("a code");
    assert_eq!(Opcode::from_cmd(code).map(Opcode::name), Some(last));
    assert!(times == 0 || Some((Reg::Cmd, code)) == wanted, "{state}");
}

/// With the line good again, the client sees what is there.
async fn check_view(bench: &Bench) {
    bench.heal();
    tokio::time::sleep(LONGEST).await;
    bench.client.log_in().await.expect("the line is good");
    bench.client.command(Opcode::StopProgramMem, None).await.expect("always taken");
    bench.client.hard_stop().await.expect("always taken");
    tokio::time::sleep(Duration::from_secs(1)).await;
    let readings = bench.client.read_all().await.expect("the line is good");
    for reading in readings.into_iter().filter(|reading| reading.reg != Reg::AccessFlag) {
        assert_eq!(reading.value, bench.look(reading.reg, reading.index), "{reading:?}");
    }
    assert_eq!(bench.acts(), [(Reg::Cmd, u16::from(Opcode::StopProgramMem.code())), (Reg::HardStop, 1)]);
}

async fn play(order: WordOrder, steps: &[Step]) {
    let bench = Bench::of(order, SmsdOptions::default());
    for step in steps {
        bench.faults(step.faults.iter().cloned());
        match step.patience {
            None => {
                let (wanted, outcome) = carry_out(&bench, &step.operation).await;
                check_acts(&bench, wanted, &outcome).await;
            }
            Some(patience) => {
                let _ = tokio::time::timeout(patience, carry_out(&bench, &step.operation)).await;
                bench.faults([]);
                tokio::time::sleep(LONGEST).await;
                assert!(bench.acts().iter().filter(|act| act.0 != Reg::MemCmd).count() <= 1, "{step:?}");
            }
        }
    }
    check_view(&bench).await;
}

fn virtual_time<T>(what: impl Future<Output = T>) -> T {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_time().start_paused(true).build();
    runtime.expect("a runtime").block_on(async {
        // On virtual time ten hours are nothing: whoever is not done by then never will be.
        let long = Duration::from_hours(10);
        tokio::time::timeout(long, what).await.expect("a deadlock")
    })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn whatever_the_line_does_the_client_sees_what_is_there_and_nothing_is_done_twice(
        order in prop::sample::select(WordOrder::ALL.to_vec()),
        steps in vec(step(), 1..80),
    ) {
        virtual_time(play(order, &steps));
    }
}
