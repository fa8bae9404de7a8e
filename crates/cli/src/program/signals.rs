//! What `program run` is told about its inputs: `IN1=at:2.5s`.

use std::time::Duration;
use stepdrive_rig::simulation::{self, Signal};

/// The signals of one `--input`.
#[derive(Clone, Debug)]
pub(super) struct Signals(pub(super) Vec<Signal>);

/// Reads `NAME=on`, `NAME=at:TIME` (from then on) or `NAME=at:TIME..TIME` (between), several parted by commas.
pub(super) fn signals(text: &str) -> Result<Signals, String> {
    let (name, times) = text.split_once('=').ok_or("it is NAME=at:TIME, as in IN1=at:2.5s")?;
    simulation::signals(name, times, time).map(Signals)
}

/// Reads a time: `500ms`, `2.5s`, `10min`, `1h`; a bare number is in seconds.
pub(super) fn time(text: &str) -> Result<Duration, String> {
    let split = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
    let (number, unit) = text.split_at(split);
    let scale = match unit {
        "us" => 1e-6,
        "ms" => 1e-3,
        "s" | "" => 1.0,
        "min" => 60.0,
        "h" => 3600.0,
        _ => return Err(format!("`{text}` is no time; it is a number and us, ms, s, min or h, as in 2.5s")),
    };
    let seconds =
        number.parse::<f64>().map_err(|_| format!("`{text}` is no time, as 500ms, 2.5s and 1h are"))?;
    Duration::try_from_secs_f64(seconds * scale).map_err(|_| format!("`{text}` is longer than time lasts"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use stepdrive_spec::smsd::inputs::Input;
    use stepdrive_spec::time::Instant;

    #[test]
    fn a_name_and_when_are_parted_by_an_equals_sign() {
        let at = |at, present| Signal { at: Instant::ZERO + at, input: Input::In1, present };
        let both = [at(Duration::from_secs(1), true), at(Duration::from_millis(1500), false)];
        assert_eq!(signals("in1=at:1..1500ms").expect("valid").0, both);
    }

    #[test]
    fn what_is_no_signal_is_refused_with_what_would_be() {
        for (text, part) in [
            ("IN1", "NAME=at:TIME"),
            ("IN9=on", "there are IN0, IN1"),
            ("IN1=at:2fortnights", "us, ms, s, min or h"),
            ("IN1=at:", "is no time"),
            ("IN1=at:1e9s", "us, ms, s, min or h"),
        ] {
            let message = signals(text).expect_err(text);
            assert!(message.contains(part), "{text}: {message}");
        }
    }

    #[test]
    fn times_are_read_with_their_units() {
        assert_eq!(time("250us"), Ok(Duration::from_micros(250)));
        assert_eq!(time("1.5"), Ok(Duration::from_millis(1500)));
        assert_eq!(time("10min"), Ok(Duration::from_mins(10)));
        assert_eq!(time("1h"), Ok(Duration::from_hours(1)));
        assert!(time("99999999999999999999999h").is_err());
    }
}
