//! What the values of settings mean, in words.

use stepdrive_spec::smd3::commands::{Command, Mode, Value};
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::models::MOTORS;
use stepdrive_spec::smsd::registers::Reg;

/// A unit of the tables as it stands behind a number: with its space, in the plural, and with a sign between two numbers.
pub fn unit(unit: &str) -> String {
    match unit.chars().next() {
        None => String::new(),
        Some(first) if first.is_ascii_digit() => format!(" × {unit}"),
        Some(_) => format!(" {}", plural(unit)),
    }
}

/// A unit of the tables by itself, in the plural.
pub fn plural(unit: &str) -> String {
    match unit.split_once("step") {
        Some((before, after)) => format!("{before}steps{after}"),
        None => unit.to_owned(),
    }
}

/// What a value of a setting of an SMSD means; empty where it is nothing but a number.
pub(super) fn of_register(reg: Reg, value: i64) -> String {
    let found = if reg == Reg::Mask {
        inputs(value)
    } else if reg == Reg::Microstepping {
        microstepping(value)
    } else if reg == Reg::WorkCurrent {
        work_current(value)
    } else if reg == Reg::StopCurrent {
        stop_current(value)
    } else if reg == Reg::MotorType {
        motor_type(value)
    } else {
        choice(reg.info().about, value)
    };
    found.unwrap_or_default()
}

/// What a value of an SMD3 means; empty where it is nothing but a number or a text.
pub fn of_value(command: Command, value: Value) -> String {
    let info = command.info();
    match value {
        Value::Bool(on) => {
            choice(info.about, on.into()).unwrap_or_else(|| if on { "on" } else { "off" }.to_owned())
        }
        Value::Uint(value) => {
            let found = i64::try_from(value).ok().and_then(|value| choice(info.about, value));
            found.unwrap_or_default()
        }
        Value::Mode(mode) => mode.name().to_owned(),
        Value::Sign(positive) => if positive { "positive" } else { "negative" }.to_owned(),
        Value::Int(_) | Value::Float(_) | Value::Text(_) | Value::FlagTable => String::new(),
    }
}

/// The name of a mode of an SMD3; empty when there is none of this number.
pub fn mode(number: i64) -> String {
    let mode = u32::try_from(number).ok().and_then(Mode::from_number);
    mode.map_or_else(String::new, |mode| mode.name().to_owned())
}

/// The inputs in a mask: `IN0, IN1`, `all`, `none`.
pub fn inputs(value: i64) -> Option<String> {
    let value = word(value)?;
    let names: Vec<&str> =
        Input::ALL.into_iter().filter(|input| value & u16::from(input.bit()) != 0).map(Input::name).collect();
    Some(match names.len() {
        0 => "none".to_owned(),
        8 => "all".to_owned(),
        _ => names.join(", "),
    })
}

/// A code of `MICROSTEPPING`, as in `1/16`.
pub fn microstepping(value: i64) -> Option<String> {
    (0..=7).contains(&value).then(|| format!("1/{}", 1_i64 << value))
}

/// A value of `WORK_CURRENT`, as in `4.2 A`.
pub fn work_current(value: i64) -> Option<String> {
    word(value).map(|value| format!("{}.{} A", value / 10, value % 10))
}

/// A code of `STOP_CURRENT`, as in `50 % of WORK_CURRENT`.
pub fn stop_current(value: i64) -> Option<String> {
    (0..=3).contains(&value).then(|| format!("{} % of WORK_CURRENT", 25 * (value + 1)))
}

/// A number of `MOTOR_TYPE`, where it means the same motor on both models.
pub fn motor_type(value: i64) -> Option<String> {
    let number = word(value)?;
    let motor = MOTORS.iter().find(|motor| motor.type_80 == number)?;
    // The models number some motors differently; which model it is, is not known here.
    let other = MOTORS.iter().find(|motor| motor.type_42 == Some(number));
    if other.is_some_and(|other| other != motor) {
        return None;
    }
    if motor.current_ma == 0 {
        return Some(motor.name.to_owned());
    }
    let ohms = f64::from(motor.resistance_mohm) / 1e3;
    let amperes = f64::from(motor.current_ma) / 1e3;
    Some(format!("{} {amperes} A, {ohms} Ω", motor.name).trim_start().to_owned())
}

/// What a number stands for in a sentence that lists its numbers, as in `Control type: 0 voltage, 1 current.`
pub fn choice(about: &str, value: i64) -> Option<String> {
    let (_, list) = about.trim_end_matches('.').split_once(": ")?;
    let choices: Option<Vec<(i64, &str)>> = list.split(", ").map(numbered).collect();
    let choices = choices?;
    choices.into_iter().find(|(number, _)| *number == value).map(|(_, text)| text.to_owned())
}

fn numbered(item: &str) -> Option<(i64, &str)> {
    let (number, text) = item.split_once(' ')?;
    let listed = text.chars().next().is_some_and(char::is_alphabetic) && !text.starts_with("to ");
    number.parse().ok().filter(|_| listed).map(|number| (number, text))
}

fn word(value: i64) -> Option<u16> {
    u16::try_from(value).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_in_the_plural() {
        assert_eq!(unit("full step/s"), " full steps/s");
        assert_eq!((unit("Hz"), unit("")), (" Hz".to_owned(), String::new()));
        assert_eq!((plural("microstep"), plural("0.1 A")), ("microsteps".to_owned(), "0.1 A".to_owned()));
    }

    #[test]
    fn settings_of_an_smsd_are_told_in_words() {
        for (reg, value, words) in [
            (Reg::Mask, 0, "none"),
            (Reg::Mask, 0xFF, "all"),
            (Reg::Mask, 5, "IN0, SET_ZERO"),
            (Reg::Microstepping, 4, "1/16"),
            (Reg::Microstepping, 8, ""),
            (Reg::WorkCurrent, 42, "4.2 A"),
            (Reg::StopCurrent, 1, "50 % of WORK_CURRENT"),
            (Reg::CurrentOrVoltage, 1, "current"),
            (Reg::MotorType, 0, "no motor"),
            (Reg::MotorType, 7, "SM4247 1.68 A, 1.65 Ω"),
            (Reg::MaxSpeed, 1000, ""),
            (Reg::Mask, -1, ""),
        ] {
            assert_eq!(of_register(reg, value), words, "{reg:?} {value}");
        }
    }

    #[test]
    fn values_of_an_smd3_are_told_in_words() {
        for (command, value, words) in [
            (Command::L, Value::Bool(true), "on"),
            (Command::Lsm, Value::Bool(false), "at once"),
            (Command::LpPlus, Value::Bool(true), "active low"),
            (Command::Edge, Value::Uint(1), "both"),
            (Command::Interp, Value::Uint(0), "a step of the resolution"),
            (Command::F, Value::Uint(2), "phases shorted"),
            (Command::Tsel, Value::Uint(1), "RTD"),
            (Command::Jsmode, Value::Uint(0), "single step"),
            (Command::Baket, Value::Uint(150), ""),
            (Command::Res, Value::Uint(8), ""),
            (Command::Mode, Value::Mode(Mode::Remote), "Remote"),
            (Command::Vmax, Value::Float(500.0), ""),
        ] {
            assert_eq!(of_value(command, value), words, "{command}");
        }
        assert_eq!((mode(2), mode(9)), ("Remote".to_owned(), String::new()));
    }
}
