//! Lines about the registers and commands of an SMSD.

use super::{Answer, is_trouble};
use crate::axis::map::{self, Slot, key, table_name, unit};
use crate::axis::meaning;
use crate::axis::names::{instead, shown};
use crate::rig::table::{Align, table, text};
use serde_json::{Value, json};
use stepdrive_host::Error;
use stepdrive_host::smsd::{Smsd, Snapshot};
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::{INSTRUCTIONS, Opcode, Operand};
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::{Access, REGISTERS, Reg, Register};

/// What a line asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Asked {
    Read(Slot),
    Write(Slot, i64),
    Command(Opcode, Option<i64>),
    Trigger(Reg),
}

/// Does what a line asks for, and explains what came.
pub(super) async fn answer(client: &dyn Smsd, line: &str) -> Result<Answer, Error> {
    let done = match parse(line) {
        Ok(Asked::Read(slot)) => read(client, line, slot).await,
        Ok(Asked::Write(slot, value)) => write(client, line, slot, value).await,
        Ok(Asked::Command(opcode, operand)) => match client.command(opcode, operand).await {
            Ok(()) => moved(client, line, opcode.name()).await,
            Err(error) => Err(error),
        },
        Ok(Asked::Trigger(coil)) => match client.trigger(coil).await {
            Ok(()) => moved(client, line, coil.info().name).await,
            Err(error) => Err(error),
        },
        Err(why) => Err(Error::Usage(format!("{why}; nothing was sent"))),
    };
    match done {
        Err(error) if !is_trouble(&error) => Ok(Answer {
            text: format!("{error}\n"),
            json: json!({ "line": line, "error": error.to_string() }),
            refused: Some(error),
        }),
        done => done,
    }
}

async fn read(client: &dyn Smsd, line: &str, slot: Slot) -> Result<Answer, Error> {
    let row = slot.row();
    if matches!(row.access, Access::Secret) {
        return Err(Error::Usage(format!(
            "{slot} cannot be read; it reads as 0 whatever it is; nothing was sent"
        )));
    }
    let value = client.read_at(slot.reg, slot.index).await?;
    Ok(told(line, slot, value))
}

async fn write(client: &dyn Smsd, line: &str, slot: Slot, value: i64) -> Result<Answer, Error> {
    client.write_at(slot.reg, slot.index, value).await?;
    if client.check_readable(slot.reg).is_err() {
        let text = format!("{slot} was written\n");
        return Ok(Answer { text, json: json!({ "line": line, "name": slot.to_string() }), refused: None });
    }
    let value = client.read_at(slot.reg, slot.index).await?;
    Ok(told(line, slot, value))
}

/// A value that was read.
fn told(line: &str, slot: Slot, value: i64) -> Answer {
    let row = slot.row();
    let meaning = meaning::of_register(row, value);
    let in_words = if meaning.is_empty() { String::new() } else { format!("  ({meaning})") };
    let json = json!({
        "line": line,
        "name": slot.to_string(),
        "address": format!("{:#06X}", slot.address()),
        "value": value,
        "unit": row.unit,
        "meaning": meaning,
    });
    Answer { text: format!("{slot} = {}{in_words}\n", map::written(row, value)), json, refused: None }
}

/// What the motor does now that a command was taken.
async fn moved(client: &dyn Smsd, line: &str, name: &str) -> Result<Answer, Error> {
    let motor = client.snapshot().await?;
    Ok(Answer { text: format!("{name}: {motor}\n"), json: motor_json(line, name, &motor), refused: None })
}

fn motor_json(line: &str, name: &str, motor: &Snapshot) -> Value {
    json!({
        "line": line,
        "command": name,
        "moving": motor.is_moving(),
        "position_microsteps": motor.position,
        "speed_full_steps_per_s": motor.speed,
        "status": meaning::of_register(Reg::StatusWord.info(), motor.status.word().into()),
    })
}

/// What a line asks for.
fn parse(line: &str) -> Result<Asked, String> {
    if let Some((name, value)) = line.split_once('=') {
        let slot = map::find(name)?;
        return Ok(Asked::Write(slot, value_of(slot, value.trim())?));
    }
    if let Some(coil) = coil(line) {
        return Ok(Asked::Trigger(coil));
    }
    let (word, operand) = line.trim().split_once(char::is_whitespace).unwrap_or((line.trim(), ""));
    match (opcode(word), operand.trim()) {
        (Some(opcode), "") => Ok(Asked::Command(opcode, None)),
        (Some(opcode), operand) => Ok(Asked::Command(opcode, Some(operand_of(opcode, operand)?))),
        (None, _) => map::find(line).map(Asked::Read).map_err(|_| unknown(line)),
    }
}

/// The coil that acts of this name.
fn coil(name: &str) -> Option<Reg> {
    let mut coils = REGISTERS.iter().filter(|row| row.access == Access::Trigger);
    coils.find(|row| key(row.name) == key(name)).map(|row| row.id)
}

/// The command of `CMD` of this name.
fn opcode(name: &str) -> Option<Opcode> {
    let wanted = key(name);
    let mut taken = INSTRUCTIONS.iter().filter(|info| info.in_cmd);
    taken.find(|info| info.name == wanted || info.alias == wanted).map(|info| info.opcode)
}

fn value_of(slot: Slot, text: &str) -> Result<i64, String> {
    let named = if slot.reg == Reg::Cmd {
        opcode(text).map(|opcode| opcode.code().into())
    } else {
        input(text).filter(|_| slot.reg == Reg::TargetInput)
    };
    named
        .or_else(|| integer(text))
        .ok_or_else(|| format!("`{}` is no value of {slot}; that is a whole number", shown(text)))
}

fn operand_of(opcode: Opcode, text: &str) -> Result<i64, String> {
    let named = input(text).filter(|_| opcode.info().operand == Operand::Input);
    named
        .or_else(|| integer(text))
        .ok_or_else(|| format!("`{}` is no operand of {opcode}; that is a whole number", shown(text)))
}

/// The number of the input of this name.
fn input(name: &str) -> Option<i64> {
    Input::from_name(&key(name)).map(|input| input.number().into())
}

/// A whole number, in hexadecimal behind `0x`; `on` and `off`.
fn integer(text: &str) -> Option<i64> {
    match text.to_ascii_lowercase().as_str() {
        "on" | "true" => Some(1),
        "off" | "false" => Some(0),
        text => match text.strip_prefix("0x") {
            Some(digits) if digits.bytes().all(|byte| byte.is_ascii_hexdigit()) => {
                i64::from_str_radix(digits, 16).ok()
            }
            Some(_) => None,
            None => text.parse().ok(),
        },
    }
}

fn unknown(line: &str) -> String {
    let slots: Vec<String> = map::slots().map(|slot| slot.to_string()).collect();
    let commands = INSTRUCTIONS.iter().filter(|info| info.in_cmd).map(|info| info.name);
    let names: Vec<&str> = slots.iter().map(String::as_str).chain(commands).collect();
    format!("`{}` is no register and no command; {}", shown(line), instead(line, &names))
}

/// All registers and commands, or all about one.
pub(super) fn help(name: &str) -> String {
    if name.is_empty() {
        return all();
    }
    if let Some(opcode) = opcode(name) {
        let info = opcode.info();
        return format!("{} {}\n    {}\n", info.name, operand_text(info.operand), info.about);
    }
    match map::find(name) {
        Ok(slot) => about(slot),
        Err(_) => format!("{}\n", unknown(name)),
    }
}

fn all() -> String {
    let register = |row: &Register| {
        [row.name.replace("{}", "N"), table_name(row.table).to_owned(), meaning::sentence(row.about)]
    };
    let taken = INSTRUCTIONS.iter().filter(|info| info.in_cmd);
    let command = taken.map(|info| {
        let form = format!("{} {}", info.name, operand_text(info.operand)).trim_end().to_owned();
        [form, "command".to_owned(), meaning::sentence(info.about)]
    });
    let rows: Vec<[String; 3]> = REGISTERS.iter().map(register).chain(command).collect();
    text(&table([("NAME", Align::Left), ("KIND", Align::Left), ("WHAT", Align::Left)], &rows))
}

fn about(slot: Slot) -> String {
    let row = slot.row();
    let [small, large] = Model::ALL.map(|model| row.range(model));
    let models = if small == large {
        String::new()
    } else {
        format!(" ({} to {} on the {})", large.0, large.1, Model::Smsd80)
    };
    let takes = match row.access {
        Access::Read => "only read".to_owned(),
        Access::Trigger => "acts when it is written".to_owned(),
        Access::ReadWrite | Access::Secret => {
            format!("takes {} to {}{}{models}", small.0, small.1, unit(row.unit))
        }
    };
    let table = table_name(row.table);
    format!("{slot}, {table} {:#06X}\n    {}\n    {takes}\n", slot.address(), row.about)
}

/// What stands behind a command.
fn operand_text(operand: Operand) -> &'static str {
    match operand {
        Operand::None => "",
        Operand::Number { .. } => "NUMBER",
        Operand::Position => "MICROSTEPS",
        Operand::Mask => "MASK",
        Operand::Input => "INPUT",
        Operand::Mode => "MODE",
        Operand::Jump => "LINE",
        Operand::Loop => "LOOP",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn slot(reg: Reg, index: u16) -> Slot {
        Slot { reg, index }
    }

    #[test]
    fn lines_are_understood_however_they_are_written() {
        for (line, asked) in [
            ("MAX_SPEED", Asked::Read(slot(Reg::MaxSpeed, 0))),
            ("max speed = 800", Asked::Write(slot(Reg::MaxSpeed, 0), 800)),
            ("Mask=0xF0", Asked::Write(slot(Reg::Mask, 0), 0xF0)),
            ("Relay = on", Asked::Write(slot(Reg::Relay, 0), 1)),
            ("TARGET_INPUT=SET_ZERO", Asked::Write(slot(Reg::TargetInput, 0), 2)),
            ("IP 3", Asked::Read(slot(Reg::LanIp, 3))),
            ("CMD", Asked::Read(slot(Reg::Cmd, 0))),
            ("CMD 5", Asked::Read(slot(Reg::CmdBuffer, 5))),
            ("CMD=RUN_F", Asked::Write(slot(Reg::Cmd, 0), 0x0E)),
            ("run_f 500", Asked::Command(Opcode::RunF, Some(500))),
            ("MOVE_F  -1600", Asked::Command(Opcode::MoveF, Some(-1600))),
            ("GO_UNTIL_F in1", Asked::Command(Opcode::GoUntilF, Some(1))),
            ("GO_ZERO", Asked::Command(Opcode::GoZero, None)),
            ("clr", Asked::Trigger(Reg::Clr)),
            ("Soft STOP", Asked::Trigger(Reg::SoftStop)),
            ("SOFT_STOP", Asked::Trigger(Reg::SoftStop)),
            ("0x1001", Asked::Read(slot(Reg::AbsPos, 0))),
            ("STOP", Asked::Read(slot(Reg::Stop, 0))),
        ] {
            assert_eq!(parse(line), Ok(asked), "{line}");
        }
    }

    #[test]
    fn what_is_not_understood_is_told() {
        for (line, told) in [
            ("MAX_SPED", "`MAX_SPED` is no register and no command; did you mean MAX_SPEED?"),
            ("RUN_G", "`RUN_G` is no register and no command; did you mean RUN_F?"),
            ("MAX_SPEED=fast", "`fast` is no value of MAX_SPEED; that is a whole number"),
            ("MAX_SPEED=0x", "`0x` is no value of MAX_SPEED"),
            ("RUN_F fast", "`fast` is no operand of RUN_F"),
            ("NO_SUCH=1", "there is no register `NO_SUCH`"),
        ] {
            let text = parse(line).expect_err(line);
            assert!(text.starts_with(told), "{line}: {text}");
        }
    }

    #[test]
    fn there_is_help_for_everything() {
        for slot in map::slots().filter(|slot| opcode(&slot.to_string()).is_none()) {
            assert!(help(&slot.to_string()).contains("\n    "), "{slot}");
        }
        assert_eq!(
            help("max_speed"),
            "MAX_SPEED, holding register 0x1101\n    Highest speed.\n    takes 16 to 15600 full steps/s\n"
        );
        assert!(help("WORK_CURRENT").contains("takes 1 to 42 × 0.1 A (1 to 80 on the SMSD-8.0LAN)"));
        assert!(help("RUN_F").starts_with("RUN_F NUMBER\n"));
        assert!(help("").lines().count() > 80);
    }
}
