//! Commands: the codes of `CMD` (ch. 4.2) and the coils that act.

use super::client::{Manner, SmsdClient};
use super::driver::Smsd;
use super::registers::write;
use super::session::{Lost, Trouble};
use super::trouble::Asked;
use super::value::{Run, Slot, command, range};
use crate::settings::unit;
use crate::{Direction, Error};
use stepdrive_spec::modbus::Reply;
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::{Opcode, Operand};
use stepdrive_spec::smsd::registers::{Access, Reg};
use stepdrive_spec::smsd::ring;

/// Which way round to a position: they are a ring of 2^22 microsteps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// The shorter way.
    Shortest,
    /// Forward, however far.
    Forward,
    /// Backward, however far.
    Reverse,
}

impl Way {
    /// The command that goes this way.
    pub(super) const fn opcode(self) -> Opcode {
        match self {
            Way::Shortest => Opcode::GoTo,
            Way::Forward => Opcode::GoToF,
            Way::Reverse => Opcode::GoToR,
        }
    }
}

impl SmsdClient {
    /// Carries out a command of `CMD`, with its operand where it has one: a speed, a position or displacement in
    /// microsteps, or the number of an input. The operand is written first; then the command, once.
    ///
    /// Stops and `STOP_PROGRAM_MEM` go out at once. Before any other it is seen to that `CMD_ERROR` is clear, and
    /// afterwards whether it is still: a command that is accepted but cannot be carried out says so there and nowhere else.
    ///
    /// # Errors
    /// [`Error::Usage`] for a code that `CMD` does not take, or an operand that is out of range, missing or too many: nothing
    /// was sent. [`Error::Fault`] when `CMD_ERROR` was set before: nothing moves. [`Error::Refused`] when the command could
    /// not be carried out. [`Error::Uncertain`] when it was not answered. [`Error::Line`] and [`Error::NotAuthorised`] when
    /// the command was not sent; [`Error::Partly`] when only the outcome could not be read.
    pub async fn command(&self, opcode: Opcode, operand: Option<i64>) -> Result<(), Error> {
        if !opcode.info().in_cmd {
            return Err(Error::Usage(format!("{opcode} is for programs; CMD does not take it")));
        }
        let operand = operand_of(opcode, operand)?;
        if is_taken_always(opcode) {
            return self.send_command(opcode).await;
        }
        let _turn = self.command.lock().await;
        if self.status().await?.cmd_error {
            return Err(Error::Fault(format!(
                "CMD_ERROR is set by an earlier command, so a refusal of {opcode} could not be told from it; \
                 clear it (CLR) and try again; nothing was sent"
            )));
        }
        if let Some((reg, value)) = operand {
            self.write(reg, value).await?;
        }
        self.send_command(opcode).await?;
        self.see_that_it_was_done(opcode).await
    }

    /// Lets a coil act, once.
    ///
    /// # Errors
    /// [`Error::Usage`] when it is none that acts. [`Error::Line`] and [`Error::NotAuthorised`] when it was not sent;
    /// [`Error::Uncertain`] when it was and there is no reply.
    pub async fn trigger(&self, coil: Reg) -> Result<(), Error> {
        let slot = Slot::new(coil, 0)?;
        if slot.row.access != Access::Trigger {
            return Err(Error::Usage(format!("{slot} is no coil that acts; nothing was sent")));
        }
        self.act(slot, 1).await
    }

    /// Writes something that acts, checked before, once.
    pub(super) async fn act(&self, slot: Slot, value: i64) -> Result<(), Error> {
        match self.act_once(slot, value).await? {
            Ok(_) => Ok(()),
            Err(lost) => {
                let command = match command(value).filter(|_| slot.row.id == Reg::Cmd) {
                    Some(opcode) => opcode.to_string(),
                    None if slot.row.access == Access::Trigger => slot.to_string(),
                    None => format!("{slot} {value}"),
                };
                let state = format!("{}{}", self.state_in_words(slot).await, self.but(&lost).await);
                Err(Error::Uncertain { command, cause: lost.cause, state })
            }
        }
    }

    /// Writes something that acts, once. When it was sent and there is no reply, the inner error says why.
    pub(super) async fn act_once(&self, slot: Slot, value: i64) -> Result<Result<Reply, Lost>, Error> {
        let (run, values) = (Run { slots: &[slot] }, [value]);
        let order = super::WordOrder::LowFirst;
        let request =
            write(run, &values, order).ok_or_else(|| Error::Usage(format!("{slot} cannot be written")))?;
        match self.ask(&request, Manner::ONCE).await {
            Ok(reply) => Ok(Ok(reply)),
            Err(Trouble::Unanswered(lost)) => Ok(Err(lost)),
            Err(trouble) => Err(Asked::Write(run, &values, None).explain(trouble, &self.name().await)),
        }
    }

    async fn send_command(&self, opcode: Opcode) -> Result<(), Error> {
        self.act(Slot::new(Reg::Cmd, 0)?, opcode.code().into()).await
    }

    /// A command that cannot be carried out sets `CMD_ERROR`.
    async fn see_that_it_was_done(&self, opcode: Opcode) -> Result<(), Error> {
        match self.snapshot().await {
            Ok(snapshot) if snapshot.status.cmd_error => Err(Error::Refused(format!(
                "{opcode} was refused by {} (CMD_ERROR is set): {snapshot}; clear it (CLR) before the next command",
                self.name().await
            ))),
            Ok(_) => Ok(()),
            Err(cause) => {
                let done = format!("{opcode} was accepted, but whether it could be carried out is not known");
                Err(Error::Partly { done, cause: Box::new(cause) })
            }
        }
    }

    /// What has to be said of a state that was read after a reply was lost: a controller answers in order on each
    /// connection, but not across two.
    pub(super) async fn but(&self, lost: &Lost) -> &'static str {
        if self.session.lock().await.wire.openings() == lost.connection {
            ""
        } else {
            "; this was read on another connection, so what was sent may still arrive"
        }
    }

    /// How the controller stands, for somebody who does not know whether a command has reached it.
    async fn state_in_words(&self, slot: Slot) -> String {
        let snapshot = match self.snapshot().await {
            Ok(snapshot) => snapshot,
            Err(error) => return format!("its state could not be read ({error})"),
        };
        if slot.row.id != Reg::Cmd {
            return snapshot.to_string();
        }
        match self.read(Reg::Cmd).await.map(command) {
            Ok(Some(last)) => format!("the last command it took is {last}; {snapshot}"),
            Ok(None) => format!("it has taken no command yet; {snapshot}"),
            Err(_) => snapshot.to_string(),
        }
    }
}

/// Whether a command is carried out whatever the motor does, and must not wait for anything.
pub(super) fn is_taken_always(opcode: Opcode) -> bool {
    let stops =
        [Opcode::SoftStop, Opcode::HardStop, Opcode::SoftHiZ, Opcode::HardHiZ, Opcode::StopProgramMem];
    stops.contains(&opcode)
}

/// The command of a direction.
pub(super) fn either(direction: Direction, forward: Opcode, reverse: Opcode) -> Opcode {
    match direction {
        Direction::Positive => forward,
        Direction::Negative => reverse,
    }
}

/// The register that takes a command's operand, and the operand, if it is in range.
pub(super) fn operand_of(opcode: Opcode, operand: Option<i64>) -> Result<Option<(Reg, i64)>, Error> {
    let (reg, (min, max), what) = match opcode.info().operand {
        Operand::Number { min, max, unit } => (Reg::TargetSpeed, (min.into(), max.into()), unit),
        Operand::Position => {
            (Reg::TargetPos, (ring::MIN.into(), ring::MAX.into()), Reg::TargetPos.info().unit)
        }
        Operand::Input => (Reg::TargetInput, inputs(), ""),
        Operand::None | Operand::Mask | Operand::Mode | Operand::Jump | Operand::Loop => {
            return match operand {
                None => Ok(None),
                Some(_) => Err(Error::Usage(format!("{opcode} takes no operand; nothing was sent"))),
            };
        }
    };
    let (lowest, highest) = range(reg.info(), None);
    let (min, max): (i64, i64) = (lowest.max(min), highest.min(max));
    let takes = format!("{min} to {max}{}", unit(what));
    match operand {
        Some(value) if (min..=max).contains(&value) => Ok(Some((reg, value))),
        Some(value) => {
            Err(Error::Usage(format!("{opcode} {value} is out of range: {takes}; nothing was sent")))
        }
        None => Err(Error::Usage(format!("{opcode} wants an operand: {takes}; nothing was sent"))),
    }
}

/// The numbers of the inputs.
fn inputs() -> (i64, i64) {
    let numbers = || Input::ALL.into_iter().map(|input| i64::from(input.number()));
    (numbers().min().unwrap_or(0), numbers().max().unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use stepdrive_spec::smsd::instructions::INSTRUCTIONS;

    #[test]
    fn every_command_finds_the_register_of_its_operand() {
        for info in INSTRUCTIONS.iter().filter(|info| info.in_cmd) {
            let wants = matches!(info.operand, Operand::Number { .. } | Operand::Position | Operand::Input);
            assert_eq!(operand_of(info.opcode, None).is_err(), wants, "{}", info.name);
            let is_speed = matches!(info.operand, Operand::Number { .. });
            assert_eq!(operand_of(info.opcode, Some(1)).is_err(), !wants || is_speed, "{}", info.name);
        }
    }

    #[test]
    fn an_operand_out_of_range_is_told_with_what_the_command_takes() {
        let text = |opcode, operand| operand_of(opcode, operand).expect_err("refused").to_string();
        assert_eq!(
            text(Opcode::RunF, Some(15_601)),
            "RUN_F 15601 is out of range: 15 to 15600 full steps/s; nothing was sent"
        );
        assert_eq!(
            text(Opcode::GoTo, None),
            "GO_TO wants an operand: -2097152 to 2097151 microsteps; nothing was sent"
        );
        assert_eq!(text(Opcode::GoUntilR, Some(8)), "GO_UNTIL_R 8 is out of range: 0 to 7; nothing was sent");
        assert_eq!(text(Opcode::GoZero, Some(0)), "GO_ZERO takes no operand; nothing was sent");
    }
}
