//! A rig file as it is written: TOML with the place of everything that may be wrong, checked, and turned into what it
//! means.

use super::mistake::RigFileError;
use super::{ClockMode, ControllerSection, DriveSection, RigFile, SmsdSection, SwitchSection};
use crate::mechanics::{Switch, Travel};
use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::net::SocketAddr;
use core::ops::{Range, RangeInclusive};
use serde::Deserialize;
use serde::de::{Deserializer, Error as _};
use stepdrive_drive::smsd::WordOrder;
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::models::Model;
use toml::Spanned;

/// A rig.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenRig {
    #[serde(default)]
    rig: WrittenClock,
    #[serde(rename = "drive", default)]
    drives: Vec<WrittenDrive>,
}

/// `[rig]`.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenClock {
    #[serde(default, deserialize_with = "clock")]
    clock: ClockMode,
}

/// `[[drive]]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenDrive {
    /// Its name, unique in the rig: letters, digits, `-` and `_`, up to 32.
    name: Spanned<String>,
    /// Its model.
    #[serde(deserialize_with = "model")]
    model: Model,
    /// Where it listens for Modbus TCP; port 0 takes a free one.
    #[serde(deserialize_with = "address")]
    modbus_tcp: Spanned<SocketAddr>,
    /// The order of the two words of a 32-bit value.
    #[serde(default, deserialize_with = "word_order")]
    word_order: WordOrder,
    /// Autonomous mode: the front panel shows "bF", and the program of `MODE_N_PROGRAMS` starts at power-up.
    #[serde(default)]
    autonomous: bool,
    /// `MODE_N_PROGRAMS` as set at the front panel, 0 to 3; without it the controller keeps the one it remembers.
    #[serde(default, deserialize_with = "mode_n_programs")]
    mode_n_programs: Option<Spanned<u8>>,
    /// The motor.
    #[serde(default)]
    motor: WrittenMotor,
    /// The mechanics; without them the axis turns for ever.
    #[serde(default)]
    mechanics: WrittenMechanics,
    /// The switches along the travel.
    #[serde(rename = "switch", default)]
    switches: Vec<WrittenSwitch>,
}

/// `[drive.motor]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenMotor {
    /// Full steps in a turn, 1 to 10 000.
    #[serde(default = "usual_steps_per_rev", deserialize_with = "steps_per_rev")]
    steps_per_rev: Spanned<u32>,
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
struct WrittenMechanics {
    /// The hard ends, in full steps; none by default.
    #[serde(default, deserialize_with = "travel")]
    travel: Option<Spanned<[f64; 2]>>,
    /// Where the carriage stands at power-up, in full steps; 0 by default.
    start: Option<Spanned<f64>>,
}

/// `[[drive.switch]]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenSwitch {
    /// The input it is wired to.
    #[serde(deserialize_with = "input")]
    input: Input,
    /// From where to where it is closed, in full steps.
    #[serde(deserialize_with = "interval")]
    closed: Spanned<[f64; 2]>,
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

/// Reads a rig.
pub(super) fn parse(text: &str) -> Result<RigFile, RigFileError> {
    let text = text.strip_prefix('\u{FEFF}').unwrap_or(text);
    let written: WrittenRig = toml::from_str(text)
        .map_err(|error| RigFileError::new(text, error.span(), reworded(error.message())))?;
    let at = |(span, message): Mistake| RigFileError::new(text, Some(span), message);
    if written.drives.is_empty() {
        let message = "the rig has no drive; begin one with [[drive]]".to_string();
        return Err(RigFileError::new(text, None, message));
    }
    for (number, drive) in written.drives.iter().enumerate() {
        let earlier = written.drives.get(..number).unwrap_or(&[]);
        drive.check().and_then(|()| drive.check_unlike(earlier)).map_err(at)?;
    }
    let drives = written.drives.into_iter().map(WrittenDrive::meant).collect();
    Ok(RigFile { clock: written.rig.clock, drives })
}

/// A mistake and its place.
type Mistake = (Range<usize>, String);

impl WrittenDrive {
    /// What a drive without mistakes means.
    fn meant(self) -> DriveSection {
        let switch =
            |switch: WrittenSwitch| SwitchSection { input: switch.input, closed: switch.closed.into_inner() };
        DriveSection {
            name: self.name.into_inner(),
            steps_per_rev: self.motor.steps_per_rev.into_inner(),
            travel: self.mechanics.travel.map(Spanned::into_inner),
            start: self.mechanics.start.map_or(0.0, Spanned::into_inner),
            controller: ControllerSection::Smsd(SmsdSection {
                model: self.model,
                modbus_tcp: self.modbus_tcp.into_inner(),
                word_order: self.word_order,
                autonomous: self.autonomous,
                mode_n_programs: self.mode_n_programs.map(Spanned::into_inner),
                switches: self.switches.into_iter().map(switch).collect(),
            }),
        }
    }

    /// Name and address must not be those of a drive before it.
    fn check_unlike(&self, earlier: &[WrittenDrive]) -> Result<(), Mistake> {
        if earlier.iter().any(|other| other.name.get_ref() == self.name.get_ref()) {
            return Err((
                self.name.span(),
                format!("a drive named `{}` is there already", self.name.get_ref()),
            ));
        }
        let address = self.modbus_tcp.get_ref();
        let same = earlier.iter().find(|other| address.port() != 0 && other.modbus_tcp.get_ref() == address);
        same.map_or(Ok(()), |other| {
            let message = format!("{address} is taken by the drive `{}`", other.name.get_ref());
            Err((self.modbus_tcp.span(), message))
        })
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
