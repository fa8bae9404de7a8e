//! The commands by name, and what belongs together: homing, bake.

use super::{Smd3Client, number};
use crate::direction::Direction;
use crate::error::Error;
use stepdrive_spec::smd3::commands::{Command, Mode, Request, Value};
use stepdrive_spec::smd3::flags::{Flags, StatusFlag};
use stepdrive_spec::smd3::text::Text;

/// What there is to see at a glance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Smd3Status {
    /// The flags.
    pub flags: Flags,
    /// `PACT`, full steps. The drive prints 6 digits of it.
    pub position: f64,
    /// `VACT`, Hz, negative in the negative direction.
    pub velocity: f64,
}

impl Smd3Status {
    /// Whether the motor stands and has rested.
    pub fn standby(&self) -> bool {
        StatusFlag::Standby.is_in(self.flags.status)
    }
}

impl Smd3Client {
    /// Flags, speed and position, in two requests. The flags and the speed are of one moment, the position of just after: so
    /// in standby it is where the motor stands.
    ///
    /// # Errors
    /// See [`Smd3Client`].
    pub async fn status(&self) -> Result<Smd3Status, Error> {
        let (velocity, flags) = self.ask(Request { command: Command::Vact, argument: None }).await?;
        let velocity = velocity.and_then(number).ok_or_else(|| self.lacks_value(Command::Vact))?;
        let position = self.get_number(Command::Pact).await?;
        Ok(Smd3Status { flags, position, velocity })
    }

    /// The flags as they are now.
    ///
    /// # Errors
    /// See [`Smd3Client`].
    pub async fn flags(&self) -> Result<Flags, Error> {
        self.ask(Request { command: Command::Vact, argument: None }).await.map(|(_, flags)| flags)
    }

    /// `SER`: the serial number.
    ///
    /// # Errors
    /// See [`Smd3Client`].
    pub async fn serial_number(&self) -> Result<Text, Error> {
        self.get_text(Command::Ser).await
    }

    /// `FW`: the firmware version.
    ///
    /// # Errors
    /// See [`Smd3Client`].
    pub async fn firmware(&self) -> Result<Text, Error> {
        self.get_text(Command::Fw).await
    }

    /// `MODE`: the mode of operation.
    ///
    /// # Errors
    /// See [`Smd3Client`].
    pub async fn mode(&self) -> Result<Mode, Error> {
        if let Value::Mode(mode) = self.get(Command::Mode).await? {
            return Ok(mode);
        }
        Err(self.lacks_value(Command::Mode))
    }

    /// `MODE`: chooses the mode of operation. The motor must be in standby.
    ///
    /// # Errors
    /// See [`Smd3Client`].
    pub async fn set_mode(&self, mode: Mode) -> Result<(), Error> {
        self.set(Command::Mode, Value::Uint(mode.number().into())).await.map(|_| ())
    }

    /// `RUNV`: turns at `VMAX` in a direction until it is stopped.
    ///
    /// # Errors
    /// See [`Smd3Client`].
    pub async fn runv(&self, direction: Direction) -> Result<(), Error> {
        self.start(Command::Runv, Value::Sign(direction == Direction::Positive)).await
    }

    /// `RUNA`: goes to a position in full steps, the shorter way where the counter turns over. It may turn already.
    ///
    /// # Errors
    /// See [`Smd3Client`].
    pub async fn runa(&self, position: i64) -> Result<(), Error> {
        self.start(Command::Runa, Value::Int(position)).await
    }

    /// `RUNR`: goes so many full steps from where it is. The motor must be in standby.
    ///
    /// # Errors
    /// See [`Smd3Client`].
    pub async fn runr(&self, steps: i64) -> Result<(), Error> {
        self.start(Command::Runr, Value::Int(steps)).await
    }

    /// `RUNH`: looks for the limit switch of a direction and takes it as zero. The mode must be Home.
    ///
    /// # Errors
    /// See [`Smd3Client`].
    pub async fn runh(&self, direction: Direction) -> Result<(), Error> {
        self.start(Command::Runh, Value::Sign(direction == Direction::Positive)).await
    }

    /// `STOP`: stops with `DMAX`; ends bake.
    ///
    /// # Errors
    /// See [`Smd3Client`].
    pub async fn stop(&self) -> Result<(), Error> {
        self.act(Command::Stop).await
    }

    /// `SSTOP`: stops within a second on a full step, whatever the profile.
    ///
    /// # Errors
    /// See [`Smd3Client`].
    pub async fn sstop(&self) -> Result<(), Error> {
        self.act(Command::Sstop).await
    }

    /// `ESTOP`: stops at once and disables the motor, until `CLR`.
    ///
    /// # Errors
    /// See [`Smd3Client`].
    pub async fn estop(&self) -> Result<(), Error> {
        self.act(Command::Estop).await
    }

    /// `CLR`: clears the error flags whose cause is gone. Answers the flags afterwards.
    ///
    /// # Errors
    /// See [`Smd3Client`].
    pub async fn clr(&self) -> Result<Flags, Error> {
        self.ask(Request { command: Command::Clr, argument: None }).await.map(|(_, flags)| flags)
    }

    /// `STORE`: stores the settings, so that they survive power-off.
    ///
    /// # Errors
    /// See [`Smd3Client`].
    pub async fn store(&self) -> Result<(), Error> {
        self.act(Command::Store).await
    }

    /// `LOAD`: loads the stored settings. The motor must be in standby.
    ///
    /// # Errors
    /// See [`Smd3Client`].
    pub async fn load(&self) -> Result<(), Error> {
        self.act(Command::Load).await
    }

    /// `LOADFD`: loads the factory's settings, unstored. The motor must be in standby.
    ///
    /// # Errors
    /// See [`Smd3Client`].
    pub async fn load_factory_defaults(&self) -> Result<(), Error> {
        self.act(Command::Loadfd).await
    }

    /// Bakes: mode Bake, the temperature in °C to be kept, `RUNB`. The motor must be in standby.
    ///
    /// # Errors
    /// See [`Smd3Client`]. Where something is refused after mode Bake was set, the drive is set back to mode Remote.
    pub async fn start_bake(&self, celsius: u16) -> Result<(), Error> {
        let setpoint = Value::Uint(celsius.into());
        super::words::check(&Request { command: Command::Baket, argument: Some(setpoint) })?;
        let begun = self.enter_bake(setpoint).await;
        if begun.is_err() && matches!(self.mode().await, Ok(Mode::Bake)) {
            // Why it did not begin counts more than whether this succeeds.
            let _ = self.set_mode(Mode::Remote).await;
        }
        begun
    }

    async fn enter_bake(&self, setpoint: Value) -> Result<(), Error> {
        self.set_mode(Mode::Bake).await?;
        self.set(Command::Baket, setpoint).await?;
        self.act(Command::Runb).await
    }

    /// Ends bake, and goes back to mode Remote.
    ///
    /// # Errors
    /// See [`Smd3Client`].
    pub async fn end_bake(&self) -> Result<(), Error> {
        self.stop().await?;
        self.set_mode(Mode::Remote).await
    }

    async fn start(&self, command: Command, argument: Value) -> Result<(), Error> {
        self.request(Request { command, argument: Some(argument) }).await.map(|_| ())
    }

    async fn get_text(&self, command: Command) -> Result<Text, Error> {
        if let Value::Text(text) = self.get(command).await? {
            return Ok(text);
        }
        Err(self.lacks_value(command))
    }
}
