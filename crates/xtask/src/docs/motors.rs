//! `docs/motors.md`: the motors that voltage control knows by number.

use super::page::{self, thousandths};
use stepdrive_spec::smsd::models::{MOTORS, Model, Motor};

const HEADS: [&str; 7] = [
    "SMSD-4.2LAN",
    "SMSD-8.0LAN",
    "Current (A)",
    "Resistance (Ω)",
    "Inductance (mH)",
    "Step angle (°)",
    "Motor",
];

const ABOUT: &str = "\
The values of `MOTOR_TYPE` (register `110B`) on each model, and what the maker says of the motor: highest current,
resistance and inductance of a phase, and the step angle. A dash stands where the model does not list the motor.";

/// The whole page.
pub(super) fn page() -> String {
    page::start("Motors", "`crates/spec/src/smsd/models.rs`", ABOUT)
        + &page::table(&HEADS, MOTORS.iter().map(cells))
}

fn cells(motor: &Motor) -> Vec<String> {
    let number = |model| motor.motor_type(model).map_or("–".to_owned(), |number| number.to_string());
    let known = |value: u32| if value == 0 { "–".to_owned() } else { thousandths(value) };
    vec![
        number(Model::Smsd42),
        number(Model::Smsd80),
        known(motor.current_ma.into()),
        known(motor.resistance_mohm),
        known(motor.inductance_uh),
        known(u32::from(motor.step_angle_decideg) * 100),
        motor.name.to_owned(),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_motor_is_shown_in_the_units_of_the_manual() {
        let named = MOTORS.iter().find(|motor| motor.name == "SM4247").expect("listed");
        assert_eq!(cells(named), ["7", "7", "1.68", "1.65", "2.8", "1.8", "SM4247"]);
    }

    #[test]
    fn what_there_is_not_is_a_dash() {
        let rows: Vec<_> = MOTORS.iter().map(cells).collect();
        assert_eq!(
            rows.first().map(Vec::as_slice),
            Some(&["0", "0", "–", "–", "–", "–", "no motor"].map(str::to_owned)[..])
        );
        assert!(rows.iter().any(|row| row.starts_with(&["–".to_owned(), "39".to_owned()])));
    }
}
