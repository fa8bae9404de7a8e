//! Random operations on a random line: what must hold whatever happens.
//!
//! `PROPTEST_CASES=2500` makes about 100,000 operations.

use crate::bench::{Act, Bench, Setup};
use crate::link::Fault;
use proptest::collection::vec;
use proptest::prelude::*;
use std::time::Duration;
use stepdrive_host::smsd::{Smsd, Way};
use stepdrive_host::{Direction, Error};
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::{Access, REGISTERS, Reg};
use stepdrive_spec::smsd::standard::Code;

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

/// What may happen on any line.
fn fault() -> impl Strategy<Value = Fault> {
    prop_oneof![
        10 => Just(Fault::None),
        1 => Just(Fault::LoseRequest),
        2 => Just(Fault::LoseReply),
        1 => millis(0..3000).prop_map(Fault::Delay),
        1 => Just(Fault::Postpone),
        1 => Just(Fault::Twice),
        1 => Just(Fault::StaleFirst),
        1 => Just(Fault::WrongNumber),
        1 => Just(Fault::OtherType),
        1 => vec(any::<u8>(), 0..40).prop_map(Fault::Garbage),
        1 => (0..20_usize).prop_map(Fault::Break),
        1 => (0..20_usize, millis(0..3000)).prop_map(|(place, pause)| Fault::Halves(place, pause)),
        1 => Just(Fault::Close),
        1 => Just(Fault::Refuse(Code::ErrorXor)),
        1 => Just(Fault::Refuse(Code::ErrorAccess)),
        1 => Just(Fault::Refuse(Code::ErrorWrite)),
    ]
}

/// And on a serial one, which does not mend what it carries.
fn serial_fault() -> impl Strategy<Value = Fault> {
    let (place, mask) = (0..30_usize, 1..=u8::MAX);
    prop_oneof![
        8 => fault(),
        1 => (0..20_usize).prop_map(Fault::CutRequest),
        1 => (place.clone(), mask.clone()).prop_map(|(place, mask)| Fault::DamageRequest(place, mask)),
        1 => (0..20_usize).prop_map(Fault::CutReply),
        1 => (place, mask).prop_map(|(place, mask)| Fault::DamageReply(place, mask)),
        1 => vec(any::<u8>(), 0..40).prop_map(Fault::NoiseFirst),
    ]
}

/// Registers that hold a value and take any within their range at any time, whatever the model.
fn held() -> impl Strategy<Value = (Reg, i64)> {
    let regs = [Reg::MaxSpeed, Reg::FsSpeed, Reg::TargetSpeed, Reg::Mask, Reg::Relay, Reg::LanPort];
    prop::sample::select(regs.to_vec()).prop_flat_map(|reg| {
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

fn step(fault: impl Strategy<Value = Fault> + Clone) -> impl Strategy<Value = Step> {
    let faults = prop_oneof![vec(fault.clone(), 0..1), vec(fault, 0..12)];
    let patience = prop::option::weighted(0.2, prop_oneof![millis(0..50), millis(0..5000)]);
    (operation(), faults, patience).prop_map(|(operation, faults, patience)| Step {
        operation,
        faults,
        patience,
    })
}

/// The instruction that a coil is.
fn of_coil(coil: Reg) -> Option<Act> {
    let opcodes = [
        (Reg::Clr, Opcode::GetStatusAndClr),
        (Reg::ResetPos, Opcode::ResetPos),
        (Reg::SoftStop, Opcode::SoftStop),
        (Reg::HardStop, Opcode::HardStop),
        (Reg::SoftHiZ, Opcode::SoftHiZ),
        (Reg::HardHiZ, Opcode::HardHiZ),
        (Reg::ResetPowerstep01, Opcode::ResetPowerstep01),
    ];
    opcodes.into_iter().find(|(reg, _)| *reg == coil).map(|(_, opcode)| Act::Instruction(opcode))
}

/// Carries out an operation, and says what it asked to act.
async fn carry_out(bench: &Bench, operation: &Operation) -> (Option<Act>, Result<(), Error>) {
    let client = &bench.client;
    match operation {
        Operation::Read(reg) => (None, read(bench, *reg).await),
        Operation::ReadAll => (None, client.read_all().await.map(drop)),
        Operation::Snapshot => (None, client.snapshot().await.map(drop)),
        Operation::Write(reg, value) => {
            let written = client.write(*reg, *value).await;
            if written.is_ok() && *reg != Reg::TargetSpeed {
                assert_eq!(bench.look(*reg, 0), *value, "{reg:?}");
            }
            (None, written)
        }
        Operation::Run(direction, speed) => {
            let opcode = if *direction == Direction::Positive { Opcode::RunF } else { Opcode::RunR };
            (Some(Act::Instruction(opcode)), client.run(*direction, *speed).await)
        }
        Operation::MoveTo(position) => {
            (Some(Act::Instruction(Opcode::GoTo)), client.move_to(*position, Way::Shortest).await)
        }
        Operation::MoveBy(by) => (Some(Act::Instruction(Opcode::MoveF)), client.move_by(*by).await),
        Operation::Trigger(coil) => (of_coil(*coil), client.trigger(*coil).await),
        Operation::Command(opcode) => (Some(Act::Instruction(*opcode)), client.command(*opcode, None).await),
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
            (Some(Act::Instruction(opcode)), client.start_program(*area).await)
        }
        Operation::Password(password) => {
            let changed = client.change_password(*password).await;
            if changed.is_ok() {
                assert_eq!(bench.change(|drive, _| drive.memory().password), *password);
            }
            (Some(Act::Password), changed)
        }
        Operation::Identity => (None, client.identity().await.map(drop)),
        Operation::Cut | Operation::Refuse(_) | Operation::Pass(_) => {
            happen(bench, operation).await;
            (None, Ok(()))
        }
    }
}

/// Only what does not change by itself can be compared with what is there now.
async fn read(bench: &Bench, reg: Reg) -> Result<(), Error> {
    let rested = bench.open() <= 1 && rests(bench);
    let read = bench.client.read(reg).await;
    if let Err(Error::Usage(why)) = &read {
        let standard = reg == Reg::LanId && why == "stage has no ID: it has the standard firmware";
        let expected = if standard { Ok(()) } else { Err(Error::Usage(why.clone())) };
        assert_eq!(bench.client.check_readable(reg), expected, "{reg:?}");
        return Ok(());
    }
    if let (Ok(read), true) = (&read, rested && rests(bench) && reg != Reg::AccessFlag) {
        assert_eq!(*read, bench.look(reg, 0), "{reg:?}");
    }
    read.map(drop)
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

fn words(program: &[Instruction]) -> Vec<u32> {
    program.iter().map(|line| line.word()).collect()
}

/// What has acted is what was asked, once at most; once exactly when that was said, never when the contrary was.
async fn check_acts(bench: &Bench, wanted: Option<Act>, outcome: &Result<(), Error>) {
    let mut acts = bench.acts();
    if let Err(Error::Uncertain { state, .. }) = outcome {
        tokio::time::sleep(LONGEST).await;
        let late = bench.acts();
        let said = state.contains(MAY_ARRIVE) || state.contains("could not be");
        assert!(late.is_empty() || said, "{late:?}, {state}");
        acts.extend(late);
    }
    let Some(wanted) = wanted else { return assert_eq!(acts, [], "{outcome:?}") };
    match outcome {
        // A change to the password that is in force already need not have arrived to be true.
        Ok(()) if wanted == Act::Password && acts.is_empty() => {
            tokio::time::sleep(LONGEST).await;
            bench.acts();
        }
        Ok(()) => assert_eq!(acts, [wanted]),
        Err(Error::Refused(why)) if why.contains("(CMD_ERROR is set)") => assert_eq!(acts, [wanted], "{why}"),
        Err(Error::Uncertain { .. }) => assert!(acts.is_empty() || acts == [wanted], "{acts:?}"),
        outcome => assert_eq!(acts, [], "{outcome:?}"),
    }
}

/// With the line good again, the client sees what is there.
async fn check_view(bench: &Bench) {
    bench.heal();
    tokio::time::sleep(LONGEST).await;
    bench.client.log_in().await.expect("the line is good");
    bench.client.stop_program().await.expect("always taken");
    bench.client.hard_stop().await.expect("always taken");
    tokio::time::sleep(Duration::from_secs(1)).await;
    let readings = bench.client.read_all().await.expect("the line is good");
    assert!(readings.len() > 50, "{}", readings.len());
    for reading in readings.into_iter().filter(|reading| reading.reg != Reg::AccessFlag) {
        assert_eq!(reading.value, bench.look(reading.reg, reading.index), "{reading:?}");
    }
    let acts = [Act::Instruction(Opcode::StopProgramMem), Act::Instruction(Opcode::HardStop)];
    assert_eq!(bench.acts(), acts);
}

async fn play(setup: &Setup, steps: &[Step]) {
    let bench = Bench::of(setup);
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
                assert!(bench.acts().len() <= 1, "{step:?}");
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
    fn whatever_a_serial_line_does_the_client_sees_what_is_there_and_nothing_is_done_twice(
        steps in vec(step(serial_fault().boxed()), 1..80),
    ) {
        virtual_time(play(&Setup::default(), &steps));
    }

    #[test]
    fn whatever_a_connection_does_the_client_sees_what_is_there_and_nothing_is_done_twice(
        steps in vec(step(fault().boxed()), 1..80),
    ) {
        virtual_time(play(&Setup::raw(), &steps));
    }
}
