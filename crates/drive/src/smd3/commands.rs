//! What a command does: its checks, what it answers, what it sets, what it starts.

use super::Smd3;
use super::profile::UNITS;
use super::ramp::Course;
use super::settings::{Settings, Stored};
use stepdrive_motion::Direction;
use stepdrive_spec::smd3::commands::{Access, Command, CommandInfo, Kind, Request, Value};
use stepdrive_spec::smd3::errors::Error;
use stepdrive_spec::smd3::flags::ErrorFlag;
use stepdrive_spec::time::Instant;

impl Smd3 {
    /// Carries out a command, or reads what it names.
    pub(super) fn carry_out(&mut self, now: Instant, request: Request) -> Result<Option<Value>, Error> {
        let Request { command, argument } = request;
        let row = command.info();
        match (row.access, argument) {
            (Access::Read | Access::ReadWrite, None) => Ok(Some(self.value(now, row))),
            (Access::ReadWrite | Access::Write, Some(argument)) => {
                let number = number(row.kind, argument).ok_or(Error::ArgumentType)?;
                self.perform(now, row, number)?;
                Ok(self.echo(now, row, number))
            }
            (Access::Action, None) => self.perform(now, row, 0.0).map(|()| None),
            (Access::Write, None) => Err(Error::UnableToGet),
            (Access::Read | Access::Action, Some(_)) => Err(Error::ArgumentCount),
        }
    }

    /// What a command reads as at `now`.
    #[allow(clippy::wildcard_enum_match_arm, reason = "all the others are settings, and read alike")]
    pub(super) fn value(&self, now: Instant, row: &CommandInfo) -> Value {
        match row.command {
            Command::Ser => Value::Text(self.config.serial),
            Command::Fw => Value::Text(self.config.firmware),
            Command::Flags => Value::FlagTable,
            Command::Mode => Value::Mode(self.mode()),
            Command::Tmot => Value::Float(self.shown_temperature(now)),
            Command::Vact => Value::Float(self.velocity(now)),
            Command::Pact => Value::Float(self.position(now)),
            Command::Prel => Value::Float(self.ramp.relative(now)),
            setting => in_kind(row.kind, self.settings.get(setting)),
        }
    }

    /// What the setting of a value is answered with; motion is answered with the flags alone.
    fn echo(&self, now: Instant, row: &CommandInfo, number: f64) -> Option<Value> {
        match row.access {
            Access::ReadWrite => Some(self.value(now, row)),
            Access::Write => (row.kind == Kind::Bool).then(|| in_kind(row.kind, number)),
            Access::Read | Access::Action => None,
        }
    }

    /// Does what a command says, if it may be done now, and settles what follows.
    fn perform(&mut self, now: Instant, row: &CommandInfo, number: f64) -> Result<(), Error> {
        self.check(row, number)?;
        self.act(now, row.command, number)?;
        self.update(now);
        Ok(())
    }

    /// The conditions of a row, in the order in which they are checked.
    fn check(&self, row: &CommandInfo, number: f64) -> Result<(), Error> {
        if !self.takes(row, number) {
            return Err(Error::ArgumentValidation);
        }
        if row.mode.is_some_and(|mode| mode != self.mode()) {
            return Err(Error::NotPossibleInMode);
        }
        if row.starts && self.errors != 0 {
            return Err(Error::NotPossibleWhenMotorDisabled);
        }
        if row.standby && !self.standby() {
            return Err(Error::StopMotorFirst);
        }
        Ok(())
    }

    /// Whether an argument is within its range.
    fn takes(&self, row: &CommandInfo, number: f64) -> bool {
        if row.access == Access::ReadWrite && !is_counter(row.command) {
            return self.settings.takes(row.command, number);
        }
        matches!(row.kind, Kind::Sign | Kind::None) || (row.min..=row.max).contains(&number)
    }

    #[allow(clippy::wildcard_enum_match_arm, reason = "all the others are settings, and set alike")]
    fn act(&mut self, now: Instant, command: Command, number: f64) -> Result<(), Error> {
        let direction = if number > 0.0 { Direction::Forward } else { Direction::Reverse };
        let profile = self.settings.profile();
        match command {
            Command::Clr => self.clear_errors(now),
            Command::Load => self.load()?,
            Command::Store => self.store()?,
            Command::Loadfd => self.put_in_force(&Settings::factory()),
            Command::Runv => self.ramp.follow(now, &profile, Course::Velocity(direction)),
            Command::Runa => self.ramp.move_to(now, &profile, whole(number)),
            Command::Runr => self.ramp.move_by(now, &profile, whole(number)),
            Command::Runb => self.bake = true,
            Command::Runh => self.start_homing(now, direction)?,
            Command::Stop => {
                // A search that was stopped is over; everything else a new AMAX or DMAX takes up again.
                let resumable = self.homing.is_none();
                self.give_up();
                self.ramp.stop(now, &profile, resumable);
            }
            Command::Sstop => {
                self.give_up();
                self.ramp.soft_stop(now, &profile);
            }
            Command::Estop => self.raise(now, ErrorFlag::EmergencyStop.mask()),
            Command::Pact => self.ramp.set_position(now, units(number)),
            Command::Prel => self.ramp.set_relative(now, units(number)),
            Command::Lp => {
                self.settings.set(Command::LpPlus, number);
                self.settings.set(Command::LpMinus, number);
            }
            Command::Mode => {
                self.settings.set(Command::Mode, number);
                self.joystick.yield_to_choice();
            }
            Command::Amax | Command::Dmax => {
                self.settings.set(command, number);
                self.ramp.resume();
            }
            setting => self.settings.set(setting, number),
        }
        Ok(())
    }

    /// Ends homing and bake; the motor goes on as it does.
    fn give_up(&mut self) {
        self.homing = None;
        self.bake = false;
    }

    /// `LOAD`. ASSUMED: with nothing stored yet the factory's configuration is loaded; a damaged one fails.
    fn load(&mut self) -> Result<(), Error> {
        match self.stored {
            _ if self.store_damaged => return Err(Error::ActionFailed),
            Stored::Nothing => self.put_in_force(&Settings::factory()),
            Stored::Intact(settings) => self.put_in_force(&settings),
            Stored::Damaged => return Err(Error::ActionFailed),
        }
        Ok(())
    }

    /// `STORE`. What it writes reads well, so it ends a damage.
    fn store(&mut self) -> Result<(), Error> {
        if self.flash_worn {
            return Err(Error::ActionFailed);
        }
        self.stored = Stored::Intact(self.settings);
        self.damage_mended = core::mem::take(&mut self.store_damaged);
        self.generation = self.generation.saturating_add(1);
        Ok(())
    }

    fn put_in_force(&mut self, settings: &Settings) {
        self.settings.load(settings);
        self.joystick.yield_to_choice();
    }
}

/// The two position counters, which are not settings.
fn is_counter(command: Command) -> bool {
    matches!(command, Command::Pact | Command::Prel)
}

/// An argument as a number, `+` and `-` as 1 and -1; `None` when it is not of this type.
fn number(kind: Kind, argument: Value) -> Option<f64> {
    match (kind, argument) {
        (Kind::Int, Value::Int(value)) => Some(value as f64),
        (Kind::Uint, Value::Uint(value)) => Some(value as f64),
        (Kind::Float, Value::Float(value)) => Some(value),
        (Kind::Bool, Value::Bool(value)) => Some(f64::from(u8::from(value))),
        (Kind::Sign, Value::Sign(positive)) => Some(if positive { 1.0 } else { -1.0 }),
        (Kind::None | Kind::Int | Kind::Uint | Kind::Float | Kind::Bool | Kind::Sign | Kind::Text, _) => None,
    }
}

/// A number as a value of a type.
fn in_kind(kind: Kind, number: f64) -> Value {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "`as` saturates")]
    match kind {
        Kind::Bool => Value::Bool(number > 0.5),
        Kind::Uint => Value::Uint(number as u64),
        Kind::Int => Value::Int(number as i64),
        Kind::Sign => Value::Sign(number > 0.0),
        Kind::None | Kind::Float | Kind::Text => Value::Float(number),
    }
}

/// A whole number of full steps.
fn whole(steps: f64) -> i64 {
    #[allow(clippy::cast_possible_truncation, reason = "a checked argument of type INT")]
    let steps = steps as i64;
    steps
}

/// Full steps as the nearest number of units.
fn units(steps: f64) -> i64 {
    whole(libm::round(steps * UNITS as f64))
}
