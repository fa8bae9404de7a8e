//! When signals come to inputs while a program is tried out: `on`, `at:2s`, `at:1s..2s`, several parted by commas.

use std::time::Duration;
use stepdrive_rig::duration;
use stepdrive_rig::simulation::Signal;
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::time::Instant;

/// The signals of one input.
pub(super) fn signals(name: &str, times: &str) -> Result<Vec<Signal>, String> {
    let input = Input::from_name(&name.to_ascii_uppercase());
    let names = || Input::ALL.map(Input::name).join(", ");
    let input = input.ok_or_else(|| format!("there is no input of this name; there are {}", names()))?;
    let mut signals = Vec::new();
    for part in times.split(',') {
        let (from, to) = interval(part.trim())?;
        signals.push(Signal { at: Instant::ZERO + from, input, present: true });
        signals.extend(to.map(|to| Signal { at: Instant::ZERO + to, input, present: false }));
    }
    Ok(signals)
}

/// From when on there is a signal, and until when; `None` when it stays.
fn interval(part: &str) -> Result<(Duration, Option<Duration>), String> {
    if part == "on" {
        return Ok((Duration::ZERO, None));
    }
    let times = part.strip_prefix("at:").ok_or("a signal is on, at:TIME or at:TIME..TIME, as in at:2.5s")?;
    let Some((from, to)) = times.split_once("..") else { return Ok((time(times)?, None)) };
    let (from, to) = (time(from)?, time(to)?);
    if from < to { Ok((from, Some(to))) } else { Err("a signal ends after it begins".to_owned()) }
}

fn time(text: &str) -> Result<Duration, String> {
    duration::parse(text).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signals_come_on_from_a_time_on_and_between_two_times() {
        let at = |milliseconds, present| Signal {
            at: Instant::ZERO + Duration::from_millis(milliseconds),
            input: Input::In1,
            present,
        };
        assert_eq!(signals("IN1", "on"), Ok(vec![at(0, true)]));
        assert_eq!(signals("in1", "at:2.5s"), Ok(vec![at(2500, true)]));
        let twice = vec![at(1000, true), at(1500, false), at(3000, true)];
        assert_eq!(signals("IN1", "at:1s..1500ms, at:3s"), Ok(twice));
    }

    #[test]
    fn what_is_no_signal_is_refused_with_what_would_be() {
        for (name, times, part) in [
            ("IN9", "on", "there are IN0, IN1"),
            ("IN1", "soon", "at:TIME"),
            ("IN1", "at:2s..1s", "ends after it begins"),
            ("IN1", "at:2fortnights", "ms"),
            ("IN1", "", "at:TIME"),
        ] {
            let message = signals(name, times).expect_err(times);
            assert!(message.contains(part), "{times}: {message}");
        }
    }
}
