//! The register map (App. A, with ch. 3 to 5): every address a client may touch, in one table.
//!
//! Addresses are those of the PDU and equal the hexadecimal numbers that the maker prints (decision 1). A value of 32
//! bits fills two registers, its low word at the lower address (decision 2; a rig may turn that round).

use super::models::Model;
use super::ring;
use crate::modbus::Table;
use Table::{Coils, DiscreteInputs, HoldingRegisters, InputRegisters};

/// How a value lies in its addresses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// One bit.
    Bit,
    /// One word, unsigned.
    U16,
    /// Two words, unsigned.
    U32,
    /// Two words, two's complement.
    I32,
}

impl Kind {
    /// How many addresses one value takes.
    pub const fn width(self) -> u16 {
        match self {
            Kind::Bit | Kind::U16 => 1,
            Kind::U32 | Kind::I32 => 2,
        }
    }
}

/// What a client may do with a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Read only.
    Read,
    /// Read and write.
    ReadWrite,
    /// Write; reads as 0.
    Secret,
    /// A coil that acts when TRUE is written and reads as FALSE.
    Trigger,
}

/// What must hold for a write to be taken (decision 7). Otherwise it is refused with exception 06.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Writable {
    /// Nothing.
    Always,
    /// The motor stands still.
    Stopped,
    /// The phases are de-energised.
    HiZ,
}

/// The values that a write may carry. Others are refused with exception 03 (decision 6).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Limits {
    /// Whatever fits.
    Any,
    /// From the first to the second.
    Within(i64, i64),
    /// From the first to the second; on the SMSD-4.2LAN and on the SMSD-8.0LAN.
    ByModel((i64, i64), (i64, i64)),
    /// The codes that [`super::instructions::Opcode::from_cmd`] knows.
    Commands,
}

/// One row of the register map: one register, or several of a kind that follow each other.
#[derive(Clone, Copy, Debug)]
pub struct Register {
    /// Which register.
    pub id: Reg,
    /// The maker's name; `{}` stands for the number within the row where `count` is over 1.
    pub name: &'static str,
    /// The table it stands in.
    pub table: Table,
    /// Its first address.
    pub address: u16,
    /// How a value lies in it.
    pub kind: Kind,
    /// How many values of this kind follow each other.
    pub count: u16,
    /// What a client may do.
    pub access: Access,
    /// `true` when this may be done before authorisation (decision 4).
    pub open: bool,
    /// When it may be written.
    pub writable: Writable,
    /// Which values may be written.
    pub limits: Limits,
    /// Unit of the value, as in `full step/s`; empty for a plain number.
    pub unit: &'static str,
    /// `true` when the maker shows it in hexadecimal.
    pub hex: bool,
    /// Its value at power-up, or from the factory when it is `stored`.
    pub default: i64,
    /// `true` when it survives power-off.
    pub stored: bool,
    /// What it is.
    pub about: &'static str,
    /// Where that is written.
    pub source: &'static str,
    /// The reading we chose where the maker's text leaves one open; empty when it does not.
    pub note: &'static str,
}

impl Register {
    /// The row that holds `address` of `table`; `None` when it is not listed.
    #[inline]
    pub fn at(table: Table, address: u16) -> Option<&'static Register> {
        let after = REGISTERS.partition_point(|row| (row.table, row.address) <= (table, address));
        let row = REGISTERS.get(after.checked_sub(1)?)?;
        (row.table == table && address < row.end()).then_some(row)
    }

    /// The first address behind the row.
    pub const fn end(&self) -> u16 {
        self.address + self.count * self.kind.width()
    }

    /// The lowest and highest value that may be written on `model`.
    pub const fn range(&self, model: Model) -> (i64, i64) {
        match (self.limits, self.kind) {
            (Limits::Within(min, max), _) => (min, max),
            (Limits::ByModel(small, large), _) => match model {
                Model::Smsd42 => small,
                Model::Smsd80 => large,
            },
            (Limits::Any | Limits::Commands, Kind::Bit) => (0, 1),
            (Limits::Any | Limits::Commands, Kind::U16) => (0, u16::MAX as i64),
            (Limits::Any | Limits::Commands, Kind::U32) => (0, u32::MAX as i64),
            (Limits::Any | Limits::Commands, Kind::I32) => (i32::MIN as i64, i32::MAX as i64),
        }
    }

    const fn new(table: Table, address: u16, kind: Kind, name: &'static str, access: Access) -> Register {
        Register {
            id: Reg::Clr,
            name,
            table,
            address,
            kind,
            count: 1,
            access,
            open: false,
            writable: Writable::Always,
            limits: Limits::Any,
            unit: "",
            hex: false,
            default: 0,
            stored: false,
            about: "",
            source: "",
            note: "",
        }
    }

    const fn count(self, count: u16) -> Register {
        Register { count, ..self }
    }

    const fn within(self, min: i64, max: i64) -> Register {
        Register { limits: Limits::Within(min, max), ..self }
    }

    const fn limits(self, limits: Limits) -> Register {
        Register { limits, ..self }
    }

    const fn unit(self, unit: &'static str) -> Register {
        Register { unit, ..self }
    }

    const fn default(self, default: i64) -> Register {
        Register { default, ..self }
    }

    const fn when(self, writable: Writable) -> Register {
        Register { writable, ..self }
    }

    const fn stored(self) -> Register {
        Register { stored: true, ..self }
    }

    const fn open(self) -> Register {
        Register { open: true, ..self }
    }

    const fn hex(self) -> Register {
        Register { hex: true, ..self }
    }

    const fn source(self, source: &'static str) -> Register {
        Register { source, ..self }
    }

    const fn note(self, note: &'static str) -> Register {
        Register { note, ..self }
    }
}

const fn trigger(address: u16, name: &'static str) -> Register {
    Register::new(Coils, address, Kind::Bit, name, Access::Trigger)
}

const fn coil(address: u16, name: &'static str) -> Register {
    Register::new(Coils, address, Kind::Bit, name, Access::ReadWrite)
}

const fn discrete(address: u16, name: &'static str) -> Register {
    Register::new(DiscreteInputs, address, Kind::Bit, name, Access::Read)
}

const fn input(address: u16, kind: Kind, name: &'static str) -> Register {
    Register::new(InputRegisters, address, kind, name, Access::Read)
}

const fn holding(address: u16, kind: Kind, name: &'static str) -> Register {
    Register::new(HoldingRegisters, address, kind, name, Access::ReadWrite)
}

const fn secret(address: u16, kind: Kind, name: &'static str) -> Register {
    Register::new(HoldingRegisters, address, kind, name, Access::Secret)
}

const STEPS_PER_S: &str = "full step/s";
const STEPS_PER_S2: &str = "full step/s²";
const FLAG_SOURCE: &str = "ch. 4.3";
const COIL_SOURCE: &str = "ch. 4.2";
const PROGRAM_SOURCE: &str = "ch. 5";
const LAN_SOURCE: &str = "App. A, LAN parameters";
const ID_SOURCE: &str = "App. A, version and identification";
const LAN_NOTE: &str = "takes effect at Apply Network Configuration (decision 13)";

/// Builds the enum of registers and the table from one list; every entry is `/// what it is`, then `Id => row;`.
macro_rules! registers {
    ($($(#[doc = $about:literal])+ $id:ident => $row:expr;)+) => {
        /// A register of the map. [`Reg::info`] is its row.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[repr(u8)]
        pub enum Reg { $($(#[doc = $about])+ $id,)+ }

        /// How many rows the map has.
        const ROWS: usize = [$(Reg::$id,)+].len();

        /// The register map, sorted by table and address.
        pub static REGISTERS: [Register; ROWS] = [$(
            Register { id: Reg::$id, about: concat!($($about,)+).trim_ascii_start(), ..$row },
        )+];
    };
}

registers! {
    /// Clears the flags `CMD_ERROR` and `SW_EVN`.
    Clr => trigger(0x1400, "CLR").source(COIL_SOURCE);
    /// Takes the present position as zero.
    ResetPos => trigger(0x1401, "Reset Pos").source(COIL_SOURCE);
    /// Resets the motor chip, but not the controller.
    ResetPowerstep01 => trigger(0x1402, "Reset powerSTEP01").source(COIL_SOURCE)
        .note("always accepted; HiZ, position 0, MIN_SPEED to FS_SPEED as at power-up (decision 21)");
    /// Brakes with `DEC` and holds.
    SoftStop => trigger(0x1403, "Soft STOP").source(COIL_SOURCE);
    /// Stops at once and holds.
    HardStop => trigger(0x1404, "Hard STOP").source(COIL_SOURCE);
    /// Brakes with `DEC` and de-energises.
    SoftHiZ => trigger(0x1405, "Soft HiZ").source(COIL_SOURCE);
    /// Stops at once and de-energises.
    HardHiZ => trigger(0x1406, "Hard HiZ").source(COIL_SOURCE);
    /// The relay output.
    Relay => coil(0x1407, "Relay").source("ch. 4.4");
    /// A `MEM_CMD` procedure has ended. The host clears it; only the controller sets it.
    BComplete => coil(0x3400, "B_COMPLETE").source(PROGRAM_SOURCE).note("writing TRUE is ignored (decision 9)");
    /// Stores the LAN parameters and puts them into effect.
    ApplyNetworkConfiguration => trigger(0x7400, "Apply Network Configuration").source(LAN_SOURCE);

    /// The motor's phases are de-energised.
    HiZ => discrete(0x1200, "HiZ").default(1).source(FLAG_SOURCE);
    /// The motor stands still.
    Stop => discrete(0x1201, "STOP").default(1).source(FLAG_SOURCE);
    /// The motor turns at constant speed.
    ConstSpeed => discrete(0x1202, "CONST_SPEED").source(FLAG_SOURCE);
    /// The motor gains speed.
    AccFlag => discrete(0x1203, "ACC").source(FLAG_SOURCE);
    /// The motor loses speed.
    DecFlag => discrete(0x1204, "DEC").source(FLAG_SOURCE);
    /// The last motion command has been carried out.
    Ready => discrete(0x1205, "READY").default(1).source(FLAG_SOURCE);
    /// The SW contact is closed.
    SwF => discrete(0x1206, "SW_F").source(FLAG_SOURCE).note("state of the contact, closed = 1");
    /// The SW contact has closed since `CLR`.
    SwEvn => discrete(0x1207, "SW_EVN").source(FLAG_SOURCE)
        .note("ASSUMED: a flag only; the chip's own stop on SW is switched off");
    /// The last direction was forward.
    DirFlag => discrete(0x1208, "DIR").default(1).source(FLAG_SOURCE);
    /// A command was refused since `CLR`.
    CmdError => discrete(0x1209, "CMD_ERROR").source(FLAG_SOURCE);
    /// This connection is authorised.
    AccessFlag => discrete(0x2200, "Access").open().source("ch. 3");
    /// A user program runs.
    ProgramRun => discrete(0x3200, "PROGRAM_RUN").source(FLAG_SOURCE);

    /// Present speed.
    Speed => input(0x1000, Kind::U16, "SPEED").unit(STEPS_PER_S).source(FLAG_SOURCE)
        .note("ASSUMED: the exact speed, rounded; the chip may show wrong values at low speed");
    /// Present position.
    AbsPos => input(0x1001, Kind::I32, "ABS_POS").unit("microstep").source(FLAG_SOURCE);
    /// Electrical position: bits 8:7 full step, 6:0 microstep in 1/128.
    ElPos => input(0x1003, Kind::U16, "EL_POS").hex().source(FLAG_SOURCE);
    /// The status word, decoded in discrete inputs 0x1200 to 0x1209.
    StatusWord => input(0x1004, Kind::U16, "STATUS").hex().default(0x13).source(FLAG_SOURCE)
        .note("low byte of the powerSTEP01's status, upper byte 0 (decision 14)");
    /// Present level of the inputs, one bit each.
    Inputs => input(0x1005, Kind::U16, "Inputs").hex().source("ch. 4.4")
        .note("1 = signal present; bit numbers are decision 15");
    /// The program that autonomous mode runs, set at the front panel.
    ModeNPrograms => input(0x3000, Kind::U16, "MODE_N_PROGRAMS").stored().source(FLAG_SOURCE);
    /// The memory area of the running program.
    NProgram => input(0x3001, Kind::U16, "N_PROGRAM").source(FLAG_SOURCE);
    /// The line of the running program.
    NCommand => input(0x3002, Kind::U16, "N_COMMAND").source(FLAG_SOURCE);
    /// Device ID: 6 for the SMSD-4.2LAN, 7 for the SMSD-8.0LAN.
    HwMajor => input(0x8001, Kind::U16, "HW_MAJOR").open().default(6).source(ID_SOURCE);
    /// Hardware version.
    HwVer => input(0x8002, Kind::U16, "HW_VER").open().default(1).source(ID_SOURCE);
    /// Firmware version, before the point.
    FwMajor => input(0x8003, Kind::U16, "FW_MAJOR").open().default(1).source(ID_SOURCE);
    /// Firmware version, behind the point.
    FwMinor => input(0x8004, Kind::U16, "FW_MINOR").open().default(3).source(ID_SOURCE);
    /// Register map version, before the point.
    RmMajor => input(0x8007, Kind::U16, "RM_MAJOR").open().default(4).source(ID_SOURCE);
    /// Register map version, behind the point.
    RmMinor => input(0x8008, Kind::U16, "RM_MINOR").open().default(3).source(ID_SOURCE);

    /// Speed at which every ramp starts and ends.
    MinSpeed => holding(0x1100, Kind::U16, "MIN_SPEED").within(0, 950).unit(STEPS_PER_S).when(Writable::Stopped)
        .source("ch. 4.2").note("ASSUMED default (decision 16)");
    /// Highest speed.
    MaxSpeed => holding(0x1101, Kind::U16, "MAX_SPEED").within(16, 15_600).unit(STEPS_PER_S).default(1000)
        .source("ch. 4.2").note("may be written in motion; the motor goes to the new limit (decision 20). ASSUMED default");
    /// Acceleration.
    Acc => holding(0x1102, Kind::U16, "ACC").within(15, 59_000).unit(STEPS_PER_S2).default(1000)
        .when(Writable::Stopped).source("ch. 4.2").note("ASSUMED default (decision 16)");
    /// Deceleration.
    Dec => holding(0x1103, Kind::U16, "DEC").within(15, 59_000).unit(STEPS_PER_S2).default(1000)
        .when(Writable::Stopped).source("ch. 4.2").note("ASSUMED default (decision 16)");
    /// Speed above which the motor is driven in full steps.
    FsSpeed => holding(0x1104, Kind::U16, "FS_SPEED").within(15, 15_600).unit(STEPS_PER_S).default(15_600)
        .source("ch. 4.2").note("ASSUMED default (decision 16)");
    /// Speed of `RUN` and of the scans.
    TargetSpeed => holding(0x1105, Kind::U16, "TARGET_SPEED").within(15, 15_600).unit(STEPS_PER_S).default(16)
        .source("ch. 4.2").note("15 is accepted as RUN does (decision 8). ASSUMED default: the slowest that the manual allows");
    /// Displacement of `MOVE`, target of `GO_TO`.
    TargetPos => holding(0x1106, Kind::I32, "TARGET_POS").within(ring::MIN as i64, ring::MAX as i64).unit("microstep")
        .source("ch. 4.2").note("written in halves it is checked when it is used (decision 6)");
    /// Input that `GO_UNTIL` waits for, 0 to 7.
    TargetInput => holding(0x1108, Kind::U16, "TARGET_INPUT").source("ch. 4.2")
        .note("the manual gives no range; checked when it is used (decision 8)");
    /// Writing a code carries out a command; reads as the last code accepted.
    Cmd => holding(0x1109, Kind::U16, "CMD").hex().limits(Limits::Commands).source("ch. 4.2")
        .note("a command that cannot be carried out now sets CMD_ERROR (decision 8)");
    /// Control type: 0 voltage, 1 current.
    CurrentOrVoltage => holding(0x110A, Kind::U16, "CURRENT_OR_VOLTAGE").within(0, 1).default(1).when(Writable::HiZ)
        .stored().source("ch. 4.1");
    /// Motor in voltage control.
    MotorType => holding(0x110B, Kind::U16, "MOTOR_TYPE").limits(Limits::ByModel((0, 45), (0, 54)))
        .when(Writable::HiZ).stored().source("ch. 4.1");
    /// Microstep mode: 0 to 7 for 1 to 1/128.
    Microstepping => holding(0x110C, Kind::U16, "MICROSTEPPING").hex().within(0, 7).default(4).when(Writable::HiZ)
        .stored().source("ch. 4.1").note("the position number is kept when it changes (decision 20)");
    /// Operating current.
    WorkCurrent => holding(0x110D, Kind::U16, "WORK_CURRENT").limits(Limits::ByModel((1, 42), (1, 80))).unit("0.1 A")
        .default(10).when(Writable::HiZ).stored().source("ch. 4.1");
    /// Holding current: 0 to 3 for 25, 50, 75, 100 % of the operating current.
    StopCurrent => holding(0x110E, Kind::U16, "STOP_CURRENT").within(0, 3).default(1).when(Writable::HiZ).stored()
        .source("ch. 4.1");
    /// Mask of the inputs: 1 heeds a signal, 0 ignores it.
    Mask => holding(0x110F, Kind::U16, "Mask").hex().within(0, 0xFF).default(0xFF).source("ch. 4.4")
        .note("ASSUMED default (decision 15)");
    /// The inputs that a command or program waits for.
    Wait => holding(0x1110, Kind::U16, "Wait").hex().source("ch. 4.4").note("writing is accepted and ignored (decision 15)");
    /// Low half of the password.
    PasswordLow32 => secret(0x2100, Kind::U32, "Password_LOW32").hex().open().default(0x89AB_CDEF).stored()
        .source("ch. 3").note("reads as 0 (decision 4)");
    /// High half of the password.
    PasswordHigh32 => secret(0x2102, Kind::U32, "Password_HIGH32").hex().open().default(0x0123_4567).stored()
        .source("ch. 3").note("reads as 0 (decision 4)");
    /// 0: authorise with the password; 1: change the password to it.
    PasswordCmd => secret(0x2104, Kind::U16, "Password_CMD").within(0, 1).open().source("ch. 3")
        .note("1 needs an authorised connection (decision 5)");
    /// Buffer of instructions on their way to or from a memory area.
    CmdBuffer => holding(0x3100, Kind::U32, "CMD {}").count(32).hex().source(PROGRAM_SOURCE);
    /// Memory area, 0 to 3.
    NProg => holding(0x3180, Kind::U16, "N_PROG").source(PROGRAM_SOURCE).note("checked at MEM_CMD (decision 10)");
    /// First line to read or write.
    NStr => holding(0x3181, Kind::U16, "N_STR").source(PROGRAM_SOURCE).note("checked at MEM_CMD (decision 10)");
    /// How many instructions to read or write, 1 to 32.
    SectorSize => holding(0x3182, Kind::U16, "SECTOR_SIZE").source(PROGRAM_SOURCE).note("checked at MEM_CMD (decision 10)");
    /// Size of the whole program, 0 to 255.
    ProgSize => holding(0x3183, Kind::U16, "PROG_SIZE").source(PROGRAM_SOURCE).note("checked at MEM_CMD (decision 10)");
    /// Runs a procedure: 0 read, 1 write, 2 erase, 3 read the size, 4 write the size.
    MemCmd => holding(0x3184, Kind::U16, "MEM_CMD").within(0, 4).source(PROGRAM_SOURCE)
        .note("exception 06 while one runs (decision 10)");
    /// Modbus unit identifier.
    LanId => holding(0x7000, Kind::U16, "ID").within(1, 247).default(1).stored().source(LAN_SOURCE).note(LAN_NOTE);
    /// MAC address, one octet a register.
    LanMac => holding(0x7001, Kind::U16, "MAC {}").count(6).within(0, 255).hex().stored().source(LAN_SOURCE)
        .note("default 00 F8 DC 3F 00 00, first octet as in App. A");
    /// IP address.
    LanIp => holding(0x7007, Kind::U16, "IP {}").count(4).within(0, 255).stored().source(LAN_SOURCE)
        .note("default 192.168.1.2; the virtual controller keeps the address that its rig gives");
    /// Subnet mask.
    LanSubnetMask => holding(0x700B, Kind::U16, "Subnet Mask {}").count(4).within(0, 255).stored().source(LAN_SOURCE)
        .note("default 255.255.0.0");
    /// Gateway.
    LanGateway => holding(0x700F, Kind::U16, "Gateway IP {}").count(4).within(0, 255).stored().source(LAN_SOURCE)
        .note("default 192.168.1.1");
    /// DNS server.
    LanDns => holding(0x7013, Kind::U16, "DNS server IP Address {}").count(4).within(0, 255).stored().source(LAN_SOURCE)
        .note("default 0.0.0.0");
    /// TCP port.
    LanPort => holding(0x7017, Kind::U16, "Port").within(1, 65_535).default(502).stored().source(LAN_SOURCE)
        .note("until it is changed it reads as the port that the rig listens on");
    /// Addressing: 1 static, 2 DHCP.
    LanDhcp => holding(0x7018, Kind::U16, "DHCP").within(1, 2).default(1).stored().source(LAN_SOURCE).note(LAN_NOTE);
}

impl Reg {
    /// Its row of the table.
    pub fn info(self) -> &'static Register {
        let [first, ..] = &REGISTERS;
        // The enum numbers the rows, so the lookup always succeeds; a table test holds that.
        REGISTERS.get(usize::from(self as u8)).unwrap_or(first)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::vec::Vec;

    #[test]
    fn rows_are_sorted_and_do_not_overlap() {
        for pair in REGISTERS.windows(2) {
            let [left, right] = pair else { unreachable!("windows of two") };
            assert!(
                (left.table, left.address) < (right.table, right.address),
                "{} {}",
                left.name,
                right.name
            );
            assert!(left.table != right.table || left.end() <= right.address, "{} {}", left.name, right.name);
        }
    }

    #[test]
    fn every_row_is_documented_and_found_by_its_id_and_address() {
        for row in &REGISTERS {
            assert!(!row.about.is_empty() && !row.source.is_empty(), "{}", row.name);
            assert_eq!(row.id.info().name, row.name);
            for address in row.address..row.end() {
                let found = Register::at(row.table, address).expect("listed");
                assert_eq!(found.id, row.id, "{address:04X}");
            }
        }
    }

    #[test]
    fn defaults_and_ranges_fit_their_kind() {
        for row in &REGISTERS {
            for model in Model::ALL {
                let (min, max) = row.range(model);
                let whole = Register { limits: Limits::Any, ..*row }.range(model);
                assert!(min <= max && whole.0 <= min && max <= whole.1, "{}", row.name);
                let listed = !matches!(row.id, Reg::LanPort | Reg::Cmd);
                assert!(!listed || (min..=max).contains(&row.default), "{}", row.name);
            }
            assert_eq!(row.kind == Kind::Bit, row.table.is_bits(), "{}", row.name);
            assert!(row.access == Access::Read || !matches!(row.table, DiscreteInputs | InputRegisters));
        }
    }

    #[test]
    fn the_ranges_of_listed_addresses_are_those_of_appendix_a() {
        let mut ranges: Vec<(Table, u16, u16)> = Vec::new();
        for row in &REGISTERS {
            match ranges.last_mut() {
                Some(last) if last.0 == row.table && last.2 == row.address => last.2 = row.end(),
                _ => ranges.push((row.table, row.address, row.end())),
            }
        }
        let listed = [
            (Coils, 0x1400, 0x1408),
            (Coils, 0x3400, 0x3401),
            (Coils, 0x7400, 0x7401),
            (DiscreteInputs, 0x1200, 0x120A),
            (DiscreteInputs, 0x2200, 0x2201),
            (DiscreteInputs, 0x3200, 0x3201),
            (InputRegisters, 0x1000, 0x1006),
            (InputRegisters, 0x3000, 0x3003),
            (InputRegisters, 0x8001, 0x8005),
            (InputRegisters, 0x8007, 0x8009),
            (HoldingRegisters, 0x1100, 0x1111),
            (HoldingRegisters, 0x2100, 0x2105),
            (HoldingRegisters, 0x3100, 0x3140),
            (HoldingRegisters, 0x3180, 0x3185),
            (HoldingRegisters, 0x7000, 0x7019),
        ];
        assert_eq!(ranges, listed);
    }

    #[test]
    fn addresses_in_the_gaps_are_not_listed() {
        for (table, address) in [
            (InputRegisters, 0x8000),
            (InputRegisters, 0x8005),
            (HoldingRegisters, 0x3140),
            (HoldingRegisters, 0x317F),
            (HoldingRegisters, 0x1000),
            (InputRegisters, 0x1100),
            (Coils, 0),
            (HoldingRegisters, 0xFFFF),
        ] {
            assert!(Register::at(table, address).is_none(), "{table:?} {address:04X}");
        }
    }

    #[test]
    fn limits_follow_the_model() {
        assert_eq!(Reg::WorkCurrent.info().range(Model::Smsd42), (1, 42));
        assert_eq!(Reg::WorkCurrent.info().range(Model::Smsd80), (1, 80));
        for model in Model::ALL {
            assert_eq!(Reg::MotorType.info().range(model).1, i64::from(model.max_motor_type()));
            assert_eq!(Reg::WorkCurrent.info().range(model).1, i64::from(model.max_work_current()));
        }
    }
}
