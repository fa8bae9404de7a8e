//! [`Smsd`] over Modbus TCP.

use super::client::SmsdClient;
use super::commands::operand_of;
use super::driver::{Answer, Progress, Smsd, Step};
use super::network::LanParameters;
use super::options::WordOrder;
use super::registers::{Reading, write};
use super::settings::Identity;
use super::snapshot::{ProgramState, Snapshot};
use super::value::{Run, Slot, command};
use crate::connect::BoxFuture;
use crate::error::Error;
use stepdrive_proto::modbus::{Adu, encode_request};
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};
use stepdrive_spec::smsd::mode::MotorConfiguration;
use stepdrive_spec::smsd::registers::{Access, Reg};

impl SmsdClient {
    /// The LAN parameters written down, and put into effect.
    async fn write_and_apply(&self, lan: &LanParameters) -> Result<(), Error> {
        self.set_lan_parameters(lan).await?;
        self.apply_lan_parameters().await.map_err(|cause| Error::Partly {
            done: "the LAN parameters were written, but may not be in effect".to_owned(),
            cause: Box::new(cause),
        })
    }

    async fn requests_for(&self, step: Step) -> Result<Vec<String>, Error> {
        let writes: Vec<(Reg, i64)> = match step {
            Step::Write(reg, value) => vec![(reg, value)],
            Step::Command(opcode, operand) => {
                operand_of(opcode, operand)?.into_iter().chain([(Reg::Cmd, opcode.code().into())]).collect()
            }
        };
        let order = self.word_order().await?;
        writes.into_iter().map(|(reg, value)| pdu_text(reg, value, order)).collect()
    }
}

/// A write as its PDU, and what it says.
fn pdu_text(reg: Reg, value: i64, order: WordOrder) -> Result<String, Error> {
    let slot = Slot::new(reg, 0)?;
    let request = write(Run { slots: &[slot] }, &[value], order);
    let request = request.ok_or_else(|| Error::Usage(format!("{slot} cannot be written")))?;
    let mut frame = Adu::new();
    encode_request(&mut frame, 0, 0, &request).map_err(|refusal| Error::Usage(refusal.to_string()))?;
    // Behind the header, which differs with every request.
    let pdu = frame.get(7..).unwrap_or(&[]).iter().map(|byte| format!("{byte:02X}"));
    let pdu = pdu.collect::<Vec<_>>().join(" ");
    Ok(match command(value).filter(|_| reg == Reg::Cmd) {
        Some(opcode) => format!("{pdu}  {slot} = {opcode}"),
        None => format!("{pdu}  {slot} = {value}"),
    })
}

impl Smsd for SmsdClient {
    fn name(&self) -> BoxFuture<'_, String> {
        Box::pin(SmsdClient::name(self))
    }

    fn connections(&self) -> BoxFuture<'_, u64> {
        Box::pin(SmsdClient::connections(self))
    }

    fn log_in(&self) -> Answer<'_, ()> {
        Box::pin(SmsdClient::log_in(self))
    }

    fn close(&self) -> BoxFuture<'_, ()> {
        Box::pin(SmsdClient::close(self))
    }

    fn sent_for(&self, step: Step) -> Answer<'_, Vec<String>> {
        Box::pin(self.requests_for(step))
    }

    fn check_readable(&self, reg: Reg) -> Result<(), Error> {
        let row = reg.info();
        match row.access {
            Access::Read | Access::ReadWrite => Ok(()),
            Access::Secret => Err(Error::Usage(format!("{} is secret and reads as 0", row.name))),
            Access::Trigger => {
                Err(Error::Usage(format!("{} is done, and tells nothing when it is read", row.name)))
            }
        }
    }

    fn read_at(&self, reg: Reg, index: u16) -> Answer<'_, i64> {
        Box::pin(SmsdClient::read_at(self, reg, index))
    }

    fn read_row(&self, reg: Reg) -> Answer<'_, Vec<i64>> {
        Box::pin(SmsdClient::read_row(self, reg))
    }

    fn read_many<'a>(&'a self, regs: &'a [Reg]) -> Answer<'a, Vec<i64>> {
        Box::pin(SmsdClient::read_many(self, regs))
    }

    fn read_all(&self) -> Answer<'_, Vec<Reading>> {
        Box::pin(SmsdClient::read_all(self))
    }

    fn write_at(&self, reg: Reg, index: u16, value: i64) -> Answer<'_, ()> {
        Box::pin(SmsdClient::write_at(self, reg, index, value))
    }

    fn write_many<'a>(&'a self, values: &'a [(Reg, i64)]) -> Answer<'a, ()> {
        Box::pin(SmsdClient::write_many(self, values))
    }

    fn identity(&self) -> Answer<'_, Identity> {
        Box::pin(SmsdClient::identity(self))
    }

    fn snapshot(&self) -> Answer<'_, Snapshot> {
        Box::pin(SmsdClient::snapshot(self))
    }

    fn program(&self) -> Answer<'_, ProgramState> {
        Box::pin(SmsdClient::program(self))
    }

    fn motor_configuration(&self) -> Answer<'_, MotorConfiguration> {
        Box::pin(SmsdClient::motor_configuration(self))
    }

    fn set_motor_configuration<'a>(&'a self, motor: &'a MotorConfiguration) -> Answer<'a, ()> {
        Box::pin(SmsdClient::set_motor_configuration(self, motor))
    }

    fn change_password(&self, password: u64) -> Answer<'_, ()> {
        Box::pin(SmsdClient::change_password(self, password))
    }

    fn lan_parameters(&self) -> Answer<'_, LanParameters> {
        Box::pin(SmsdClient::lan_parameters(self))
    }

    fn configure_lan<'a>(&'a self, lan: &'a LanParameters) -> Answer<'a, ()> {
        Box::pin(self.write_and_apply(lan))
    }

    fn command(&self, opcode: Opcode, operand: Option<i64>) -> Answer<'_, ()> {
        Box::pin(SmsdClient::command(self, opcode, operand))
    }

    fn trigger(&self, coil: Reg) -> Answer<'_, ()> {
        Box::pin(SmsdClient::trigger(self, coil))
    }

    fn store_program_with<'a>(
        &'a self,
        area: u8,
        program: &'a [Instruction],
        progress: Progress<'a>,
    ) -> Answer<'a, ()> {
        Box::pin(SmsdClient::store_program_with(self, area, program, progress))
    }

    fn fetch_program_with<'a>(&'a self, area: u8, progress: Progress<'a>) -> Answer<'a, Vec<Instruction>> {
        Box::pin(SmsdClient::fetch_program_with(self, area, progress))
    }

    fn erase_program(&self, area: u8) -> Answer<'_, ()> {
        Box::pin(SmsdClient::erase_program(self, area))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_write_is_shown_as_its_pdu_and_in_words() {
        let text = |reg, value, order| pdu_text(reg, value, order).expect("it can be written");
        assert_eq!(text(Reg::Cmd, 0x12, WordOrder::LowFirst), "06 11 09 00 12  CMD = GO_TO_F");
        assert_eq!(
            text(Reg::TargetPos, -2, WordOrder::HighFirst),
            "10 11 06 00 02 04 FF FF FF FE  TARGET_POS = -2"
        );
    }
}
