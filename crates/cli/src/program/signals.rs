//! What `program run` is told about its inputs: `IN1=at:2.5s`.

use std::time::Duration;
use stepdrive_rig::simulation::Signal;
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::time::Instant;

/// The signals of one `--input`.
#[derive(Clone, Debug)]
pub(super) struct Signals(pub(super) Vec<Signal>);

/// Reads `NAME=on`, `NAME=at:TIME` (from then on) or `NAME=at:TIME..TIME` (between), several parted by commas.
pub(super) fn signals(text: &str) -> Result<Signals, String> {
    let (name, times) = text.split_once('=').ok_or("it is NAME=at:TIME, as in IN1=at:2.5s")?;
    let names = || Input::ALL.map(Input::name).join(", ");
    let input = Input::from_name(&name.to_ascii_uppercase());
    let input = input.ok_or_else(|| format!("there is no input {name}; there are {}", names()))?;
    let mut signals = Vec::new();
    for part in times.split(',') {
        let (from, to) = interval(part)?;
        signals.push(Signal { at: Instant::ZERO + from, input, present: true });
        signals.extend(to.map(|to| Signal { at: Instant::ZERO + to, input, present: false }));
    }
    Ok(Signals(signals))
}

fn interval(part: &str) -> Result<(Duration, Option<Duration>), String> {
    if part == "on" {
        return Ok((Duration::ZERO, None));
    }
    let times =
        part.strip_prefix("at:").ok_or_else(|| format!("`{part}` is not on, at:TIME or at:TIME..TIME"))?;
    let Some((from, to)) = times.split_once("..") else { return Ok((time(times)?, None)) };
    let (from, to) = (time(from)?, time(to)?);
    if from < to { Ok((from, Some(to))) } else { Err(format!("`{part}` ends before it begins")) }
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

    fn at(milliseconds: u64, present: bool) -> Signal {
        Signal { at: Instant::ZERO + Duration::from_millis(milliseconds), input: Input::In1, present }
    }

    #[test]
    fn signals_come_on_from_a_time_on_and_between_two_times() {
        assert_eq!(signals("IN1=on").expect("valid").0, [at(0, true)]);
        assert_eq!(signals("in1=at:2.5s").expect("valid").0, [at(2500, true)]);
        let twice = [at(1000, true), at(1500, false), at(3000, true)];
        assert_eq!(signals("IN1=at:1s..1500ms,at:3s").expect("valid").0, twice);
    }

    #[test]
    fn what_is_no_signal_is_refused_with_what_would_be() {
        for (text, part) in [
            ("IN1", "NAME=at:TIME"),
            ("IN9=on", "there are IN0, IN1"),
            ("IN1=soon", "is not on, at:TIME"),
            ("IN1=at:2s..1s", "ends before it begins"),
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
