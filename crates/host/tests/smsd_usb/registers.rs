//! The registers of the map, over a protocol that has none.

use crate::bench::{Act, Bench, MS, Setup, text};
use crate::link::Fault;
use std::collections::BTreeSet;
use stepdrive_host::smsd::{Smsd, Step};
use stepdrive_host::{Direction, Error};
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::{Access, REGISTERS, Reg, Register};
use stepdrive_spec::smsd::standard::Code;
use stepdrive_spec::smsd::status::MotStatus;

/// A controller with something in every corner of it, turning.
async fn turning(setup: &Setup) -> Bench {
    let bench = Bench::ready_as(setup).await;
    bench.client.write_many(&[(Reg::MaxSpeed, 700), (Reg::WorkCurrent, 33)]).await.expect("in range");
    bench.client.set_relay(true).await.expect("a relay");
    bench.change(|drive, now| drive.set_input(now, Input::In1, true));
    bench.client.run(Direction::Negative, 300).await.expect("ready");
    tokio::time::sleep(1234 * MS).await;
    bench
}

fn readable(bench: &Bench) -> impl Iterator<Item = &'static Register> {
    REGISTERS.iter().filter(|row| bench.client.check_readable(row.id).is_ok())
}

#[tokio::test(start_paused = true)]
async fn every_register_that_can_be_read_reads_as_what_the_controller_says() {
    for setup in [Setup::default(), Setup { model: Model::Smsd80, ..Setup::default() }, Setup::raw()] {
        let bench = turning(&setup).await;
        for row in readable(&bench) {
            if row.id == Reg::AccessFlag || row.id == Reg::LanId && setup == Setup::raw() {
                continue;
            }
            for index in 0..row.count {
                let read = bench.client.read_at(row.id, index).await;
                assert_eq!(read, Ok(bench.look(row.id, index)), "{} {index}", row.name);
            }
            let whole: Vec<i64> = (0..row.count).map(|index| bench.look(row.id, index)).collect();
            assert_eq!(bench.client.read_row(row.id).await, Ok(whole), "{}", row.name);
        }
        assert!(bench.look(Reg::AbsPos, 0) < -1000, "it turns");
    }
}

#[tokio::test(start_paused = true)]
async fn a_register_that_cannot_be_read_says_why_and_nothing_is_sent() {
    let bench = Bench::new();
    let mut count = 0;
    for row in REGISTERS.iter().filter(|row| bench.client.check_readable(row.id).is_err()) {
        count += 1;
        let Err(why) = bench.client.check_readable(row.id) else { continue };
        assert_eq!(bench.client.read(row.id).await, Err(why.clone()), "{}", row.name);
        assert_eq!(why.exit_code(), 1);
    }
    assert_eq!(count, 28);
    assert_eq!(
        text(bench.client.read(Reg::Acc).await),
        "ACC cannot be read here: the standard protocol has no instruction for it; it is 1000 at power-up"
    );
    assert_eq!(
        text(bench.client.read_row(Reg::CmdBuffer).await),
        "CMD cannot be read here: the standard protocol reads and writes programs whole"
    );
    assert!(bench.attempts().is_empty());
}

#[tokio::test(start_paused = true)]
async fn what_one_reply_tells_is_asked_once() {
    let bench = turning(&Setup::default()).await;
    let cases: [(&[Reg], u64); 4] = [
        (&[Reg::AbsPos, Reg::Ready, Reg::Stop, Reg::StatusWord, Reg::AbsPos], 1),
        (&[Reg::Mask, Reg::Inputs, Reg::Wait], 1),
        (&[Reg::MotorType, Reg::Microstepping, Reg::ModeNPrograms, Reg::NProgram, Reg::NCommand], 2),
        (&[Reg::LanPort, Reg::LanDhcp, Reg::HwMajor, Reg::FwMinor], 2),
    ];
    for (regs, requests) in cases {
        bench.requests();
        let values = bench.client.read_many(regs).await.expect("logged in");
        assert_eq!(bench.requests(), requests, "{regs:?}");
        let expected: Vec<i64> = regs.iter().map(|reg| bench.look(*reg, 0)).collect();
        assert_eq!(values, expected, "{regs:?}");
    }
    let all = bench.client.read_all().await.expect("logged in");
    assert_eq!(bench.requests(), 12, "the whole map");
    assert_eq!(all.len(), readable(&bench).map(|row| usize::from(row.count)).sum::<usize>());
}

#[tokio::test(start_paused = true)]
async fn four_requests_tell_what_the_motor_does_and_the_first_where_it_stands() {
    let bench = turning(&Setup::default()).await;
    bench.requests();
    let snapshot = bench.client.snapshot().await.expect("logged in");
    assert_eq!(bench.requests(), 4);
    assert_eq!(i64::from(snapshot.position), bench.look(Reg::AbsPos, 0));
    assert_eq!(i64::from(snapshot.speed), bench.look(Reg::Speed, 0));
    assert_eq!(i64::from(snapshot.el_pos), bench.look(Reg::ElPos, 0));
    assert!(snapshot.input(Input::In1) && !snapshot.input(Input::In0));
    assert_eq!(snapshot.status.motion, MotStatus::ConstantSpeed);
    // Late replies: the motor has stopped in the meantime, and that is not told of the position before.
    bench.client.soft_stop().await.expect("always taken");
    bench.faults([Fault::None, Fault::Delay(900 * MS)]);
    let snapshot = bench.client.snapshot().await.expect("logged in");
    assert!(snapshot.is_moving() && i64::from(snapshot.position) > bench.look(Reg::AbsPos, 0));
    let state = bench.client.state().await.expect("logged in");
    assert!(state.relay && state.program.running.is_none());
}

#[tokio::test(start_paused = true)]
async fn a_position_is_right_in_either_form_of_its_sign() {
    let bench = Bench::ready().await;
    for (value, position) in [(0x003F_FFFF, -1), (0xFFFF_FFFF, -1), (0x0020_0000, -2_097_152), (0x1000, 4096)]
    {
        bench.faults([Fault::Value(value)]);
        assert_eq!(bench.client.read(Reg::AbsPos).await, Ok(position));
        bench.faults([Fault::Value(value)]);
        assert_eq!(bench.client.snapshot().await.map(|seen| i64::from(seen.position)), Ok(position));
    }
}

#[tokio::test(start_paused = true)]
async fn a_value_under_the_code_of_another_is_not_believed() {
    let bench = Bench::ready().await;
    for code in [Code::Ok, Code::GetAbsPos] {
        bench.faults([Fault::Refuse(code)]);
        let error = bench.client.read(Reg::Speed).await.expect_err("not its code");
        assert_eq!(error.to_string(), format!("stage was asked to read SPEED and answered {code}"));
        assert_eq!(error.exit_code(), 2);
    }
}

#[tokio::test(start_paused = true)]
async fn every_register_that_holds_a_value_takes_its_lowest_and_highest() {
    let bench = Bench::ready().await;
    let operands = [Reg::TargetSpeed, Reg::TargetPos, Reg::TargetInput];
    let mut refused = BTreeSet::new();
    for row in REGISTERS.iter().filter(|row| row.access == Access::ReadWrite && row.id != Reg::Cmd) {
        let (min, max) = row.range(Model::Smsd42);
        let last = row.count - 1;
        for value in [min, max] {
            match bench.client.write_at(row.id, last, value).await {
                Ok(()) if operands.contains(&row.id) => assert_eq!(bench.client.supposed(row.id), value),
                Ok(()) => assert_eq!(bench.look(row.id, last), value, "{}", row.name),
                Err(error) => {
                    assert!(error.to_string().contains("cannot be written here: "), "{error}");
                    refused.insert(row.id);
                }
            }
        }
    }
    let whole =
        [Reg::BComplete, Reg::CmdBuffer, Reg::NProg, Reg::NStr, Reg::SectorSize, Reg::ProgSize, Reg::MemCmd];
    assert_eq!(refused, whole.into_iter().chain([Reg::Wait]).collect());
    let told = text(bench.client.write(Reg::Wait, 1).await);
    assert_eq!(
        told,
        "Wait cannot be written here: the standard protocol has no instruction for it; nothing was sent"
    );
}

#[tokio::test(start_paused = true)]
async fn a_value_out_of_range_is_told_and_nothing_is_sent() {
    let bench = Bench::new();
    for row in REGISTERS.iter().filter(|row| row.access == Access::ReadWrite) {
        let (_, max) = row.range(Model::Smsd80);
        for value in [max + 1, i64::MIN, i64::MAX] {
            let error = bench.client.write(row.id, value).await.expect_err("out of range");
            assert!(matches!(&error, Error::Usage(text) if text.contains(&value.to_string())), "{error}");
        }
    }
    assert_eq!(text(bench.client.write(Reg::AbsPos, 0).await), "ABS_POS can only be read; nothing was sent");
    assert!(bench.attempts().is_empty());
}

#[tokio::test(start_paused = true)]
async fn a_range_that_depends_on_the_model_is_that_of_the_model() {
    for (model, most) in [(Model::Smsd42, 42), (Model::Smsd80, 80)] {
        let bench = Bench::of(&Setup { model, ..Setup::default() });
        assert_eq!(bench.client.write(Reg::WorkCurrent, most).await, Ok(()));
        let told = text(bench.client.write(Reg::WorkCurrent, most + 1).await);
        assert!(told.contains(&format!("1 to {most} × 0.1 A on the {model}")), "{told}");
    }
}

#[tokio::test(start_paused = true)]
async fn part_of_the_motor_configuration_is_changed_and_the_rest_kept() {
    let bench = Bench::ready().await;
    let before = bench.client.motor_configuration().await.expect("logged in");
    bench.requests();
    bench.client.write_many(&[(Reg::StopCurrent, 3), (Reg::Microstepping, 7)]).await.expect("in range");
    assert_eq!(bench.requests(), 2, "GET_MODE, SET_MODE");
    let after = bench.change(|drive, _| drive.memory().motor);
    assert_eq!((after.stop_current, after.microstepping), (3, 7));
    assert_eq!((after.work_current, after.motor_type), (before.work_current, before.motor_type));
}

#[tokio::test(start_paused = true)]
async fn what_the_motor_forbids_is_refused_in_words() {
    let bench = turning(&Setup::default()).await;
    let error = bench.client.write(Reg::Acc, 99).await.expect_err("turning");
    assert_eq!(
        error.to_string(),
        "stage refused to write ACC 99: the motor is turning; stop it first; \
         nothing was changed but CMD_ERROR, which is set: clear it (CLR)"
    );
    assert_eq!(error.exit_code(), 7);
    assert_eq!(bench.look(Reg::Acc, 0), 1000);
    assert_eq!(bench.client.supposed(Reg::Acc), 1000);
    // That flag is not taken for a refusal of what may be written.
    assert_eq!(bench.client.write(Reg::MaxSpeed, 650).await, Ok(()));
    bench.requests();
    let told = text(bench.client.write(Reg::Microstepping, 7).await);
    assert_eq!(
        told,
        "stage would refuse to write MICROSTEPPING 7: the motor is energised; de-energise it first (Soft HiZ or Hard HiZ); \
         nothing was changed"
    );
    assert_eq!(bench.requests(), 1, "SET_MODE was not sent");
    bench.client.hard_stop().await.expect("always taken");
    assert_eq!(bench.client.write(Reg::Acc, 99).await, Ok(()), "standing, whatever CMD_ERROR says");
    assert_eq!(bench.look(Reg::Acc, 0), 99);
}

#[tokio::test(start_paused = true)]
async fn what_cannot_be_read_is_supposed_to_be_what_was_written() {
    let bench = Bench::ready().await;
    assert_eq!(bench.client.supposed(Reg::Acc), 1000);
    bench.client.write_many(&[(Reg::Acc, 300), (Reg::FsSpeed, 99), (Reg::TargetPos, -5)]).await.expect("ok");
    assert_eq!((bench.client.supposed(Reg::Acc), bench.client.supposed(Reg::FsSpeed)), (300, 99));
    let instruction = Instruction { opcode: Opcode::SetDec, data: 77 };
    bench.client.instruct(instruction).await.expect("an instruction");
    assert_eq!((bench.client.supposed(Reg::Dec), bench.look(Reg::Dec, 0)), (77, 77));
    bench.client.reset_motor_chip().await.expect("a coil");
    assert_eq!((bench.client.supposed(Reg::Acc), bench.look(Reg::Acc, 0)), (1000, 1000));
    assert_eq!(bench.client.supposed(Reg::TargetPos), -5, "an operand is no setting of the chip");
}

#[tokio::test(start_paused = true)]
async fn the_operand_written_before_goes_out_with_the_command() {
    let bench = Bench::ready().await;
    bench.client.write(Reg::TargetSpeed, 200).await.expect("in range");
    bench.requests();
    bench.client.write(Reg::Cmd, Opcode::RunR.code().into()).await.expect("a command");
    assert_eq!(bench.requests(), 1);
    tokio::time::sleep(1000 * MS).await;
    assert_eq!((bench.look(Reg::Speed, 0), bench.look(Reg::DirFlag, 0)), (200, 0));
    bench.client.write(Reg::HardStop, 1).await.expect("a coil");
    bench.client.write(Reg::SoftStop, 0).await.expect("FALSE does nothing");
    assert_eq!(bench.acts(), [Opcode::RunR, Opcode::HardStop].map(Act::Instruction));
    let told = text(bench.client.write_many(&[(Reg::MinSpeed, 1), (Reg::Cmd, 0x1F)]).await);
    assert_eq!(told, "CMD acts and is written alone; nothing was sent");
}

#[tokio::test(start_paused = true)]
async fn what_goes_out_is_shown_by_type_and_data() {
    let bench = Bench::ready().await;
    let shown = async |step| bench.client.sent_for(step).await.expect("it can be sent");
    assert_eq!(
        shown(Step::Write(Reg::MaxSpeed, 100)).await,
        ["02 60 90 01 00  SET_MAX_SPEED 100".to_owned()]
    );
    assert_eq!(shown(Step::Command(Opcode::MoveF, Some(-1))).await, ["02 00 FD FF FF  MOVE_F -1"]);
    assert_eq!(shown(Step::Write(Reg::HardHiZ, 1)).await, ["02 20 02 00 00  HARD_HI_Z"]);
    assert_eq!(shown(Step::Write(Reg::TargetPos, 5)).await, [""; 0]);
    assert_eq!(
        shown(Step::Write(Reg::StopCurrent, 0)).await,
        ["02 40 00 00 00  GET_MODE", "02 30 04 A8 00  SET_MODE 10753"].map(str::to_owned)
    );
    assert!(bench.client.sent_for(Step::Write(Reg::Wait, 0)).await.is_err());
    assert_eq!(bench.acts(), []);
}
