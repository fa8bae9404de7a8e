//! The standard binary protocol: what the controller speaks over USB, and with its standard firmware over TCP (ch. 6).
//!
//! Sources in this file: "ch." as everywhere; "sheet" is the sheet of facts on the standard protocol, by its sections, which
//! stands where the maker's manual of the Modbus firmware refers to another manual.
//!
//! The bytes are the business of `stepdrive_proto::smsd`; here are the tables, and the vocabulary of requests and replies in
//! which that and the controller meet.

use super::instructions::{Opcode, PROGRAM_LINES};
use super::status::Status;
use arrayvec::ArrayVec;
use core::fmt;
use core::time::Duration;

/// Most bytes of data in a packet (sheet §2).
pub const MAX_DATA: usize = 1024;

/// TCP port of the standard firmware as it leaves the factory (sheet §9).
pub const STANDARD_PORT: u16 = 5000;

/// ASSUMED: the start of a packet that is left so long is dropped (decision 25).
pub const HALF_PACKET_TIMEOUT: Duration = Duration::from_millis(400);

/// Least time between two attempts to log in by this protocol, whatever became of the first, and from power-up to the
/// first; one that comes earlier is not looked at (sheet §5). ASSUMED: it does not start that time anew either.
pub const AUTHORISATION_REST: Duration = Duration::from_secs(1);

/// Protocol version of controllers made since 19 April 2018 (sheet §2).
pub const VERSION_2: u8 = 2;
/// Protocol version before; it has no instructions 0x3A to 0x3E (sheet §7).
pub const VERSION_1: u8 = 1;

/// What a controller runs, which decides what it speaks over LAN, and the form of its LAN parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Firmware {
    /// Modbus TCP over LAN; LAN parameters with the unit identifier (ch. 6).
    #[default]
    Modbus,
    /// The standard protocol over LAN too; LAN parameters without it (sheet §9).
    Standard,
}

impl Firmware {
    /// The size of the LAN parameters in bytes: 26 or 25.
    pub const fn lan_size(self) -> usize {
        match self {
            Firmware::Modbus => 26,
            Firmware::Standard => 25,
        }
    }
}

/// A row of the table of packet types.
#[derive(Debug)]
pub struct PacketTypeInfo {
    /// The type.
    pub packet_type: PacketType,
    /// `CMD_TYPE`.
    pub code: u8,
    /// The maker's name.
    pub name: &'static str,
    /// The data of a request.
    pub request: &'static str,
    /// The data of the reply to it.
    pub reply: &'static str,
}

macro_rules! packet_types {
    ($($(#[doc = $about:literal])+ $packet_type:ident = $code:literal, $name:literal, $request:literal, $reply:literal;)+) => {
        /// `CMD_TYPE` of a packet (sheet §4). [`PacketType::info`] is its row of the table.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[repr(u8)]
        pub enum PacketType { $($(#[doc = $about])+ $packet_type = $code,)+ }

        /// Every packet type, by code.
        pub static PACKET_TYPES: &[PacketTypeInfo] = &[$(PacketTypeInfo {
            packet_type: PacketType::$packet_type,
            code: $code,
            name: $name,
            request: $request,
            reply: $reply,
        },)+];
    };
}

packet_types! {
    /// Logs in. Over TCP the controller sends one without data first.
    Request = 0, "CODE_CMD_REQUEST", "password, 8 bytes", "RESPONSE with the status structure";
    /// What the controller answers with.
    Response = 1, "CODE_CMD_RESPONSE", "not for the host", "";
    /// Carries out one instruction.
    Powerstep01 = 2, "CODE_CMD_POWERSTEP01", "one instruction, 4 bytes", "POWERSTEP01 with the status structure; RESPONSE when it is refused";
    /// Writes memory area 0.
    WriteMem0 = 3, "CODE_CMD_POWERSTEP01_W_MEM0", "0 to 255 instructions, 4 bytes each", "RESPONSE with the status structure";
    /// Writes memory area 1.
    WriteMem1 = 4, "CODE_CMD_POWERSTEP01_W_MEM1", "0 to 255 instructions, 4 bytes each", "RESPONSE with the status structure";
    /// Writes memory area 2.
    WriteMem2 = 5, "CODE_CMD_POWERSTEP01_W_MEM2", "0 to 255 instructions, 4 bytes each", "RESPONSE with the status structure";
    /// Writes memory area 3.
    WriteMem3 = 6, "CODE_CMD_POWERSTEP01_W_MEM3", "0 to 255 instructions, 4 bytes each", "RESPONSE with the status structure";
    /// Reads memory area 0.
    ReadMem0 = 7, "CODE_CMD_POWERSTEP01_R_MEM0", "none", "the same type, the instructions of the program";
    /// Reads memory area 1.
    ReadMem1 = 8, "CODE_CMD_POWERSTEP01_R_MEM1", "none", "the same type, the instructions of the program";
    /// Reads memory area 2.
    ReadMem2 = 9, "CODE_CMD_POWERSTEP01_R_MEM2", "none", "the same type, the instructions of the program";
    /// Reads memory area 3.
    ReadMem3 = 10, "CODE_CMD_POWERSTEP01_R_MEM3", "none", "the same type, the instructions of the program";
    /// Sets the LAN parameters.
    ConfigSet = 11, "CODE_CMD_CONFIG_SET", "LAN parameters, 26 bytes (25 with the standard firmware)", "RESPONSE with the status structure";
    /// Answers the LAN parameters.
    ConfigGet = 12, "CODE_CMD_CONFIG_GET", "none", "the same type, LAN parameters, 26 bytes (25 with the standard firmware)";
    /// Changes the password.
    PasswordSet = 13, "CODE_CMD_PASSWORD_SET", "password, 8 bytes", "RESPONSE with the status structure";
    /// Answers the counters of errors.
    ErrorGet = 14, "CODE_CMD_ERROR_GET", "none", "the same type, 17 counters, 4 bytes each";
    /// Answers the versions of hardware, firmware and protocol. The maker has not described it.
    VersionGet = 16, "CODE_CMD_VERSION_GET", "none", "the same type, 9 bytes";
}

impl PacketType {
    /// The type with this code.
    pub fn from_code(code: u8) -> Option<PacketType> {
        PACKET_TYPES.iter().find(|info| info.code == code).map(|info| info.packet_type)
    }

    /// Its code.
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// Its row of the table.
    pub fn info(self) -> &'static PacketTypeInfo {
        let [first, ..] = PACKET_TYPES else { unreachable!("the table has rows") };
        PACKET_TYPES.iter().find(|info| info.packet_type == self).unwrap_or(first)
    }
}

macro_rules! codes {
    ($($(#[doc = $about:literal])+ $code:ident = $number:literal, $name:literal;)+) => {
        /// `ERROR_OR_COMMAND` of a reply: what became of the request, or what its value is (sheet §6).
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[repr(u8)]
        pub enum Code { $($(#[doc = $about])+ $code = $number,)+ }

        /// Every code with the maker's name and what it means, by number; the numbers are 0 to 23 without gap.
        pub static CODES: &[(Code, &str, &str)] = &[$((Code::$code, $name, concat!($($about,)+)),)+];
    };
}

codes! {
    /// Done.
    Ok = 0, "OK";
    /// Logged in.
    OkAccess = 1, "OK_ACCESS";
    /// The password is wrong, or nobody has logged in.
    ErrorAccess = 2, "ERROR_ACCESS";
    /// An attempt to log in came too early after the one before, or after power-up.
    ErrorAccessTimeout = 3, "ERROR_ACCESS_TIMEOUT";
    /// The checksum is wrong.
    ErrorXor = 4, "ERROR_XOR";
    /// There is no such packet type or instruction.
    ErrorNoCommand = 5, "ERROR_NO_COMMAND";
    /// The length is wrong.
    ErrorLen = 6, "ERROR_LEN";
    /// A value is out of its range.
    ErrorRange = 7, "ERROR_RANGE";
    /// The memory cannot be written now.
    ErrorWrite = 8, "ERROR_WRITE";
    /// The memory cannot be read.
    ErrorRead = 9, "ERROR_READ";
    /// A user program failed.
    ErrorPrograms = 10, "ERROR_PROGRAMS";
    /// Settings cannot be written.
    ErrorWriteSetup = 11, "ERROR_WRITE_SETUP";
    /// There is no next instruction.
    NoNext = 12, "NO_NEXT";
    /// The program has ended.
    EndPrograms = 13, "END_PROGRAMS";
    /// The value is inputs, mask and waiting.
    GetStatusInEvent = 14, "GET_STATUS_IN_EVENT";
    /// The value is the motor configuration.
    GetMode = 15, "GET_MODE";
    /// The value is the position.
    GetAbsPos = 16, "GET_ABS_POS";
    /// The value is the electrical position.
    GetElPos = 17, "GET_EL_POS";
    /// The value is the speed.
    GetSpeed = 18, "GET_SPEED";
    /// The value is `MIN_SPEED`.
    GetMinSpeed = 19, "GET_MIN_SPEED";
    /// The value is `MAX_SPEED`.
    GetMaxSpeed = 20, "GET_MAX_SPEED";
    /// The value is the running memory area and instruction.
    GetStack = 21, "GET_STACK";
    /// The relay is on.
    StatusReleSet = 22, "STATUS_RELE_SET";
    /// The relay is off.
    StatusReleClr = 23, "STATUS_RELE_CLR";
}

impl Code {
    /// The code with this number; `None` above 23.
    pub fn from_number(number: u8) -> Option<Code> {
        CODES.get(usize::from(number)).map(|(code, ..)| *code)
    }

    /// Its number, 0 to 23.
    pub const fn number(self) -> u8 {
        self as u8
    }

    /// The maker's name.
    pub fn name(self) -> &'static str {
        CODES.get(usize::from(self.number())).map_or("", |(_, name, _)| name)
    }

    /// What it means, in a sentence.
    pub fn about(self) -> &'static str {
        CODES.get(usize::from(self.number())).map_or("", |(.., about)| about.trim_ascii_start())
    }

    /// Whether it says that the request was not carried out.
    pub const fn is_error(self) -> bool {
        matches!(self as u8, 2..=11)
    }
}

impl fmt::Display for Code {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// The instructions that are answered with another code than [`Code::Ok`] once they are carried out (sheet §6 and §7).
static CODES_OF: [(Opcode, Code); 13] = [
    (Opcode::End, Code::EndPrograms),
    (Opcode::GetSpeed, Code::GetSpeed),
    (Opcode::StatusInEvent, Code::GetStatusInEvent),
    (Opcode::GetMode, Code::GetMode),
    (Opcode::GetAbsPos, Code::GetAbsPos),
    (Opcode::GetElPos, Code::GetElPos),
    (Opcode::SetRele, Code::StatusReleSet),
    (Opcode::ClrRele, Code::StatusReleClr),
    (Opcode::GetRele, Code::StatusReleClr),
    (Opcode::StopUsb, Code::EndPrograms),
    (Opcode::GetMinSpeed, Code::GetMinSpeed),
    (Opcode::GetMaxSpeed, Code::GetMaxSpeed),
    (Opcode::GetStack, Code::GetStack),
];

/// The code that an instruction is answered with once it is carried out. `GET_RELE` is answered with
/// [`Code::StatusReleSet`] instead while the relay is on.
pub fn code_of(opcode: Opcode) -> Code {
    CODES_OF.iter().find(|(other, _)| *other == opcode).map_or(Code::Ok, |(_, code)| *code)
}

/// Whether an instruction exists in a protocol version: 0x3A to 0x3E came with version 2 (sheet §7).
pub const fn exists_in(opcode: Opcode, version: u8) -> bool {
    version >= VERSION_2 || opcode.code() < Opcode::GotoProgramIfInZero.code()
}

/// How many counters of errors there are.
pub const COUNTERS: usize = 17;

macro_rules! counters {
    ($($(#[doc = $about:literal])+ $counter:ident, $name:literal;)+) => {
        /// A counter of `ERROR_GET` (sheet §10); its place is its number.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[repr(u8)]
        pub enum Counter { $($(#[doc = $about])+ $counter,)+ }

        /// Every counter with the maker's name and what it counts, in the order of the reply.
        pub static COUNTER_ROWS: [(Counter, &str, &str); COUNTERS] =
            [$((Counter::$counter, $name, concat!($($about,)+)),)+];
    };
}

counters! {
    /// How often the phases were energised.
    Starts, "N_STARTS";
    /// Failures of the quartz oscillator.
    Xt, "ERROR_XT";
    /// Packets that did not come to their end in time.
    TimeOut, "ERROR_TIME_OUT";
    /// Failures to start the motor chip.
    InitPowerstep01, "ERROR_INIT_POWERSTEP01";
    /// Failures to start the network chip.
    InitWiznet, "ERROR_INIT_WIZNET";
    /// Failures to start the memory.
    InitFram, "ERROR_INIT_FRAM";
    /// Connections that could not be served.
    Socket, "ERROR_SOCKET";
    /// Failures to write the memory.
    Fram, "ERROR_FRAM";
    /// Unexpected interrupts.
    Interrupt, "ERROR_INTERRUPT";
    /// Failures of the 5 V output.
    Extern5V, "ERROR_EXTERN_5V";
    /// Failures of the motor supply.
    ExternVdd, "ERROR_EXTERN_VDD";
    /// Shutdowns of the motor chip by its temperature.
    ThermalPowerstep01, "ERROR_THERMAL_POWERSTEP01";
    /// Overheatings of the brake resistor.
    ThermalBrake, "ERROR_THERMAL_BRAKE";
    /// Commands that the motor chip refused.
    CommandPowerstep01, "ERROR_COMMAND_POWERSTEP01";
    /// Undervoltage lockouts of the motor chip.
    UvloPowerstep01, "ERROR_UVLO_POWERSTEP01";
    /// Stalls that the motor chip noticed.
    StallPowerstep01, "ERROR_STALL_POWERSTEP01";
    /// Errors of user programs.
    WorkProgram, "ERROR_WORK_PROGRAM";
}

/// The LAN parameters as packets carry them (ch. 6, sheet §9). The values may be out of their ranges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LanParameters {
    /// MAC address.
    pub mac: [u8; 6],
    /// IP address.
    pub ip: [u8; 4],
    /// Subnet mask.
    pub subnet_mask: [u8; 4],
    /// Gateway.
    pub gateway: [u8; 4],
    /// DNS server.
    pub dns: [u8; 4],
    /// TCP port.
    pub port: u16,
    /// 1 static, 2 DHCP.
    pub dhcp: u8,
    /// Modbus unit identifier; `None` in the form of the standard firmware.
    pub id: Option<u8>,
}

/// The versions that [`PacketType::VersionGet`] answers. ASSUMED: the whole reply, after what the register map has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Versions {
    /// Hardware: the model's number and the version.
    pub hardware: [u16; 2],
    /// Firmware: major and minor.
    pub firmware: [u16; 2],
    /// Protocol: 1 or 2.
    pub protocol: u8,
}

/// The words of a program.
pub type Words = ArrayVec<u32, PROGRAM_LINES>;

/// What a host asks. Values are as they came; whether they are in range is for the controller to say.
#[derive(Clone, Debug, PartialEq, Eq)]
#[allow(
    clippy::large_enum_variant,
    reason = "there is one at a time, in place; boxing would need an allocator"
)]
pub enum Request {
    /// Log in with this password (the bytes of the wire little-endian).
    Authorise(u64),
    /// Carry out an instruction word (ch. 5).
    Command(u32),
    /// Put a program into memory area 0 to 3.
    WriteMemory {
        /// The area.
        area: u8,
        /// The instruction words.
        words: Words,
    },
    /// Answer the program in memory area 0 to 3.
    ReadMemory {
        /// The area.
        area: u8,
    },
    /// Set the LAN parameters and put them into effect.
    SetLan(LanParameters),
    /// Answer the LAN parameters.
    GetLan,
    /// Change the password.
    SetPassword(u64),
    /// Answer the counters of errors.
    GetErrors,
    /// Answer the versions.
    GetVersions,
}

impl Request {
    /// The type of the packet that carries it. Areas above 3 count as 3.
    pub const fn packet_type(&self) -> PacketType {
        match self {
            Request::Authorise(_) => PacketType::Request,
            Request::Command(_) => PacketType::Powerstep01,
            Request::WriteMemory { area: 0, .. } => PacketType::WriteMem0,
            Request::WriteMemory { area: 1, .. } => PacketType::WriteMem1,
            Request::WriteMemory { area: 2, .. } => PacketType::WriteMem2,
            Request::WriteMemory { .. } => PacketType::WriteMem3,
            Request::ReadMemory { area: 0 } => PacketType::ReadMem0,
            Request::ReadMemory { area: 1 } => PacketType::ReadMem1,
            Request::ReadMemory { area: 2 } => PacketType::ReadMem2,
            Request::ReadMemory { .. } => PacketType::ReadMem3,
            Request::SetLan(_) => PacketType::ConfigSet,
            Request::GetLan => PacketType::ConfigGet,
            Request::SetPassword(_) => PacketType::PasswordSet,
            Request::GetErrors => PacketType::ErrorGet,
            Request::GetVersions => PacketType::VersionGet,
        }
    }
}

/// The status structure of a reply, 7 bytes (sheet §6).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Answer {
    /// `STATUS_POWERSTEP01`.
    pub status: Status,
    /// `ERROR_OR_COMMAND`.
    pub code: Code,
    /// `RETURN_DATA`; 0 where there is nothing to tell.
    pub data: u32,
}

/// What a controller answers.
#[derive(Clone, Debug, PartialEq, Eq)]
#[allow(
    clippy::large_enum_variant,
    reason = "there is one at a time, in place; boxing would need an allocator"
)]
pub enum Reply {
    /// A packet of type RESPONSE.
    Response(Answer),
    /// A packet of type POWERSTEP01: an instruction was carried out.
    Powerstep01(Answer),
    /// The program in a memory area.
    Memory {
        /// The area, 0 to 3.
        area: u8,
        /// The instruction words.
        words: Words,
    },
    /// The LAN parameters.
    Lan(LanParameters),
    /// The counters of errors, in the order of [`COUNTER_ROWS`].
    Errors([u32; COUNTERS]),
    /// The versions.
    Versions(Versions),
}

/// A packet that carries no request, and what it is answered with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Malformed {
    /// The packet as such is wrong, or an attempt to log in has not the length of a password: [`Code::ErrorLen`] or
    /// [`Code::ErrorXor`], answered whoever is logged in.
    Packet(Code),
    /// Its content is wrong: an unknown type, or data of a length that the type does not have. Answered
    /// [`Code::ErrorAccess`] as long as nobody has logged in.
    Content(Code),
}

impl Malformed {
    /// What it is answered with once somebody has logged in.
    pub const fn code(self) -> Code {
        match self {
            Malformed::Packet(code) | Malformed::Content(code) => code,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::smsd::instructions::INSTRUCTIONS;

    #[test]
    fn codes_and_counters_stand_at_their_numbers() {
        for (place, (code, name, about)) in CODES.iter().enumerate() {
            assert_eq!((usize::from(code.number()), code.name()), (place, *name));
            assert!(about.ends_with('.'), "{name}");
        }
        for (place, (counter, ..)) in COUNTER_ROWS.iter().enumerate() {
            assert_eq!(*counter as usize, place);
        }
        assert_eq!(CODES.len(), 24);
    }

    #[test]
    fn packet_types_are_0_to_14_and_16() {
        assert!(PACKET_TYPES.iter().map(|info| info.code).eq((0..=14).chain([16])));
        for info in PACKET_TYPES {
            assert_eq!(PacketType::from_code(info.code), Some(info.packet_type));
            assert_eq!(info.packet_type.info().name, info.name);
        }
        assert_eq!((PacketType::from_code(15), PacketType::from_code(17)), (None, None));
    }

    #[test]
    fn version_1_ends_before_goto_program_if_in_zero() {
        let newer: [u8; 5] = [0x3A, 0x3B, 0x3C, 0x3D, 0x3E];
        for info in &INSTRUCTIONS {
            assert!(exists_in(info.opcode, VERSION_2));
            assert_eq!(exists_in(info.opcode, VERSION_1), !newer.contains(&info.code), "{}", info.name);
        }
    }

    #[test]
    fn errors_are_the_codes_2_to_11() {
        let errors = CODES.iter().filter(|(code, ..)| code.is_error()).map(|(code, ..)| code.number());
        assert!(errors.eq(2..=11));
    }
}
