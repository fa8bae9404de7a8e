//! What a controller is, its motor configuration and its password.

use super::client::{Manner, SmsdClient};
use super::login::enter;
use super::session::{Lost, Trouble};
use super::snapshot::between;
use super::value::{Run, Slot};
use crate::Error;
use std::fmt;
use stepdrive_spec::modbus::Request;
use stepdrive_spec::smsd::mode::MotorConfiguration;
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::Reg;

/// Value of `Password_CMD`: change the password.
const CHANGE: u16 = 1;

/// What a controller says that it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Identity {
    /// The model; `None` for a `HW_MAJOR` that the maker does not list, and where that is not told.
    pub model: Option<Model>,
    /// `HW_MAJOR`, `HW_VER`; `None` where the controller does not tell.
    pub hardware: Option<(u16, u16)>,
    /// `FW_MAJOR`, `FW_MINOR`; `None` where the controller does not tell.
    pub firmware: Option<(u16, u16)>,
    /// `RM_MAJOR`, `RM_MINOR`; `None` where the line does not tell.
    pub register_map: Option<(u16, u16)>,
    /// Version of the standard protocol, 1 or 2; `None` where the line does not tell.
    pub protocol: Option<u8>,
}

impl fmt::Display for Identity {
    /// As in `SMSD-4.2LAN, hardware 1, firmware 1.3, register map 4.3`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.model, self.hardware) {
            (Some(model), _) => write!(f, "{model}")?,
            (None, Some((major, _))) => write!(f, "unknown model {major}")?,
            (None, None) => write!(f, "an SMSD that does not tell its model")?,
        }
        if let Some((_, version)) = self.hardware {
            write!(f, ", hardware {version}")?;
        }
        if let Some((major, minor)) = self.firmware {
            write!(f, ", firmware {major}.{minor}")?;
        }
        if let Some((major, minor)) = self.register_map {
            write!(f, ", register map {major}.{minor}")?;
        }
        self.protocol.map_or(Ok(()), |version| write!(f, ", protocol {version}"))
    }
}

impl SmsdClient {
    /// What the controller says that it is. It needs no password where the controller wants none for it.
    ///
    /// # Errors
    /// Those of [`SmsdClient::read_at`].
    pub async fn identity(&self) -> Result<Identity, Error> {
        let regs = [Reg::HwMajor, Reg::HwVer, Reg::FwMajor, Reg::FwMinor, Reg::RmMajor, Reg::RmMinor];
        let values = self.read_many(&regs).await?;
        let value =
            |place: usize| values.get(place).and_then(|value| u16::try_from(*value).ok()).unwrap_or(0);
        Ok(Identity {
            model: model_of(value(0)),
            hardware: Some((value(0), value(1))),
            firmware: Some((value(2), value(3))),
            register_map: Some((value(4), value(5))),
            protocol: None,
        })
    }

    /// The motor configuration.
    ///
    /// # Errors
    /// Those of [`SmsdClient::read_at`].
    pub async fn motor_configuration(&self) -> Result<MotorConfiguration, Error> {
        let values = self.read_run(Run { slots: &configuration() }).await?;
        let value =
            |place: usize| values.get(place).and_then(|value| u16::try_from(*value).ok()).unwrap_or(0);
        Ok(MotorConfiguration {
            current_or_voltage: value(0),
            motor_type: value(1),
            microstepping: value(2),
            work_current: value(3),
            stop_current: value(4),
        })
    }

    /// Sets the motor configuration, all of it in one request, and reads it back. The motor must be de-energised.
    ///
    /// # Errors
    /// Those of [`SmsdClient::write_at`]; [`Error::Differs`] when it does not read back as it was written.
    pub async fn set_motor_configuration(&self, motor: &MotorConfiguration) -> Result<(), Error> {
        let values = [
            motor.current_or_voltage,
            motor.motor_type,
            motor.microstepping,
            motor.work_current,
            motor.stop_current,
        ];
        self.write_slots(configuration().into_iter().zip(values.map(i64::from)).collect()).await?;
        let found = self.motor_configuration().await?;
        if found == *motor {
            return Ok(());
        }
        Err(Error::Differs(format!("the motor configuration was written as {motor:?} and reads {found:?}")))
    }

    /// Changes the password, of the controller and of this client. Connections that are logged in stay so.
    ///
    /// When the reply is lost the client logs in anew: the password that is accepted then says what has become of it. Where
    /// that leaves a doubt, the client knows both from then on, and tries the new one when the old one is refused.
    ///
    /// # Errors
    /// Those of [`SmsdClient::write_at`].
    pub async fn change_password(&self, password: u64) -> Result<(), Error> {
        let _turn = self.memory.lock().await;
        let order = self.word_order().await?;
        let mut tries = self.options.tries;
        loop {
            tries = tries.saturating_sub(1);
            match self.enter_and_change(enter(password, order), password).await {
                Ok(()) => return Ok(()),
                Err(Trouble::NotSent(_)) if tries > 0 => {}
                Err(Trouble::Unanswered(lost)) => return self.see_which_is_in_force(password, lost).await,
                Err(trouble) => return Err(self.not_changed(trouble).await),
            }
        }
    }

    /// Both requests on one connection, since what is entered belongs to it.
    async fn enter_and_change(&self, enter: Request, password: u64) -> Result<(), Trouble> {
        let mut session = self.session.lock().await;
        session.prepare(Manner::ONCE.logged_in).await?;
        if let Err(trouble) = session.exchange(&enter).await {
            // Nothing is changed by it alone.
            let Trouble::Unanswered(lost) = trouble else { return Err(trouble) };
            return Err(Trouble::NotSent(lost.cause));
        }
        session.login.passwords.may_change_to(password);
        let address = Reg::PasswordCmd.info().address;
        session.exchange(&Request::WriteRegister { address, value: CHANGE }).await?;
        session.login.passwords.has_changed_to(password);
        Ok(())
    }

    async fn see_which_is_in_force(&self, password: u64, lost: Lost) -> Result<(), Error> {
        self.close().await;
        let state = match self.log_in().await {
            Ok(()) if self.session.lock().await.login.passwords.current() == password => return Ok(()),
            Ok(()) => format!("the password before is in force{}", self.but(&lost).await),
            Err(error) => format!("which password is in force could not be found out ({error})"),
        };
        Err(Error::Uncertain { command: "the change of the password".to_owned(), cause: lost.cause, state })
    }

    async fn not_changed(&self, trouble: Trouble) -> Error {
        match trouble {
            Trouble::Told(error) => error,
            Trouble::NotSent(cause) | Trouble::Unanswered(Lost { cause, .. }) => Error::Line(cause),
            Trouble::Exception(exception) => Error::Refused(format!(
                "{} did not change the password ({exception}); the one before is in force",
                self.name().await
            )),
        }
    }
}

fn configuration() -> Vec<Slot> {
    between(Reg::CurrentOrVoltage, Reg::StopCurrent)
}

/// The model of a device ID; `None` for one that the maker does not list.
pub(super) fn model_of(hw_major: u16) -> Option<Model> {
    Model::ALL.into_iter().find(|model| model.hw_major() == hw_major)
}
