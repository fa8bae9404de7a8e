//! A setting as it is shown.

use super::{Found, number, value_in};
use serde::Serialize;
use serde_json::Value;
use stepdrive_host::settings::{Key, Setting, Standing, resolution};

/// A setting, with all that is known of it.
#[derive(Debug, Serialize)]
pub(super) struct Row {
    pub(super) name: &'static str,
    pub(super) group: &'static str,
    pub(super) about: &'static str,
    pub(super) unit: &'static str,
    pub(super) kind: &'static str,
    pub(super) min: Option<f64>,
    pub(super) max: Option<f64>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) choices: Vec<Choice>,
    pub(super) default: Value,
    /// Whether it is what the controller makes of its default, where both are known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) at_default: Option<bool>,
    /// What survives power-off, as it was stored or loaded from here last; `null` where nobody has yet.
    pub(super) stored: Value,
    /// `null` where the line does not tell it.
    pub(super) value: Value,
    /// Whether it can be set as the controller stands now.
    pub(super) writable: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) why_not: Option<String>,
    /// It is lost at power-off whatever is done.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub(super) volatile: bool,
    pub(super) source: &'static str,
}

/// A value that can be chosen.
#[derive(Debug, Serialize)]
pub(super) struct Choice {
    value: Value,
    name: String,
}

impl Row {
    pub(super) fn of(key: Key, found: &Found, stored: Option<&[Setting]>, standing: Standing) -> Row {
        let (min, max) = key.range(found.model);
        let choices = key.choices(found.model).into_iter();
        let choices: Vec<Choice> =
            choices.map(|(value, name)| Choice { value: number(value), name }).collect();
        let obstacle = standing.forbids(key);
        let stored = stored.filter(|_| !key.is_volatile()).and_then(|stored| value_in(stored, key));
        let (value, resolution) = (found.value(key), resolution(&[], &found.settings));
        Row {
            name: key.name(),
            group: key.group(),
            about: key.about(),
            unit: key.unit(),
            kind: kind(key, !choices.is_empty()),
            min: Some(min),
            max: Some(max),
            choices: if key.is_switch() { Vec::new() } else { choices },
            default: number(key.default()),
            at_default: value.map(|value| key.is_as_wanted(key.default(), value, resolution)),
            stored: stored.map_or(Value::Null, number),
            value: value.map_or(Value::Null, number),
            writable: obstacle.is_none(),
            why_not: obstacle.map(|obstacle| obstacle.to_string()),
            volatile: key.is_volatile(),
            source: key.source(),
        }
    }
}

fn kind(key: Key, has_choices: bool) -> &'static str {
    if key.is_switch() {
        "bool"
    } else if has_choices {
        "choice"
    } else if key.is_whole() {
        "integer"
    } else {
        "number"
    }
}
