//! Commands: the codes of `CMD` (ch. 4.2) and the coils that act, each an instruction.

use super::client::SmsdUsbClient;
use super::registers::with_data;
use super::session::Trouble;
use super::table::{Sink, position, sink};
use super::trouble::Asked;
use crate::Error;
use crate::smsd::client::Manner;
use crate::smsd::commands::{is_taken_always, operand_of};
use crate::smsd::snapshot::Snapshot;
use crate::smsd::value::{Slot, command};
use stepdrive_spec::smsd::instructions::{Instruction, Opcode, Operand};
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::standard::Request;
use stepdrive_spec::smsd::status::Status;

impl SmsdUsbClient {
    /// Carries out a command; see [`Smsd::command`](crate::smsd::Smsd::command).
    pub(super) async fn carry_out(&self, opcode: Opcode, operand: Option<i64>) -> Result<(), Error> {
        if !opcode.info().in_cmd {
            return Err(Error::Usage(format!("{opcode} is for programs; CMD does not take it")));
        }
        let instruction = self.with_operand(opcode, operand)?;
        if is_taken_always(opcode) {
            return self.act(instruction, opcode.name()).await.map(drop);
        }
        let _turn = self.command.lock().await;
        if self.status_now().await?.cmd_error {
            return Err(Error::Fault(format!(
                "CMD_ERROR is set by an earlier command, so a refusal of {opcode} could not be told from it; \
                 clear it (CLR) and try again; nothing was sent"
            )));
        }
        let answer = self.act(instruction, opcode.name()).await?;
        if answer.status.cmd_error { Err(self.not_done(opcode).await) } else { Ok(()) }
    }

    /// Writes a command to `CMD`, with the operand that was written before.
    pub(super) async fn command_of(&self, code: i64) -> Result<(), Error> {
        let Some(opcode) = command(code) else {
            return Err(Error::Usage(format!("{code:#04X} is no command; nothing was sent")));
        };
        let operand = operand_register(opcode).map(|reg| self.last_written(reg));
        let instruction = self.with_operand(opcode, operand)?;
        self.act(instruction, opcode.name()).await.map(drop)
    }

    /// The instruction for a command; its operand is remembered as that of its register.
    fn with_operand(&self, opcode: Opcode, operand: Option<i64>) -> Result<Instruction, Error> {
        Ok(match operand_of(opcode, operand)? {
            None => Instruction { opcode, data: 0 },
            Some((reg, value)) => {
                self.remember(reg, value);
                with_data(opcode, value)
            }
        })
    }

    /// Lets a coil act; see [`Smsd::trigger`](crate::smsd::Smsd::trigger).
    pub(super) async fn let_act(&self, coil: Reg) -> Result<(), Error> {
        let slot = Slot::new(coil, 0)?;
        match sink(coil) {
            Ok(Sink::Trigger(opcode)) => {
                if opcode == Opcode::ResetPowerstep01 {
                    self.forget_settings();
                }
                self.act(Instruction { opcode, data: 0 }, slot.row.name).await.map(drop)
            }
            Ok(Sink::Apply) => self.apply_lan(slot).await,
            _ => Err(Error::Usage(format!("{slot} is no coil that acts; nothing was sent"))),
        }
    }

    /// Puts the LAN parameters into effect as they are.
    async fn apply_lan(&self, slot: Slot) -> Result<(), Error> {
        let _turn = self.whole.lock().await;
        let lan = self.lan().await?;
        match self.ask(&Request::SetLan(lan), Manner::ONCE).await {
            Ok(_) => {
                self.leave_lan().await;
                Ok(())
            }
            Err(Trouble::Unanswered(lost)) => Err(self.uncertain(slot.row.name, lost).await),
            Err(trouble) => Err(Asked::Act(slot.to_string()).explain(trouble, &self.called().await)),
        }
    }

    /// What a command came to that set `CMD_ERROR`.
    async fn not_done(&self, opcode: Opcode) -> Error {
        let state = match self.look().await {
            Ok(snapshot) => snapshot.to_string(),
            Err(error) => format!("its state could not be read ({error})"),
        };
        Error::Refused(format!(
            "{opcode} was refused by {} (CMD_ERROR is set): {state}; clear it (CLR) before the next command",
            self.called().await
        ))
    }

    // ---- what the motor does

    /// The status flags.
    pub(super) async fn status_now(&self) -> Result<Status, Error> {
        let asked = Asked::read(Slot::new(Reg::StatusWord, 0)?);
        Ok(self.answer(Instruction { opcode: Opcode::GetAbsPos, data: 0 }, &asked).await?.status)
    }

    /// What the motor does, in four requests. Status and position come in one reply, the first: where that says that the
    /// motor stands, the position is where it stands.
    pub(super) async fn look(&self) -> Result<Snapshot, Error> {
        let data = |opcode| Instruction { opcode, data: 0 };
        let asked = |reg| Slot::new(reg, 0).map(Asked::read);
        let first = self.answer(data(Opcode::GetAbsPos), &asked(Reg::AbsPos)?).await?;
        let speed = self.answer(data(Opcode::GetSpeed), &asked(Reg::Speed)?).await?;
        let el_pos = self.answer(data(Opcode::GetElPos), &asked(Reg::ElPos)?).await?;
        let events = self.answer(data(Opcode::StatusInEvent), &asked(Reg::Inputs)?).await?;
        Ok(Snapshot {
            status: first.status,
            position: position(first.data),
            speed: u16::try_from(speed.data).unwrap_or(u16::MAX),
            el_pos: u16::try_from(el_pos.data).unwrap_or(u16::MAX),
            inputs: events.data.to_le_bytes()[0],
        })
    }
}

/// The register that the operand of a command stands in.
pub(super) fn operand_register(opcode: Opcode) -> Option<Reg> {
    match opcode.info().operand {
        Operand::Number { .. } => Some(Reg::TargetSpeed),
        Operand::Position => Some(Reg::TargetPos),
        Operand::Input => Some(Reg::TargetInput),
        Operand::None | Operand::Mask | Operand::Mode | Operand::Jump | Operand::Loop => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use stepdrive_spec::smsd::instructions::INSTRUCTIONS;

    #[test]
    fn the_operand_of_a_command_stands_where_its_range_is_from() {
        for info in INSTRUCTIONS.iter().filter(|info| info.in_cmd) {
            let register = operand_register(info.opcode);
            let operand = register.map(|reg| if reg == Reg::TargetInput { 7 } else { 100 });
            let taken = operand_of(info.opcode, operand).expect("in range");
            assert_eq!(taken.map(|(reg, _)| reg), register, "{}", info.name);
        }
    }
}
