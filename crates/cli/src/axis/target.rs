//! Which axis is meant, and opening it.

use super::config::{self, AxisSection, Password};
use super::names::{instead, shown};
use super::trust::Record;
use super::{AxisArgs, Controller, Opened, Reach};
use crate::Failure;
use etcetera::BaseStrategy;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use stepdrive_host::axis::{DriveAxis, Motor, Smd3Motor, SmsdMotor, SoftLimits};
use stepdrive_host::smd3::Smd3Client;
use stepdrive_host::smsd::{Smsd, SmsdOptions};
use stepdrive_host::units::Scale;
use stepdrive_host::uri::Target;
use stepdrive_host::{BoxFuture, Connect, Stream};

/// The file in which axes are described.
const FILE: &str = "stepdrive.toml";

/// How an axis is named, for messages.
const HOW: &str =
    "name an axis of stepdrive.toml, or where its controller is, as in -a HOST:PORT or -a /dev/ttyACM0";

/// An axis, and what is known of it beforehand.
#[derive(Clone, Debug)]
pub(crate) struct Found {
    /// What it is called: its name in `stepdrive.toml`, or where it is.
    pub(crate) name: String,
    /// Where its controller is.
    pub(crate) target: Target,
    /// The file with its controller's settings, if there is one.
    pub(crate) profile: Option<PathBuf>,
    scale: Scale,
    limits: SoftLimits,
    password: Password,
}

/// A line under another name.
struct Named {
    name: String,
    line: Box<dyn Connect>,
}

impl Connect for Named {
    fn connect(&self) -> BoxFuture<'_, io::Result<Box<dyn Stream>>> {
        self.line.connect()
    }

    fn name(&self) -> &str {
        &self.name
    }
}

/// Finds the axis that is meant.
pub(crate) fn find(args: &AxisArgs) -> Result<Found, Failure> {
    let axes = Axes::read(&args.reach)?;
    match &args.axis {
        Some(name) => axes.named(name),
        None => axes.only(),
    }
}

/// Finds the axes that are meant; all of `stepdrive.toml` when none is named.
pub(crate) fn find_all(names: &[String], reach: &Reach) -> Result<Vec<Found>, Failure> {
    let axes = Axes::read(reach)?;
    if names.is_empty() {
        if axes.sections.is_empty() {
            return Err(axes.none());
        }
        return Ok(axes.sections.into_iter().map(Found::from).collect());
    }
    names.iter().map(|name| axes.named(name)).collect()
}

/// The scale and the limits of the axis that has this controller in the `stepdrive.toml` that is there, if one has. What is
/// wrong with the file is told to whoever asks for an axis of it.
pub(crate) fn measured(target: &Target) -> Option<(Scale, SoftLimits)> {
    let sections = config::read(&usual_file()?).ok()?;
    let is_there = |section: &AxisSection| place_of(&section.target) == place_of(target);
    sections.into_iter().find(is_there).map(|section| (section.scale, section.limits))
}

/// Where a controller is, however it is spoken to.
fn place_of(target: &Target) -> String {
    target.name().replace("localhost:", "127.0.0.1:")
}

/// The axes that have names.
struct Axes {
    /// Where they stand; `None` when there is no such file.
    file: Option<PathBuf>,
    sections: Vec<AxisSection>,
}

impl Axes {
    fn read(reach: &Reach) -> Result<Axes, Failure> {
        let file = reach.config.clone().or_else(usual_file);
        let sections = file.as_deref().map_or(Ok(Vec::new()), config::read)?;
        Ok(Axes { file, sections })
    }

    /// The axis of a name, or where a controller is.
    fn named(&self, name: &str) -> Result<Found, Failure> {
        if let Some(section) = self.sections.iter().find(|section| section.name == name) {
            return Ok(Found::from(section.clone()));
        }
        let alike: Vec<&AxisSection> =
            self.sections.iter().filter(|section| section.name.eq_ignore_ascii_case(name)).collect();
        match alike.as_slice() {
            [] if is_place(name) => Ok(Found::at(Target::parse(name)?)),
            [] => Err(self.unknown(name)),
            [one] => Ok(Found::from((*one).clone())),
            several => {
                let names: Vec<&str> = several.iter().map(|section| section.name.as_str()).collect();
                Err(Failure::Several(format!(
                    "`{name}` may be any of {}; write it as it stands there",
                    names.join(", ")
                )))
            }
        }
    }

    /// The one that there is.
    fn only(mut self) -> Result<Found, Failure> {
        match (self.sections.len(), self.sections.pop()) {
            (1, Some(section)) => Ok(Found::from(section)),
            (_, None) => Err(self.none()),
            (_, Some(last)) => {
                let names = self.sections.iter().chain([&last]).map(|section| section.name.as_str());
                let names = names.collect::<Vec<_>>().join(", ");
                Err(Failure::Several(format!(
                    "several axes are described in {}: {names}; say which with -a NAME",
                    self.place()
                )))
            }
        }
    }

    fn unknown(&self, name: &str) -> Failure {
        let known: Vec<&str> = self.sections.iter().map(|section| section.name.as_str()).collect();
        let why = match &self.file {
            Some(file) => format!("in {} {}", file.display(), instead(name, &known)),
            None => self.place(),
        };
        Failure::NotFound(format!("there is no axis `{}`: {why}; {HOW}", shown(name)))
    }

    fn none(&self) -> Failure {
        match &self.file {
            Some(file) => Failure::NotFound(format!("{} describes no axis; {HOW}", file.display())),
            None => Failure::NotFound(format!("no axis is named, and {}; {HOW}", self.place())),
        }
    }

    /// Where names are looked up.
    fn place(&self) -> String {
        self.file
            .as_ref()
            .map_or_else(|| format!("there is no {FILE} here"), |file| file.display().to_string())
    }
}

/// Whether it says where a controller is; names have no such characters.
fn is_place(text: &str) -> bool {
    text.contains([':', '/', '@', '?']) || Target::parse(text).is_ok()
}

/// The file that is there: here, or in the platform's folder for configuration.
fn usual_file() -> Option<PathBuf> {
    let folder = etcetera::choose_base_strategy().ok().map(|platform| platform.config_dir());
    let there = folder.map(|folder| folder.join("stepdrive").join(FILE));
    [Some(PathBuf::from(FILE)), there].into_iter().flatten().find(|file| file.exists())
}

impl From<AxisSection> for Found {
    fn from(section: AxisSection) -> Found {
        let AxisSection { name, target, scale, limits, profile, password } = section;
        Found { name, target, profile, scale, limits, password }
    }
}

impl Found {
    /// A controller of which no more is known than where it is.
    fn at(target: Target) -> Found {
        let name = match &target {
            Target::Smd3Serial { path } => path.clone(),
            Target::Smsd { .. }
            | Target::SmsdUsb { .. }
            | Target::SmsdUsbTcp { .. }
            | Target::SmsdStandard { .. }
            | Target::Smd3Tcp { .. } => target.to_string(),
        };
        let (scale, limits, password) = (Scale::STEPS, SoftLimits::OFF, Password::Factory);
        Found { name, target, profile: None, scale, limits, password }
    }

    /// A line under the name of the axis, where it has one.
    fn line(&self, line: impl Connect + 'static) -> Named {
        let place = line.name();
        let named = self.name == self.target.to_string() || self.name == place;
        let name = if named { place.to_owned() } else { format!("{} at {place}", self.name) };
        Named { name, line: Box::new(line) }
    }

    /// Opens it. It connects when it is first asked for something.
    pub(crate) fn open(self, reach: &Reach) -> Result<Opened, Failure> {
        let record = Record::of(&self.target);
        let controller = if let Some(driver) = self.smsd(reach)? {
            Controller::Smsd(self.axis(SmsdMotor::new(&self.name, driver), &record))
        } else {
            let client = Smd3Client::new(self.line(self.target.connect()), reach.timeouts());
            Controller::Smd3(self.axis(Smd3Motor::new(client), &record))
        };
        Ok(Opened { found: self, controller, record })
    }

    /// The driver of the SMSD that it is; `None` when it is none.
    fn smsd(&self, reach: &Reach) -> Result<Option<Box<dyn Smsd>>, Failure> {
        let Some(factory) = self.target.smsd_options() else { return Ok(None) };
        let password = self.password(reach)?.unwrap_or(factory.password);
        let options = SmsdOptions { password, timeouts: reach.timeouts(), ..factory };
        Ok(self.target.smsd(self.line(self.target.connect()), options))
    }

    fn axis<M: Motor>(&self, motor: M, record: &Record) -> Arc<DriveAxis<M>> {
        let axis = DriveAxis::new(motor).with_scale(self.scale).with_limits(self.limits);
        Arc::new(axis.with_trust(record.state()))
    }

    /// The password that is given for it; `None` for the factory's.
    fn password(&self, reach: &Reach) -> Result<Option<u64>, Failure> {
        let given = match (&reach.password_env, &reach.password_file) {
            (Some(variable), _) => &Password::Env(variable.clone()),
            (None, Some(file)) => &Password::File(file.clone()),
            (None, None) => &self.password,
        };
        let (text, place) = match given {
            Password::Factory => return Ok(None),
            Password::Env(variable) => (self.read_variable(variable)?, variable.clone()),
            Password::File(file) => (self.read_password_file(file)?, file.display().to_string()),
        };
        let wrong = || {
            Failure::Usage(format!(
                "what {place} holds is no password of {}: that is 1 to 16 hexadecimal digits, as in 0x0123456789ABCDEF",
                self.name
            ))
        };
        parsed_password(&text).map(Some).ok_or_else(wrong)
    }

    #[allow(clippy::disallowed_methods, reason = "a password stands in no file and in no argument")]
    fn read_variable(&self, variable: &str) -> Result<String, Failure> {
        std::env::var(variable).map_err(|_| {
            let name = &self.name;
            Failure::Usage(format!(
                "the variable {variable}, which is to hold the password of {name}, is not set"
            ))
        })
    }

    fn read_password_file(&self, file: &Path) -> Result<String, Failure> {
        std::fs::read_to_string(file).map_err(|error| {
            Failure::Usage(format!(
                "cannot read {}, which is to hold the password of {}: {error}",
                file.display(),
                self.name
            ))
        })
    }
}

fn parsed_password(text: &str) -> Option<u64> {
    let text = text.trim();
    let digits = text.strip_prefix("0x").unwrap_or(text);
    let all_digits = digits.len() <= 16 && digits.bytes().all(|byte| byte.is_ascii_hexdigit());
    all_digits.then(|| u64::from_str_radix(digits, 16).ok()).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_is_told_from_a_name() {
        for place in ["h:1", "/dev/ttyACM0", "COM3", "smsd+tcp://h", "ftp://h", "me@h", "h?unit=1"] {
            assert!(is_place(place), "{place}");
        }
        for name in ["stage", "stage-2", "x_y", "", "com"] {
            assert!(!is_place(name), "{name}");
        }
    }

    #[test]
    fn a_password_is_hexadecimal() {
        assert_eq!(parsed_password(" 0x0123456789ABCDEF\n"), Some(0x0123_4567_89AB_CDEF));
        assert_eq!(parsed_password("ff"), Some(255));
        for text in ["", "0x", "0x0123456789ABCDEF0", "+ff", "password"] {
            assert_eq!(parsed_password(text), None, "{text}");
        }
    }
}
