//! The settings of both families, from the tables of their registers and commands.

use super::words::{self, unit};
use stepdrive_spec::smd3::commands::{Access, COMMANDS, Command, Kind, Value};
use stepdrive_spec::smd3::units::{self, Grid};
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::{self, Reg};

/// A family of controllers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// SMSD-4.2LAN and SMSD-8.0LAN.
    Smsd,
    /// SMD3.
    Smd3,
}

/// A setting.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Key {
    /// A register of an SMSD.
    Smsd(Reg),
    /// A command of an SMD3.
    Smd3(Command),
}

/// The settings of an SMSD: what shapes motion, what the motor is, which inputs are heeded. The LAN parameters are a matter
/// of their own.
const SMSD: [Reg; 11] = [
    Reg::MinSpeed,
    Reg::MaxSpeed,
    Reg::Acc,
    Reg::Dec,
    Reg::FsSpeed,
    Reg::CurrentOrVoltage,
    Reg::MotorType,
    Reg::Microstepping,
    Reg::WorkCurrent,
    Reg::StopCurrent,
    Reg::Mask,
];

/// What belongs together in an SMSD: a name, and the first setting of it.
const SMSD_GROUPS: [(&str, Reg); 3] =
    [("Motion", Reg::MinSpeed), ("Motor", Reg::CurrentOrVoltage), ("Inputs", Reg::Mask)];

/// Those of an SMD3 that a new resolution rounds anew.
const SHAPED_BY_RES: [Command; 5] =
    [Command::Amax, Command::Dmax, Command::Vstart, Command::Vstop, Command::Vmax];

/// More values than this are not offered to be chosen from.
const MOST_CHOICES: f64 = 64.0;

/// So much may a value differ from what is printed of it: the drive prints six digits.
const PRINTED: f64 = 1e-5;

impl Key {
    /// All settings of a family, in the order of its table.
    pub fn all(family: Family) -> Vec<Key> {
        let smd3 = COMMANDS.iter().filter(|row| row.stored && row.access == Access::ReadWrite);
        match family {
            Family::Smsd => SMSD.map(Key::Smsd).to_vec(),
            Family::Smd3 => smd3.map(|row| Key::Smd3(row.command)).collect(),
        }
    }

    /// The maker's name.
    pub fn name(self) -> &'static str {
        match self {
            Key::Smsd(reg) => reg.info().name,
            Key::Smd3(command) => command.info().mnemonic,
        }
    }

    /// The unit of its value; empty for a plain number.
    pub fn unit(self) -> &'static str {
        match self {
            Key::Smsd(reg) => reg.info().unit,
            Key::Smd3(command) => command.info().unit,
        }
    }

    /// What it is, in a sentence.
    pub fn about(self) -> &'static str {
        match self {
            Key::Smsd(reg) => reg.info().about,
            Key::Smd3(command) => command.info().about,
        }
    }

    /// What it belongs to, as in `Motor`.
    pub fn group(self) -> &'static str {
        match self {
            Key::Smsd(reg) => {
                SMSD_GROUPS.iter().rfind(|(_, first)| reg >= *first).map_or("", |(name, _)| *name)
            }
            Key::Smd3(command) => command.section(),
        }
    }

    /// Where the maker tells of it.
    pub fn source(self) -> &'static str {
        match self {
            Key::Smsd(reg) => reg.info().source,
            Key::Smd3(_) => "manual, Command reference",
        }
    }

    /// Its value as it leaves the factory.
    pub fn default(self) -> f64 {
        match self {
            Key::Smsd(reg) => reg.info().default as f64,
            Key::Smd3(command) => command.info().default,
        }
    }

    /// Whether it is lost at power-off whatever is done.
    pub fn is_volatile(self) -> bool {
        matches!(self, Key::Smsd(reg) if !reg.info().stored)
    }

    /// Whether its values are whole numbers.
    pub fn is_whole(self) -> bool {
        !matches!(self, Key::Smd3(command) if command.info().kind == Kind::Float)
    }

    /// Whether a new `RES` may change it.
    pub fn is_shaped_by_res(self) -> bool {
        matches!(self, Key::Smd3(command) if SHAPED_BY_RES.contains(&command))
    }

    /// What a value means; empty where it is nothing but a number.
    pub fn meaning(self, value: f64) -> String {
        // Settings that have a meaning are whole, and small.
        #[allow(clippy::cast_possible_truncation, reason = "`as` saturates")]
        let whole = value as i64;
        match self {
            Key::Smsd(reg) => words::of_register(reg, whole),
            Key::Smd3(Command::Mode) => words::mode(whole),
            Key::Smd3(command) => match command.info().kind {
                Kind::Bool => words::of_value(command, Value::Bool(whole != 0)),
                Kind::Uint => words::of_value(command, Value::Uint(whole.unsigned_abs())),
                Kind::None | Kind::Int | Kind::Float | Kind::Sign | Kind::Text => String::new(),
            },
        }
    }

    /// Whether it is on or off.
    pub fn is_switch(self) -> bool {
        match self {
            Key::Smsd(reg) => reg.info().kind == registers::Kind::Bit,
            Key::Smd3(command) => command.info().kind == Kind::Bool,
        }
    }

    /// Its values with what each means, where each means something and there are no more than a person can choose from.
    pub fn choices(self, model: Option<Model>) -> Vec<(f64, String)> {
        let (min, max) = self.range(model);
        if !self.is_whole() || max - min > MOST_CHOICES || self.is_amount() {
            return Vec::new();
        }
        let values = std::iter::successors(Some(min), |value| (*value < max).then_some(value + 1.0));
        let choices: Vec<(f64, String)> = values.map(|value| (value, self.meaning(value))).collect();
        if choices.iter().all(|(_, name)| !name.is_empty()) { choices } else { Vec::new() }
    }

    /// Whether its number is one of its unit: then there is nothing to choose.
    fn is_amount(self) -> bool {
        !self.unit().is_empty()
    }

    /// Why it cannot have a value, on a model where that matters, at a resolution where that matters.
    pub fn refuses(self, value: f64, model: Option<Model>, resolution: u16) -> Option<String> {
        if self.is_whole() && value.fract() != 0.0 {
            return Some("is a whole number".to_owned());
        }
        let (min, max) = self.range(model);
        if !(min..=max).contains(&value) {
            let unit = unit(self.unit());
            return Some(format!("takes {min} to {max}{unit}"));
        }
        let Key::Smd3(command) = self else { return None };
        if value <= 0.0
            && matches!(command, Command::Vstart | Command::Vstop | Command::Vmax | Command::Thigh)
        {
            return Some("is above 0".to_owned());
        }
        let greatest = profile_grid(command, resolution).map(Grid::greatest);
        let beyond = greatest.filter(|greatest| value > *greatest && !same(value, *greatest));
        beyond.map(|greatest| {
            let unit = unit(self.unit());
            format!("goes up to {greatest:.1}{unit} when RES is {resolution}")
        })
    }

    /// The lowest and the highest value that it can have: on a model, or on any where that is not known. At a resolution of an
    /// SMD3 what shapes its motion may have closer limits; see [`Key::refuses`].
    pub fn range(self, model: Option<Model>) -> (f64, f64) {
        match self {
            Key::Smsd(reg) => {
                let models = Model::ALL.into_iter().filter(|one| model.is_none_or(|model| model == *one));
                let ranges = models.map(|model| reg.info().range(model));
                let widest = ranges.reduce(|one, other| (one.0.min(other.0), one.1.max(other.1)));
                widest.map_or((0.0, 0.0), |(min, max)| (min as f64, max as f64))
            }
            Key::Smd3(command) => (command.info().min, command.info().max),
        }
    }

    /// What the controller makes of a value: the nearest that it can.
    pub fn made(self, value: f64, resolution: u16) -> f64 {
        let Key::Smd3(command) = self else { return value };
        match grid(command, resolution) {
            Some(grid) => grid.round(value),
            None if command == Command::Thigh => units::round_thigh(value),
            None if command == Command::Res => resolution_of(value).into(),
            None => value,
        }
    }

    /// Whether a controller that has a value is as it is wanted. It may round otherwise than is known here, or not at all.
    pub fn is_as_wanted(self, wanted: f64, found: f64, resolution: u16) -> bool {
        same(wanted, found) || same(self.made(wanted, resolution), found)
    }

    /// A value as it is sent: as it is, unless it is a greatest value that was rounded up when it was printed.
    pub fn sendable(self, value: f64, resolution: u16) -> f64 {
        let Key::Smd3(command) = self else { return value };
        profile_grid(command, resolution).map_or(value, |grid| value.min(grid.greatest()))
    }
}

/// A value as the drive prints it: six digits.
pub fn printed(value: f64) -> f64 {
    format!("{value:.5e}").parse().unwrap_or(value)
}

/// Whether two values are the same but for how they are printed.
pub fn same(one: f64, other: f64) -> bool {
    (one - other).abs() <= PRINTED * one.abs().max(other.abs())
}

/// The resolution that `RES` becomes.
pub fn resolution_of(value: f64) -> u16 {
    // `as` saturates: what is not a number or negative becomes 0.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "`as` saturates")]
    let whole = value as u32;
    units::nearest_resolution(whole)
}

fn grid(command: Command, resolution: u16) -> Option<Grid> {
    let fixed = [
        (Command::Ir, units::CURRENT),
        (Command::Ia, units::CURRENT),
        (Command::Ih, units::CURRENT),
        (Command::Pddel, units::POWER_DOWN_DELAY),
        (Command::Ihd, units::HOLD_DELAY),
        (Command::Tzw, units::ZERO_WAIT),
    ];
    let fixed = fixed.into_iter().find(|(known, _)| *known == command).map(|(_, grid)| grid);
    fixed.or_else(|| profile_grid(command, resolution))
}

fn profile_grid(command: Command, resolution: u16) -> Option<Grid> {
    if matches!(command, Command::Amax | Command::Dmax) {
        return Some(units::acceleration(resolution));
    } else if matches!(command, Command::Vstart | Command::Vstop) {
        return Some(units::vstart(resolution));
    }
    (command == Command::Vmax).then(|| units::vmax(resolution))
}

#[cfg(test)]
mod tests {
    use super::*;
    use stepdrive_spec::smsd::registers::{Access as Rights, REGISTERS};

    #[test]
    fn every_setting_that_survives_power_off_is_one() {
        let lan = Reg::LanId..=Reg::LanDhcp;
        for row in REGISTERS.iter().filter(|row| row.stored && row.access == Rights::ReadWrite) {
            let known = Key::all(Family::Smsd).contains(&Key::Smsd(row.id)) || lan.contains(&row.id);
            assert!(known, "{}", row.name);
        }
        for row in COMMANDS.iter().filter(|row| row.stored) {
            assert!(Key::all(Family::Smd3).contains(&Key::Smd3(row.command)), "{}", row.mnemonic);
        }
    }

    #[test]
    fn every_setting_takes_its_default() {
        for family in [Family::Smsd, Family::Smd3] {
            for key in Key::all(family) {
                assert_eq!(key.refuses(key.default(), Some(Model::Smsd42), 256), None, "{}", key.name());
            }
        }
    }

    #[test]
    fn every_setting_belongs_to_something() {
        let group = |key: Key| key.group();
        assert_eq!([Reg::Acc, Reg::FsSpeed].map(|reg| group(Key::Smsd(reg))), ["Motion"; 2]);
        assert_eq!([Reg::CurrentOrVoltage, Reg::StopCurrent].map(|reg| group(Key::Smsd(reg))), ["Motor"; 2]);
        assert_eq!(group(Key::Smsd(Reg::Mask)), "Inputs");
        assert_eq!([Command::Mode, Command::Exten].map(|command| group(Key::Smd3(command))), ["General"; 2]);
        assert_eq!(
            [Command::Ir, Command::Vmax].map(|command| group(Key::Smd3(command))),
            ["Motor", "Profile"]
        );
        for key in [Family::Smsd, Family::Smd3].into_iter().flat_map(Key::all) {
            assert!(!group(key).is_empty() && !key.source().is_empty(), "{}", key.name());
        }
    }

    #[test]
    fn what_has_names_can_be_chosen_from() {
        let names =
            |key: Key| key.choices(Some(Model::Smsd80)).into_iter().map(|(_, name)| name).collect::<Vec<_>>();
        assert_eq!(names(Key::Smsd(Reg::CurrentOrVoltage)), ["voltage", "current"]);
        assert_eq!(names(Key::Smsd(Reg::Microstepping)).first().map(String::as_str), Some("1/1"));
        assert_eq!(names(Key::Smsd(Reg::StopCurrent)).len(), 4);
        assert_eq!(names(Key::Smd3(Command::Mode)).len(), 6);
        assert_eq!(names(Key::Smd3(Command::Tsel)), ["thermocouple", "RTD"]);
        for key in [
            Key::Smsd(Reg::MaxSpeed),
            Key::Smsd(Reg::WorkCurrent),
            Key::Smd3(Command::Res),
            Key::Smd3(Command::Ir),
        ] {
            assert_eq!(names(key), Vec::<String>::new(), "{}", key.name());
        }
    }

    #[test]
    fn a_value_that_it_cannot_have_is_refused() {
        let smsd = |reg, value| Key::Smsd(reg).refuses(value, Some(Model::Smsd42), 256).expect("refused");
        assert_eq!(smsd(Reg::MaxSpeed, 5.0), "takes 16 to 15600 full steps/s");
        assert_eq!(smsd(Reg::WorkCurrent, 43.0), "takes 1 to 42 × 0.1 A");
        assert_eq!(smsd(Reg::Acc, 100.5), "is a whole number");
        assert_eq!(Key::Smsd(Reg::WorkCurrent).refuses(43.0, None, 256), None);
        let smd3 = |command, value| Key::Smd3(command).refuses(value, None, 256).expect("refused");
        assert_eq!(smd3(Command::Vmax, 0.0), "is above 0");
        assert_eq!(smd3(Command::Vstart, 800.0), "goes up to 732.4 Hz when RES is 256");
        assert_eq!(smd3(Command::Res, 4.0), "takes 8 to 256");
        assert!(Key::Smd3(Command::Ir).refuses(f64::NAN, None, 256).is_some());
    }

    #[test]
    fn what_the_drive_prints_of_a_greatest_value_can_be_set_again() {
        let amax = Key::Smd3(Command::Amax);
        let printed = printed(units::acceleration(8).greatest());
        assert_eq!(amax.refuses(printed, None, 8), None);
        assert!(amax.sendable(printed, 8) <= units::acceleration(8).greatest());
        assert!(amax.refuses(printed * 1.001, None, 8).is_some());
    }

    #[test]
    fn a_value_is_rounded_as_the_drive_does_it() {
        let made = |command, value| Key::Smd3(command).made(value, 256);
        assert!(same(made(Command::Pddel, 100.0), 109.227));
        assert!(same(made(Command::Res, 100.0), 128.0));
        assert!(same(made(Command::Thigh, 200.0), 200.321));
        assert!(same(Key::Smsd(Reg::MaxSpeed).made(777.0, 256), 777.0));
        assert!(!same(109.227, 109.3));
    }
}
