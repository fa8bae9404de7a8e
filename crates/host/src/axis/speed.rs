//! Speeds that a controller does not take.

use crate::error::Error;
use crate::settings::unit;
use std::fmt::Display;

/// The refusal of a speed, for which a setting takes `min` to `max`.
pub(super) fn refused(setting: &str, speed: f64, min: impl Display, max: impl Display, of: &str) -> Error {
    let (speed, unit) = (shortly(speed), unit(of));
    Error::Usage(format!("{setting} {speed} is out of range: {min} to {max}{unit}; nothing was sent"))
}

/// A number with six digits at most, however great or small it is.
fn shortly(number: f64) -> String {
    let rounded = format!("{number:.5e}").parse().unwrap_or(number);
    if (1e-4..1e7).contains(&rounded) { rounded.to_string() } else { format!("{rounded:e}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refusal_shows_any_number_shortly() {
        for (speed, shown) in [
            (100_000.0, "100000"),
            (15.4, "15.4"),
            (20_000.0 / 3.0, "6666.67"),
            (1e-9, "1e-9"),
            (1e308, "1e308"),
            (369_000_000_000.123, "3.69e11"),
        ] {
            assert_eq!(
                refused("MAX_SPEED", speed, 16, 15_600, "full step/s").to_string(),
                format!("MAX_SPEED {shown} is out of range: 16 to 15600 full steps/s; nothing was sent")
            );
        }
    }
}
