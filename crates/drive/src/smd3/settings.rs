//! The settings: what each is, what is taken, how it is rounded, and how the stored ones are written down.

use super::profile::Profile;
use arrayvec::ArrayVec;
use core::fmt;
use core::time::Duration;
use stepdrive_spec::smd3::commands::{Access, COMMANDS, Command, CommandInfo, Kind, Mode};
use stepdrive_spec::smd3::units::{self, Grid};

/// How many commands there are: a value is kept for each, although some have none.
const ROWS: usize = COMMANDS.len();

/// The version of the layout of [`Settings::encode`].
const VERSION: u8 = 1;

/// Room for a version, a count, a number for each setting, and a checksum.
const MAX_BYTES: usize = 2 + 8 * ROWS + 4;

/// Settings that the resolution sets the grain of.
const PROFILE: [Command; 5] = [Command::Amax, Command::Dmax, Command::Vstart, Command::Vstop, Command::Vmax];

/// The settings of a drive. Each is a number of the grid that the drive can make.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    values: [f64; ROWS],
}

/// The settings as bytes.
pub type SettingsBytes = ArrayVec<u8, MAX_BYTES>;

/// Bytes that are no settings, or not any more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DamagedSettings;

impl fmt::Display for DamagedSettings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the stored configuration is damaged")
    }
}

impl core::error::Error for DamagedSettings {}

/// What the flash holds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[allow(clippy::large_enum_variant, reason = "a drive has one, and there is no heap")]
pub enum Stored {
    /// Nothing: nobody has sent `STORE` yet.
    #[default]
    Nothing,
    /// A configuration.
    Intact(Settings),
    /// Something that fails its check.
    Damaged,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings::factory()
    }
}

impl Settings {
    /// As they leave the factory.
    pub fn factory() -> Settings {
        let mut settings = Settings { values: [0.0; ROWS] };
        // The resolution first: the others are rounded to its grain.
        settings.put(Command::Res, Command::Res.info().default);
        for row in &COMMANDS {
            settings.put(row.command, settings.rounded(row.command, row.default));
        }
        settings
    }

    /// The value of a setting; BOOL as 0 and 1. 0 for a command that is not a setting.
    pub fn get(&self, setting: Command) -> f64 {
        self.values.get(usize::from(setting as u8)).copied().unwrap_or(0.0)
    }

    /// Whether a BOOL is 1.
    pub fn is_on(&self, setting: Command) -> bool {
        self.get(setting) > 0.5
    }

    /// The mode chosen with `MODE`.
    pub fn mode(&self) -> Mode {
        let number = self.get(Command::Mode);
        Mode::ALL.into_iter().find(|mode| number < f64::from(mode.number()) + 0.5).unwrap_or(Mode::Remote)
    }

    /// Microsteps to the full step.
    pub fn resolution(&self) -> u16 {
        nearest_resolution(self.get(Command::Res))
    }

    /// Whether a value may be set: within the range of its row and of the resolution, and `VSTART` at most `VSTOP`.
    pub(super) fn takes(&self, setting: Command, value: f64) -> bool {
        let row = setting.info();
        let in_row = (row.min..=row.max).contains(&value);
        let above_zero = !is_above_zero(setting) || value > 0.0;
        let in_grid = self.profile_grid(setting).is_none_or(|grid| value <= grid.greatest());
        in_row && above_zero && in_grid && self.keeps_order(setting, self.rounded(setting, value))
    }

    /// Sets a value that may be set, rounded to the nearest that the drive can make. A new resolution rounds the
    /// profile anew.
    pub(super) fn set(&mut self, setting: Command, value: f64) {
        self.put(setting, self.rounded(setting, value));
        if setting == Command::Res {
            for setting in PROFILE {
                self.put(setting, self.rounded(setting, self.get(setting)));
            }
        }
    }

    /// Takes over what `STORE` keeps.
    pub(super) fn load(&mut self, other: &Settings) {
        for row in stored_rows() {
            self.put(row.command, other.get(row.command));
        }
    }

    /// What shapes motion.
    pub(super) fn profile(&self) -> Profile {
        Profile {
            amax: self.get(Command::Amax),
            dmax: self.get(Command::Dmax),
            vstart: self.get(Command::Vstart),
            vstop: self.get(Command::Vstop),
            vmax: self.get(Command::Vmax),
            tzw: self.time(Command::Tzw, 1.0),
        }
    }

    /// A setting that is a time, in its unit of so many seconds.
    pub(super) fn time(&self, setting: Command, unit_seconds: f64) -> Duration {
        Duration::try_from_secs_f64(self.get(setting) * unit_seconds).unwrap_or(Duration::ZERO)
    }

    fn put(&mut self, setting: Command, value: f64) {
        if let Some(slot) = self.values.get_mut(usize::from(setting as u8)) {
            *slot = value;
        }
    }

    /// The nearest value that the drive can make.
    fn rounded(&self, setting: Command, value: f64) -> f64 {
        if let Some(grid) = self.grid(setting) {
            grid.round(value)
        } else if setting == Command::Thigh {
            units::round_thigh(value)
        } else if setting == Command::Res {
            f64::from(nearest_resolution(value))
        } else {
            // The others are whole numbers and come as such.
            value
        }
    }

    /// The grid of a setting that has one.
    fn grid(&self, setting: Command) -> Option<Grid> {
        self.profile_grid(setting).or_else(|| fixed_grid(setting))
    }

    /// The grid of a setting whose grain the resolution sets.
    fn profile_grid(&self, setting: Command) -> Option<Grid> {
        let grid = if matches!(setting, Command::Amax | Command::Dmax) {
            units::acceleration
        } else if matches!(setting, Command::Vstart | Command::Vstop) {
            units::vstart
        } else if setting == Command::Vmax {
            units::vmax
        } else {
            return None;
        };
        Some(grid(self.resolution()))
    }

    fn keeps_order(&self, setting: Command, value: f64) -> bool {
        (setting != Command::Vstart || value <= self.get(Command::Vstop))
            && (setting != Command::Vstop || value >= self.get(Command::Vstart))
    }

    // ---- as bytes

    /// The stored settings as bytes: a version, how many there are, each as an `f64` in the order of the table, and a
    /// CRC-32 over all of it; little-endian.
    pub fn encode(&self) -> SettingsBytes {
        let mut bytes = SettingsBytes::new();
        let count = u8::try_from(stored_rows().count()).unwrap_or(u8::MAX);
        bytes.extend([VERSION, count]);
        for row in stored_rows() {
            bytes.extend(self.get(row.command).to_le_bytes());
        }
        let check = crc32(&bytes);
        bytes.extend(check.to_le_bytes());
        bytes
    }

    /// The settings from bytes; what is not stored is as it leaves the factory.
    ///
    /// # Errors
    /// When the bytes are not what [`Settings::encode`] makes, or hold a value that the drive would not have taken.
    pub fn decode(bytes: &[u8]) -> Result<Settings, DamagedSettings> {
        read(bytes).ok_or(DamagedSettings)
    }

    /// Whether every stored value is one that the drive can have.
    fn is_sound(&self) -> bool {
        stored_rows().all(|row| {
            let value = self.get(row.command);
            // The greatest value of a grid may lie a rounding step above the range of its row.
            let slack = self.grid(row.command).map_or(0.0, |grid| grid.part);
            let whole = !is_whole(row) || libm::floor(value).to_bits() == value.to_bits();
            let in_row = (row.min..=row.max + slack).contains(&value) && value.is_sign_positive();
            let in_grid = self.rounded(row.command, value).to_bits() == value.to_bits();
            whole && in_row && in_grid && self.keeps_order(row.command, value)
        })
    }
}

fn read(bytes: &[u8]) -> Option<Settings> {
    let (content, check) = bytes.split_last_chunk()?;
    if crc32(content) != u32::from_le_bytes(*check) {
        return None;
    }
    let ([version, count], mut rest) = content.split_first_chunk()?;
    if *version != VERSION || usize::from(*count) != stored_rows().count() {
        return None;
    }
    let mut settings = Settings::factory();
    for row in stored_rows() {
        let (value, behind) = rest.split_first_chunk()?;
        settings.put(row.command, f64::from_le_bytes(*value));
        rest = behind;
    }
    (rest.is_empty() && settings.is_sound()).then_some(settings)
}

fn stored_rows() -> impl Iterator<Item = &'static CommandInfo> {
    COMMANDS.iter().filter(|row| row.stored)
}

/// Speeds of which 0 is not one.
fn is_above_zero(setting: Command) -> bool {
    matches!(setting, Command::Vstart | Command::Vstop | Command::Vmax | Command::Thigh)
}

fn is_whole(row: &CommandInfo) -> bool {
    row.access == Access::ReadWrite && matches!(row.kind, Kind::Bool | Kind::Uint)
}

/// The grid of a setting that always has the same.
fn fixed_grid(setting: Command) -> Option<Grid> {
    let grids = [
        (Command::Ir, units::CURRENT),
        (Command::Ia, units::CURRENT),
        (Command::Ih, units::CURRENT),
        (Command::Pddel, units::POWER_DOWN_DELAY),
        (Command::Ihd, units::HOLD_DELAY),
        (Command::Tzw, units::ZERO_WAIT),
    ];
    grids.into_iter().find(|(command, _)| *command == setting).map(|(_, grid)| grid)
}

fn nearest_resolution(value: f64) -> u16 {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "`as` saturates")]
    let number = value as u32;
    units::nearest_resolution(number)
}

/// CRC-32 as in Ethernet frames.
fn crc32(bytes: &[u8]) -> u32 {
    let reversed_polynomial = 0xEDB8_8320;
    let mut crc = u32::MAX;
    for byte in bytes {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 { crc >> 1 ^ reversed_polynomial } else { crc >> 1 };
        }
    }
    !crc
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_is_the_usual_one() {
        assert_eq!(crc32(b"123456789"), 0xCBF4_3926);
    }

    #[test]
    fn factory_settings_are_sound() {
        assert!(Settings::factory().is_sound());
    }
}
