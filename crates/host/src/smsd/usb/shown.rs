//! What goes out for something, for people.

use super::client::SmsdUsbClient;
use super::commands::operand_register;
use super::registers::with_data;
use super::table::{Sink, sink};
use super::trouble::Asked;
use crate::Error;
use crate::smsd::commands::operand_of;
use crate::smsd::driver::Step;
use crate::smsd::value::{Slot, command};
use stepdrive_spec::smsd::instructions::{Instruction, Opcode, Operand};
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::standard::PacketType;

impl SmsdUsbClient {
    /// The packets for a step, each by its type and data: the rest of its header differs with every packet.
    pub(super) async fn packets_for(&self, step: Step) -> Result<Vec<String>, Error> {
        Ok(match step {
            Step::Command(opcode, operand) => {
                let instruction =
                    operand_of(opcode, operand)?.map_or(plain(opcode), |(_, value)| with_data(opcode, value));
                vec![text(instruction)]
            }
            Step::Write(reg, value) => self.packets_for_write(Slot::new(reg, 0)?, value).await?,
        })
    }

    async fn packets_for_write(&self, slot: Slot, value: i64) -> Result<Vec<String>, Error> {
        self.check_all(&[(slot, value)]).await?;
        Ok(match sink(slot.row.id) {
            Ok(Sink::Set(opcode)) => vec![text(with_data(opcode, value))],
            Ok(Sink::Switch(off, on)) => vec![text(plain(if value == 0 { off } else { on }))],
            Ok(Sink::Trigger(opcode)) => vec![text(plain(opcode))],
            Ok(Sink::Operand) => Vec::new(),
            Ok(Sink::Command) => vec![text(self.command_packet(value)?)],
            Ok(Sink::Mode(part)) => {
                let (mut mode, _) = self.mode(&Asked::read(slot)).await?;
                *part(&mut mode) = u16::try_from(value).unwrap_or(u16::MAX);
                let set = Instruction { opcode: Opcode::SetMode, data: mode.data() };
                vec![text(plain(Opcode::GetMode)), text(set)]
            }
            Ok(Sink::Lan | Sink::Apply) | Err(_) => {
                return Err(Error::Usage(format!("{slot} goes out with all LAN parameters, in one packet")));
            }
        })
    }

    fn command_packet(&self, code: i64) -> Result<Instruction, Error> {
        let opcode = command(code).unwrap_or(Opcode::End);
        let operand = operand_register(opcode).map(|reg: Reg| self.last_written(reg));
        Ok(operand_of(opcode, operand)?.map_or(plain(opcode), |(_, value)| with_data(opcode, value)))
    }
}

fn plain(opcode: Opcode) -> Instruction {
    Instruction { opcode, data: 0 }
}

/// An instruction as type and data of its packet, and what it says.
fn text(instruction: Instruction) -> String {
    let Instruction { opcode, data } = instruction;
    let [a, b, c, d] = instruction.word().to_le_bytes();
    let packet = format!("{:02X} {a:02X} {b:02X} {c:02X} {d:02X}", PacketType::Powerstep01.code());
    match opcode.info().operand {
        Operand::None => format!("{packet}  {opcode}"),
        Operand::Position => format!("{packet}  {opcode} {}", instruction.position()),
        Operand::Number { .. }
        | Operand::Mask
        | Operand::Input
        | Operand::Mode
        | Operand::Jump
        | Operand::Loop => format!("{packet}  {opcode} {data}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_instruction_is_shown_by_type_and_data_and_in_words() {
        assert_eq!(text(with_data(Opcode::SetMaxSpeed, 100)), "02 60 90 01 00  SET_MAX_SPEED 100");
        assert_eq!(text(with_data(Opcode::MoveF, -1)), "02 00 FD FF FF  MOVE_F -1");
        assert_eq!(text(plain(Opcode::HardStop)), "02 00 02 00 00  HARD_STOP");
    }
}
