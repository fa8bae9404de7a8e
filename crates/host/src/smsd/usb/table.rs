//! Which request reads a register, and which writes it.

use stepdrive_spec::smsd::instructions::Opcode;
use stepdrive_spec::smsd::mode::MotorConfiguration;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::standard::{Code, LanParameters, Versions};
use stepdrive_spec::smsd::status::{MotStatus, Status};

/// Why a register cannot be read or written.
pub(super) type Why = &'static str;

const NO_INSTRUCTION: Why = "the standard protocol has no instruction for it";
const OPERAND: Why = "it is kept here until the next command of CMD goes out with it";
const WHOLE: Why = "the standard protocol reads and writes programs whole";
const PASSWORD: Why = "the standard protocol sends the password when it logs in, and changes it as a whole";
const LAST_COMMAND: Why = "the standard protocol does not tell the last command";
const NO_REGISTER_MAP: Why = "the standard protocol has no register map";
const NOTHING: Why = "it is done, and tells nothing";
const READ_ONLY: Why = "it can only be read";

/// The request whose reply has the value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Question {
    /// An instruction.
    Instruction(Opcode),
    /// Any, by somebody who may not be logged in.
    Access,
    /// The versions.
    Versions,
    /// The LAN parameters.
    Lan,
}

/// Where in a reply the value is.
#[derive(Clone, Copy, Debug)]
pub(super) enum Place {
    /// In the flags of the status.
    Flag(fn(Status) -> bool),
    /// It is the status.
    Status,
    /// In `RETURN_DATA`.
    Data(fn(u32) -> i64),
    /// It is the code of the reply.
    Code(fn(Code) -> bool),
    /// In the motor configuration.
    Mode(fn(MotorConfiguration) -> u16),
    /// In the versions.
    Versions(fn(&Versions) -> u16),
    /// In the LAN parameters, by its number in the row. `None` where the controller has no such parameter.
    Lan(fn(&mut LanParameters, usize) -> Option<Octets<'_>>),
}

/// A LAN parameter in its structure.
#[derive(Debug)]
pub(super) enum Octets<'a> {
    /// One byte.
    One(&'a mut u8),
    /// Two.
    Two(&'a mut u16),
}

impl Octets<'_> {
    /// What it is.
    pub(super) fn get(&self) -> i64 {
        match self {
            Octets::One(value) => i64::from(**value),
            Octets::Two(value) => i64::from(**value),
        }
    }

    /// Sets it, to a value that is in range.
    pub(super) fn set(self, value: i64) {
        match self {
            Octets::One(place) => *place = u8::try_from(value).unwrap_or(u8::MAX),
            Octets::Two(place) => *place = u16::try_from(value).unwrap_or(u16::MAX),
        }
    }
}

/// How a register is read.
pub(super) type Source = (Question, Place);

/// How a register is written.
#[derive(Clone, Copy, Debug)]
pub(super) enum Sink {
    /// By an instruction with the value as its data.
    Set(Opcode),
    /// As part of the motor configuration.
    Mode(fn(&mut MotorConfiguration) -> &mut u16),
    /// By one instruction for 0, and another for 1.
    Switch(Opcode, Opcode),
    /// By an instruction that acts.
    Trigger(Opcode),
    /// As part of the LAN parameters, where it is read.
    Lan,
    /// By putting the LAN parameters into effect.
    Apply,
    /// Not at all: it is kept as the operand of a command.
    Operand,
    /// It is the command.
    Command,
}

/// Whether a register is kept here as the operand of a command.
pub(super) fn is_operand(reg: Reg) -> bool {
    matches!(sink(reg), Ok(Sink::Operand))
}

/// A row: a register, how it is read and how it is written.
struct Way {
    reg: Reg,
    source: Result<Source, Why>,
    sink: Result<Sink, Why>,
}

/// Every register, in the order of the map.
static WAYS: &[Way] = &[
    acts(Reg::Clr, Sink::Trigger(Opcode::GetStatusAndClr)),
    acts(Reg::ResetPos, Sink::Trigger(Opcode::ResetPos)),
    acts(Reg::ResetPowerstep01, Sink::Trigger(Opcode::ResetPowerstep01)),
    acts(Reg::SoftStop, Sink::Trigger(Opcode::SoftStop)),
    acts(Reg::HardStop, Sink::Trigger(Opcode::HardStop)),
    acts(Reg::SoftHiZ, Sink::Trigger(Opcode::SoftHiZ)),
    acts(Reg::HardHiZ, Sink::Trigger(Opcode::HardHiZ)),
    both(Reg::Relay, code(Opcode::GetRele, is_on), Sink::Switch(Opcode::ClrRele, Opcode::SetRele)),
    neither(Reg::BComplete, WHOLE),
    acts(Reg::ApplyNetworkConfiguration, Sink::Apply),
    reads(Reg::HiZ, flag(|status| status.hi_z)),
    reads(Reg::Stop, flag(|status| matches!(status.motion, MotStatus::Stopped))),
    reads(Reg::ConstSpeed, flag(|status| matches!(status.motion, MotStatus::ConstantSpeed))),
    reads(Reg::AccFlag, flag(|status| matches!(status.motion, MotStatus::Accelerating))),
    reads(Reg::DecFlag, flag(|status| matches!(status.motion, MotStatus::Decelerating))),
    reads(Reg::Ready, flag(|status| status.ready)),
    reads(Reg::SwF, flag(|status| status.sw_f)),
    reads(Reg::SwEvn, flag(|status| status.sw_evn)),
    reads(Reg::DirFlag, flag(|status| status.forward)),
    reads(Reg::CmdError, flag(|status| status.cmd_error)),
    reads(Reg::AccessFlag, (Question::Access, Place::Code(is_access))),
    Way { reg: Reg::ProgramRun, source: Err(NO_INSTRUCTION), sink: Err(READ_ONLY) },
    reads(Reg::Speed, data(Opcode::GetSpeed, i64::from)),
    reads(Reg::AbsPos, data(Opcode::GetAbsPos, |data| position(data).into())),
    reads(Reg::ElPos, data(Opcode::GetElPos, i64::from)),
    reads(Reg::StatusWord, (STATUS, Place::Status)),
    reads(Reg::Inputs, data(Opcode::StatusInEvent, byte::<0>)),
    reads(Reg::ModeNPrograms, data(Opcode::GetMode, |data| i64::from(data >> 19 & 3))),
    reads(Reg::NProgram, data(Opcode::GetStack, |data| i64::from(data >> 8 & 3))),
    reads(Reg::NCommand, data(Opcode::GetStack, byte::<0>)),
    reads(Reg::HwMajor, versions(|versions| versions.hardware[0])),
    reads(Reg::HwVer, versions(|versions| versions.hardware[1])),
    reads(Reg::FwMajor, versions(|versions| versions.firmware[0])),
    reads(Reg::FwMinor, versions(|versions| versions.firmware[1])),
    Way { reg: Reg::RmMajor, source: Err(NO_REGISTER_MAP), sink: Err(READ_ONLY) },
    Way { reg: Reg::RmMinor, source: Err(NO_REGISTER_MAP), sink: Err(READ_ONLY) },
    both(Reg::MinSpeed, data(Opcode::GetMinSpeed, i64::from), Sink::Set(Opcode::SetMinSpeed)),
    both(Reg::MaxSpeed, data(Opcode::GetMaxSpeed, i64::from), Sink::Set(Opcode::SetMaxSpeed)),
    Way { reg: Reg::Acc, source: Err(NO_INSTRUCTION), sink: Ok(Sink::Set(Opcode::SetAcc)) },
    Way { reg: Reg::Dec, source: Err(NO_INSTRUCTION), sink: Ok(Sink::Set(Opcode::SetDec)) },
    Way { reg: Reg::FsSpeed, source: Err(NO_INSTRUCTION), sink: Ok(Sink::Set(Opcode::SetFsSpeed)) },
    Way { reg: Reg::TargetSpeed, source: Err(OPERAND), sink: Ok(Sink::Operand) },
    Way { reg: Reg::TargetPos, source: Err(OPERAND), sink: Ok(Sink::Operand) },
    Way { reg: Reg::TargetInput, source: Err(OPERAND), sink: Ok(Sink::Operand) },
    Way { reg: Reg::Cmd, source: Err(LAST_COMMAND), sink: Ok(Sink::Command) },
    both(
        Reg::CurrentOrVoltage,
        mode(|mode| mode.current_or_voltage),
        Sink::Mode(|mode| &mut mode.current_or_voltage),
    ),
    both(Reg::MotorType, mode(|mode| mode.motor_type), Sink::Mode(|mode| &mut mode.motor_type)),
    both(Reg::Microstepping, mode(|mode| mode.microstepping), Sink::Mode(|mode| &mut mode.microstepping)),
    both(Reg::WorkCurrent, mode(|mode| mode.work_current), Sink::Mode(|mode| &mut mode.work_current)),
    both(Reg::StopCurrent, mode(|mode| mode.stop_current), Sink::Mode(|mode| &mut mode.stop_current)),
    both(Reg::Mask, data(Opcode::StatusInEvent, byte::<1>), Sink::Set(Opcode::SetMaskEvent)),
    Way { reg: Reg::Wait, source: Ok(data(Opcode::StatusInEvent, byte::<2>)), sink: Err(NO_INSTRUCTION) },
    neither(Reg::PasswordLow32, PASSWORD),
    neither(Reg::PasswordHigh32, PASSWORD),
    neither(Reg::PasswordCmd, PASSWORD),
    neither(Reg::CmdBuffer, WHOLE),
    neither(Reg::NProg, WHOLE),
    neither(Reg::NStr, WHOLE),
    neither(Reg::SectorSize, WHOLE),
    neither(Reg::ProgSize, WHOLE),
    neither(Reg::MemCmd, WHOLE),
    lan(Reg::LanId, |lan, _| lan.id.as_mut().map(Octets::One)),
    lan(Reg::LanMac, |lan, number| lan.mac.get_mut(number).map(Octets::One)),
    lan(Reg::LanIp, |lan, number| lan.ip.get_mut(number).map(Octets::One)),
    lan(Reg::LanSubnetMask, |lan, number| lan.subnet_mask.get_mut(number).map(Octets::One)),
    lan(Reg::LanGateway, |lan, number| lan.gateway.get_mut(number).map(Octets::One)),
    lan(Reg::LanDns, |lan, number| lan.dns.get_mut(number).map(Octets::One)),
    lan(Reg::LanPort, |lan, _| Some(Octets::Two(&mut lan.port))),
    lan(Reg::LanDhcp, |lan, _| Some(Octets::One(&mut lan.dhcp))),
];

/// The register that an instruction sets.
pub(super) fn set_by(opcode: Opcode) -> Option<Reg> {
    WAYS.iter().find(|way| matches!(way.sink, Ok(Sink::Set(set)) if set == opcode)).map(|way| way.reg)
}

/// How a register is read.
pub(super) fn source(reg: Reg) -> Result<Source, Why> {
    WAYS.iter().find(|way| way.reg == reg).map_or(Err(NO_INSTRUCTION), |way| way.source)
}

/// How a register is written.
pub(super) fn sink(reg: Reg) -> Result<Sink, Why> {
    WAYS.iter().find(|way| way.reg == reg).map_or(Err(NO_INSTRUCTION), |way| way.sink)
}

const fn both(reg: Reg, source: Source, sink: Sink) -> Way {
    Way { reg, source: Ok(source), sink: Ok(sink) }
}

const fn reads(reg: Reg, source: Source) -> Way {
    Way { reg, source: Ok(source), sink: Err(READ_ONLY) }
}

const fn acts(reg: Reg, sink: Sink) -> Way {
    Way { reg, source: Err(NOTHING), sink: Ok(sink) }
}

const fn neither(reg: Reg, why: Why) -> Way {
    Way { reg, source: Err(why), sink: Err(why) }
}

const fn lan(reg: Reg, of: fn(&mut LanParameters, usize) -> Option<Octets<'_>>) -> Way {
    both(reg, (Question::Lan, Place::Lan(of)), Sink::Lan)
}

/// Every reply to an instruction has the status; this one brings the position with it.
pub(super) const STATUS: Question = Question::Instruction(Opcode::GetAbsPos);

const fn flag(of: fn(Status) -> bool) -> Source {
    (STATUS, Place::Flag(of))
}

const fn data(opcode: Opcode, of: fn(u32) -> i64) -> Source {
    (Question::Instruction(opcode), Place::Data(of))
}

const fn code(opcode: Opcode, of: fn(Code) -> bool) -> Source {
    (Question::Instruction(opcode), Place::Code(of))
}

const fn mode(of: fn(MotorConfiguration) -> u16) -> Source {
    (Question::Instruction(Opcode::GetMode), Place::Mode(of))
}

const fn versions(of: fn(&Versions) -> u16) -> Source {
    (Question::Versions, Place::Versions(of))
}

/// A position, whether or not the controller extends its sign beyond 22 bits (sheet §6).
pub(super) const fn position(data: u32) -> i32 {
    (data << 10).cast_signed() >> 10
}

fn byte<const NUMBER: usize>(data: u32) -> i64 {
    data.to_le_bytes().get(NUMBER).copied().unwrap_or(0).into()
}

fn is_on(code: Code) -> bool {
    code == Code::StatusReleSet
}

fn is_access(code: Code) -> bool {
    code != Code::ErrorAccess
}

#[cfg(test)]
mod tests {
    use super::*;
    use stepdrive_spec::smsd::registers::{Access, REGISTERS};

    #[test]
    fn every_register_has_its_row() {
        assert!(WAYS.iter().map(|way| way.reg).eq(REGISTERS.iter().map(|row| row.id)));
    }

    #[test]
    fn what_the_map_lets_one_write_is_written_and_nothing_else() {
        for row in &REGISTERS {
            let read_only = sink(row.id).err() == Some(READ_ONLY);
            assert_eq!(read_only, row.access == Access::Read, "{}", row.name);
            let acts = matches!(sink(row.id), Ok(Sink::Trigger(_) | Sink::Apply));
            assert_eq!(acts, row.access == Access::Trigger, "{}", row.name);
            assert_eq!(source(row.id).err() == Some(NOTHING), acts, "{}", row.name);
        }
    }

    #[test]
    fn an_instruction_that_sets_takes_what_its_register_takes() {
        use stepdrive_spec::smsd::instructions::Operand;
        for row in &REGISTERS {
            let Ok(Sink::Set(opcode)) = sink(row.id) else { continue };
            let range = row.range(stepdrive_spec::smsd::models::Model::Smsd42);
            if let Operand::Number { min, max, .. } = opcode.info().operand {
                assert_eq!(range, (min.into(), max.into()), "{opcode}");
            } else {
                assert_eq!((opcode.info().operand, range), (Operand::Mask, (0, 255)));
            }
        }
    }

    #[test]
    fn a_position_is_read_in_both_forms() {
        assert_eq!(position(0xFFFF_FFFF), -1);
        assert_eq!(position(0x003F_FFFF), -1);
        assert_eq!((position(0x0020_0000), position(0x001F_FFFF)), (-2_097_152, 2_097_151));
        assert_eq!(position(0xFFE0_0000), -2_097_152);
    }

    #[test]
    fn every_part_of_the_configuration_is_read_where_it_is_written() {
        for (reg, value) in [
            (Reg::CurrentOrVoltage, 0),
            (Reg::MotorType, 30),
            (Reg::Microstepping, 7),
            (Reg::WorkCurrent, 80),
            (Reg::StopCurrent, 3),
        ] {
            let mut mode = MotorConfiguration::FACTORY;
            let Ok(Sink::Mode(part)) = sink(reg) else { panic!("{reg:?} is part of it") };
            *part(&mut mode) = value;
            let Ok((_, Place::Mode(of))) = source(reg) else { panic!("{reg:?} is read from it") };
            assert_eq!(of(MotorConfiguration::from_data(mode.data() | 3 << 19)), value, "{reg:?}");
        }
    }
}
