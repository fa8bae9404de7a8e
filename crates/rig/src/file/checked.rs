//! A rig file checked, and turned into what it means.

use super::mistake::RigFileError;
use super::written::{
    AnyModel, WrittenDrive, WrittenRig, WrittenSettings, WrittenSwitch, WrittenWinding, reworded, unknown,
};
use super::{
    ApiSection, ControllerSection, DriveSection, RigFile, SerialPort, Smd3Section, SwitchSection, wires,
};
use crate::mechanics::{Switch, Travel};
use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::net::SocketAddr;
use core::ops::{Range, RangeInclusive};
use core::time::Duration;
use stepdrive_drive::smd3::Thermal;
use stepdrive_spec::smd3::signals::{Sensor, Signal};
use toml::Spanned;

/// The farthest place on a travel that a rig file may name, in full steps.
const FARTHEST: f64 = 1e9;

/// A mistake and its place.
pub(super) type Mistake = (Range<usize>, String);

/// The fewest and the most characters of a token: too many to guess, few enough for a line.
const TOKEN_LENGTH: RangeInclusive<usize> = 16..=256;

/// Reads a rig.
pub(super) fn parse(text: &str) -> Result<RigFile, RigFileError> {
    let text = text.strip_prefix('\u{FEFF}').unwrap_or(text);
    let written: WrittenRig = toml::from_str(text)
        .map_err(|error| RigFileError::new(text, error.span(), reworded(error.message())))?;
    if written.drives.is_empty() {
        let message = "the rig has no drive; begin one with [[drive]]".to_string();
        return Err(RigFileError::new(text, None, message));
    }
    written.check().map_err(|(span, message)| RigFileError::new(text, Some(span), message))
}

impl WrittenRig {
    /// What the rig means.
    fn check(&self) -> Result<RigFile, Mistake> {
        let mut drives = Vec::new();
        for (number, drive) in self.drives.iter().enumerate() {
            drive.check_unlike(self.drives.get(..number).unwrap_or(&[]))?;
            drives.push(drive.check()?);
        }
        let api = self.rig.check_api(&self.drives)?;
        let rig = RigFile {
            clock: self.rig.clock,
            api,
            seed: self.rig.seed.unwrap_or(1),
            drives,
            wires: Vec::new(),
        };
        Ok(RigFile { wires: wires::check(&self.wires, &rig)?, ..rig })
    }
}

impl WrittenSettings {
    /// Where the rig is controlled from.
    fn check_api(&self, drives: &[WrittenDrive]) -> Result<Option<ApiSection>, Mistake> {
        let token = self.api_token.as_ref().map(check_token).transpose()?;
        let Some(written) = &self.api else {
            return self.api_token.as_ref().map_or(Ok(None), |token| {
                let message = "api_token without api; there is nothing that it would guard".to_string();
                Err((token.span(), message))
            });
        };
        let address = *written.get_ref();
        if !address.ip().to_canonical().is_loopback() && token.is_none() {
            let message = format!(
                "{address} can be reached by others, who could then control the rig; give an api_token too, or take \
                 a loopback address, as in 127.0.0.1:{}",
                address.port()
            );
            return Err((written.span(), message));
        }
        let clashes = |drive: &&WrittenDrive| drive.addresses().any(|other| clash(*other.get_ref(), address));
        if let Some(drive) = drives.iter().find(clashes) {
            return Err((
                written.span(),
                format!("{address} is taken by the drive `{}`", drive.name.get_ref()),
            ));
        }
        Ok(Some(ApiSection { address, token }))
    }
}

/// Whether two cannot listen at once. An unspecified address takes its port on all.
fn clash(one: SocketAddr, other: SocketAddr) -> bool {
    let everywhere = one.ip().is_unspecified() || other.ip().is_unspecified();
    one.port() != 0 && one.port() == other.port() && (everywhere || one.ip() == other.ip())
}

fn check_token(token: &Spanned<String>) -> Result<String, Mistake> {
    let text = token.get_ref();
    if TOKEN_LENGTH.contains(&text.len()) && text.bytes().all(|byte| byte.is_ascii_graphic()) {
        return Ok(text.clone());
    }
    let (least, most) = (TOKEN_LENGTH.start(), TOKEN_LENGTH.end());
    let message = format!("api_token is not {least} to {most} printable ASCII characters without spaces");
    Err((token.span(), message))
}

impl WrittenDrive {
    /// Name and addresses must not be those of a drive before it.
    fn check_unlike(&self, earlier: &[WrittenDrive]) -> Result<(), Mistake> {
        check_name(&self.name)?;
        if earlier.iter().any(|other| other.name.get_ref() == self.name.get_ref()) {
            return Err((
                self.name.span(),
                format!("a drive named `{}` is there already", self.name.get_ref()),
            ));
        }
        let fixed = self.addresses().filter(|address| address.get_ref().port() != 0);
        for (number, address) in fixed.clone().enumerate() {
            if fixed.clone().take(number).any(|other| other.get_ref() == address.get_ref()) {
                let message = format!("{} is taken by another key of the same drive", address.get_ref());
                return Err((address.span(), message));
            }
            let taken =
                |other: &&WrittenDrive| other.addresses().any(|other| other.get_ref() == address.get_ref());
            if let Some(other) = earlier.iter().find(taken) {
                let message =
                    format!("{} is taken by the drive `{}`", address.get_ref(), other.name.get_ref());
                return Err((address.span(), message));
            }
        }
        self.check_serial_unlike(earlier)
    }

    /// Its virtual COM port must not have the name of another's.
    fn check_serial_unlike(&self, earlier: &[WrittenDrive]) -> Result<(), Mistake> {
        let Some((serial, path)) = self.serial_path() else { return Ok(()) };
        let taken = |other: &&WrittenDrive| other.serial_path().is_some_and(|(_, other)| other == path);
        earlier.iter().find(taken).map_or(Ok(()), |other| {
            Err((serial, format!("{path} is taken by the drive `{}`", other.name.get_ref())))
        })
    }

    /// The name that its virtual COM port is given, if it is.
    fn serial_path(&self) -> Option<(Range<usize>, &str)> {
        let port = self.serial.as_ref().or(self.usb.as_ref())?;
        let SerialPort::Pty(path) = port.get_ref();
        Some((port.span(), path.as_deref()?))
    }

    fn addresses(&self) -> impl Iterator<Item = &Spanned<SocketAddr>> + Clone {
        [&self.modbus_tcp, &self.usb_tcp, &self.standard_tcp, &self.serial_tcp].into_iter().flatten()
    }

    /// What the drive means.
    fn check(&self) -> Result<DriveSection, Mistake> {
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
        let controller = match self.model {
            AnyModel::Smsd(model) => ControllerSection::Smsd(self.check_smsd(model)?),
            AnyModel::Smd3 => ControllerSection::Smd3(self.check_smd3()?),
        };
        Ok(DriveSection {
            name: self.name.get_ref().clone(),
            steps_per_rev: *self.motor.steps_per_rev.get_ref(),
            travel: value(self.mechanics.travel.as_ref()),
            start: value(self.mechanics.start.as_ref()).unwrap_or(0.0),
            controller,
        })
    }

    fn check_smd3(&self) -> Result<Smd3Section, Mistake> {
        let foreign = [
            ("modbus_tcp", span(self.modbus_tcp.as_ref())),
            ("usb", span(self.usb.as_ref())),
            ("usb_tcp", span(self.usb_tcp.as_ref())),
            ("lan", span(self.lan.as_ref())),
            ("standard_tcp", span(self.standard_tcp.as_ref())),
            ("protocol_version", span(self.protocol_version.as_ref())),
            ("word_order", span(self.word_order.as_ref())),
            ("autonomous", span(self.autonomous.as_ref())),
            ("mode_n_programs", span(self.mode_n_programs.as_ref())),
        ];
        check_foreign(foreign, "an SMD3")?;
        if self.serial.is_none() && self.serial_tcp.is_none() {
            let message =
                "an SMD3 needs a port, as in serial = \"pty\" or serial_tcp = \"127.0.0.1:0\"".to_string();
            return Err((self.name.span(), message));
        }
        let (thermal, sensor) = match &self.winding {
            Some(winding) => (winding.get_ref().check()?, winding.get_ref().sensor),
            None => (Thermal::default(), Sensor::Connected),
        };
        Ok(Smd3Section {
            serial: self.serial.as_ref().map(|serial| serial.get_ref().clone()),
            serial_tcp: value(self.serial_tcp.as_ref()),
            thermal,
            sensor,
            switches: self.check_switches(Signal::from_name, &Signal::ALL.map(Signal::name))?,
        })
    }

    pub(super) fn check_switches<S: Copy>(
        &self,
        find: impl Fn(&str) -> Option<S>,
        names: &[&str],
    ) -> Result<Vec<SwitchSection<S>>, Mistake> {
        let check = |switch: &WrittenSwitch| {
            let name = switch.input.get_ref();
            let input = find(name).ok_or_else(|| (switch.input.span(), unknown("input", name, names)))?;
            check_interval(&switch.closed, "closed")?;
            let closed = *switch.closed.get_ref();
            if Switch::new(input, closed).is_none() {
                let message =
                    "closed is narrower than 1/256 of a full step; no microstep would meet it".to_string();
                return Err((switch.closed.span(), message));
            }
            Ok(SwitchSection { input, closed })
        };
        self.switches.iter().map(check).collect()
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

impl WrittenWinding {
    fn check(&self) -> Result<Thermal, Mistake> {
        let usual = Thermal::default();
        let ambient_c = check_number(self.ambient.as_ref(), "ambient", -273.0..=1000.0, usual.ambient_c)?;
        let usual_seconds = usual.time_constant.as_secs_f64();
        let seconds = check_number(self.time_constant.as_ref(), "time_constant", 0.001..=1e9, usual_seconds)?;
        let rise_k = check_number(self.rise.as_ref(), "rise", 0.001..=10_000.0, usual.rise_k)?;
        Ok(Thermal { ambient_c, time_constant: Duration::from_secs_f64(seconds), rise_k, ..usual })
    }
}

pub(super) fn value<T: Copy>(written: Option<&Spanned<T>>) -> Option<T> {
    written.map(|written| *written.get_ref())
}

pub(super) fn span<T>(written: Option<&Spanned<T>>) -> Option<Range<usize>> {
    written.map(Spanned::span)
}

/// Keys that belong to the other family.
pub(super) fn check_foreign<const N: usize>(
    keys: [(&str, Option<Range<usize>>); N],
    model: &str,
) -> Result<(), Mistake> {
    let found = keys.into_iter().find_map(|(key, span)| Some((key, span?)));
    found.map_or(Ok(()), |(key, span)| {
        Err((span, format!("{key} is not for {model}; see `stepdrive example-rig`")))
    })
}

fn check_number(
    written: Option<&Spanned<f64>>,
    key: &str,
    range: RangeInclusive<f64>,
    usual: f64,
) -> Result<f64, Mistake> {
    let Some(written) = written else { return Ok(usual) };
    let number = *written.get_ref();
    if range.contains(&number) {
        return Ok(number);
    }
    Err((written.span(), format!("{key} is {number:?}; it is {:?} to {:?}", range.start(), range.end())))
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
