//! What can be said of each word alone.

use super::Check;
use crate::diagnostic::{Code, Place};
use crate::fields::mode_is_listed;
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::{Instruction, Opcode, Operand};
use stepdrive_spec::smsd::mode::MotorConfiguration;
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::Reg;

/// Reports words that are no instructions, and instructions that stop the program because of what they are.
pub(super) fn check(check: &mut Check<'_>, model: Option<Model>) {
    for (place, word) in check.image.words() {
        match Instruction::from_word(word) {
            Err(error) => {
                let message = format!("0x{word:08X} is no instruction: {error}");
                let help = "a controller refuses to store it";
                check.warn(Code::NotAnInstruction, message, &[(place, "")], help);
            }
            Ok(instruction) if is_refused(instruction) => refused(check, place, instruction),
            Ok(instruction) => beyond_model(check, place, instruction, model),
        }
    }
}

/// `true` when the controller stops the program at this instruction whatever came before.
pub(super) fn is_refused(instruction: Instruction) -> bool {
    let Instruction { opcode, data } = instruction;
    let info = opcode.info();
    let operand_is_wrong = match info.operand {
        Operand::Number { min, max, .. } => !(min..=max).contains(&data),
        Operand::Input => u16::try_from(data).ok().and_then(Input::from_number).is_none(),
        Operand::Mode => !mode_is_listed(MotorConfiguration::from_data(data)),
        // The bits that these do not use are ignored.
        Operand::None | Operand::Position | Operand::Mask | Operand::Jump | Operand::Loop => false,
    };
    !info.in_program || operand_is_wrong
}

fn refused(check: &mut Check<'_>, place: Place, instruction: Instruction) {
    let name = instruction.opcode.name();
    let message = if instruction.opcode.info().in_program {
        format!("`{name}` with the data {} is refused, which stops the program", instruction.data)
    } else {
        format!("`{name}` cannot stand in a program, and stops it")
    };
    let help = "write the instruction by its name, and the assembler says what it takes";
    check.warn(Code::RefusedInstruction, message, &[(place, "the program stops here with an error")], help);
}

fn beyond_model(check: &mut Check<'_>, place: Place, instruction: Instruction, model: Option<Model>) {
    let Some(model) = model.filter(|_| instruction.opcode == Opcode::SetMode) else { return };
    let mode = MotorConfiguration::from_data(instruction.data);
    let above = |reg: Reg, value: u16| i64::from(value) > reg.info().range(model).1;
    if above(Reg::WorkCurrent, mode.work_current) {
        let max = model.max_work_current();
        let message = format!("the current is more than the {}.{} A of an {model}", max / 10, max % 10);
        check.warn(
            Code::BeyondModel,
            message,
            &[(place, "refused, which stops the program")],
            "choose a lower current",
        );
    } else if above(Reg::MotorType, mode.motor_type) {
        let message = format!("an {model} knows motors 0 to {}", model.max_motor_type());
        let help = "choose a motor of its table";
        check.warn(Code::BeyondModel, message, &[(place, "refused, which stops the program")], help);
    }
}
