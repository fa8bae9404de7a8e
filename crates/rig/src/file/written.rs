//! A rig file as it is written: TOML, with the place of everything that may be wrong.

use super::{ClockMode, SerialPort};
use crate::duration;
use crate::names::shown;
use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::net::SocketAddr;
use core::ops::RangeInclusive;
use core::time::Duration;
use serde::Deserialize;
use serde::de::{Deserializer, Error as _};
use stepdrive_drive::smsd::WordOrder;
use stepdrive_spec::smd3::signals::Sensor;
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::standard::{Firmware, VERSION_1, VERSION_2};
use toml::Spanned;

/// A rig.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct WrittenRig {
    #[serde(default)]
    pub(super) rig: WrittenSettings,
    #[serde(rename = "drive", default)]
    pub(super) drives: Vec<WrittenDrive>,
    #[serde(rename = "wire", default)]
    pub(super) wires: Vec<WrittenWire>,
}

/// `[rig]`.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct WrittenSettings {
    /// How rig time passes.
    #[serde(default, deserialize_with = "clock")]
    pub(super) clock: ClockMode,
    /// Where the rig is controlled from; port 0 takes a free one.
    #[serde(default, deserialize_with = "address")]
    pub(super) api: Option<Spanned<SocketAddr>>,
    /// What a client of that must show.
    pub(super) api_token: Option<Spanned<String>>,
    /// What bouncing switches and faults of the lines draw from; 1 by default.
    #[serde(default, deserialize_with = "seed")]
    pub(super) seed: Option<u64>,
}

/// `[[wire]]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct WrittenWire {
    /// The output at which it begins, as in `a.relay`.
    pub(super) from: Spanned<String>,
    /// The input at which it ends, as in `b.CONTINUE`.
    pub(super) to: Spanned<String>,
    /// How much later a change arrives; at once by default.
    #[serde(default, deserialize_with = "delay")]
    pub(super) delay: Duration,
    /// Whether it arrives the other way round.
    #[serde(default)]
    pub(super) invert: bool,
}

/// `[[drive]]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct WrittenDrive {
    /// Its name, unique in the rig: letters, digits, `-` and `_`, up to 32.
    pub(super) name: Spanned<String>,
    /// Its model.
    #[serde(deserialize_with = "model")]
    pub(super) model: AnyModel,
    /// SMSD: where it listens for Modbus TCP; port 0 takes a free one.
    #[serde(default, deserialize_with = "address")]
    pub(super) modbus_tcp: Option<Spanned<SocketAddr>>,
    /// SMSD: its virtual COM port.
    #[serde(default, deserialize_with = "usb")]
    pub(super) usb: Option<Spanned<SerialPort>>,
    /// SMSD: where it takes over TCP what comes over USB; port 0 takes a free one.
    #[serde(default, deserialize_with = "address")]
    pub(super) usb_tcp: Option<Spanned<SocketAddr>>,
    /// SMSD: what it speaks over LAN.
    #[serde(default, deserialize_with = "lan")]
    pub(super) lan: Option<Spanned<Firmware>>,
    /// SMSD: where it listens with the standard firmware; port 0 takes a free one.
    #[serde(default, deserialize_with = "address")]
    pub(super) standard_tcp: Option<Spanned<SocketAddr>>,
    /// SMSD: the version of the standard protocol, 1 or 2.
    #[serde(default, deserialize_with = "protocol_version")]
    pub(super) protocol_version: Option<Spanned<u8>>,
    /// SMD3: its virtual COM port.
    #[serde(default, deserialize_with = "serial")]
    pub(super) serial: Option<Spanned<SerialPort>>,
    /// SMD3: where it takes its lines over TCP; port 0 takes a free one.
    #[serde(default, deserialize_with = "address")]
    pub(super) serial_tcp: Option<Spanned<SocketAddr>>,
    /// The order of the two words of a 32-bit value.
    #[serde(default, deserialize_with = "word_order")]
    pub(super) word_order: Option<Spanned<WordOrder>>,
    /// Autonomous mode: the front panel shows "bF", and the program of `MODE_N_PROGRAMS` starts at power-up.
    #[serde(default)]
    pub(super) autonomous: Option<Spanned<bool>>,
    /// `MODE_N_PROGRAMS` as set at the front panel, 0 to 3; without it the controller keeps the one it remembers.
    #[serde(default, deserialize_with = "mode_n_programs")]
    pub(super) mode_n_programs: Option<Spanned<u8>>,
    /// The motor.
    #[serde(default)]
    pub(super) motor: WrittenMotor,
    /// The mechanics; without them the axis turns for ever.
    #[serde(default)]
    pub(super) mechanics: WrittenMechanics,
    /// The winding and its temperature sensor, of an SMD3's motor.
    pub(super) winding: Option<Spanned<WrittenWinding>>,
    /// The switches along the travel.
    #[serde(rename = "switch", default)]
    pub(super) switches: Vec<WrittenSwitch>,
}

/// A model of either family.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum AnyModel {
    Smsd(Model),
    Smd3,
}

/// `[drive.winding]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct WrittenWinding {
    /// Temperature around the motor, °C.
    pub(super) ambient: Option<Spanned<f64>>,
    /// Time constant, seconds.
    pub(super) time_constant: Option<Spanned<f64>>,
    /// Rise over ambient at 1 A in both phases, kelvin.
    pub(super) rise: Option<Spanned<f64>>,
    /// The temperature sensor at power-up.
    #[serde(default, deserialize_with = "sensor")]
    pub(super) sensor: Sensor,
}

/// `[drive.motor]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct WrittenMotor {
    /// Full steps in a turn, 1 to 10 000.
    #[serde(default = "usual_steps_per_rev", deserialize_with = "steps_per_rev")]
    pub(super) steps_per_rev: Spanned<u32>,
}

impl Default for WrittenMotor {
    fn default() -> WrittenMotor {
        WrittenMotor { steps_per_rev: usual_steps_per_rev() }
    }
}

/// A 1.8° motor.
fn usual_steps_per_rev() -> Spanned<u32> {
    Spanned::new(0..0, 200)
}

/// `[drive.mechanics]`.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct WrittenMechanics {
    /// The hard ends, in full steps; none by default.
    #[serde(default, deserialize_with = "travel")]
    pub(super) travel: Option<Spanned<[f64; 2]>>,
    /// Where the carriage stands at power-up, in full steps; 0 by default.
    pub(super) start: Option<Spanned<f64>>,
}

/// `[[drive.switch]]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct WrittenSwitch {
    /// The input it is wired to.
    pub(super) input: Spanned<String>,
    /// From where to where it is closed, in full steps.
    #[serde(deserialize_with = "interval")]
    pub(super) closed: Spanned<[f64; 2]>,
}

fn model<'de, D: Deserializer<'de>>(deserializer: D) -> Result<AnyModel, D::Error> {
    let find = |name: &str| match name {
        "SMD3" => Some(AnyModel::Smd3),
        name => Model::from_name(name).map(AnyModel::Smsd),
    };
    let [small, large] = Model::ALL.map(Model::name);
    named(deserializer, "model", find, &[small, large, "SMD3"])
}

fn sensor<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Sensor, D::Error> {
    let find = |name: &str| match name {
        "connected" => Some(Sensor::Connected),
        "open" => Some(Sensor::Open),
        "short" => Some(Sensor::Short),
        _ => None,
    };
    named(deserializer, "sensor", find, &["connected", "open", "short"])
}

fn serial<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Spanned<SerialPort>>, D::Error> {
    port(deserializer, "serial").map(Some)
}

fn usb<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Spanned<SerialPort>>, D::Error> {
    port(deserializer, "usb").map(Some)
}

/// Reads a virtual COM port.
fn port<'de, D: Deserializer<'de>>(deserializer: D, key: &str) -> Result<Spanned<SerialPort>, D::Error> {
    let text = Spanned::<String>::deserialize(deserializer)?;
    let port = match text.get_ref().as_str() {
        "pty" => Some(SerialPort::Pty(None)),
        other => other
            .strip_prefix("pty:")
            .filter(|path| !path.is_empty() && !path.contains(char::is_control))
            .map(|path| SerialPort::Pty(Some(path.into()))),
    };
    let none = || D::Error::custom(format!("{key} `{}` is unknown; it is pty or pty:PATH", text.get_ref()));
    Ok(Spanned::new(text.span(), port.ok_or_else(none)?))
}

fn lan<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Spanned<Firmware>>, D::Error> {
    let find = |name: &str| match name {
        "modbus" => Some(Firmware::Modbus),
        "standard" => Some(Firmware::Standard),
        _ => None,
    };
    named_at(deserializer, "lan", find, &["modbus", "standard"]).map(Some)
}

fn protocol_version<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Spanned<u8>>, D::Error> {
    whole(deserializer, "protocol_version", VERSION_1.into()..=VERSION_2.into()).map(Some)
}

fn clock<'de, D: Deserializer<'de>>(deserializer: D) -> Result<ClockMode, D::Error> {
    let text = String::deserialize(deserializer)?;
    ClockMode::parse(&text).map_err(D::Error::custom)
}

fn delay<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Duration, D::Error> {
    let text = String::deserialize(deserializer)?;
    let wrong = |error| D::Error::custom(format!("delay is `{}`; {error}", shown(&text)));
    duration::parse(&text).map_err(wrong)
}

fn seed<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<u64>, D::Error> {
    whole(deserializer, "seed", 0..=i64::MAX).map(|seed| Some(seed.into_inner()))
}

fn word_order<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Spanned<WordOrder>>, D::Error> {
    let find = |name: &str| match name {
        "low-first" => Some(WordOrder::LowFirst),
        "high-first" => Some(WordOrder::HighFirst),
        _ => None,
    };
    named_at(deserializer, "word_order", find, &["low-first", "high-first"]).map(Some)
}

/// Reads one of a few names.
fn named<'de, D: Deserializer<'de>, T>(
    deserializer: D,
    what: &str,
    find: impl Fn(&str) -> Option<T>,
    names: &[&str],
) -> Result<T, D::Error> {
    named_at(deserializer, what, find, names).map(Spanned::into_inner)
}

/// Reads one of a few names, and lists them all when it is another.
fn named_at<'de, D: Deserializer<'de>, T>(
    deserializer: D,
    what: &str,
    find: impl Fn(&str) -> Option<T>,
    names: &[&str],
) -> Result<Spanned<T>, D::Error> {
    let name = Spanned::<String>::deserialize(deserializer)?;
    let found = find(name.get_ref()).ok_or_else(|| D::Error::custom(unknown(what, name.get_ref(), names)))?;
    Ok(Spanned::new(name.span(), found))
}

pub(super) fn unknown(what: &str, name: &str, names: &[&str]) -> String {
    let allowed = if names.len() > 1 { "one of " } else { "" };
    format!("{what} `{name}` is unknown; it is {allowed}{}", names.join(", "))
}

fn mode_n_programs<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Spanned<u8>>, D::Error> {
    whole(deserializer, "mode_n_programs", 0..=3).map(Some)
}

fn steps_per_rev<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Spanned<u32>, D::Error> {
    whole(deserializer, "steps_per_rev", 1..=10_000)
}

/// Reads a whole number within a range.
fn whole<'de, D: Deserializer<'de>, T: TryFrom<i64>>(
    deserializer: D,
    key: &str,
    range: RangeInclusive<i64>,
) -> Result<Spanned<T>, D::Error> {
    let number = Spanned::<i64>::deserialize(deserializer)?;
    let value = *number.get_ref();
    let within = range.contains(&value).then_some(value).and_then(|value| T::try_from(value).ok());
    let within = within.ok_or_else(|| {
        D::Error::custom(format!("{key} is {value}; it is {} to {}", range.start(), range.end()))
    })?;
    Ok(Spanned::new(number.span(), within))
}

fn travel<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Spanned<[f64; 2]>>, D::Error> {
    interval(deserializer).map(Some)
}

/// Reads two numbers. An array would take more than two, too.
fn interval<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Spanned<[f64; 2]>, D::Error> {
    let numbers = Spanned::<Vec<f64>>::deserialize(deserializer)?;
    let both = <[f64; 2]>::try_from(numbers.get_ref().as_slice()).map_err(|_| {
        D::Error::custom(format!("two numbers are wanted, from and to; here are {}", numbers.get_ref().len()))
    })?;
    Ok(Spanned::new(numbers.span(), both))
}

fn address<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Spanned<SocketAddr>>, D::Error> {
    let text = Spanned::<String>::deserialize(deserializer)?;
    let address = text.get_ref().parse().map_err(|_| {
        let text = text.get_ref();
        D::Error::custom(format!("`{text}` is no IP address with a port, as in 127.0.0.1:5020"))
    })?;
    Ok(Some(Spanned::new(text.span(), address)))
}

/// How the library that reads the file words what is wrong, and how a person would.
const WORDING: [(&str, &str); 8] = [
    ("duplicate key", "this field is there already"),
    ("invalid type: map", "found a table"),
    ("invalid type: sequence", "found a list"),
    ("invalid type: ", "found "),
    ("floating point", "number"),
    ("expected i64", "expected a whole number"),
    ("expected f64", "expected a number"),
    ("expected a boolean", "expected true or false"),
];

/// A message about the form of the file, in plain words.
pub(super) fn reworded(message: &str) -> String {
    let mut text = message.trim_end().to_string();
    if text == "invalid type: map, expected a sequence" {
        return "found one table where there may be several; its name stands in double brackets".to_string();
    }
    for (theirs, plain) in WORDING {
        text = text.replacen(theirs, plain, 1);
    }
    text.replace("expected a sequence", "expected a list")
}
