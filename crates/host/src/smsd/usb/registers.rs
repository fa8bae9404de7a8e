//! The registers of the map, each by the request that reads or writes it.

use super::client::SmsdUsbClient;
use super::primitives::model_in;
use super::session::Trouble;
use super::table::{Place, Question, Sink, sink, source};
use super::trouble::{Asked, forbidden};
use crate::Error;
use crate::smsd::client::Manner;
use crate::smsd::registers::Reading;
use crate::smsd::value::{Slot, range};
use std::collections::BTreeMap;
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};
use stepdrive_spec::smsd::mode::MotorConfiguration;
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::{Limits, REGISTERS, Reg, Writable};
use stepdrive_spec::smsd::standard::{Answer, Code, LanParameters, Reply, Request, Versions};

/// What a question was answered.
#[derive(Clone, Copy, Debug)]
enum Told {
    Answer(Answer),
    Versions(Versions),
    Lan(LanParameters),
}

impl SmsdUsbClient {
    /// Fails when a register cannot be read by this protocol.
    pub(super) fn readable(reg: Reg) -> Result<(), Error> {
        let row = reg.info();
        let Err(why) = source(reg) else { return Ok(()) };
        let name = row.name.replace(" {}", "");
        let is_setting = matches!(sink(reg), Ok(Sink::Set(_)));
        let default = if is_setting { format!("; it is {} at power-up", row.default) } else { String::new() };
        Err(Error::Usage(format!("{name} cannot be read here: {why}{default}")))
    }

    /// Reads registers, each question once, and answers in the order asked.
    pub(super) async fn read_slots(&self, slots: &[Slot]) -> Result<Vec<i64>, Error> {
        self.read_slots_with(BTreeMap::new(), slots).await
    }

    /// The same, some questions being answered already.
    async fn read_slots_with(
        &self,
        mut told: BTreeMap<Question, Told>,
        slots: &[Slot],
    ) -> Result<Vec<i64>, Error> {
        for slot in slots {
            SmsdUsbClient::readable(slot.row.id)?;
        }
        let mut values = Vec::with_capacity(slots.len());
        for slot in slots {
            let Ok((question, place)) = source(slot.row.id) else { continue };
            let found = match told.get(&question) {
                Some(found) => *found,
                None => self.question(question, *slot).await?,
            };
            told.insert(question, found);
            match value(place, found, slot.index) {
                Some(value) => values.push(value),
                None => return Err(self.has_none(*slot).await),
            }
        }
        Ok(values)
    }

    /// Every register that can be read, in the order of the map.
    pub(super) async fn read_map(&self) -> Result<Vec<Reading>, Error> {
        let rows = REGISTERS.iter().filter(|row| source(row.id).is_ok());
        // Only a controller with the Modbus firmware has a unit identifier.
        let lan = self.lan().await?;
        let has_id = lan.id.is_some();
        let mut told = BTreeMap::from([(Question::Lan, Told::Lan(lan))]);
        let versions = self.versions_if_told().await?;
        told.extend(versions.map(|versions| (Question::Versions, Told::Versions(versions))));
        let is_told = |reg: Reg| match source(reg) {
            Ok((Question::Versions, _)) => versions.is_some(),
            _ => has_id || reg != Reg::LanId,
        };
        let slots: Vec<Slot> = rows.filter(|row| is_told(row.id)).flat_map(Slot::all).collect();
        let values = self.read_slots_with(told, &slots).await?;
        let reading = |(slot, value): (&Slot, i64)| Reading { reg: slot.row.id, index: slot.index, value };
        Ok(slots.iter().zip(values).map(reading).collect())
    }

    async fn question(&self, question: Question, slot: Slot) -> Result<Told, Error> {
        Ok(match question {
            Question::Instruction(opcode) => {
                Told::Answer(self.answer(Instruction { opcode, data: 0 }, &Asked::read(slot)).await?)
            }
            Question::Access => Told::Answer(self.access(slot).await?),
            Question::Versions => Told::Versions(self.versions().await?),
            Question::Lan => Told::Lan(self.lan().await?),
        })
    }

    /// Asks something without logging in for it.
    async fn access(&self, slot: Slot) -> Result<Answer, Error> {
        let request = Request::Command(Instruction { opcode: Opcode::GetAbsPos, data: 0 }.word());
        let asked = Asked::read(slot);
        match self.ask(&request, Manner::OPEN).await {
            Ok(Reply::Response(answer) | Reply::Powerstep01(answer)) => Ok(answer),
            Ok(reply) => Err(self.unexpected(&asked, &reply).await),
            Err(Trouble::Refused(answer)) if answer.code == Code::ErrorAccess => Ok(answer),
            Err(trouble) => Err(asked.explain(trouble, &self.called().await)),
        }
    }

    pub(super) async fn has_none(&self, slot: Slot) -> Error {
        Error::Usage(format!("{} has no {slot}: it has the standard firmware", self.called().await))
    }

    // ---- writing

    /// Writes registers. All are checked before anything is sent; what goes out together goes out at the place of the
    /// first of it in the map.
    pub(super) async fn write_slots(&self, mut values: Vec<(Slot, i64)>) -> Result<(), Error> {
        values.sort_by_key(|(slot, _)| (slot.row.id, slot.index));
        if let Some((slot, _)) = values.iter().find(|(slot, _)| slot.acts()) {
            return Err(Error::Usage(format!("{slot} acts and is written alone; nothing was sent")));
        }
        let model = self.check_all(&values).await?;
        let (mut mode_is_done, mut lan_is_done) = (false, false);
        for (slot, value) in &values {
            match sink(slot.row.id) {
                Ok(Sink::Mode(_)) if !std::mem::replace(&mut mode_is_done, true) => {
                    self.write_mode(&values).await?;
                }
                Ok(Sink::Lan) if !std::mem::replace(&mut lan_is_done, true) => {
                    self.write_lan(&values).await?;
                }
                Ok(Sink::Mode(_) | Sink::Lan) => {}
                Ok(sink) => self.write_one(*slot, *value, sink, model).await?,
                Err(why) => return Err(unwritable(*slot, why)),
            }
        }
        Ok(())
    }

    /// Writes one register.
    pub(super) async fn write_slot(&self, slot: Slot, value: i64) -> Result<(), Error> {
        if !slot.acts() {
            return self.write_slots(vec![(slot, value)]).await;
        }
        let model = self.check_all(&[(slot, value)]).await?;
        match sink(slot.row.id) {
            Ok(sink) => self.write_one(slot, value, sink, model).await,
            Err(why) => Err(unwritable(slot, why)),
        }
    }

    async fn write_one(&self, slot: Slot, value: i64, sink: Sink, model: Option<Model>) -> Result<(), Error> {
        match sink {
            Sink::Operand => {
                self.remember(slot.row.id, value);
                Ok(())
            }
            Sink::Set(opcode) => self.set(slot, value, with_data(opcode, value), model).await,
            Sink::Switch(off, on) => {
                let opcode = if value == 0 { off } else { on };
                self.set(slot, value, Instruction { opcode, data: 0 }, model).await
            }
            // FALSE to a coil that acts does nothing (decision 9).
            Sink::Trigger(_) | Sink::Apply if value == 0 => Ok(()),
            Sink::Trigger(_) | Sink::Apply => self.let_act(slot.row.id).await,
            Sink::Command => self.command_of(value).await,
            Sink::Mode(_) => self.write_mode(&[(slot, value)]).await,
            Sink::Lan => self.write_lan(&[(slot, value)]).await,
        }
    }

    /// Carries out an instruction that sets something.
    async fn set(
        &self,
        slot: Slot,
        value: i64,
        instruction: Instruction,
        model: Option<Model>,
    ) -> Result<(), Error> {
        let asked = Asked::write(slot, value, model);
        let answer = self.answer(instruction, &asked).await?;
        self.check_taken(&asked, slot.row.writable, answer).await?;
        self.remember(slot.row.id, value);
        Ok(())
    }

    /// Fails when the motor has not taken a setting.
    pub(super) async fn check_taken(
        &self,
        asked: &Asked,
        writable: Writable,
        answer: Answer,
    ) -> Result<(), Error> {
        match forbidden(writable, answer.status).filter(|_| answer.status.cmd_error) {
            None => Ok(()),
            Some(why) => Err(Error::Refused(format!(
                "{} refused to {asked}: {why}; nothing was changed but CMD_ERROR, which is set: clear it (CLR)",
                self.called().await
            ))),
        }
    }

    /// Changes part of the motor configuration.
    async fn write_mode(&self, values: &[(Slot, i64)]) -> Result<(), Error> {
        let _turn = self.whole.lock().await;
        let asked =
            Asked::Write { what: in_words(values, |sink| matches!(sink, Sink::Mode(_))), takes: None };
        let (mut mode, answer) = self.mode(&asked).await?;
        if let Some(why) = forbidden(Writable::HiZ, answer.status) {
            let name = self.called().await;
            return Err(Error::Refused(format!(
                "{name} would refuse to {asked}: {why}; nothing was changed"
            )));
        }
        for (slot, value) in values {
            if let Ok(Sink::Mode(part)) = sink(slot.row.id) {
                *part(&mut mode) = u16::try_from(*value).unwrap_or(u16::MAX);
            }
        }
        self.put_mode(mode, &asked).await
    }

    /// The motor configuration, and the answer in which it came.
    pub(super) async fn mode(&self, asked: &Asked) -> Result<(MotorConfiguration, Answer), Error> {
        let answer = self.answer(Instruction { opcode: Opcode::GetMode, data: 0 }, asked).await?;
        Ok((MotorConfiguration::from_data(answer.data), answer))
    }

    /// Sets the motor configuration.
    pub(super) async fn put_mode(&self, mode: MotorConfiguration, asked: &Asked) -> Result<(), Error> {
        let instruction = Instruction { opcode: Opcode::SetMode, data: mode.data() };
        let answer = self.answer(instruction, asked).await?;
        self.check_taken(asked, Writable::HiZ, answer).await
    }

    // ---- checks

    /// Checks what is to be written. Answers the model, where the range of a value depends on it.
    pub(super) async fn check_all(&self, values: &[(Slot, i64)]) -> Result<Option<Model>, Error> {
        for (slot, value) in values {
            slot.check(*value, self.known_model())?;
            if let Err(why) = sink(slot.row.id) {
                return Err(unwritable(*slot, why));
            }
        }
        if !values.iter().any(|(slot, _)| matches!(slot.row.limits, Limits::ByModel(..))) {
            return Ok(None);
        }
        let model = self.versions_if_told().await?.and_then(model_in);
        for (slot, value) in values {
            slot.check(*value, model)?;
        }
        Ok(model)
    }
}

/// An instruction with a number as its data.
pub(super) fn with_data(opcode: Opcode, value: i64) -> Instruction {
    Instruction::with_position(opcode, i32::try_from(value).unwrap_or(0))
}

/// Whether a value of a register may be.
pub(super) fn can_be(slot: Slot, value: i64) -> bool {
    let (lowest, highest) = range(slot.row, None);
    (lowest..=highest).contains(&value)
}

/// A value in what was told; `None` where it has no such value.
fn value(place: Place, told: Told, index: u16) -> Option<i64> {
    match (place, told) {
        (Place::Flag(of), Told::Answer(answer)) => Some(of(answer.status).into()),
        (Place::Status, Told::Answer(answer)) => Some(answer.status.word().into()),
        (Place::Data(of), Told::Answer(answer)) => Some(of(answer.data)),
        (Place::Mode(of), Told::Answer(answer)) => {
            Some(of(MotorConfiguration::from_data(answer.data)).into())
        }
        (Place::Code(of), Told::Answer(answer)) => Some(of(answer.code).into()),
        (Place::Versions(of), Told::Versions(versions)) => Some(of(&versions).into()),
        (Place::Lan(of), Told::Lan(mut lan)) => of(&mut lan, index.into()).map(|octets| octets.get()),
        _ => None,
    }
}

/// The registers among these that go a certain way, with their values.
pub(super) fn in_words(values: &[(Slot, i64)], goes: fn(Sink) -> bool) -> String {
    let those = values.iter().filter(|(slot, _)| sink(slot.row.id).is_ok_and(goes));
    let all: Vec<String> = those.map(|(slot, value)| format!("{slot} {value}")).collect();
    match all.as_slice() {
        [first, .., last] if all.len() > 8 => format!("{first} … {last}"),
        _ => all.join(", "),
    }
}

fn unwritable(slot: Slot, why: &str) -> Error {
    Error::Usage(format!("{slot} cannot be written here: {why}; nothing was sent"))
}
