//! The instructions of the controller, in one table: those of user programs (App. B) and those that the `CMD` register
//! takes (ch. 4.2), which are the same codes.

use core::fmt;

/// Instructions in one memory area (ch. 5).
pub const PROGRAM_LINES: usize = 255;
/// Memory areas (ch. 5).
pub const PROGRAM_AREAS: usize = 4;

/// What the 22 data bits of an instruction mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operand {
    /// Nothing; the bits are ignored.
    None,
    /// An unsigned number from `min` to `max`.
    Number {
        /// Lowest value allowed.
        min: u32,
        /// Highest value allowed.
        max: u32,
        /// Unit, as in `full step/s`; empty for a plain number.
        unit: &'static str,
    },
    /// A signed position or displacement in microsteps, -2^21 to 2^21 - 1.
    Position,
    /// An 8-bit mask of inputs.
    Mask,
    /// The number of an input, 0 to 7.
    Input,
    /// The motor configuration of `SET_MODE`.
    Mode,
    /// A line to jump to: bits 7:0 the instruction, 9:8 the memory area.
    Jump,
    /// A loop: bits 9:0 how many instructions, 19:10 how many cycles.
    Loop,
}

/// One row of the instruction table.
#[derive(Clone, Copy, Debug)]
pub struct OpcodeInfo {
    /// The instruction.
    pub opcode: Opcode,
    /// Its code, bits 9:4 of an instruction word.
    pub code: u8,
    /// The maker's name without the prefix `CMD_PowerSTEP01_`.
    pub name: &'static str,
    /// A second name under which the maker's documents have it; empty when there is none.
    pub alias: &'static str,
    /// What its data means.
    pub operand: Operand,
    /// `true` when it may stand in a user program.
    pub in_program: bool,
    /// `true` when the `CMD` register takes it.
    pub in_cmd: bool,
    /// What it does.
    pub about: &'static str,
}

const SPEED: Operand = Operand::Number { min: 15, max: 15_600, unit: "full step/s" };
const ACCELERATION: Operand = Operand::Number { min: 15, max: 59_000, unit: "full step/s²" };
const MILLISECONDS: Operand = Operand::Number { min: 0, max: 3_600_000, unit: "ms" };

/// Where an instruction is allowed: `P` in programs, `C` in the `CMD` register, `PC` in both, `U` over USB only.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Use {
    P,
    PC,
    U,
}

macro_rules! instructions {
    ($($(#[doc = $about:literal])+ $opcode:ident = $code:literal, $name:literal $(/ $alias:literal)?, $operand:expr, $use:ident;)+) => {
        /// An instruction of the controller. [`Opcode::info`] is its row of the table.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[repr(u8)]
        pub enum Opcode { $($(#[doc = $about])+ $opcode = $code,)+ }

        /// Every instruction, by code. The codes are 0x00 to 0x3E without gap.
        pub static INSTRUCTIONS: [OpcodeInfo; 63] = [$(OpcodeInfo {
            opcode: Opcode::$opcode,
            code: $code,
            name: $name,
            alias: concat!($($alias)?),
            operand: $operand,
            in_program: !matches!(Use::$use, Use::U),
            in_cmd: matches!(Use::$use, Use::PC),
            about: concat!($($about,)+).trim_ascii_start(),
        },)+];
    };
}

instructions! {
    /// Ends the program.
    End = 0x00, "END", Operand::None, P;
    /// Answers the speed.
    GetSpeed = 0x01, "GET_SPEED", Operand::None, U;
    /// Answers inputs, mask and waiting.
    StatusInEvent = 0x02, "STATUS_IN_EVENT", Operand::None, U;
    /// Sets the motor configuration; the phases must be de-energised.
    SetMode = 0x03, "SET_MODE", Operand::Mode, P;
    /// Answers the motor configuration.
    GetMode = 0x04, "GET_MODE", Operand::None, U;
    /// Sets `MIN_SPEED`; the motor must stand.
    SetMinSpeed = 0x05, "SET_MIN_SPEED", Operand::Number { min: 0, max: 950, unit: "full step/s" }, P;
    /// Sets `MAX_SPEED`.
    SetMaxSpeed = 0x06, "SET_MAX_SPEED", Operand::Number { min: 16, max: 15_600, unit: "full step/s" }, P;
    /// Sets `ACC`; the motor must stand.
    SetAcc = 0x07, "SET_ACC", ACCELERATION, P;
    /// Sets `DEC`; the motor must stand.
    SetDec = 0x08, "SET_DEC", ACCELERATION, P;
    /// Sets `FS_SPEED`.
    SetFsSpeed = 0x09, "SET_FS_SPEED", SPEED, P;
    /// Sets the mask of input signals: 1 heeds the input, 0 ignores it.
    SetMaskEvent = 0x0A, "SET_MASK_EVENT", Operand::Mask, P;
    /// Answers the position.
    GetAbsPos = 0x0B, "GET_ABS_POS", Operand::None, U;
    /// Answers the electrical position.
    GetElPos = 0x0C, "GET_EL_POS", Operand::None, U;
    /// Answers the status and clears the error flags.
    GetStatusAndClr = 0x0D, "GET_STATUS_AND_CLR", Operand::None, U;
    /// Turns forward at the given speed.
    RunF = 0x0E, "RUN_F", SPEED, PC;
    /// Turns backward at the given speed.
    RunR = 0x0F, "RUN_R", SPEED, PC;
    /// Moves forward by the given displacement; the motor must stand. A negative one goes backward.
    MoveF = 0x10, "MOVE_F", Operand::Position, PC;
    /// Moves backward by the given displacement; the motor must stand. A negative one goes forward.
    MoveR = 0x11, "MOVE_R", Operand::Position, PC;
    /// Goes forward to the given position.
    GoToF = 0x12, "GO_TO_F", Operand::Position, PC;
    /// Goes backward to the given position.
    GoToR = 0x13, "GO_TO_R", Operand::Position, PC;
    /// Turns forward at `MAX_SPEED` until the input signals, then brakes with `DEC`.
    GoUntilF = 0x14, "GO_UNTIL_F", Operand::Input, PC;
    /// Turns backward at `MAX_SPEED` until the input signals, then brakes with `DEC`.
    GoUntilR = 0x15, "GO_UNTIL_R", Operand::Input, PC;
    /// Turns forward until `SET_ZERO` signals, stops at once and takes the position as zero.
    ScanZeroF = 0x16, "SCAN_ZERO_F", SPEED, PC;
    /// Turns backward until `SET_ZERO` signals, stops at once and takes the position as zero.
    ScanZeroR = 0x17, "SCAN_ZERO_R", SPEED, PC;
    /// Turns forward until `IN1` signals, stops at once and remembers the position as the mark.
    ScanMarkF = 0x18, "SCAN_MARK_F" / "SCAN_LABEL_F", SPEED, PC;
    /// Turns backward until `IN1` signals, stops at once and remembers the position as the mark.
    ScanMarkR = 0x19, "SCAN_MARK_R" / "SCAN_LABEL_R", SPEED, PC;
    /// Goes to position zero the shorter way.
    GoZero = 0x1A, "GO_ZERO", Operand::None, PC;
    /// Goes to the mark the shorter way.
    GoMark = 0x1B, "GO_MARK" / "GO_LABEL", Operand::None, PC;
    /// Goes to the given position the shorter way.
    GoTo = 0x1C, "GO_TO", Operand::Position, PC;
    /// Takes the present position as zero.
    ResetPos = 0x1D, "RESET_POS", Operand::None, P;
    /// Resets the motor chip: de-energised, position zero, drive parameters as at power-up.
    ResetPowerstep01 = 0x1E, "RESET_POWERSTEP01", Operand::None, P;
    /// Brakes with `DEC` and holds.
    SoftStop = 0x1F, "SOFT_STOP", Operand::None, PC;
    /// Stops at once and holds.
    HardStop = 0x20, "HARD_STOP", Operand::None, PC;
    /// Brakes with `DEC` and de-energises.
    SoftHiZ = 0x21, "SOFT_HI_Z", Operand::None, PC;
    /// Stops at once and de-energises.
    HardHiZ = 0x22, "HARD_HI_Z", Operand::None, PC;
    /// Waits for the given time.
    SetWait = 0x23, "SET_WAIT", MILLISECONDS, P;
    /// Switches the relay on.
    SetRele = 0x24, "SET_RELE", Operand::None, P;
    /// Switches the relay off.
    ClrRele = 0x25, "CLR_RELE", Operand::None, P;
    /// Answers the state of the relay.
    GetRele = 0x26, "GET_RELE", Operand::None, U;
    /// Waits until `IN0` signals.
    WaitIn0 = 0x27, "WAIT_IN0", Operand::None, P;
    /// Waits until `IN1` signals.
    WaitIn1 = 0x28, "WAIT_IN1", Operand::None, P;
    /// Jumps.
    GotoProgram = 0x29, "GOTO_PROGRAM", Operand::Jump, P;
    /// Jumps if `IN0` signals.
    GotoProgramIfIn0 = 0x2A, "GOTO_PROGRAM_IF_IN0", Operand::Jump, P;
    /// Jumps if `IN1` signals.
    GotoProgramIfIn1 = 0x2B, "GOTO_PROGRAM_IF_IN1", Operand::Jump, P;
    /// Repeats the instructions that follow.
    LoopProgram = 0x2C, "LOOP_PROGRAM", Operand::Loop, P;
    /// Jumps and remembers where to return to.
    CallProgram = 0x2D, "CALL_PROGRAM", Operand::Jump, P;
    /// Returns behind the last `CALL_PROGRAM`.
    ReturnProgram = 0x2E, "RETURN_PROGRAM", Operand::None, P;
    /// Starts the program in memory 0.
    StartProgramMem0 = 0x2F, "START_PROGRAM_MEM0", Operand::None, PC;
    /// Starts the program in memory 1.
    StartProgramMem1 = 0x30, "START_PROGRAM_MEM1", Operand::None, PC;
    /// Starts the program in memory 2.
    StartProgramMem2 = 0x31, "START_PROGRAM_MEM2", Operand::None, PC;
    /// Starts the program in memory 3.
    StartProgramMem3 = 0x32, "START_PROGRAM_MEM3", Operand::None, PC;
    /// Stops the program; the motor goes on as it was.
    StopProgramMem = 0x33, "STOP_PROGRAM_MEM", Operand::None, PC;
    /// Hands the motor to the EN, STEP and DIR inputs.
    StepClock = 0x34, "STEP_CLOCK", Operand::None, U;
    /// Stops USB.
    StopUsb = 0x35, "STOP_USB", Operand::None, U;
    /// Answers `MIN_SPEED`.
    GetMinSpeed = 0x36, "GET_MIN_SPEED", Operand::None, U;
    /// Answers `MAX_SPEED`.
    GetMaxSpeed = 0x37, "GET_MAX_SPEED", Operand::None, U;
    /// Answers the running memory area and instruction.
    GetStack = 0x38, "GET_STACK", Operand::None, U;
    /// Jumps if the position is zero.
    GotoProgramIfZero = 0x39, "GOTO_PROGRAM_IF_ZERO", Operand::Jump, P;
    /// Jumps if `SET_ZERO` signals.
    GotoProgramIfInZero = 0x3A, "GOTO_PROGRAM_IF_IN_ZERO", Operand::Jump, P;
    /// Waits until `CONTINUE` signals.
    WaitContinue = 0x3B, "WAIT_CONTINUE", Operand::None, P;
    /// Waits for the given time, or until `IN0`, `IN1` or `SET_ZERO` signals.
    SetWait2 = 0x3C, "SET_WAIT_2", MILLISECONDS, P;
    /// Turns forward until `IN1` signals, remembers that position as the mark and brakes with `DEC`.
    ScanMark2F = 0x3D, "SCAN_MARK2_F", SPEED, PC;
    /// Turns backward until `IN1` signals, remembers that position as the mark and brakes with `DEC`.
    ScanMark2R = 0x3E, "SCAN_MARK2_R", SPEED, PC;
}

impl Opcode {
    /// The instruction with this code; `None` above 0x3E.
    pub fn from_code(code: u16) -> Option<Opcode> {
        INSTRUCTIONS.get(usize::from(code)).map(|info| info.opcode)
    }

    /// The instruction that the `CMD` register takes under this code; `None` for a code that ch. 4.2 does not list.
    pub fn from_cmd(code: u16) -> Option<Opcode> {
        Opcode::from_code(code).filter(|opcode| opcode.info().in_cmd)
    }

    /// Its row of the table.
    pub fn info(self) -> &'static OpcodeInfo {
        let [first, ..] = &INSTRUCTIONS;
        // The codes are the indices, so the lookup always succeeds; a table test holds that.
        INSTRUCTIONS.get(usize::from(self.code())).unwrap_or(first)
    }

    /// Its code, 0x00 to 0x3E.
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// The maker's name.
    pub fn name(self) -> &'static str {
        self.info().name
    }
}

impl fmt::Display for Opcode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// Why a word is no instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotAnInstruction {
    /// One of the four reserved bits 3:0 is set.
    ReservedBits(u8),
    /// The code in bits 9:4 is not listed.
    UnknownCode(u8),
}

impl fmt::Display for NotAnInstruction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            NotAnInstruction::ReservedBits(bits) => write!(f, "the reserved bits 3:0 are {bits:#X}, not 0"),
            NotAnInstruction::UnknownCode(code) => write!(f, "instruction code {code:#04X} is not listed"),
        }
    }
}

impl core::error::Error for NotAnInstruction {}

/// An instruction as a program holds it: `SMSD_CMD_Type` (ch. 5).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Instruction {
    /// What to do.
    pub opcode: Opcode,
    /// The 22 data bits.
    pub data: u32,
}

impl Instruction {
    /// The instruction with a signed operand, cut to 22 bits.
    pub const fn with_position(opcode: Opcode, position: i32) -> Instruction {
        Instruction { opcode, data: position.cast_unsigned() & 0x3F_FFFF }
    }

    /// The instruction in a 32-bit word: bits 3:0 reserved, 9:4 code, 31:10 data.
    ///
    /// # Errors
    /// When a reserved bit is set or the code is not listed.
    pub fn from_word(word: u32) -> Result<Instruction, NotAnInstruction> {
        let [low, ..] = word.to_le_bytes();
        if low & 0xF != 0 {
            return Err(NotAnInstruction::ReservedBits(low & 0xF));
        }
        let code = (word >> 4 & 0x3F) as u8;
        match Opcode::from_code(u16::from(code)) {
            Some(opcode) => Ok(Instruction { opcode, data: word >> 10 }),
            None => Err(NotAnInstruction::UnknownCode(code)),
        }
    }

    /// The 32-bit word that holds the instruction. Data bits above the 22nd are dropped.
    pub const fn word(self) -> u32 {
        self.data << 10 | (self.opcode.code() as u32) << 4
    }

    /// The data as a signed number of 22 bits.
    pub const fn position(self) -> i32 {
        (self.data << 10).cast_signed() >> 10
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_code_of_every_instruction_is_its_place_in_the_table() {
        for (place, info) in INSTRUCTIONS.iter().enumerate() {
            assert_eq!(usize::from(info.code), place, "{}", info.name);
            assert_eq!(info.opcode.info().name, info.name);
            assert!(!info.about.is_empty(), "{}", info.name);
        }
    }

    #[test]
    fn names_and_aliases_are_unique() {
        let names =
            || INSTRUCTIONS.iter().flat_map(|info| [info.name, info.alias]).filter(|name| !name.is_empty());
        for name in names() {
            assert_eq!(names().filter(|other| *other == name).count(), 1, "{name}");
        }
    }

    #[test]
    fn the_cmd_register_takes_the_26_codes_of_chapter_4_2() {
        let taken = (0..=0xFF).filter(|code| Opcode::from_cmd(*code).is_some());
        let listed = (0x0E..=0x1C).chain(0x1F..=0x22).chain(0x2F..=0x33).chain(0x3D..=0x3E);
        assert!(taken.eq(listed));
    }

    #[test]
    fn the_worked_example_of_chapter_5_reads_as_set_max_speed_100() {
        let instruction = Instruction::from_word(0x0001_9060).expect("a listed instruction");
        assert_eq!(instruction, Instruction { opcode: Opcode::SetMaxSpeed, data: 100 });
        assert_eq!(instruction.word(), 0x0001_9060);
    }

    #[test]
    fn words_with_reserved_bits_or_unknown_codes_are_refused() {
        assert_eq!(Instruction::from_word(0x0001_9061), Err(NotAnInstruction::ReservedBits(1)));
        assert_eq!(Instruction::from_word(0x3F0), Err(NotAnInstruction::UnknownCode(0x3F)));
    }

    #[test]
    fn positions_are_signed_numbers_of_22_bits() {
        let lowest = Instruction::with_position(Opcode::GoTo, -2_097_152);
        assert_eq!(lowest.word().to_le_bytes(), [0xC0, 0x01, 0x00, 0x80]);
        assert_eq!(lowest.position(), -2_097_152);
        assert_eq!(Instruction::with_position(Opcode::MoveF, -1).position(), -1);
        assert_eq!(Instruction::with_position(Opcode::MoveF, 3200).position(), 3200);
    }
}
