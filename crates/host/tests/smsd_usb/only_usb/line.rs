//! The standard protocol over USB, and over TCP with the standard firmware, as the suite sees them.

use crate::common::link::Fault;
use crate::line::Line;
use crate::standard_bench::{Act, Bench, Setup, Standard};
use proptest::collection::vec;
use proptest::prelude::*;
use std::time::Duration;
use stepdrive_host::smsd::{Smsd, SmsdOptions};
use stepdrive_proto::smsd::{PacketBuf, encode_request};
use stepdrive_spec::smsd::instructions::{Instruction, Opcode, PROGRAM_LINES};
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::standard::{Code, Request, VERSION_2};

/// What has no place in the controller before its command.
const OPERANDS: [Reg; 3] = [Reg::TargetSpeed, Reg::TargetPos, Reg::TargetInput];

/// What no instruction writes by itself.
pub(crate) const NO_VALUES: [Reg; 8] = [
    Reg::BComplete,
    Reg::CmdBuffer,
    Reg::NProg,
    Reg::NStr,
    Reg::SectorSize,
    Reg::ProgSize,
    Reg::MemCmd,
    Reg::Wait,
];

/// A serial line does not mend what it carries.
pub(crate) struct Packets<const SERIAL: bool>;
/// The USB port.
pub(crate) type Usb = Packets<true>;
/// TCP, with the standard firmware.
pub(crate) type Lan = Packets<false>;

impl<const SERIAL: bool> Packets<SERIAL> {
    fn setup() -> Setup {
        if SERIAL { Setup::default() } else { Setup::raw() }
    }
}

impl<const SERIAL: bool> Line for Packets<SERIAL> {
    type Protocol = Standard;

    fn with(model: Model, options: SmsdOptions) -> Bench {
        Bench::of(&Setup { model, options, ..Self::setup() })
    }

    const KINDS: usize = Model::ALL.len();

    fn kinds() -> Vec<Bench> {
        Model::ALL.into_iter().map(|model| Self::with(model, SmsdOptions::default())).collect()
    }

    fn command(opcode: Opcode) -> Act {
        Act::Instruction(opcode)
    }

    fn coil(coil: Reg) -> Act {
        let opcodes = [
            (Reg::Clr, Opcode::GetStatusAndClr),
            (Reg::ResetPos, Opcode::ResetPos),
            (Reg::SoftStop, Opcode::SoftStop),
            (Reg::HardStop, Opcode::HardStop),
            (Reg::SoftHiZ, Opcode::SoftHiZ),
            (Reg::HardHiZ, Opcode::HardHiZ),
            (Reg::ResetPowerstep01, Opcode::ResetPowerstep01),
        ];
        let opcode =
            opcodes.into_iter().find(|(reg, _)| *reg == coil).expect("a coil that is an instruction");
        Act::Instruction(opcode.1)
    }

    fn password() -> Act {
        Act::Password
    }

    fn own_troubles() -> Vec<Fault> {
        let mut faults = vec![Fault::OtherType, Fault::Garbage(vec![0xFF; 2000])];
        if SERIAL {
            faults.extend(serial_troubles());
        }
        faults
    }

    const SERIAL: bool = SERIAL;
    // Without marks a request may be taken for the end of the one before.
    const SENDS_AHEAD: bool = SERIAL;
    const NO_REPLY: &[Fault] = &[];
    const LONGEST_READ: Duration = Duration::from_secs(4);
    const LONGEST_LOGIN: Duration = Duration::from_millis(3600);

    fn own_fault() -> (u32, BoxedStrategy<Fault>) {
        let codes = vec![Code::ErrorXor, Code::ErrorAccess, Code::ErrorWrite];
        let own = prop_oneof![1 => Just(Fault::OtherType), 3 => prop::sample::select(codes).prop_map(Fault::Refuse)];
        if SERIAL { (20, prop_oneof![1 => own, 4 => serial_fault()].boxed()) } else { (4, own.boxed()) }
    }

    const LOGIN: usize = 1;
    // Flags.
    const BEFORE_COMMAND: usize = 1;
    const COMMAND: u64 = 2;
    const STOP_PROGRAM: u64 = 1;
    const BEFORE_PASSWORD: usize = 0;
    const SNAPSHOT: u64 = 4;
    const STATE: u64 = 7;
    // The versions are known from before.
    const WHOLE_MAP: u64 = 11;
    const READS: &[(&[Reg], u64)] = &[
        (&[Reg::AbsPos, Reg::Ready, Reg::Stop, Reg::StatusWord, Reg::AbsPos], 1),
        (&[Reg::Mask, Reg::Inputs, Reg::Wait], 1),
        (&[Reg::MotorType, Reg::Microstepping, Reg::ModeNPrograms, Reg::NProgram, Reg::NCommand], 2),
        (&[Reg::LanPort, Reg::LanDhcp, Reg::HwMajor, Reg::FwMinor], 1),
    ];
    const FIVE_WRITES: u64 = 5;

    fn length(opcode: Opcode) -> usize {
        let mut packet = PacketBuf::new();
        let word = Instruction { opcode, data: 0 }.word();
        encode_request(&mut packet, Self::setup().framing, VERSION_2, 9, &Request::Command(word));
        packet.len()
    }

    const BLOCK: usize = PROGRAM_LINES;

    const UNREADABLE: usize = 28;
    const ASKED_FOR_RANGE: &[Reg] = &[];
    const HELD: &[Reg] =
        &[Reg::MaxSpeed, Reg::FsSpeed, Reg::TargetSpeed, Reg::Mask, Reg::Relay, Reg::LanPort];
    const WIDE: (Reg, i64) = (Reg::MaxSpeed, 12_345);

    fn takes_value(reg: Reg) -> bool {
        reg != Reg::Cmd && !NO_VALUES.contains(&reg) && (SERIAL || reg != Reg::LanId)
    }

    // Whether the one who asks has access is another question; and the standard firmware has no `ID`.
    fn compares(reg: Reg) -> bool {
        reg != Reg::AccessFlag && (SERIAL || reg != Reg::LanId)
    }

    fn holds(bench: &Bench, reg: Reg, index: u16) -> i64 {
        if OPERANDS.contains(&reg) { bench.client.supposed(reg) } else { bench.look(reg, index) }
    }

    async fn fill(bench: &Bench) {
        bench.client.write(Reg::WorkCurrent, 33).await.expect("in range");
    }

    const TELLS_WHETHER_A_PROGRAM_RUNS: bool = false;

    const CONTROLLER: &'static str = "stage";
    const OF_THE_PASSWORD: &'static str = "";
    const PROGRAM_RUNS: &'static str = "refused to write the program to memory 3 (ERROR_WRITE: the memory cannot be \
         written now); the program in that memory area is running, or a procedure of MEM_CMD is at work: stop the program, \
         or wait; nothing was changed";
    const ENERGISED: &'static str = "refused to write CURRENT_OR_VOLTAGE 1, MOTOR_TYPE 0, MICROSTEPPING 4, \
         WORK_CURRENT 10, STOP_CURRENT 1: the motor is energised; de-energise it first (Soft HiZ or Hard HiZ); \
         nothing was changed but CMD_ERROR, which is set: clear it (CLR)";
}

fn serial_troubles() -> Vec<Fault> {
    let mut faults = Vec::new();
    faults.extend((0..12).map(Fault::CutRequest));
    faults.extend((0..15).map(Fault::CutReply));
    for mask in [1, 0x80, 0xFF] {
        faults.extend((0..12).map(|place| Fault::DamageRequest(place, mask)));
        faults.extend((0..15).map(|place| Fault::DamageReply(place, mask)));
    }
    faults.push(Fault::NoiseFirst(b"booting\r\n\xFA\x01\x02".to_vec()));
    faults.push(Fault::NoiseFirst(vec![0xFA, 0xFB, 0xFE, 0xFE, 0xFA]));
    faults
}

fn serial_fault() -> impl Strategy<Value = Fault> {
    let (place, mask) = (0..30_usize, 1..=u8::MAX);
    prop_oneof![
        (0..20_usize).prop_map(Fault::CutRequest),
        (place.clone(), mask.clone()).prop_map(|(place, mask)| Fault::DamageRequest(place, mask)),
        (0..20_usize).prop_map(Fault::CutReply),
        (place, mask).prop_map(|(place, mask)| Fault::DamageReply(place, mask)),
        vec(any::<u8>(), 0..40).prop_map(Fault::NoiseFirst),
    ]
}
