//! What the numbers of both families mean, in words.

use stepdrive_asm::bare;
pub(crate) use stepdrive_host::settings::of_value;
use stepdrive_host::settings::{choice, inputs, microstepping, motor_type, stop_current, work_current};
use stepdrive_spec::smd3::commands::{Command, Kind, Value};
use stepdrive_spec::smd3::flags::{ERROR_FLAGS, FlagBits, FlagInfo, Flags, STATUS_FLAGS};
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::{self, Reg, Register};
use stepdrive_spec::smsd::status::{MotStatus, Status};

/// What finds words for a value.
type Words = fn(i64) -> Option<String>;

/// The registers whose values have words of their own, and what finds these.
const IN_WORDS: [(Reg, Words); 13] = [
    (Reg::StatusWord, status),
    (Reg::Inputs, inputs),
    (Reg::Mask, inputs),
    (Reg::Wait, inputs),
    (Reg::ElPos, electrical),
    (Reg::Microstepping, microstepping),
    (Reg::WorkCurrent, work_current),
    (Reg::StopCurrent, stop_current),
    (Reg::MotorType, motor_type),
    (Reg::TargetInput, input),
    (Reg::Cmd, command),
    (Reg::CmdBuffer, instruction),
    (Reg::HwMajor, model),
];

/// What a value of a register means; empty where it is nothing but a number.
pub(crate) fn of_register(row: &Register, value: i64) -> String {
    let found = match IN_WORDS.iter().find(|(reg, _)| *reg == row.id) {
        Some((_, words)) => words(value),
        None if row.kind == registers::Kind::Bit => Some(bit(row, value)),
        None => choice(row.about, value),
    };
    found.unwrap_or_default()
}

/// The names of all flags that are set, `none` when there are none.
pub(crate) fn flags(flags: Flags) -> String {
    let names: Vec<&str> =
        flag_names(&STATUS_FLAGS, flags.status).chain(flag_names(&ERROR_FLAGS, flags.error)).collect();
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

/// The names of the flags of a table that are in a set.
pub(crate) fn flag_names(table: &'static [FlagInfo], bits: FlagBits) -> impl Iterator<Item = &'static str> {
    table.iter().filter(move |flag| flag.is_in(bits)).map(|flag| flag.name)
}

/// A value of an SMD3 as people write it, without its unit.
pub(crate) fn plain(value: Value) -> String {
    match value {
        Value::Int(value) => value.to_string(),
        Value::Uint(value) => value.to_string(),
        Value::Float(value) => value.to_string(),
        Value::Bool(value) => u8::from(value).to_string(),
        Value::Sign(positive) => if positive { "+" } else { "-" }.to_owned(),
        Value::Text(text) => text.to_string(),
        Value::Mode(mode) => mode.number().to_string(),
        Value::FlagTable => String::new(),
    }
}

/// What a command of an SMD3 takes, as in `0 to 15000 Hz`.
pub(crate) fn range(command: Command) -> String {
    let info = command.info();
    match info.kind {
        Kind::Bool => "0 or 1".to_owned(),
        Kind::Sign => "+ or -".to_owned(),
        Kind::Int | Kind::Uint | Kind::Float => {
            format!("{} to {}{}", info.min, info.max, super::map::unit(info.unit))
        }
        Kind::None | Kind::Text => String::new(),
    }
}

fn word(value: i64) -> Option<u16> {
    u16::try_from(value).ok()
}

fn status(value: i64) -> Option<String> {
    let status = Status::from_word(word(value)?);
    let flags = [
        (status.hi_z, "HiZ"),
        (status.ready, "READY"),
        (status.sw_f, "SW_F"),
        (status.sw_evn, "SW_EVN"),
        (status.cmd_error, "CMD_ERROR"),
    ];
    let motion = match status.motion {
        MotStatus::Stopped => "stopped",
        MotStatus::Accelerating => "gaining speed",
        MotStatus::Decelerating => "losing speed",
        MotStatus::ConstantSpeed => "constant speed",
    };
    let way = if status.forward { "forward" } else { "backward" };
    let set = flags.into_iter().filter(|(on, _)| *on).map(|(_, name)| name);
    Some(set.chain([way, motion]).collect::<Vec<&str>>().join(", "))
}

fn input(value: i64) -> Option<String> {
    Input::from_number(word(value)?).map(|input| input.name().to_owned())
}

fn electrical(value: i64) -> Option<String> {
    word(value).map(|value| format!("full step {}, {}/128", value >> 7 & 3, value & 0x7F))
}

fn command(value: i64) -> Option<String> {
    Opcode::from_cmd(word(value)?).map(|opcode| opcode.to_string())
}

fn model(value: i64) -> Option<String> {
    let hw_major = word(value)?;
    let model = Model::ALL.into_iter().find(|model| model.hw_major() == hw_major)?;
    Some(model.name().to_owned())
}

fn instruction(value: i64) -> Option<String> {
    Some(bare(Instruction::from_word(u32::try_from(value).ok()?).ok()?))
}

/// A bit that is set says what its row says.
fn bit(row: &Register, value: i64) -> String {
    match (row.id, value) {
        (Reg::Relay, 0) => "off".to_owned(),
        (Reg::Relay, _) => "on".to_owned(),
        (_, 0) => "no".to_owned(),
        _ => sentence(row.about),
    }
}

/// What a table says of something, without the full stop.
pub(crate) fn sentence(about: &str) -> String {
    about.trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use stepdrive_spec::smd3::flags::{ErrorFlag, StatusFlag};

    fn of(reg: Reg, value: i64) -> String {
        of_register(reg.info(), value)
    }

    #[test]
    fn registers_are_told_in_words() {
        for (reg, value, words) in [
            (Reg::StatusWord, 0x13, "HiZ, READY, forward, stopped"),
            (Reg::StatusWord, 0xE0, "CMD_ERROR, backward, constant speed"),
            (Reg::Inputs, 0, "none"),
            (Reg::Inputs, 5, "IN0, SET_ZERO"),
            (Reg::Mask, 0xFF, "all"),
            (Reg::Microstepping, 4, "1/16"),
            (Reg::WorkCurrent, 42, "4.2 A"),
            (Reg::StopCurrent, 1, "50 % of WORK_CURRENT"),
            (Reg::CurrentOrVoltage, 1, "current"),
            (Reg::MotorType, 0, "no motor"),
            (Reg::MotorType, 7, "SM4247 1.68 A, 1.65 Ω"),
            (Reg::LanDhcp, 2, "DHCP"),
            (Reg::MemCmd, 3, "read the size"),
            (Reg::HwMajor, 6, "SMSD-4.2LAN"),
            (Reg::Cmd, 0x0E, "RUN_F"),
            (Reg::TargetInput, 2, "SET_ZERO"),
            (Reg::CmdBuffer, 0x0001_9060, "SET_MAX_SPEED 100"),
            (Reg::Stop, 1, "The motor stands still"),
            (Reg::Stop, 0, "no"),
            (Reg::Relay, 1, "on"),
            (Reg::ElPos, 0x1FF, "full step 3, 127/128"),
            (Reg::MaxSpeed, 1000, ""),
        ] {
            assert_eq!(of(reg, value), words, "{reg:?} {value}");
        }
    }

    #[test]
    fn no_value_of_any_register_is_too_much() {
        for row in &registers::REGISTERS {
            for value in [i64::MIN, -1, 0, 1, 3, 8, 255, 65_535, 1 << 32, i64::MAX] {
                let words = of_register(row, value);
                assert!(!words.contains('{') && !words.starts_with("to "), "{} {value}: {words}", row.name);
            }
        }
    }

    #[test]
    fn flags_are_named() {
        assert_eq!(flags(Flags { status: 0, error: 0 }), "none");
        let both = Flags { status: StatusFlag::Standby.mask(), error: ErrorFlag::Topen.mask() };
        assert_eq!(flags(both), "STANDBY, TOPEN");
    }
}
