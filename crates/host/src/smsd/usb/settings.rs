//! What a controller is, its motor configuration, its program and its password.

use super::client::SmsdUsbClient;
use super::primitives::model_in;
use super::registers::in_words;
use super::session::Trouble;
use super::table::{Place, Sink, source};
use super::trouble::Asked;
use crate::Error;
use crate::smsd::client::Manner;
use crate::smsd::session::Lost;
use crate::smsd::settings::Identity;
use crate::smsd::snapshot::{ProgramState, between};
use crate::smsd::value::Slot;
use stepdrive_spec::smsd::mode::MotorConfiguration;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::standard::Request;

impl SmsdUsbClient {
    /// What the controller says that it is; one may leave all but the protocol untold.
    pub(super) async fn what_it_is(&self) -> Result<Identity, Error> {
        let versions = self.versions_if_told().await?;
        let protocol = self.protocol_version().await?;
        let pair = |[major, minor]: [u16; 2]| (major, minor);
        Ok(Identity {
            model: versions.and_then(model_in),
            hardware: versions.map(|versions| pair(versions.hardware)),
            firmware: versions.map(|versions| pair(versions.firmware)),
            register_map: None,
            protocol: Some(protocol),
        })
    }

    /// The user program, in two requests. Whether it runs this protocol does not tell.
    pub(super) async fn program_now(&self) -> Result<ProgramState, Error> {
        let slots = [Reg::NProgram, Reg::NCommand, Reg::ModeNPrograms].map(|reg| Slot::new(reg, 0));
        let slots = slots.into_iter().collect::<Result<Vec<Slot>, Error>>()?;
        let values = self.read_slots(&slots).await?;
        let value =
            |place: usize| values.get(place).and_then(|value| u16::try_from(*value).ok()).unwrap_or(0);
        Ok(ProgramState { running: None, area: value(0), line: value(1), autonomous: value(2) })
    }

    /// The motor configuration, in one request.
    pub(super) async fn configuration(&self) -> Result<MotorConfiguration, Error> {
        let asked = Asked::Read("the motor configuration".to_owned());
        Ok(self.mode(&asked).await?.0)
    }

    /// Sets the motor configuration, all of it in one request, and reads it back.
    pub(super) async fn set_configuration(&self, motor: &MotorConfiguration) -> Result<(), Error> {
        let _turn = self.whole.lock().await;
        let values: Vec<(Slot, i64)> = between(Reg::CurrentOrVoltage, Reg::StopCurrent)
            .into_iter()
            .filter_map(|slot| match source(slot.row.id) {
                Ok((_, Place::Mode(of))) => Some((slot, i64::from(of(*motor)))),
                _ => None,
            })
            .collect();
        self.check_all(&values).await?;
        let asked = Asked::write_all(&in_words(&values, |sink| matches!(sink, Sink::Mode(_))));
        self.put_mode(*motor, &asked).await?;
        let found = self.configuration().await?;
        if found == *motor {
            return Ok(());
        }
        Err(Error::Differs(format!("the motor configuration was written as {motor:?} and reads {found:?}")))
    }

    /// Changes the password, of the controller and of this client.
    ///
    /// When the reply is lost the client logs in anew: the password that is accepted then says what has become of it. Where
    /// that leaves a doubt, the client knows both from then on, and tries the new one when the old one is refused.
    pub(super) async fn set_password(&self, password: u64) -> Result<(), Error> {
        let _turn = self.whole.lock().await;
        self.session.lock().await.login.passwords.may_change_to(password);
        match self.ask(&Request::SetPassword(password), Manner::ONCE).await {
            Ok(_) => {
                self.session.lock().await.login.passwords.has_changed_to(password);
                Ok(())
            }
            Err(Trouble::Unanswered(lost)) => self.see_which_is_in_force(password, lost).await,
            Err(trouble) => {
                let asked = Asked::write_all("the new password");
                Err(asked.explain(trouble, &self.called().await))
            }
        }
    }

    async fn see_which_is_in_force(&self, password: u64, lost: Lost) -> Result<(), Error> {
        self.session.lock().await.wire.close();
        let state = match self.enter().await {
            Ok(()) if self.session.lock().await.login.passwords.current() == password => return Ok(()),
            Ok(()) => format!("the password before is in force{}", self.but(lost.connection).await),
            Err(error) => format!("which password is in force could not be found out ({error})"),
        };
        Err(Error::Uncertain { command: "the change of the password".to_owned(), cause: lost.cause, state })
    }
}
