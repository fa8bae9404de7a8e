//! `docs/smsd-usb-tables.md`: the packets of the SMSD's standard protocol, its codes and its counters.

use super::page;
use stepdrive_spec::smsd::instructions::{INSTRUCTIONS, Opcode, OpcodeInfo, Operand};
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::standard::{
    CODES, COUNTER_ROWS, Code, Firmware, PACKET_TYPES, STANDARD_PORT, VERSION_1, code_of, exists_in,
};

const ABOUT: &str = "\
What stands in the packets of the standard protocol; [smsd-usb.md](smsd-usb.md) says how they are framed and how the
controller behaves. Numbers are little-endian.";

const INSTRUCTIONS_ABOUT: &str = "
A POWERSTEP01 packet carries one instruction: bits 3:0 reserved and 0, bits 9:4 its code, bits 31:10 its data, of which
positions are signed. What the data may be and what each does is in [instructions.md](instructions.md).

- **Answered with**: the code once it is carried out. `RETURN_PROGRAM` never is, as there is nothing to return from. Data
  out of range: `ERROR_RANGE`.
- **Data**: whether it has any; those of the others are ignored.
- **Since**: the version of the protocol; before, it is answered with `ERROR_NO_COMMAND`.
";

const ANSWER_ABOUT: &str = "
`STATUS_POWERSTEP01`, 2 bytes; `ERROR_OR_COMMAND`, 1 byte; `RETURN_DATA`, 4 bytes, 0 where there is nothing to tell.
";

/// `STATUS_POWERSTEP01`, bit by bit (`stepdrive_spec::smsd::status`).
const STATUS: [[&str; 3]; 8] = [
    ["0", "HiZ", "The motor's phases are de-energised."],
    ["1", "READY", "The last motion instruction has been carried out."],
    ["2", "SW_F", "The SW contact is closed."],
    ["3", "SW_EVN", "It has closed since the flags were last cleared."],
    ["4", "DIR", "The direction of the last motion was forward."],
    ["6:5", "MOT_STATUS", "0 stands, 1 gains speed, 2 loses speed, 3 turns at constant speed."],
    ["7", "CMD_ERROR", "An instruction could not be carried out since the flags were last cleared."],
    ["15:8", "", "0."],
];

const VALUES_ABOUT: &str = "
What stands in `RETURN_DATA`, where it is more than the register of that name:

- `GET_ABS_POS`: microsteps, sign-extended to 32 bits. A host had better extend bit 21 itself.
- `GET_MODE`: bit 0 control (1 current), 6:1 motor, 9:7 microstep, 16:10 current in 0.1 A, 18:17 holding current in quarters
  less one, 20:19 `MODE_N_PROGRAMS`, which `SET_MODE` ignores.
- `STATUS_IN_EVENT`: bits 7:0 the inputs' levels, 15:8 their mask, 23:16 which are waited for.
- `GET_STACK`: bits 7:0 the instruction, 9:8 the memory area.
";

const VERSIONS: &str = "
## Versions

`HW_MAJOR`, `HW_VER`, `FW_MAJOR` and `FW_MINOR` as in [registers.md](registers.md), 2 bytes each, and the version of the
protocol, 1 byte.
";

/// The LAN parameters in their order: the maker's name of the field, the register that holds the same, and its bytes.
const LAN: [(&str, Reg, usize); 8] = [
    ("mac", Reg::LanMac, 6),
    ("ip", Reg::LanIp, 4),
    ("sn", Reg::LanSubnetMask, 4),
    ("gw", Reg::LanGateway, 4),
    ("dns", Reg::LanDns, 4),
    ("Port", Reg::LanPort, 2),
    ("dhcp", Reg::LanDhcp, 1),
    ("unitID", Reg::LanId, 1),
];

/// The whole page.
pub(super) fn page() -> String {
    let sources = "`crates/spec/src/smsd/standard.rs`, `instructions.rs` and `registers.rs`";
    [
        page::start("Tables of the SMSD's standard protocol", sources, ABOUT),
        "\n## Packet types\n".to_owned(),
        packet_types(),
        "\n## The status structure\n".to_owned(),
        ANSWER_ABOUT.to_owned(),
        page::table(&["Bit", "Name", "About"], STATUS.map(|row| row.map(str::to_owned).into())),
        "\n## Codes\n".to_owned(),
        codes(),
        "\n## Instructions\n".to_owned(),
        INSTRUCTIONS_ABOUT.to_owned(),
        page::table(
            &["Code", "Name", "Answered with", "Data", "Since"],
            INSTRUCTIONS.iter().map(instruction),
        ),
        VALUES_ABOUT.to_owned(),
        "\n## LAN parameters\n".to_owned(),
        lan_about(),
        lan(),
        "\n## Counters\n\nOf 4 bytes each, in this order. They begin at 0 with the power.\n".to_owned(),
        counters(),
        VERSIONS.to_owned(),
    ]
    .concat()
}

fn packet_types() -> String {
    let rows = PACKET_TYPES.iter().map(|info| {
        vec![
            info.code.to_string(),
            format!("`{}`", info.name),
            info.request.to_owned(),
            info.reply.to_owned(),
        ]
    });
    page::table(&["CMD_TYPE", "Name", "Data of a request", "Reply"], rows)
}

fn codes() -> String {
    let rows = CODES.iter().map(|(code, ..)| {
        vec![code.number().to_string(), format!("`{}`", code.name()), code.about().to_owned()]
    });
    page::table(&["Number", "Name", "About"], rows)
}

fn instruction(info: &OpcodeInfo) -> Vec<String> {
    let codes: Vec<String> =
        answered_with(info.opcode).iter().map(|code| format!("{} `{code}`", code.number())).collect();
    let since = if exists_in(info.opcode, VERSION_1) { "1" } else { "2" };
    vec![
        format!("`{:02X}`", info.code),
        format!("`{}`", info.name),
        codes.join(" or "),
        page::tick(info.operand != Operand::None),
        since.to_owned(),
    ]
}

fn answered_with(opcode: Opcode) -> Vec<Code> {
    #[allow(clippy::wildcard_enum_match_arm, reason = "these two are the exceptions")]
    match opcode {
        Opcode::GetRele => vec![Code::StatusReleSet, Code::StatusReleClr],
        Opcode::ReturnProgram => vec![Code::ErrorPrograms],
        opcode => vec![code_of(opcode)],
    }
}

fn lan_about() -> String {
    format!(
        "\n{} bytes; {} with the standard firmware, which has no `unitID` and whose port is {STANDARD_PORT} as it leaves the \
         factory.\n",
        Firmware::Modbus.lan_size(),
        Firmware::Standard.lan_size()
    )
}

fn lan() -> String {
    let mut offset = 0;
    let rows = LAN.map(|(name, register, size)| {
        let row = register.info();
        let (least, greatest) = row.range(Model::Smsd42);
        let cells = vec![
            offset.to_string(),
            size.to_string(),
            format!("`{name}`"),
            row.about.to_owned(),
            format!("{least} … {greatest}"),
            format!("`{:04X}`", row.address),
            row.note.to_owned(),
        ];
        offset += size;
        cells
    });
    page::table(&["Offset", "Size", "Field", "About", "Range", "Register", "Note"], rows)
}

fn counters() -> String {
    let rows = (0..).zip(&COUNTER_ROWS).map(|(place, (_, name, about)): (usize, _)| {
        vec![(4 * place).to_string(), format!("`{name}`"), about.trim().to_owned()]
    });
    page::table(&["Offset", "Name", "Counts"], rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_type_code_instruction_and_counter_stands_on_the_page_once() {
        let text = page();
        let types = PACKET_TYPES.iter().map(|info| format!("\n| {} | `{}` |", info.code, info.name));
        let codes = CODES.iter().map(|(code, name, _)| format!("\n| {} | `{name}` |", code.number()));
        let instructions =
            INSTRUCTIONS.iter().map(|info| format!("\n| `{:02X}` | `{}` |", info.code, info.name));
        let counters =
            (0..).zip(&COUNTER_ROWS).map(|(place, (_, name, _))| format!("\n| {} | `{name}` |", 4 * place));
        for cell in types.chain(codes).chain(instructions).chain(counters) {
            assert_eq!(text.matches(&cell).count(), 1, "{cell}");
        }
    }

    #[test]
    fn the_lan_parameters_have_the_size_that_packets_have() {
        let size = |rows: &[(&str, Reg, usize)]| rows.iter().map(|(.., size)| size).sum::<usize>();
        assert_eq!(size(&LAN), Firmware::Modbus.lan_size());
        assert_eq!(size(&LAN[..7]), Firmware::Standard.lan_size());
        assert!(page().contains("\n| 25 | 1 | `unitID` |"));
    }
}
