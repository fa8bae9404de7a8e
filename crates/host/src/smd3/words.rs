//! What the drive says, in words for people.

use super::found::Found;
use crate::error::Error;
use stepdrive_spec::smd3::commands::{Access, Command, Kind, Mode, Request, Value};
use stepdrive_spec::smd3::errors::Error as Refusal;
use stepdrive_spec::smd3::flags::{ERROR_FLAGS, FlagBits};

/// A value as people write it.
pub(super) fn value_text(value: Value) -> String {
    match value {
        Value::Int(value) => value.to_string(),
        Value::Uint(value) => value.to_string(),
        Value::Float(value) => value.to_string(),
        Value::Bool(value) => u8::from(value).to_string(),
        Value::Sign(positive) => if positive { "+" } else { "-" }.to_owned(),
        Value::Text(text) => text.to_string(),
        Value::Mode(mode) => mode_text(mode),
        Value::FlagTable => "the table of flags".to_owned(),
    }
}

/// A mode as the drive prints it.
pub(super) fn mode_text(mode: Mode) -> String {
    format!("{} ({})", mode.number(), mode.name())
}

/// A request as it stands in a line, for messages.
pub(super) fn request_text(request: &Request) -> String {
    match request.argument {
        None => request.command.to_string(),
        Some(argument) => format!("{},{}", request.command, value_text(argument)),
    }
}

/// The names of the error flags in a set, as `TOPEN and EMERGENCY STOP`.
pub(super) fn error_flag_names(bits: FlagBits) -> String {
    let names: Vec<&str> = ERROR_FLAGS.iter().filter(|flag| flag.is_in(bits)).map(|flag| flag.name).collect();
    if names.is_empty() { format!("flags {bits:#06X}") } else { names.join(" and ") }
}

/// What a refusal means, to whom it happened, and what to do.
pub(super) fn refused(request: &Request, refusal: Refusal, found: &Found) -> Error {
    let what = request_text(request);
    let number = refusal.code();
    let head = format!("{what} refused ({number}, {})", refusal.text());
    match refusal {
        Refusal::StopMotorFirst => Error::Refused(format!("{head}: {}", stop_first(request.command, found))),
        Refusal::ArgumentValidation => {
            Error::Usage(format!("{head}: {}; nothing was changed", allowed(request.command)))
        }
        Refusal::NotPossibleInMode => {
            Error::Refused(format!("{head}: {}", other_mode(request.command, found)))
        }
        Refusal::NotPossibleWhenMotorDisabled => {
            Error::Fault(format!("{head}: {}", disabled(found.flags.error)))
        }
        Refusal::ActionFailed => action_failed(request, &head),
        Refusal::UnableToGet | Refusal::UnknownCommand | Refusal::ArgumentType | Refusal::ArgumentCount => {
            let unknown = unknown(request.command, refusal);
            Error::Device(format!(
                "{head}: the controller does not know {unknown}; its firmware may be older"
            ))
        }
    }
}

/// What a drive does not know that refuses a well-formed request as no command.
fn unknown(command: Command, refusal: Refusal) -> String {
    match refusal {
        Refusal::UnableToGet => format!("how to read {command}"),
        Refusal::ArgumentType => format!("{command} with an argument of this type"),
        Refusal::ArgumentCount => format!("{command} with this number of arguments"),
        Refusal::UnknownCommand
        | Refusal::StopMotorFirst
        | Refusal::ArgumentValidation
        | Refusal::ActionFailed
        | Refusal::NotPossibleInMode
        | Refusal::NotPossibleWhenMotorDisabled => command.to_string(),
    }
}

/// Why the motor is disabled, and what to do.
fn disabled(error: FlagBits) -> String {
    if error == 0 {
        return "the drive says that the motor is disabled, but no error flag says by what; enable it with CLR".to_owned();
    }
    format!("the motor is disabled by {}; remove the cause and clear it with CLR", error_flag_names(error))
}

fn stop_first(command: Command, found: &Found) -> String {
    if found.velocity == Some(0.0) {
        return "the drive said that the motor was turning; it has stopped since; try again".to_owned();
    }
    let turning = match found.velocity {
        Some(velocity) => format!("the motor turns at {} Hz", velocity.abs()),
        None => "the motor turns".to_owned(),
    };
    let remedy = if command == Command::Runr { "stop it or use RUNA" } else { "stop it first" };
    format!("{turning}; {remedy}")
}

fn other_mode(command: Command, found: &Found) -> String {
    let present =
        found.mode.map_or_else(|| "another mode".to_owned(), |mode| format!("mode {}", mode_text(mode)));
    match command.info().mode {
        Some(mode) => format!(
            "it belongs to mode {}, and the drive is in {present}; set MODE {} first",
            mode_text(mode),
            mode.number()
        ),
        None => format!("the drive is in {present}"),
    }
}

fn action_failed(request: &Request, head: &str) -> Error {
    let command = request.command;
    if command == Command::Store {
        return Error::Device(format!(
            "{head}: the flash could not be written and holds what it held before; the settings are in force until power-off"
        ));
    }
    if command == Command::Load {
        return Error::Device(format!(
            "{head}: the stored configuration cannot be read; the settings in force were kept; STORE writes a new one"
        ));
    }
    if command == Command::Runh {
        let limit = if request.argument == Some(Value::Sign(true)) { "L+" } else { "L-" };
        return Error::Refused(format!(
            "{head}: the limit input of that direction is not in use; enable it with L 1 and {limit} 1"
        ));
    }
    Error::Device(format!("{head}: the drive could not do it and does not say why"))
}

/// The range of a command's argument, as `16 to 15000 Hz`.
fn range_text(command: Command) -> String {
    let info = command.info();
    let unit = if info.unit.is_empty() { String::new() } else { format!(" {}", info.unit) };
    format!("{} to {}{unit}", info.min, info.max)
}

/// What a command takes where its row of the table allows more than the drive did.
fn allowed(command: Command) -> String {
    if command == Command::Vstart {
        return "it is above 0 and at most VSTOP, and the resolution RES sets how high it goes".to_owned();
    }
    if command == Command::Vstop {
        return "it is above 0 and at least VSTART, and the resolution RES sets how high it goes".to_owned();
    }
    let limit = if command.info().standby { "" } else { "; the resolution RES may set closer limits" };
    format!("it takes {}{limit}", range_text(command))
}

/// Checks a request against the table before anything is sent.
pub(super) fn check(request: &Request) -> Result<(), Error> {
    let Request { command, argument } = *request;
    let info = command.info();
    match (info.access, argument) {
        (Access::Read | Access::ReadWrite | Access::Action, None) => Ok(()),
        (Access::Write, None) => {
            Err(usage(&format!("{command} cannot be read; it takes {}", takes(info.kind))))
        }
        (Access::Read, Some(_)) => Err(usage(&format!("{command} can only be read"))),
        (Access::Action, Some(_)) => Err(usage(&format!("{command} takes no value"))),
        (Access::ReadWrite | Access::Write, Some(value)) => check_value(command, value),
    }
}

fn check_value(command: Command, value: Value) -> Result<(), Error> {
    let info = command.info();
    let number = match (info.kind, value) {
        (Kind::Sign, Value::Sign(_)) | (Kind::Bool, Value::Bool(_)) => return Ok(()),
        (Kind::Int, Value::Int(number)) => number as f64,
        (Kind::Uint, Value::Uint(number)) => number as f64,
        (Kind::Float, Value::Float(number)) => number,
        _ => {
            let given = value_text(value);
            return Err(usage(&format!("{command} takes {}, not {given}", takes(info.kind))));
        }
    };
    if (info.min..=info.max).contains(&number) {
        return Ok(());
    }
    Err(usage(&format!("{command} {} is out of range: {}", value_text(value), range_text(command))))
}

/// What a command takes.
pub(super) fn takes(kind: Kind) -> &'static str {
    match kind {
        Kind::None => "no value",
        Kind::Int => "a whole number",
        Kind::Uint => "a whole number without sign",
        Kind::Float => "a number",
        Kind::Bool => "0 or 1",
        Kind::Sign => "+ or -",
        Kind::Text => "a text",
    }
}

fn usage(what: &str) -> Error {
    Error::Usage(format!("{what}; nothing was sent"))
}

/// A number as the value that a command takes.
pub(super) fn value_of(command: Command, number: f64) -> Result<Value, Error> {
    let whole = number.fract() == 0.0 && number.abs() < 9e15;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "whole, and within 53 bits")]
    let value = match command.info().kind {
        Kind::Float => Value::Float(number),
        Kind::Int if whole => Value::Int(number as i64),
        Kind::Uint if whole && number >= 0.0 => Value::Uint(number as u64),
        Kind::Bool if whole && (0.0..=1.0).contains(&number) => Value::Bool(number > 0.5),
        kind @ (Kind::None | Kind::Int | Kind::Uint | Kind::Bool | Kind::Sign | Kind::Text) => {
            return Err(usage(&format!("{command} takes {}, not {number}", takes(kind))));
        }
    };
    Ok(value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use stepdrive_spec::smd3::flags::Flags;

    fn words(request: Request, refusal: Refusal, found: &Found) -> String {
        refused(&request, refusal, found).to_string()
    }

    fn set(command: Command, value: Value) -> Request {
        Request { command, argument: Some(value) }
    }

    #[test]
    fn a_value_out_of_range_is_told_with_the_range_before_anything_is_sent() {
        let told = |command, value| check(&set(command, value)).expect_err("refused").to_string();
        assert_eq!(
            told(Command::Vmax, Value::Float(20_000.0)),
            "VMAX 20000 is out of range: 0 to 15000 Hz; nothing was sent"
        );
        assert_eq!(told(Command::Mode, Value::Uint(6)), "MODE 6 is out of range: 0 to 5; nothing was sent");
        assert_eq!(told(Command::Vmax, Value::Bool(true)), "VMAX takes a number, not 1; nothing was sent");
        assert_eq!(told(Command::Tmot, Value::Float(1.0)), "TMOT can only be read; nothing was sent");
        let nan = told(Command::Amax, Value::Float(f64::NAN));
        assert_eq!(nan, "AMAX NaN is out of range: 1 to 1000000 Hz/s; nothing was sent");
        let bare = check(&Request { command: Command::Runv, argument: None }).expect_err("refused");
        assert_eq!(bare.to_string(), "RUNV cannot be read; it takes + or -; nothing was sent");
    }

    #[test]
    fn numbers_become_what_a_command_takes() {
        assert_eq!(value_of(Command::L, 1.0), Ok(Value::Bool(true)));
        assert_eq!(value_of(Command::Runa, -5.0), Ok(Value::Int(-5)));
        assert_eq!(value_of(Command::Res, 64.0), Ok(Value::Uint(64)));
        for (command, number) in
            [(Command::L, 2.0), (Command::Runa, 1.5), (Command::Res, -8.0), (Command::Clr, 1.0)]
        {
            assert!(value_of(command, number).is_err(), "{command} {number}");
        }
        assert!(value_of(Command::Runa, f64::INFINITY).is_err());
    }

    #[test]
    fn refusals_say_what_happened_to_what_and_what_to_do() {
        let mut found = Found { velocity: Some(-412.0), ..Found::default() };
        let runr = set(Command::Runr, Value::Int(200));
        assert_eq!(
            words(runr, Refusal::StopMotorFirst, &found),
            "RUNR,200 refused (-1, Stop motor first): the motor turns at 412 Hz; stop it or use RUNA"
        );
        found.velocity = Some(0.0);
        assert_eq!(
            words(runr, Refusal::StopMotorFirst, &found),
            "RUNR,200 refused (-1, Stop motor first): the drive said that the motor was turning; it has stopped since; try again"
        );
        found.mode = Some(Mode::Joystick);
        assert_eq!(
            words(runr, Refusal::NotPossibleInMode, &found),
            "RUNR,200 refused (-6, Not possible in mode): it belongs to mode 2 (Remote), and the drive is in mode 3 \
             (Joystick); set MODE 2 first"
        );
        found.flags = Flags { status: 0, error: 0x22 };
        let fault = refused(&runr, Refusal::NotPossibleWhenMotorDisabled, &found);
        assert_eq!(fault.exit_code(), 8);
        assert!(fault.to_string().contains("disabled by TOPEN and EMERGENCY STOP"), "{fault}");
        let unflagged = words(runr, Refusal::NotPossibleWhenMotorDisabled, &Found::default());
        assert_eq!(
            unflagged,
            "RUNR,200 refused (-7, Not possible when motor disabled): the drive says that the motor is disabled, but no \
             error flag says by what; enable it with CLR"
        );
        let home = words(set(Command::Runh, Value::Sign(false)), Refusal::ActionFailed, &found);
        assert!(home.ends_with("enable it with L 1 and L- 1"), "{home}");
    }

    #[test]
    fn every_refusal_of_every_command_has_words() {
        for row in &stepdrive_spec::smd3::commands::COMMANDS {
            for refusal in Refusal::ALL {
                let told =
                    words(Request { command: row.command, argument: None }, refusal, &Found::default());
                assert!(told.starts_with(row.mnemonic) && told.contains(refusal.text()), "{told}");
            }
        }
    }
}
