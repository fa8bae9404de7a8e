//! Modbus TCP, as the suite sees it.

use crate::common::link::Fault;
use crate::line::Line;
use crate::modbus_bench::{Act, Bench, Modbus};
use proptest::prelude::*;
use std::time::Duration;
use stepdrive_drive::smsd::Memory;
use stepdrive_host::smsd::{SmsdOptions, WordOrder};
use stepdrive_spec::modbus::Exception;
use stepdrive_spec::smsd::instructions::Opcode;
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::Reg;

/// Bytes of a request that reads, or writes one register or coil.
const REQUEST: usize = 12;

pub(crate) struct ModbusTcp;

impl Line for ModbusTcp {
    type Protocol = Modbus;

    fn with(model: Model, options: SmsdOptions) -> Bench {
        Bench::with(model, WordOrder::LowFirst, Memory::factory(), options)
    }

    const KINDS: usize = WordOrder::ALL.len();

    fn kinds() -> Vec<Bench> {
        WordOrder::ALL.into_iter().map(|order| Bench::of(order, SmsdOptions::default())).collect()
    }

    fn command(opcode: Opcode) -> Act {
        (Reg::Cmd, opcode.code().into())
    }

    fn coil(coil: Reg) -> Act {
        (coil, 1)
    }

    fn password() -> Act {
        (Reg::PasswordCmd, 1)
    }

    fn acts(bench: &Bench) -> Vec<Act> {
        bench.acts().into_iter().filter(|(reg, _)| *reg != Reg::MemCmd).collect()
    }

    fn own_troubles() -> Vec<Fault> {
        vec![Fault::WrongUnit, Fault::ForeignFirst, Fault::Garbage(vec![0, 0, 0, 0, 0, 1])]
    }

    const SENDS_AHEAD: bool = true;
    const NO_REPLY: &[Fault] = &[Fault::WrongUnit];
    const LONGEST_READ: Duration = Duration::from_millis(3100);
    const LONGEST_LOGIN: Duration = Duration::from_millis(2500);

    fn own_fault() -> (u32, BoxedStrategy<Fault>) {
        let faults = vec![Fault::WrongUnit, Fault::ForeignFirst, Fault::Except(Exception::ServerDeviceBusy)];
        (3, prop::sample::select(faults).boxed())
    }

    // Whether anybody is logged in, the password in two parts.
    const LOGIN: usize = 3;
    // Flags, operand.
    const BEFORE_COMMAND: usize = 2;
    const COMMAND: u64 = 4;
    const STOP_PROGRAM: u64 = 1;
    // The password in two parts.
    const BEFORE_PASSWORD: usize = 1;
    const SNAPSHOT: u64 = 1;
    const STATE: u64 = 4;
    const WHOLE_MAP: u64 = 13;
    const READS: &[(&[Reg], u64)] =
        &[(&[Reg::MaxSpeed, Reg::AbsPos, Reg::MinSpeed, Reg::Speed, Reg::MaxSpeed], 2)];
    const FIVE_WRITES: u64 = 2;

    fn length(_opcode: Opcode) -> usize {
        REQUEST
    }

    const BLOCK: usize = 32;

    // Eight coils that act, the password in two parts and its command.
    const UNREADABLE: usize = 11;
    const ASKED_FOR_RANGE: &[Reg] = &[Reg::WorkCurrent, Reg::MotorType];
    const HELD: &[Reg] = &[
        Reg::MaxSpeed,
        Reg::FsSpeed,
        Reg::TargetSpeed,
        Reg::TargetPos,
        Reg::TargetInput,
        Reg::Mask,
        Reg::LanPort,
    ];
    const WIDE: (Reg, i64) = (Reg::TargetPos, -77_777);

    fn takes_value(reg: Reg) -> bool {
        ![Reg::Cmd, Reg::MemCmd, Reg::BComplete, Reg::Wait].contains(&reg)
    }

    async fn fill(bench: &Bench) {
        bench
            .client
            .write_many(&[(Reg::TargetPos, -2_000_000), (Reg::TargetInput, 5)])
            .await
            .expect("in range");
        for (index, value) in (0..32).zip([0x1234_5678, 0xFFFF_FFFF, 0, 0x8000_0001].into_iter().cycle()) {
            bench.client.write_at(Reg::CmdBuffer, index, value).await.expect("a buffer takes any words");
        }
    }

    fn check_shown(bench: &Bench, reg: Reg, value: i64) {
        assert_eq!(bench.look(reg, 0), value, "{reg:?}");
    }

    const TELLS_WHETHER_A_PROGRAM_RUNS: bool = true;

    const CONTROLLER: &'static str = "stage (unit 1)";
    const OF_THE_PASSWORD: &'static str = ", in either word order";
    const PROGRAM_RUNS: &'static str = "refused MEM_CMD 2 (Modbus exception 06 (server device busy)): a procedure of \
         MEM_CMD is at work, or the program in that memory area is running; wait, or stop the program";
    const ENERGISED: &'static str = "refused CURRENT_OR_VOLTAGE 1, MOTOR_TYPE 0, MICROSTEPPING 4, WORK_CURRENT 10, \
         STOP_CURRENT 1 (Modbus exception 06 (server device busy)): \
         the motor is energised; de-energise it first (Soft HiZ or Hard HiZ); nothing was changed";

    fn state_behind(last: Opcode, motor: &str) -> String {
        format!("the last command it took is {last}; {motor}")
    }
}
