//! Round numbers along an axis.

/// Marks on an axis.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Ticks {
    /// From one to the next: 1, 2 or 5 times a power of ten.
    step: f64,
    /// Where they are.
    pub(super) values: Vec<f64>,
}

/// More than are ever drawn.
const MOST: u32 = 100;

impl Ticks {
    /// Marks from `low` to `high`, which is above it, at most about so many.
    pub(super) fn between(low: f64, high: f64, about: f64) -> Ticks {
        let rough = (high - low) / about;
        let power = 10_f64.powf(rough.log10().floor());
        let step = [1.0, 2.0, 5.0].into_iter().map(|digit| digit * power).find(|step| *step >= rough);
        let step = step.unwrap_or(10.0 * power);
        let first = (low / step).ceil();
        let values = (0..MOST).map(|number| (first + f64::from(number)) * step);
        Ticks { step, values: values.take_while(|value| *value <= high + step * 1e-9).collect() }
    }

    /// A value as it is written at its mark, as `-12.5` or `1 600 000`, with a true minus.
    pub(super) fn label(&self, value: f64) -> String {
        if self.step < 1e-9 || value.abs() >= 1e15 {
            return format!("{value:e}");
        }
        let decimals = (0..9).find(|decimals| is_whole(self.step * 10_f64.powi(*decimals))).unwrap_or(9);
        let text = format!("{:.*}", usize::try_from(decimals).unwrap_or(0), value.abs());
        let (whole, fraction) = text.split_once('.').map_or((text.as_str(), ""), |parts| parts);
        let point = if fraction.is_empty() { "" } else { "." };
        let sign = if value < -self.step / 2.0 { "\u{2212}" } else { "" };
        format!("{sign}{}{point}{fraction}", grouped(whole))
    }
}

fn is_whole(value: f64) -> bool {
    (value - value.round()).abs() < 1e-6
}

/// Digits in groups of three where they are five or more.
fn grouped(digits: &str) -> String {
    if digits.len() < 5 {
        return digits.to_owned();
    }
    let group = |(place, digit): (usize, char)| {
        let space = place > 0 && (digits.len() - place).is_multiple_of(3);
        [space.then_some('\u{a0}'), Some(digit)]
    };
    digits.chars().enumerate().flat_map(group).flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(low: f64, high: f64, about: f64) -> Vec<String> {
        let ticks = Ticks::between(low, high, about);
        ticks.values.iter().map(|value| ticks.label(*value)).collect()
    }

    #[test]
    fn marks_are_round_numbers_within_the_axis() {
        assert_eq!(labels(0.0, 10.0, 6.0), ["0", "2", "4", "6", "8", "10"]);
        assert_eq!(
            labels(-0.31, 0.27, 6.0),
            ["\u{2212}0.3", "\u{2212}0.2", "\u{2212}0.1", "0.0", "0.1", "0.2"]
        );
        assert_eq!(labels(12_400.0, 12_900.0, 3.0), ["12\u{a0}400", "12\u{a0}600", "12\u{a0}800"]);
        assert_eq!(labels(0.0, 2_000_000.0, 2.0), ["0", "1\u{a0}000\u{a0}000", "2\u{a0}000\u{a0}000"]);
    }

    #[test]
    fn axes_of_any_size_have_marks_and_end() {
        for (low, high) in [(0.0, 1e-12), (-1e300, 1e300), (1e17, 1e17 + 64.0), (5e-324, 1e-320)] {
            let count = labels(low, high, 6.0).len();
            assert!(count <= 100, "{low} to {high}: {count}");
        }
    }
}
