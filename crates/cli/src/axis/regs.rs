//! `stepdrive regs`: everything that a controller shows, decoded.

use super::map::{hex, slots, table_name, unit, written};
use super::{AxisArgs, Client, Opened, look_at, meaning};
use crate::Failure;
use crate::axis::settings::number;
use crate::rig::table::{Align, table, text};
use crate::terminal::{print, print_json};
use serde::Serialize;
use serde_json::Value as Json;
use stepdrive_host::settings::{Family, Key, printed, resolution_of};
use stepdrive_host::smd3::Smd3Client;
use stepdrive_host::smsd::{Reading, Smsd};
use stepdrive_host::{Error, LineError};
use stepdrive_spec::smd3::commands::{Access, COMMANDS, Command, CommandInfo, Value};
use stepdrive_spec::smsd::registers::{self, REGISTERS, Reg, Register};
use stepdrive_spec::smsd::standard::STANDARD_PORT;

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stepdrive regs -a stage
  stepdrive regs -a /dev/ttyACM0 --changed
  stepdrive regs -a stage --json | jq '.rows[] | select(.differs) | .name'")]
pub(crate) struct RegsArgs {
    /// Only settings that are not as they leave the factory.
    #[arg(long)]
    changed: bool,
    #[command(flatten)]
    axis: AxisArgs,
}

/// A register of an SMSD, or a command of an SMD3.
#[derive(Serialize)]
struct Row {
    name: String,
    /// Of an SMSD.
    #[serde(skip_serializing_if = "Option::is_none")]
    address: Option<String>,
    /// Of an SMSD: coil, discrete input, input register, holding register.
    #[serde(skip_serializing_if = "Option::is_none")]
    table: Option<&'static str>,
    /// `null` for what can only be written or done.
    value: Json,
    unit: &'static str,
    meaning: String,
    /// Its value as it leaves the factory, of a setting.
    #[serde(skip_serializing_if = "Option::is_none")]
    default: Option<Json>,
    /// Whether it is another.
    differs: bool,
    about: &'static str,
    /// Why it has no value, where it was refused.
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<String>,
    /// How the value is shown to people.
    #[serde(skip)]
    shown: String,
}

/// All of it.
#[derive(Serialize)]
struct Regs<'a> {
    axis: &'a str,
    family: &'static str,
    rows: Vec<Row>,
}

/// Shows everything.
pub(crate) fn regs(args: &RegsArgs) -> Result<(), Failure> {
    look_at(&args.axis, async |opened| {
        let mut regs = read(opened).await?;
        if args.changed {
            regs.rows.retain(|row| row.differs);
        }
        if args.axis.reach.json {
            return print_json(&regs);
        }
        if regs.rows.is_empty() {
            return print(&format!("all settings of {} are as they leave the factory\n", opened.name()));
        }
        print(&shown(&regs.rows))
    })
}

async fn read(opened: &Opened) -> Result<Regs<'_>, Failure> {
    let axis = opened.name();
    Ok(match opened.client() {
        Client::Smsd(client) => Regs { axis, family: "smsd", rows: of_smsd(client).await? },
        Client::Smd3(client) => Regs { axis, family: "smd3", rows: of_smd3(client).await? },
    })
}

fn shown(rows: &[Row]) -> String {
    let with_addresses = rows.iter().any(|row| row.address.is_some());
    let default = |row: &Row| match &row.default {
        Some(default) if row.differs => default.to_string(),
        _ => String::new(),
    };
    let cells = |row: &Row| [row.name.clone(), row.shown.clone(), default(row), meaning_of(row)];
    let columns =
        [("NAME", Align::Left), ("VALUE", Align::Left), ("DEFAULT", Align::Left), ("MEANING", Align::Left)];
    if !with_addresses {
        return text(&table(columns, &rows.iter().map(cells).collect::<Vec<_>>()));
    }
    let [name, value, usual, about] = columns;
    let with_address = |row: &Row| {
        let [name, value, usual, about] = cells(row);
        [row.address.clone().unwrap_or_default(), name, value, usual, about]
    };
    let rows: Vec<[String; 5]> = rows.iter().map(with_address).collect();
    text(&table([("ADDRESS", Align::Left), name, value, usual, about], &rows))
}

fn meaning_of(row: &Row) -> String {
    match &row.error {
        Some(error) => error.clone(),
        None if row.meaning.is_empty() => meaning::sentence(row.about),
        None => row.meaning.clone(),
    }
}

async fn of_smsd(client: &dyn Smsd) -> Result<Vec<Row>, Failure> {
    let readings = client.read_all().await?;
    Ok(REGISTERS.iter().flat_map(|row| smsd_rows(client, row, &readings)).collect())
}

/// The lines of a row of the map: one, or one for each register that is of interest by itself.
fn smsd_rows(client: &dyn Smsd, row: &'static Register, readings: &[Reading]) -> Vec<Row> {
    let own: Vec<&Reading> = readings.iter().filter(|reading| reading.reg == row.id).collect();
    let values: Vec<i64> = own.iter().map(|reading| reading.value).collect();
    let name = row.name.replace("{}", "").trim_end().to_owned();
    match values.as_slice() {
        [] => {
            let tells = matches!(row.access, registers::Access::Read | registers::Access::ReadWrite);
            let error = client.check_readable(row.id).err().filter(|_| tells).map(|why| why.to_string());
            vec![Row { error, shown: "-".to_owned(), ..smsd_row(row, row.address, name, Json::Null) }]
        }
        [value] => vec![smsd_value(row, *value, usual(row, readings))],
        [first, rest @ ..] if row.id == Reg::CmdBuffer => {
            if rest.iter().all(|value| value == first) {
                let shown = format!("{} in all {}", hex(row, *first), values.len());
                return vec![Row { shown, ..smsd_row(row, row.address, name, Json::from(values)) }];
            }
            let slots = slots().filter(|slot| slot.reg == row.id);
            let row = |(slot, value): (super::map::Slot, &i64)| Row {
                meaning: meaning::of_register(row, *value),
                shown: hex(row, *value),
                ..smsd_row(row, slot.address(), slot.to_string(), Json::from(*value))
            };
            slots.zip(&values).map(row).collect()
        }
        _ => {
            let octet = |value: &i64| if row.hex { format!("{value:02X}") } else { value.to_string() };
            let octets: Vec<String> = values.iter().map(octet).collect();
            let shown = octets.join(if row.hex { ":" } else { "." });
            vec![Row { shown, ..smsd_row(row, row.address, name, Json::from(values)) }]
        }
    }
}

fn smsd_row(row: &'static Register, address: u16, name: String, value: Json) -> Row {
    Row {
        name,
        address: Some(format!("{address:#06X}")),
        table: Some(table_name(row.table)),
        value,
        unit: row.unit,
        meaning: String::new(),
        default: None,
        differs: false,
        about: row.about,
        error: None,
        shown: String::new(),
    }
}

/// What a register holds at the factory. Who has no unit identifier has the standard firmware.
fn usual(row: &Register, readings: &[Reading]) -> i64 {
    let is_standard = readings.iter().all(|reading| reading.reg != Reg::LanId);
    if row.id == Reg::LanPort && is_standard { STANDARD_PORT.into() } else { row.default }
}

fn smsd_value(row: &'static Register, value: i64, usual: i64) -> Row {
    let is_setting = Key::all(Family::Smsd).contains(&Key::Smsd(row.id))
        || (row.stored && row.access == registers::Access::ReadWrite);
    Row {
        meaning: meaning::of_register(row, value),
        default: is_setting.then(|| usual.into()),
        differs: is_setting && value != usual,
        shown: written(row, value),
        ..smsd_row(row, row.address, row.name.to_owned(), value.into())
    }
}

/// What a command of an SMD3 answers; `None` for one that is not asked.
type Answer = Option<Result<Value, Error>>;

async fn of_smd3(client: &Smd3Client) -> Result<Vec<Row>, Failure> {
    let mut answers = Vec::new();
    for info in &COMMANDS {
        answers.push((info, answer(client, info).await?));
    }
    let res = answers.iter().find(|(info, _)| info.command == Command::Res);
    let res = res.and_then(|(_, answer)| as_number(*answer.as_ref()?.as_ref().ok()?));
    let resolution = resolution_of(res.unwrap_or(Command::Res.info().default));
    let flags = client.last_flags().map(meaning::flags).unwrap_or_default();
    let row = |(info, answer): (&'static CommandInfo, Answer)| match answer {
        None if info.command == Command::Flags => {
            Row { meaning: flags.clone(), ..smd3_row(info, Json::Null, "-".to_owned()) }
        }
        None => smd3_row(info, Json::Null, "-".to_owned()),
        Some(Ok(value)) => smd3_value(info, value, resolution),
        Some(Err(error)) => {
            Row { error: Some(error.to_string()), ..smd3_row(info, Json::Null, "-".to_owned()) }
        }
    };
    Ok(answers.into_iter().map(row).collect())
}

/// Asks a command that can be read, except for `FLAGS`: nobody knows how its answer is laid out, and every other answer
/// has the flags.
async fn answer(client: &Smd3Client, info: &CommandInfo) -> Result<Answer, Error> {
    let is_asked = match info.access {
        Access::Write | Access::Action => false,
        Access::Read | Access::ReadWrite => info.command != Command::Flags,
    };
    if !is_asked {
        return Ok(None);
    }
    let answer = client.get(info.command).await;
    match &answer {
        // A firmware that lacks it, or a sensor that is not there, is no reason to show nothing else.
        Ok(_) | Err(Error::Device(_) | Error::Usage(_) | Error::Refused(_) | Error::Fault(_)) => {}
        // Nor is one answer that cannot be understood on a line that is in order.
        Err(Error::Line(LineError::Garbled { .. })) => drop(client.get(Command::Ser).await?),
        Err(error) => return Err(error.clone()),
    }
    Ok(Some(answer))
}

fn smd3_row(info: &'static CommandInfo, value: Json, shown: String) -> Row {
    Row {
        name: info.mnemonic.to_owned(),
        address: None,
        table: None,
        value,
        unit: info.unit,
        meaning: String::new(),
        default: None,
        differs: false,
        about: info.about,
        error: None,
        shown,
    }
}

fn smd3_value(info: &'static CommandInfo, value: Value, resolution: u16) -> Row {
    let key = Key::Smd3(info.command);
    let is_setting = Key::all(Family::Smd3).contains(&key);
    let differs = as_number(value).is_some_and(|value| !key.is_as_wanted(key.default(), value, resolution));
    Row {
        meaning: meaning::of_value(info.command, value),
        default: is_setting.then(|| number(printed(key.made(key.default(), resolution)))),
        differs: is_setting && differs,
        ..smd3_row(info, json_of(value), format!("{}{}", meaning::plain(value), unit(info.unit)))
    }
}

/// A value as a number, where it is one.
fn as_number(value: Value) -> Option<f64> {
    match value {
        Value::Int(value) => Some(value as f64),
        Value::Uint(value) => Some(value as f64),
        Value::Float(value) => Some(value),
        Value::Bool(on) => Some(f64::from(u8::from(on))),
        Value::Mode(mode) => Some(mode.number().into()),
        Value::Sign(_) | Value::Text(_) | Value::FlagTable => None,
    }
}

/// A value for JSON.
pub(super) fn json_of(value: Value) -> Json {
    match (as_number(value), value) {
        (_, Value::FlagTable) => Json::Null,
        (Some(value), _) => number(value),
        (None, value) => meaning::plain(value).into(),
    }
}
