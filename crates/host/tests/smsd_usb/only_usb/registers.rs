//! The registers of the map, over a protocol that has none.

use super::line::{NO_VALUES, Usb};
use crate::common::link::Fault;
use crate::common::station::{MS, text};
use crate::standard_bench::{Act, Bench};
use crate::suite::turning;
use stepdrive_host::smsd::{Smsd, Step};
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::{REGISTERS, Reg};
use stepdrive_spec::smsd::standard::Code;

#[tokio::test(start_paused = true)]
async fn a_register_that_cannot_be_read_says_why_and_nothing_is_sent() {
    let bench = Bench::new();
    for row in REGISTERS {
        let Err(why) = bench.client.check_readable(row.id) else { continue };
        assert_eq!(bench.client.read(row.id).await, Err(why), "{}", row.name);
    }
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
async fn a_motor_that_stops_while_it_is_asked_about_is_shown_as_it_was() {
    let bench = turning::<Usb>(Bench::new()).await;
    // Late replies: the motor has stopped in the meantime, and that is not told of the position before.
    bench.client.soft_stop().await.expect("always taken");
    bench.faults([Fault::None, Fault::Delay(900 * MS)]);
    let snapshot = bench.client.snapshot().await.expect("logged in");
    assert!(snapshot.is_moving() && i64::from(snapshot.position) > bench.look(Reg::AbsPos, 0));
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
async fn what_no_instruction_writes_by_itself_says_so() {
    let bench = Bench::ready().await;
    for reg in NO_VALUES {
        let (min, max) = reg.info().range(Model::Smsd42);
        for value in [min, max] {
            let told = text(bench.client.write_at(reg, reg.info().count - 1, value).await);
            assert!(told.contains("cannot be written here: "), "{told}");
        }
    }
    let told = text(bench.client.write(Reg::Wait, 1).await);
    assert_eq!(
        told,
        "Wait cannot be written here: the standard protocol has no instruction for it; nothing was sent"
    );
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
    let bench = turning::<Usb>(Bench::new()).await;
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
