//! Lines to an SMD3, and its replies explained.

use super::{Answer, is_trouble};
use crate::axis::map::unit;
use crate::axis::meaning;
use crate::axis::names::{instead, shown};
use crate::axis::regs::json_of;
use crate::rig::table::{Align, table, text};
use serde_json::json;
use stepdrive_host::Error;
use stepdrive_host::smd3::{RawReply, Smd3Client};
use stepdrive_spec::smd3::commands::{Access, COMMANDS, Command, CommandInfo, Value};
use stepdrive_spec::smd3::flags::{ERROR_FLAGS, Flags, STATUS_FLAGS};

/// Sends a line as it is, and explains the reply.
pub(super) async fn answer(client: &Smd3Client, line: &str) -> Result<Answer, Error> {
    let reply = match client.send_line(line).await {
        Ok(reply) => reply,
        Err(error) if is_trouble(&error) => return Err(error),
        // It was not sent.
        Err(error) => {
            let json = json!({ "sent": null, "error": error.to_string() });
            return Ok(Answer { text: format!("{error}\n"), json, refused: Some(error) });
        }
    };
    let command = mnemonic(line);
    Ok(Answer { text: explained(&reply, command), json: as_json(line, &reply), refused: reply.outcome.err() })
}

fn mnemonic(line: &str) -> Option<Command> {
    Command::from_mnemonic(line.split(',').next().unwrap_or_default().trim())
}

/// The reply, and below it what it says.
fn explained(reply: &RawReply, command: Option<Command>) -> String {
    let mut said: Vec<String> = Vec::new();
    match (&reply.outcome, command) {
        (Ok(Some(value)), Some(command)) => said.extend(value_in_words(command, *value)),
        (Ok(_), _) => {}
        (Err(error), _) => said.push(error.to_string()),
    }
    said.extend(reply.flags.map(flags_in_words));
    std::iter::once(&reply.text).chain(&said).fold(String::new(), |text, line| {
        if text.is_empty() { format!("{line}\n") } else { format!("{text}    {line}\n") }
    })
}

fn value_in_words(command: Command, value: Value) -> Option<String> {
    if value == Value::FlagTable {
        return None;
    }
    let meaning = meaning::of_value(command, value);
    let meaning = if meaning.is_empty() { String::new() } else { format!(", {meaning}") };
    Some(format!("{command} = {}{}{meaning}", meaning::plain(value), unit(command.info().unit)))
}

fn flags_in_words(flags: Flags) -> String {
    let errors: Vec<&str> = meaning::flag_names(&ERROR_FLAGS, flags.error).collect();
    let status: Vec<&str> = meaning::flag_names(&STATUS_FLAGS, flags.status).collect();
    let listed = |names: Vec<&str>| if names.is_empty() { "none".to_owned() } else { names.join(", ") };
    if errors.is_empty() {
        return format!("status: {}; no errors", listed(status));
    }
    format!("status: {}; ERRORS: {} (CLR clears what is over)", listed(status), errors.join(", "))
}

fn as_json(line: &str, reply: &RawReply) -> serde_json::Value {
    let status =
        reply.flags.map(|flags| meaning::flag_names(&STATUS_FLAGS, flags.status).collect::<Vec<_>>());
    let errors = reply.flags.map(|flags| meaning::flag_names(&ERROR_FLAGS, flags.error).collect::<Vec<_>>());
    let value = reply.outcome.as_ref().ok().copied().flatten();
    let command = mnemonic(line);
    json!({
        "sent": line,
        "reply": reply.text,
        "command": command.map(|command| command.info().mnemonic),
        "value": value.map(json_of),
        "unit": command.map(|command| command.info().unit),
        "meaning": command.zip(value).map(|(command, value)| meaning::of_value(command, value)),
        "status_flags": status,
        "error_flags": errors,
        "error": reply.outcome.as_ref().err().map(Error::to_string),
    })
}

/// All commands, or all about one.
pub(super) fn help(name: &str) -> String {
    if name.is_empty() {
        let row = |info: &CommandInfo| [form(info), meaning::sentence(info.about)];
        let rows: Vec<[String; 2]> = COMMANDS.iter().map(row).collect();
        return text(&table([("LINE", Align::Left), ("WHAT", Align::Left)], &rows));
    }
    let Some(command) = Command::from_mnemonic(name) else {
        let names: Vec<&str> = COMMANDS.iter().map(|info| info.mnemonic).collect();
        return format!("there is no command `{}`; {}\n", shown(name), instead(name, &names));
    };
    let info = command.info();
    let range = meaning::range(command);
    let takes = match info.access {
        Access::Read => "only read".to_owned(),
        Access::Action => "done without a value".to_owned(),
        Access::Write | Access::ReadWrite => format!("takes {range}"),
    };
    let standby = if info.standby { "; the motor must be in standby" } else { "" };
    let mode = info
        .mode
        .map_or_else(String::new, |mode| format!("; the mode must be {} ({})", mode.number(), mode.name()));
    format!("{}\n    {}\n    {takes}{standby}{mode}\n", form(info), info.about)
}

/// How its line is written.
fn form(info: &CommandInfo) -> String {
    let argument = info.kind.name();
    match info.access {
        Access::Read | Access::Action => info.mnemonic.to_owned(),
        Access::ReadWrite => format!("{}[,{argument}]", info.mnemonic),
        Access::Write => format!("{},{argument}", info.mnemonic),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use stepdrive_spec::smd3::flags::{ErrorFlag, StatusFlag};

    fn reply(text: &str, flags: Flags, outcome: Result<Option<Value>, Error>) -> RawReply {
        RawReply { text: text.to_owned(), flags: Some(flags), outcome }
    }

    #[test]
    fn a_reply_is_followed_by_what_it_says() {
        let flags = Flags { status: StatusFlag::Standby.mask(), error: 0 };
        let value = reply("0x0040,0x0000,5.00000E+02", flags, Ok(Some(Value::Float(500.0))));
        assert_eq!(
            explained(&value, Some(Command::Vmax)),
            "0x0040,0x0000,5.00000E+02\n    VMAX = 500 Hz\n    status: STANDBY; no errors\n"
        );
        let switch = reply("0x0040,0x0000,1", flags, Ok(Some(Value::Bool(true))));
        assert!(explained(&switch, Some(Command::LpPlus)).contains("LP+ = 1, active low\n"));
    }

    #[test]
    fn faults_and_refusals_are_told() {
        let flags = Flags { status: 0, error: ErrorFlag::EmergencyStop.mask() };
        let refused = reply("0x0000,0x0020,-7", flags, Err(Error::Fault("disabled".to_owned())));
        let told = explained(&refused, Some(Command::Runr));
        assert!(told.contains("    disabled\n    status: none; ERRORS: EMERGENCY STOP (CLR"), "{told}");
    }

    #[test]
    fn there_is_help_for_every_command() {
        for info in &COMMANDS {
            let told = help(info.mnemonic);
            assert!(told.starts_with(info.mnemonic) && told.contains(info.about), "{told}");
            assert!(help("").contains(&form(info)));
        }
        assert_eq!(help("VMAXX"), "there is no command `VMAXX`; did you mean VMAX?\n");
        assert!(help("runr").contains(
            "takes -8388607 to 8388607 full steps; the motor must be in standby; the mode must be 2"
        ));
    }
}
