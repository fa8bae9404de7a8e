//! What the protocol has by itself: instructions, memories, LAN parameters, counters, versions.

use super::client::SmsdUsbClient;
use super::session::Trouble;
use super::table::set_by;
use super::trouble::{Asked, was_taken};
use crate::error::{Error, LineError};
use crate::smsd::client::Manner;
use crate::smsd::session::Lost;
use crate::smsd::settings::model_of;
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::standard::{
    Answer, COUNTERS, Code, LanParameters, Reply, Request, Versions, Words, code_of,
};

impl SmsdUsbClient {
    /// Carries out any instruction, also one that no register stands for, as `STEP_CLOCK`. One that tells something, or
    /// leaves the same behind however often it is carried out, is repeated when its reply is lost; any other is sent once.
    ///
    /// The answer has the status afterwards (of `GET_STATUS_AND_CLR` before); a motion that the motor does not take is
    /// answered like one that it does, and shows only in `CMD_ERROR` there, which may be an earlier one's.
    ///
    /// # Errors
    /// [`Error::Usage`] for an instruction that the controller's version of the protocol does not have: it was not sent.
    /// [`Error::Refused`] when it was refused; [`Error::Uncertain`] when one that is sent once was not answered.
    /// [`Error::Line`], [`Error::NotAuthorised`], [`Error::Device`].
    pub async fn instruct(&self, instruction: Instruction) -> Result<Answer, Error> {
        let Instruction { opcode, data } = instruction;
        if opcode == Opcode::ResetPowerstep01 {
            self.forget_settings();
        }
        if kind(opcode) == Kind::Acts {
            return self.act(instruction, opcode.name()).await;
        }
        let answer = self.answer(instruction, &Asked::Act(opcode.to_string())).await?;
        if let Some(reg) = set_by(opcode).filter(|reg| was_taken(reg.info().writable, answer.status)) {
            self.remember(reg, data.into());
        }
        Ok(answer)
    }

    /// The counters of errors, in the order of [`COUNTER_ROWS`](stepdrive_spec::smsd::standard::COUNTER_ROWS).
    ///
    /// # Errors
    /// [`Error::Line`], [`Error::NotAuthorised`], [`Error::Device`].
    pub async fn error_counters(&self) -> Result<[u32; COUNTERS], Error> {
        let asked = Asked::Read("the counters of errors".to_owned());
        let reply = self.told(&Request::GetErrors, &asked).await?;
        let Reply::Errors(counters) = reply else { return Err(self.unexpected(&asked, &reply).await) };
        Ok(counters)
    }

    /// The versions of hardware, firmware and protocol, as the controller answers them. The maker has not described the
    /// request.
    ///
    /// # Errors
    /// [`Error::Device`] when the controller does not tell. [`Error::Line`], [`Error::NotAuthorised`].
    pub async fn versions(&self) -> Result<Versions, Error> {
        match self.versions_if_told().await? {
            Some(versions) => Ok(versions),
            None => Err(Error::Device(format!("{} does not tell its versions", self.called().await))),
        }
    }

    /// The versions, which never change; `None` when the controller does not know the request, answers it in a form of its
    /// own, or not at all.
    pub(super) async fn versions_if_told(&self) -> Result<Option<Versions>, Error> {
        if let Some(versions) = self.versions.get() {
            return Ok(*versions);
        }
        let versions = match self.ask(&Request::GetVersions, Manner::REPEATED).await {
            Ok(Reply::Versions(versions)) => Some(versions),
            Ok(_) | Err(Trouble::Refused(_)) => None,
            // The line may have been the cause, so it is asked again when it is wanted again.
            Err(Trouble::Unanswered(Lost {
                cause: LineError::Silent { .. } | LineError::Garbled { .. },
                ..
            })) => {
                return Ok(None);
            }
            Err(trouble) => {
                let asked = Asked::Read("the versions".to_owned());
                return Err(asked.explain(trouble, &self.called().await));
            }
        };
        Ok(*self.versions.get_or_init(|| versions))
    }

    /// The version of the protocol that the controller's packets bear: 1 or 2. Logs in if it has not said anything yet.
    ///
    /// # Errors
    /// [`Error::Line`], [`Error::NotAuthorised`].
    pub async fn protocol_version(&self) -> Result<u8, Error> {
        if let Some(version) = self.session.lock().await.version() {
            return Ok(version);
        }
        self.enter().await?;
        let version = self.session.lock().await.version();
        version.ok_or_else(|| Error::Device("the controller has said nothing".to_owned()))
    }

    /// The words in a memory area.
    pub(super) async fn words(&self, area: u8) -> Result<Words, Error> {
        let asked = Asked::Read(format!("memory {area}"));
        let reply = self.told(&Request::ReadMemory { area }, &asked).await?;
        let Reply::Memory { words, .. } = reply else { return Err(self.unexpected(&asked, &reply).await) };
        Ok(words)
    }

    /// The LAN parameters as they stand in the packet.
    pub(super) async fn lan(&self) -> Result<LanParameters, Error> {
        let asked = Asked::Read("the LAN parameters".to_owned());
        let reply = self.told(&Request::GetLan, &asked).await?;
        let Reply::Lan(lan) = reply else { return Err(self.unexpected(&asked, &reply).await) };
        Ok(lan)
    }

    /// Sends an instruction that may be repeated.
    pub(super) async fn answer(&self, instruction: Instruction, asked: &Asked) -> Result<Answer, Error> {
        let reply = self.told(&Request::Command(instruction.word()), asked).await?;
        self.fitting(instruction.opcode, &reply, asked).await
    }

    /// Sends an instruction that acts, once, under the name that errors are to give it.
    pub(super) async fn act(&self, instruction: Instruction, name: &str) -> Result<Answer, Error> {
        let asked = Asked::Act(name.to_owned());
        match self.ask(&Request::Command(instruction.word()), Manner::ONCE).await {
            Ok(reply) => self.fitting(instruction.opcode, &reply, &asked).await,
            Err(Trouble::Unanswered(lost)) => Err(self.uncertain(name, lost).await),
            Err(trouble) => Err(asked.explain(trouble, &self.called().await)),
        }
    }

    /// What acts was sent and its reply did not come: the state as it is now.
    pub(super) async fn uncertain(&self, command: &str, lost: Lost) -> Error {
        let state = match self.look().await {
            Ok(snapshot) => format!("{snapshot}{}", self.but(lost.connection).await),
            Err(error) => format!("its state could not be read ({error})"),
        };
        Error::Uncertain { command: command.to_owned(), cause: lost.cause, state }
    }

    /// Makes a request that may be repeated.
    pub(super) async fn told(&self, request: &Request, asked: &Asked) -> Result<Reply, Error> {
        match self.ask(request, Manner::REPEATED).await {
            Ok(reply) => Ok(reply),
            Err(trouble) => Err(asked.explain(trouble, &self.called().await)),
        }
    }

    /// The answer to an instruction; of one that tells something, if it is that.
    async fn fitting(&self, opcode: Opcode, reply: &Reply, asked: &Asked) -> Result<Answer, Error> {
        if let Reply::Response(answer) | Reply::Powerstep01(answer) = reply
            && fits(opcode, answer.code)
        {
            return Ok(*answer);
        }
        Err(self.unexpected(asked, reply).await)
    }

    /// A reply that answers something else.
    pub(super) async fn unexpected(&self, asked: &Asked, reply: &Reply) -> Error {
        let name = self.called().await;
        match reply {
            Reply::Response(answer) | Reply::Powerstep01(answer) => {
                Error::Device(format!("{name} was asked to {asked} and answered {}", answer.code))
            }
            Reply::Memory { .. } | Reply::Lan(_) | Reply::Errors(_) | Reply::Versions(_) => {
                Error::Device(format!("{name} was asked to {asked} and answered something else"))
            }
        }
    }
}

/// What it comes to when an instruction is carried out twice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// It tells something.
    Tells,
    /// It leaves the same behind.
    Sets,
    /// It acts.
    Acts,
}

fn kind(opcode: Opcode) -> Kind {
    use Opcode as O;
    let sets = [
        O::SetMode,
        O::SetMinSpeed,
        O::SetMaxSpeed,
        O::SetAcc,
        O::SetDec,
        O::SetFsSpeed,
        O::SetMaskEvent,
        O::SetRele,
        O::ClrRele,
    ];
    if tells(opcode) {
        Kind::Tells
    } else if sets.contains(&opcode) {
        Kind::Sets
    } else {
        Kind::Acts
    }
}

/// Whether an instruction only tells something.
fn tells(opcode: Opcode) -> bool {
    use Opcode as O;
    let all = [
        O::GetSpeed,
        O::StatusInEvent,
        O::GetMode,
        O::GetAbsPos,
        O::GetElPos,
        O::GetRele,
        O::GetMinSpeed,
        O::GetMaxSpeed,
        O::GetStack,
    ];
    all.contains(&opcode)
}

/// Whether an answer with this code has the value that an instruction asks for, where it asks for one.
fn fits(opcode: Opcode, code: Code) -> bool {
    if opcode == Opcode::GetRele {
        return matches!(code, Code::StatusReleSet | Code::StatusReleClr);
    }
    !tells(opcode) || code == code_of(opcode)
}

/// The model that versions tell.
pub(super) fn model_in(versions: Versions) -> Option<Model> {
    model_of(versions.hardware[0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use stepdrive_spec::smsd::instructions::INSTRUCTIONS;

    #[test]
    fn nothing_that_moves_or_counts_is_repeated() {
        for info in &INSTRUCTIONS {
            if info.in_cmd || !info.in_program && !tells(info.opcode) {
                assert_eq!(kind(info.opcode), Kind::Acts, "{}", info.name);
            }
        }
        assert_eq!(kind(Opcode::ResetPos), Kind::Acts);
        assert_eq!(kind(Opcode::SetAcc), Kind::Sets);
    }

    #[test]
    fn a_value_is_believed_only_under_its_own_code() {
        assert!(fits(Opcode::GetAbsPos, Code::GetAbsPos) && !fits(Opcode::GetAbsPos, Code::Ok));
        assert!(!fits(Opcode::GetSpeed, Code::GetAbsPos));
        assert!(fits(Opcode::GetRele, Code::StatusReleSet) && fits(Opcode::GetRele, Code::StatusReleClr));
        assert!(fits(Opcode::SetRele, Code::Ok));
    }
}
