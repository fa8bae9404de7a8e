//! `docs/smd3-commands.md`: the commands of the SMD3, its flags and its errors.

use super::page;
use std::fmt::Write;
use stepdrive_spec::smd3::commands::{Access, COMMANDS, Command, CommandInfo, Kind, SECTIONS};
use stepdrive_spec::smd3::errors::Error;
use stepdrive_spec::smd3::flags::{ERROR_FLAGS, FlagInfo, STATUS_FLAGS};
use stepdrive_spec::smd3::units::{Grid, RESOLUTIONS, acceleration, vmax, vstart};

const ABOUT: &str = "\
A line is a mnemonic, or a mnemonic, a comma and an argument, ended by CR LF; a lone CR or LF will do. Capitals do not
matter, nor do spaces and tabs around the parts. Every line is answered with one that ends with CR LF and begins with the
status flags and the error flags; the value follows, or an error in its place. An empty line is answered with the flags
alone, as is a command that has no value.

```text
VMAX,500           0x0040,0x0000,5.00000E+02
MODE               0x0040,0x0000,2 (Remote)
RUNA,1000          0x0000,0x0000
RES,64             0x0000,0x0000,-1 (Stop motor first)
```

The first error that applies is answered: mnemonic, count of arguments, type, range, mode, disabled, standby. A line of
more than 256 bytes is answered with -101.

`FLAGS` is answered with a table in place of the value: each flag's name, a tab, and 0 or 1. LF stands between its lines,
and CR LF only behind the last.";

const COMMANDS_ABOUT: &str = "
- **Access**: *read* is answered with the value; *set* takes an argument and is answered with the value that it was
  rounded to, or with the flags alone where it starts motion; *do* takes no argument.
- **Type**: INT `100`, `-10`, `+7`. UINT `99`, `0xA74F`. FLOAT `10.23`, `100e-3`, answered as `1.02300E+01`. BOOL `0`, `1`.
  STRING `+`, `-` for a direction, or a text that is read.
- **Range**: what an argument may be; others are refused with -2.
- **Default**: how it leaves the factory, before rounding. **Stored**: `STORE` keeps it.
- **Standby**: the motor must be in standby for it to be set or done, else -1. **Mode**: the mode that it belongs to, else
  -6.
- **Note**: the reading chosen where the maker's text leaves one open; `assumptions.md` lists what nobody knows.
";

const HEADS: [&str; 11] =
    ["Mnemonic", "Access", "Type", "Range", "Unit", "Default", "Stored", "Standby", "Mode", "About", "Note"];
const FLAG_HEADS: [&str; 4] = ["Bit", "Mask", "Name", "About"];
const ERROR_HEADS: [&str; 2] = ["Number", "As it is answered"];

/// The whole page.
pub(super) fn page() -> String {
    let mut text = page::start("Commands of the SMD3", "`crates/spec/src/smd3/`", ABOUT);
    text.push_str("\n## Commands\n");
    text.push_str(COMMANDS_ABOUT);
    for (name, _) in SECTIONS {
        let rows = COMMANDS.iter().filter(|row| row.command.section() == name).map(cells);
        // Writing to a String cannot fail.
        let _ = write!(text, "\n### {name}\n{}", page::table(&HEADS, rows));
    }
    text.push_str("\n## Status flags, the first set\n");
    text.push_str(&flags(&STATUS_FLAGS));
    text.push_str("\n## Error flags, the second set\n");
    text.push_str(&flags(&ERROR_FLAGS));
    text.push_str("\n## Errors\n");
    text.push_str(&page::table(&ERROR_HEADS, Error::ALL.map(|error| error_cells(error).into())));
    text
}

fn cells(row: &CommandInfo) -> Vec<String> {
    let is_setting = row.access == Access::ReadWrite;
    vec![
        format!("`{}`", row.mnemonic),
        access(row.access).to_owned(),
        row.kind.name().to_owned(),
        range(row),
        row.unit.to_owned(),
        if is_setting { row.default.to_string() } else { String::new() },
        page::tick(row.stored),
        page::tick(row.standby),
        row.mode.map(|mode| format!("{} {}", mode.number(), mode.name())).unwrap_or_default(),
        row.about.to_owned(),
        row.note.to_owned(),
    ]
}

fn access(access: Access) -> &'static str {
    match access {
        Access::Read => "read",
        Access::ReadWrite => "read, set",
        Access::Write => "set",
        Access::Action => "do",
    }
}

fn range(row: &CommandInfo) -> String {
    if matches!(row.access, Access::Read | Access::Action) {
        return String::new();
    }
    match row.kind {
        Kind::None | Kind::Text => String::new(),
        Kind::Sign => "`+`, `-`".to_owned(),
        Kind::Int | Kind::Uint | Kind::Float | Kind::Bool => {
            format!("{} … {}", row.min, greatest(row))
        }
    }
}

/// The upper end of a range, which the resolution may set.
fn greatest(row: &CommandInfo) -> String {
    let Some(grid) = grid(row.command) else { return row.max.to_string() };
    let [coarsest, .., finest] = RESOLUTIONS;
    let at = |resolution| row.max.min((grid(resolution).greatest() * 10.0).floor() / 10.0);
    if at(coarsest).to_bits() == at(finest).to_bits() {
        return at(finest).to_string();
    }
    format!("{} at `RES` {finest}, {} at {coarsest}", at(finest), at(coarsest))
}

/// What a quantity of the profile is counted in at a resolution.
fn grid(command: Command) -> Option<fn(u16) -> Grid> {
    [
        (Command::Amax, acceleration as fn(u16) -> Grid),
        (Command::Dmax, acceleration),
        (Command::Vstart, vstart),
        (Command::Vstop, vstart),
        (Command::Vmax, vmax),
    ]
    .into_iter()
    .find_map(|(of, grid)| (of == command).then_some(grid))
}

fn flags(table: &[FlagInfo]) -> String {
    let rows = table.iter().map(|flag| {
        vec![
            flag.bit.to_string(),
            format!("`0x{:04X}`", 1_u32 << flag.bit),
            flag.name.to_owned(),
            flag.about.to_owned(),
        ]
    });
    page::table(&FLAG_HEADS, rows)
}

fn error_cells(error: Error) -> [String; 2] {
    [error.code().to_string(), format!("`{error}`")]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_command_flag_and_error_stands_on_the_page_once() {
        let text = page();
        let commands = COMMANDS.iter().map(|row| format!("\n| `{}` |", row.mnemonic));
        let flags = STATUS_FLAGS.iter().chain(&ERROR_FLAGS).map(|flag| format!(" | {} |", flag.name));
        let errors = Error::ALL.into_iter().map(|error| format!(" | `{error}` |"));
        for cell in commands.chain(flags).chain(errors) {
            assert_eq!(text.matches(&cell).count(), 1, "{cell}");
        }
    }

    #[test]
    fn ranges_end_where_the_resolution_sets_them() {
        assert_eq!(range(Command::Amax.info()), "1 … 16763.5 at `RES` 256, 536433.6 at 8");
        assert_eq!(range(Command::Vmax.info()), "0 … 15000");
        assert_eq!(range(Command::Runa.info()), "-8388607 … 8388607");
        assert_eq!(range(Command::Runv.info()), "`+`, `-`");
        assert_eq!(range(Command::Vact.info()), "");
    }
}
