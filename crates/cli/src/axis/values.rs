//! `stepdrive get` and `stepdrive set`.

use super::map::{self, Slot};
use super::names::{instead, shown};
use super::{AxisArgs, Client, Opened, act_on, look_at, meaning};
use crate::Failure;
use crate::terminal::{print, print_json};
use serde_json::{Value as Json, json};
use stepdrive_host::Error;
use stepdrive_host::smd3::Smd3Client;
use stepdrive_host::smsd::Smsd;
use stepdrive_spec::smd3::commands::{self, COMMANDS, Command, Value};
use stepdrive_spec::smsd::registers::{self, Reg};

/// What is read.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stepdrive get -a stage MAX_SPEED ACC
  stepdrive get -a stage 0x1101 'IP 0'
  stepdrive get -a uhv VMAX TMOT L+
  stepdrive get -a uhv TMOT --json | jq '.values[0].value'

  $ stepdrive get -a stage MAX_SPEED MICROSTEPPING
  MAX_SPEED = 1000 full steps/s
  MICROSTEPPING = 0x0004 (1/16)

Names are the makers', in any case: registers of an SMSD (`stepdrive regs` lists them), commands of an SMD3.")]
pub(crate) struct GetArgs {
    #[command(flatten)]
    axis: AxisArgs,
    /// Registers of an SMSD, or commands of an SMD3.
    #[arg(required = true, value_name = "NAME")]
    names: Vec<String>,
}

/// What is set.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stepdrive set -a stage MAX_SPEED 800
  stepdrive set -a stage Mask 0xFF
  stepdrive set -a uhv VMAX 500.5
  stepdrive set -a uhv L- 1

  $ stepdrive set -a stage MAX_SPEED 800
  MAX_SPEED = 800 full steps/s

Values are in the makers' units, and are read back. An SMD3 takes the nearest that it can: what it has made of the value is
shown. What starts motion is no setting: there are `move`, `run`, `home` and `stop`.")]
pub(crate) struct SetArgs {
    #[command(flatten)]
    axis: AxisArgs,
    /// A register of an SMSD, or a command of an SMD3.
    name: String,
    /// A number, also in hexadecimal as 0x10.
    #[arg(allow_hyphen_values = true)]
    value: String,
}

/// Something that was read or set.
struct Reading {
    name: String,
    value: Json,
    /// As people write it.
    text: String,
    unit: &'static str,
    meaning: String,
}

/// Reads values.
pub(crate) fn get(args: &GetArgs) -> Result<(), Failure> {
    look_at(&args.axis, async |opened| {
        let readings = match opened.client() {
            Client::Smsd(client) => registers(client, &args.names).await?,
            Client::Smd3(client) => values(client, &args.names).await?,
        };
        if args.axis.reach.json {
            let values: Vec<Json> = readings.iter().map(Reading::json).collect();
            return print_json(&json!({ "axis": opened.name(), "values": values }));
        }
        print(&readings.iter().map(Reading::line).collect::<String>())
    })
}

/// Sets a value.
pub(crate) fn set(args: &SetArgs) -> Result<(), Failure> {
    act_on(&args.axis, async |opened| {
        let reading = match opened.client() {
            Client::Smsd(client) => set_register(client, &args.name, &args.value).await?,
            Client::Smd3(client) => set_value(client, &args.name, &args.value).await?,
        };
        if args.axis.reach.json {
            return print_json(&with_axis(opened, &reading));
        }
        print(&reading.line())
    })
}

fn with_axis(opened: &Opened, reading: &Reading) -> Json {
    let mut object = reading.json();
    object["axis"] = opened.name().into();
    object
}

impl Reading {
    fn line(&self) -> String {
        let meaning = if self.meaning.is_empty() { String::new() } else { format!(" ({})", self.meaning) };
        format!("{} = {}{meaning}\n", self.name, self.text)
    }

    fn json(&self) -> Json {
        let some = |text: &str| (!text.is_empty()).then(|| text.to_owned());
        let unit = some(&map::plural(self.unit));
        json!({ "name": self.name, "value": self.value, "unit": unit, "meaning": some(&self.meaning) })
    }
}

// ---- registers of an SMSD

fn slot(name: &str) -> Result<Slot, Failure> {
    map::find(name).map_err(Failure::Usage)
}

async fn registers(client: &dyn Smsd, names: &[String]) -> Result<Vec<Reading>, Failure> {
    // A name that is wrong is told before anything is read.
    let slots = names.iter().map(|name| readable(client, name)).collect::<Result<Vec<Slot>, Failure>>()?;
    let mut readings = Vec::new();
    for slot in slots {
        let value = client.read_at(slot.reg, slot.index).await?;
        readings.push(register(slot, value));
    }
    Ok(readings)
}

fn readable(client: &dyn Smsd, name: &str) -> Result<Slot, Failure> {
    let slot = slot(name)?;
    client.check_readable(slot.reg)?;
    Ok(slot)
}

fn register(slot: Slot, value: i64) -> Reading {
    let row = slot.row();
    Reading {
        name: slot.to_string(),
        value: value.into(),
        text: map::written(row, value),
        unit: row.unit,
        meaning: meaning::of_register(row, value),
    }
}

async fn set_register(client: &dyn Smsd, name: &str, value: &str) -> Result<Reading, Failure> {
    let slot = slot(name)?;
    if let Some(instead) = instead_of(slot) {
        return Err(Failure::Usage(format!(
            "{slot} is no setting, but does something; {instead}; nothing was sent"
        )));
    }
    if client.keeps(slot.reg) {
        return Err(Failure::Usage(format!(
            "{slot} is no setting on this line, but goes out with a command; give it there, as `home --speed`; nothing was sent"
        )));
    }
    let value = whole(&slot.to_string(), value)?;
    client.write_at(slot.reg, slot.index, value).await?;
    if client.check_readable(slot.reg).is_err() {
        let meaning = "taken; this line does not read it back".to_owned();
        return Ok(Reading { meaning, ..register(slot, value) });
    }
    let found = client.read_at(slot.reg, slot.index).await?;
    if found == value {
        return Ok(register(slot, found));
    }
    Err(Failure::Host(Error::Differs(format!(
        "{slot} was set to {value}, and reads as {found}; somebody else may have set it, or it belongs to what the motor does"
    ))))
}

/// The command that does what a register does.
const INSTEAD: [(Reg, &str); 9] = [
    (Reg::Cmd, "there are `move`, `run`, `home` and `stop`"),
    (Reg::MemCmd, "there is `program`"),
    (Reg::SoftStop, "there is `stop`"),
    (Reg::HardStop, "there is `stop --hard`"),
    (Reg::SoftHiZ, "there is `stop --free`"),
    (Reg::HardHiZ, "there is `stop --free`"),
    (Reg::ResetPos, "there is `zero`"),
    (Reg::Clr, "there is `clear`"),
    (Reg::ApplyNetworkConfiguration, "there is `settings`"),
];

/// What is to be used instead of a register that acts.
fn instead_of(slot: Slot) -> Option<&'static str> {
    let acts = match slot.row().access {
        registers::Access::Trigger | registers::Access::Secret => true,
        registers::Access::Read | registers::Access::ReadWrite => false,
    };
    let known = INSTEAD.iter().find(|(reg, _)| *reg == slot.reg).map(|(_, instead)| *instead);
    known.or_else(|| acts.then_some("it is left to programs that know what they do"))
}

/// A whole number, also in hexadecimal.
fn whole(name: &str, text: &str) -> Result<i64, Failure> {
    let digits = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X"));
    let number = match digits {
        Some(digits) if !digits.starts_with(['+', '-']) => i64::from_str_radix(digits, 16).ok(),
        Some(_) => None,
        None => text.parse().ok(),
    };
    number.ok_or_else(|| {
        Failure::Usage(format!("{name} takes a whole number, not `{}`; nothing was sent", shown(text)))
    })
}

// ---- commands of an SMD3

fn command(name: &str) -> Result<Command, Failure> {
    Command::from_mnemonic(&name.trim().to_ascii_uppercase()).ok_or_else(|| {
        let known: Vec<&str> = COMMANDS.iter().map(|row| row.mnemonic).collect();
        Failure::Usage(format!("there is no command `{}`; {}", shown(name), instead(name, &known)))
    })
}

async fn values(client: &Smd3Client, names: &[String]) -> Result<Vec<Reading>, Failure> {
    let commands = names.iter().map(|name| command(name)).collect::<Result<Vec<Command>, Failure>>()?;
    let mut readings = Vec::new();
    for command in commands {
        readings.push(reading(command, client.get(command).await?));
    }
    Ok(readings)
}

fn reading(command: Command, value: Value) -> Reading {
    let info = command.info();
    let json = match value {
        Value::Int(value) => value.into(),
        Value::Uint(value) => value.into(),
        Value::Float(value) => value.into(),
        Value::Bool(value) => value.into(),
        Value::Mode(mode) => mode.number().into(),
        Value::Sign(_) | Value::Text(_) | Value::FlagTable => meaning::plain(value).into(),
    };
    let text = format!("{}{}", meaning::plain(value), map::unit(info.unit));
    let meaning = meaning::of_value(command, value);
    Reading { name: info.mnemonic.to_owned(), value: json, text, unit: info.unit, meaning }
}

async fn set_value(client: &Smd3Client, name: &str, value: &str) -> Result<Reading, Failure> {
    let command = command(name)?;
    let info = command.info();
    if info.starts || info.access == commands::Access::Action {
        let instead = "there are `move`, `run`, `home`, `stop`, `clear`, `bake` and `settings`";
        return Err(Failure::Usage(format!(
            "{command} is no setting, but does something; {instead}; nothing was sent"
        )));
    }
    let number = if value.starts_with("0x") || value.starts_with("0X") {
        whole(info.mnemonic, value)? as f64
    } else {
        let number = value.parse().ok().filter(|number: &f64| number.is_finite());
        number.ok_or_else(|| {
            Failure::Usage(format!("{command} takes a number, not `{}`; nothing was sent", shown(value)))
        })?
    };
    Ok(reading(command, client.set_number(command, number).await?))
}
