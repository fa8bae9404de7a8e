//! The rig file: TOML in, machines out.
//!
//! Everything but a drive's `name`, `model` and address has a default. What a person gets wrong is told with the file's
//! name, line and column.

use crate::machine::Machine;
use crate::mechanics::{Mechanics, Switch, Travel};
use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::fmt;
use core::net::SocketAddr;
use core::ops::{Range, RangeInclusive};
use serde::Deserialize;
use serde::de::{Deserializer, Error as _};
use stepdrive_drive::smsd::{Config, Memory, WordOrder};
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::models::Model;
use toml::Spanned;

/// The rig that `stepdrive up` brings up when it is given none: one SMSD-4.2LAN named `stage`, commented.
pub const DEMO: &str = include_str!("../demo.toml");

/// A rig, as written in its file.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RigFile {
    /// What holds for the rig as a whole.
    #[serde(default)]
    pub rig: RigSection,
    /// The drives; at least one.
    #[serde(rename = "drive", default)]
    pub drives: Vec<DriveSection>,
}

/// `[rig]`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RigSection {
    /// How rig time passes.
    #[serde(default, deserialize_with = "clock")]
    pub clock: ClockMode,
}

/// How rig time passes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ClockMode {
    /// As fast as time does.
    #[default]
    Real,
}

/// `[[drive]]`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriveSection {
    /// Its name, unique in the rig: letters, digits, `-` and `_`, up to 32.
    pub name: Spanned<String>,
    /// Its model.
    #[serde(deserialize_with = "model")]
    pub model: Model,
    /// Where it listens for Modbus TCP; port 0 takes a free one.
    #[serde(deserialize_with = "address")]
    pub modbus_tcp: Spanned<SocketAddr>,
    /// The order of the two words of a 32-bit value.
    #[serde(default, deserialize_with = "word_order")]
    pub word_order: WordOrder,
    /// Autonomous mode: the front panel shows "bF", and the program of `MODE_N_PROGRAMS` starts at power-up.
    #[serde(default)]
    pub autonomous: bool,
    /// `MODE_N_PROGRAMS` as set at the front panel, 0 to 3; without it the controller keeps the one it remembers.
    #[serde(default, deserialize_with = "mode_n_programs")]
    pub mode_n_programs: Option<Spanned<u8>>,
    /// The motor.
    #[serde(default)]
    pub motor: MotorSection,
    /// The mechanics; without them the axis turns for ever.
    #[serde(default)]
    pub mechanics: MechanicsSection,
    /// The switches along the travel.
    #[serde(rename = "switch", default)]
    pub switches: Vec<SwitchSection>,
}

/// `[drive.motor]`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MotorSection {
    /// Full steps in a turn, 1 to 10 000.
    #[serde(default = "usual_steps_per_rev", deserialize_with = "steps_per_rev")]
    pub steps_per_rev: Spanned<u32>,
}

impl Default for MotorSection {
    fn default() -> MotorSection {
        MotorSection { steps_per_rev: usual_steps_per_rev() }
    }
}

/// A 1.8° motor.
fn usual_steps_per_rev() -> Spanned<u32> {
    Spanned::new(0..0, 200)
}

/// `[drive.mechanics]`.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MechanicsSection {
    /// The hard ends, in full steps; none by default.
    #[serde(default, deserialize_with = "travel")]
    pub travel: Option<Spanned<[f64; 2]>>,
    /// Where the carriage stands at power-up, in full steps; 0 by default.
    pub start: Option<Spanned<f64>>,
}

/// `[[drive.switch]]`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SwitchSection {
    /// The input it is wired to.
    #[serde(deserialize_with = "input")]
    pub input: Input,
    /// From where to where it is closed, in full steps.
    #[serde(deserialize_with = "interval")]
    pub closed: Spanned<[f64; 2]>,
}

fn model<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Model, D::Error> {
    named(deserializer, "model", Model::from_name, &Model::ALL.map(Model::name))
}

fn input<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Input, D::Error> {
    named(deserializer, "input", Input::from_name, &Input::ALL.map(Input::name))
}

fn clock<'de, D: Deserializer<'de>>(deserializer: D) -> Result<ClockMode, D::Error> {
    named(deserializer, "clock", |name| (name == "real").then_some(ClockMode::Real), &["real"])
}

fn word_order<'de, D: Deserializer<'de>>(deserializer: D) -> Result<WordOrder, D::Error> {
    let find = |name: &str| match name {
        "low-first" => Some(WordOrder::LowFirst),
        "high-first" => Some(WordOrder::HighFirst),
        _ => None,
    };
    named(deserializer, "word_order", find, &["low-first", "high-first"])
}

/// Reads one of a few names, and lists them all when it is another.
fn named<'de, D: Deserializer<'de>, T>(
    deserializer: D,
    what: &str,
    find: impl Fn(&str) -> Option<T>,
    names: &[&str],
) -> Result<T, D::Error> {
    let name = String::deserialize(deserializer)?;
    find(&name).ok_or_else(|| {
        let allowed = if names.len() > 1 { "one of " } else { "" };
        D::Error::custom(format!("{what} `{name}` is unknown; it is {allowed}{}", names.join(", ")))
    })
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

fn address<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Spanned<SocketAddr>, D::Error> {
    let text = Spanned::<String>::deserialize(deserializer)?;
    let address = text.get_ref().parse().map_err(|_| {
        let text = text.get_ref();
        D::Error::custom(format!("`{text}` is no IP address with a port, as in 127.0.0.1:5020"))
    })?;
    Ok(Spanned::new(text.span(), address))
}

/// A mistake in a rig file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RigFileError {
    /// What is wrong, and what would be right.
    pub message: String,
    /// Line, from 1; `None` when it is the file as a whole.
    pub line: Option<usize>,
    /// Column in characters, from 1.
    pub column: Option<usize>,
    /// The line itself, and how many characters of it are meant.
    excerpt: Option<(String, usize)>,
}

impl RigFileError {
    fn new(text: &str, span: Option<Range<usize>>, message: String) -> RigFileError {
        let place = span.and_then(|span| {
            let before = text.get(..span.start)?;
            let line_start = before.rfind('\n').map_or(0, |at| at + 1);
            let line = text.get(line_start..)?.lines().next().unwrap_or("");
            let column = text.get(line_start..span.start)?.chars().count() + 1;
            let meant =
                text.get(span).map_or(1, |part| part.lines().next().unwrap_or("").chars().count().max(1));
            Some((before.matches('\n').count() + 1, column, line.to_string(), meant))
        });
        match place {
            None => RigFileError { message, line: None, column: None, excerpt: None },
            Some((line, column, source, meant)) => RigFileError {
                message,
                line: Some(line),
                column: Some(column),
                excerpt: Some((source, meant)),
            },
        }
    }

    /// The mistake as a person reads it: `FILE:LINE:COLUMN: message`, then the line with what is meant underlined.
    pub fn render(&self, file: &str) -> String {
        let (Some(line), Some(column), Some((source, meant))) = (self.line, self.column, &self.excerpt)
        else {
            return format!("{file}: {}", self.message);
        };
        let (pad, rule) = (" ".repeat(line.to_string().len()), "^".repeat(*meant));
        let indent = " ".repeat(column.saturating_sub(1));
        format!(
            "{file}:{line}:{column}: {}\n{pad} |\n{line} | {source}\n{pad} | {indent}{rule}",
            self.message
        )
    }
}

impl fmt::Display for RigFileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl core::error::Error for RigFileError {}

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
fn reworded(message: &str) -> String {
    let mut text = message.trim_end().to_string();
    if text == "invalid type: map, expected a sequence" {
        return "found one table where there may be several; its name stands in double brackets".to_string();
    }
    for (theirs, plain) in WORDING {
        text = text.replacen(theirs, plain, 1);
    }
    text.replace("expected a sequence", "expected a list")
}

/// The farthest place on a travel that a rig file may name, in full steps.
const FARTHEST: f64 = 1e9;

impl RigFile {
    /// Reads a rig.
    ///
    /// # Errors
    /// The first mistake found, with its place in `text`.
    pub fn parse(text: &str) -> Result<RigFile, RigFileError> {
        let text = text.strip_prefix('\u{FEFF}').unwrap_or(text);
        let file: RigFile = toml::from_str(text)
            .map_err(|error| RigFileError::new(text, error.span(), reworded(error.message())))?;
        let at = |span: Range<usize>, message: String| Err(RigFileError::new(text, Some(span), message));
        if file.drives.is_empty() {
            let message = "the rig has no drive; begin one with [[drive]]".to_string();
            return Err(RigFileError::new(text, None, message));
        }
        for (number, drive) in file.drives.iter().enumerate() {
            if let Err((span, message)) = drive.check() {
                return at(span, message);
            }
            let earlier = || file.drives.iter().take(number);
            if earlier().any(|other| other.name.get_ref() == drive.name.get_ref()) {
                return at(
                    drive.name.span(),
                    format!("a drive named `{}` is there already", drive.name.get_ref()),
                );
            }
            let address = drive.modbus_tcp.get_ref();
            let same = earlier().find(|other| address.port() != 0 && other.modbus_tcp.get_ref() == address);
            if let Some(other) = same {
                let message = format!("{address} is taken by the drive `{}`", other.name.get_ref());
                return at(drive.modbus_tcp.span(), message);
            }
        }
        Ok(file)
    }
}

/// A mistake and its place.
type Mistake = (Range<usize>, String);

impl DriveSection {
    /// The controller of this drive.
    pub fn config(&self) -> Config {
        Config {
            model: self.model,
            word_order: self.word_order,
            port: self.modbus_tcp.get_ref().port(),
            autonomous: self.autonomous,
        }
    }

    /// The drive, switched on with what its controller remembers.
    pub fn power_up(&self, mut memory: Memory) -> Machine {
        if let Some(number) = &self.mode_n_programs {
            memory.mode_n_programs = *number.get_ref();
        }
        let travel = self.mechanics.travel.as_ref().and_then(|travel| Travel::between(*travel.get_ref()));
        let start = self.mechanics.start.as_ref().map_or(0.0, |start| *start.get_ref());
        let switch = |switch: &SwitchSection| Switch::new(switch.input, *switch.closed.get_ref());
        let switches = self.switches.iter().filter_map(switch).collect();
        Machine::power_up(self.config(), memory, Mechanics::new(travel, start), switches)
    }

    fn check(&self) -> Result<(), Mistake> {
        check_name(&self.name)?;
        if let Some(travel) = &self.mechanics.travel {
            check_interval(travel, "travel")?;
            if Travel::between(*travel.get_ref()).is_none() {
                let message = "travel is narrower than 1/256 of a full step; nothing could move".to_string();
                return Err((travel.span(), message));
            }
        }
        if let Some(start) = &self.mechanics.start {
            self.check_start(start)?;
        }
        for switch in &self.switches {
            check_interval(&switch.closed, "closed")?;
            if Switch::new(switch.input, *switch.closed.get_ref()).is_none() {
                let message =
                    "closed is narrower than 1/256 of a full step; no microstep would meet it".to_string();
                return Err((switch.closed.span(), message));
            }
        }
        Ok(())
    }

    fn check_start(&self, start: &Spanned<f64>) -> Result<(), Mistake> {
        let place = *start.get_ref();
        let [low, high] =
            self.mechanics.travel.as_ref().map_or([-FARTHEST, FARTHEST], |travel| *travel.get_ref());
        if place >= low && place <= high {
            return Ok(());
        }
        let message = match &self.mechanics.travel {
            Some(_) => format!("start {place:?} is not within the travel, {low:?} to {high:?}"),
            None => format!("start is {place:?}; it is within ±1e9 full steps"),
        };
        Err((start.span(), message))
    }
}

fn check_name(name: &Spanned<String>) -> Result<(), Mistake> {
    let text = name.get_ref();
    let allowed = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    if (1..=32).contains(&text.len()) && text.chars().all(allowed) {
        return Ok(());
    }
    Err((name.span(), format!("the name `{text}` is not 1 to 32 letters, digits, - and _")))
}

fn check_interval(interval: &Spanned<[f64; 2]>, key: &str) -> Result<(), Mistake> {
    let [low, high] = *interval.get_ref();
    if low < high && low >= -FARTHEST && high <= FARTHEST {
        return Ok(());
    }
    let message = format!(
        "{key} is [{low:?}, {high:?}]; the first must be below the second, both within ±1e9 full steps"
    );
    Err((interval.span(), message))
}
