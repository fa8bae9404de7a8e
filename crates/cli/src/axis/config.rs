//! `stepdrive.toml`: axes by name, how they are measured, and what they may do.

use crate::Failure;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use stepdrive_host::axis::SoftLimits;
use stepdrive_host::units::{Decimal, Scale, Unit};
use stepdrive_host::uri::Target;
use stepdrive_rig::file::Mistake;
use toml::Spanned;

/// The longest name of an axis.
const LONGEST_NAME: usize = 32;

/// An axis: `[axis.NAME]`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct AxisSection {
    /// Its name: letters, digits, `-` and `_`.
    pub(super) name: String,
    /// Where its controller is.
    pub(super) target: Target,
    /// How it is measured.
    pub(super) scale: Scale,
    /// Where it may go.
    pub(super) limits: SoftLimits,
    /// The file with its controller's settings.
    pub(super) profile: Option<PathBuf>,
    /// Where its password is.
    pub(super) password: Password,
}

/// Where a password is kept.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) enum Password {
    /// Nowhere: it is the factory's.
    #[default]
    Factory,
    /// In a variable of the environment.
    Env(String),
    /// In a file.
    File(PathBuf),
}

/// The file as it is written.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    #[serde(default)]
    axis: BTreeMap<Spanned<String>, Spanned<WrittenAxis>>,
}

/// `[axis.NAME]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenAxis {
    /// Where its controller is.
    uri: Spanned<String>,
    /// `mm`, `deg`, `turns` or `steps`, which is the default.
    unit: Option<Spanned<String>>,
    /// Travel for one turn of the output, mm.
    per_turn: Option<Spanned<f64>>,
    /// Full steps to a turn of the motor.
    steps_per_rev: Option<Spanned<u32>>,
    /// So many turns of the motor make so many of the output.
    gear: Option<Spanned<[u32; 2]>>,
    /// Whether the positive direction is the motor's negative one.
    #[serde(default)]
    reversed: bool,
    /// The lowest and the highest position that it may be sent to, in its unit; none with 0 and 0.
    limits: Option<Spanned<[f64; 2]>>,
    /// The file with its controller's settings.
    profile: Option<PathBuf>,
    /// The variable of the environment that holds its password.
    password_env: Option<Spanned<String>>,
    /// The file that holds its password.
    password_file: Option<Spanned<PathBuf>>,
}

/// What is wrong, and where.
type Misplaced = (Option<Range<usize>>, String);

/// Reads a file of axes.
pub(super) fn read(file: &Path) -> Result<Vec<AxisSection>, Failure> {
    let text = std::fs::read_to_string(file)
        .map_err(|error| Failure::Usage(format!("cannot read {}: {error}", file.display())))?;
    let folder = file.parent().unwrap_or(Path::new(""));
    parse(&text, folder).map_err(|mistake| Failure::Usage(mistake.render(&file.display().to_string())))
}

/// The axes of a file in the order of their names; paths in it are relative to `folder`.
fn parse(text: &str, folder: &Path) -> Result<Vec<AxisSection>, Mistake> {
    let written: Written = toml::from_str(text).map_err(|error| Mistake::of_toml(text, &error))?;
    let sections = written.axis.iter().map(|(name, axis)| section(name, axis, folder));
    sections
        .collect::<Result<Vec<AxisSection>, Misplaced>>()
        .map_err(|(span, message)| Mistake::new(text, span, message))
}

fn section(
    name: &Spanned<String>,
    written: &Spanned<WrittenAxis>,
    folder: &Path,
) -> Result<AxisSection, Misplaced> {
    let axis = written.get_ref();
    let target = Target::parse(axis.uri.get_ref()).map_err(|error| at(&axis.uri, error.to_string()))?;
    let scale = scale(name, axis)?;
    Ok(AxisSection {
        name: checked_name(name)?,
        limits: axis.limits.as_ref().map_or(Ok(SoftLimits::OFF), limits)?,
        profile: axis.profile.as_ref().map(|file| folder.join(file)),
        password: password(axis, &target, folder)?,
        target,
        scale,
    })
}

/// A mistake in a value.
fn at<T>(value: &Spanned<T>, message: impl Into<String>) -> Misplaced {
    (Some(value.span()), message.into())
}

fn checked_name(name: &Spanned<String>) -> Result<String, Misplaced> {
    let text = name.get_ref();
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || matches!(byte, b'-' | b'_');
    if !text.is_empty() && text.len() <= LONGEST_NAME && text.bytes().all(plain) {
        return Ok(text.clone());
    }
    Err(at(name, format!("the name of an axis is 1 to {LONGEST_NAME} letters, digits, - and _")))
}

fn scale(name: &Spanned<String>, axis: &WrittenAxis) -> Result<Scale, Misplaced> {
    let unit = axis.unit.as_ref().map_or(Ok(Unit::Step), unit)?;
    if let Some(per_turn) = axis.per_turn.as_ref().filter(|_| unit != Unit::Mm) {
        return Err(at(per_turn, format!("per_turn belongs to an axis in mm; this one is in {unit}")));
    }
    let scale = match unit {
        Unit::Step => {
            if let Some(steps) = &axis.steps_per_rev {
                return Err(at(
                    steps,
                    "an axis in steps needs no steps_per_rev; give it unit = \"mm\", \"deg\" or \"turns\"",
                ));
            }
            Scale::STEPS
        }
        Unit::Mm => {
            let per_turn = required(name, axis.per_turn.as_ref(), "per_turn, the mm for one turn", unit)?;
            let travel = decimal(per_turn, *per_turn.get_ref())?;
            let steps = steps(name, axis, unit)?;
            let wrong = if travel > Decimal::ZERO { steps.span() } else { per_turn.span() };
            Scale::millimetres(travel, *steps.get_ref()).map_err(|error| (Some(wrong), error.to_string()))?
        }
        Unit::Deg => {
            let steps = steps(name, axis, unit)?;
            Scale::degrees(*steps.get_ref()).map_err(|error| at(steps, error.to_string()))?
        }
        Unit::Turn => {
            let steps = steps(name, axis, unit)?;
            Scale::turns(*steps.get_ref()).map_err(|error| at(steps, error.to_string()))?
        }
    };
    let scale = match &axis.gear {
        Some(gear) => {
            let [motor, output] = *gear.get_ref();
            scale.geared(motor, output).map_err(|error| at(gear, error.to_string()))?
        }
        None => scale,
    };
    Ok(if axis.reversed { scale.reversed() } else { scale })
}

fn unit(written: &Spanned<String>) -> Result<Unit, Misplaced> {
    Unit::from_name(written.get_ref()).ok_or_else(|| {
        let known = Unit::ALL.map(Unit::name).join(", ");
        at(written, format!("the unit of an axis is one of {known}"))
    })
}

fn steps<'a>(
    name: &Spanned<String>,
    axis: &'a WrittenAxis,
    unit: Unit,
) -> Result<&'a Spanned<u32>, Misplaced> {
    required(name, axis.steps_per_rev.as_ref(), "steps_per_rev, the motor's full steps to a turn", unit)
}

fn required<'a, T>(
    name: &Spanned<String>,
    value: Option<&'a Spanned<T>>,
    what: &str,
    unit: Unit,
) -> Result<&'a Spanned<T>, Misplaced> {
    value.ok_or_else(|| at(name, format!("an axis in {unit} needs {what}")))
}

fn decimal<T>(place: &Spanned<T>, value: f64) -> Result<Decimal, Misplaced> {
    Decimal::from_f64(value).ok_or_else(|| at(place, format!("{value} is not within ±9223372036")))
}

fn limits(written: &Spanned<[f64; 2]>) -> Result<SoftLimits, Misplaced> {
    let [low, high] = *written.get_ref();
    SoftLimits::new(decimal(written, low)?, decimal(written, high)?)
        .map_err(|error| at(written, error.to_string()))
}

fn password(axis: &WrittenAxis, target: &Target, folder: &Path) -> Result<Password, Misplaced> {
    let is_smsd = target.smsd_options().is_some();
    let none = "an SMD3 has no password; leave this out";
    match (&axis.password_env, &axis.password_file) {
        (None, None) => Ok(Password::Factory),
        (Some(env), _) if !is_smsd => Err(at(env, none)),
        (_, Some(file)) if !is_smsd => Err(at(file, none)),
        (Some(_), Some(file)) => {
            Err(at(file, "the password is in password_env already; leave one of the two out"))
        }
        (Some(env), None) => Ok(Password::Env(env.get_ref().clone())),
        (None, Some(file)) => Ok(Password::File(folder.join(file.get_ref()))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> Result<Vec<AxisSection>, String> {
        parse(text, Path::new("/etc/axes")).map_err(|mistake| mistake.render("stepdrive.toml"))
    }

    const STAGE: &str = r#"
[axis.stage]
uri = "smsd+tcp://stage.lab:502?unit=1"
unit = "mm"
per_turn = 5.0
steps_per_rev = 200
limits = [-10, 200]
profile = "stage.profile.toml"
password_env = "STAGE_PASSWORD"
"#;

    #[test]
    fn an_axis_is_read_with_all_that_it_has() {
        let more = "[axis.a]\nuri = \"/dev/ttyACM0\"\n[axis.b]\nuri = \"smd3+tcp://h:1\"\nunit = \"deg\"\n\
                    steps_per_rev = 400\ngear = [10, 1]\nreversed = true\nlimits = [0, 0]\n";
        let axes = parsed(&format!("{STAGE}{more}")).expect("valid");
        let [a, b, stage] = axes.as_slice() else { panic!("{axes:?}") };
        assert_eq!((a.name.as_str(), a.scale, a.limits), ("a", Scale::STEPS, SoftLimits::OFF));
        let degrees = Scale::degrees(400).and_then(|scale| scale.geared(10, 1)).expect("a scale");
        assert_eq!((b.scale, b.limits), (degrees.reversed(), SoftLimits::OFF));
        assert_eq!(stage.scale, Scale::millimetres(Decimal::whole(5), 200).expect("a scale"));
        assert_eq!(stage.limits.range(), Some((Decimal::whole(-10), Decimal::whole(200))));
        assert_eq!(stage.profile.as_deref(), Some(Path::new("/etc/axes/stage.profile.toml")));
        assert_eq!(stage.password, Password::Env("STAGE_PASSWORD".to_owned()));
        assert_eq!(parsed(""), Ok(Vec::new()));
    }

    #[test]
    fn every_mistake_is_told_with_its_place() {
        for (line, told) in [
            ("uri = \"ftp://x\"", "stepdrive.toml:2:7: `ftp` is no kind of target"),
            ("", "stepdrive.toml:1:"),
            (
                "uri = \"h:1\"\nunit = \"inch\"",
                "stepdrive.toml:3:8: the unit of an axis is one of mm, deg, turns, steps",
            ),
            (
                "uri = \"h:1\"\nunit = \"mm\"\nper_turn = 5",
                "stepdrive.toml:1:7: an axis in mm needs steps_per_rev",
            ),
            (
                "uri = \"h:1\"\nunit = \"mm\"\nsteps_per_rev = 200",
                "stepdrive.toml:1:7: an axis in mm needs per_turn",
            ),
            (
                "uri = \"h:1\"\nunit = \"mm\"\nsteps_per_rev = 200\nper_turn = -5",
                "stepdrive.toml:5:12: an axis goes more",
            ),
            (
                "uri = \"h:1\"\nunit = \"mm\"\nsteps_per_rev = 0\nper_turn = 5",
                "stepdrive.toml:4:17: a motor has 1 to",
            ),
            ("uri = \"h:1\"\nper_turn = 5", "stepdrive.toml:3:12: per_turn belongs to an axis in mm"),
            (
                "uri = \"h:1\"\nsteps_per_rev = 5",
                "stepdrive.toml:3:17: an axis in steps needs no steps_per_rev",
            ),
            ("uri = \"h:1\"\ngear = [2, 1]", "stepdrive.toml:3:8: an axis measured in steps has no use"),
            ("uri = \"h:1\"\nlimits = [5, 1]", "stepdrive.toml:3:10: soft limits are [5, 1]"),
            ("uri = \"h:1\"\nlimits = [nan, 1]", "stepdrive.toml:3:10: NaN is not within"),
            ("uri = \"/dev/x\"\npassword_env = \"P\"", "stepdrive.toml:3:16: an SMD3 has no password"),
            (
                "uri = \"h:1\"\npassword_env = \"P\"\npassword_file = \"p\"",
                "stepdrive.toml:4:17: the password is in password_env already",
            ),
            ("uri = \"h:1\"\nlimit = [1, 2]", "stepdrive.toml:3:1: "),
        ] {
            let mistake = parsed(&format!("[axis.x]\n{line}\n")).expect_err(line);
            assert!(mistake.starts_with(told), "{line}: {mistake}");
        }
        let mistake = parsed("[axis.\"my stage\"]\nuri = \"h:1\"\n").expect_err("a name");
        assert!(mistake.starts_with("stepdrive.toml:1:7: the name of an axis is 1 to 32"), "{mistake}");
    }
}
