//! Profiles: a controller's settings as TOML.

use super::kind::ControllerKind;
use super::lan::{WrittenLan, lan_text};
use crate::axis::names::{instead, shown};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::ops::Range;
use stepdrive_host::settings::{Family, Key, Setting, plural};
use stepdrive_host::smsd::LanParameters;
use stepdrive_rig::file::Mistake;
use stepdrive_spec::smsd::models::Model;
use toml::Spanned;

/// A profile.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Profile {
    /// What it is for.
    pub(super) kind: ControllerKind,
    /// The settings in the order of the family's table; not all need be there.
    pub(super) settings: Vec<Setting>,
    /// Where in the text each of them stands.
    spans: Vec<Range<usize>>,
    /// The LAN parameters of an SMSD, all but the MAC address.
    pub(super) lan: Option<LanParameters>,
}

/// A profile as it is written.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    model: Spanned<String>,
    #[serde(default)]
    settings: BTreeMap<Spanned<String>, Spanned<toml::Value>>,
    lan: Option<Spanned<WrittenLan>>,
}

/// What is wrong, and where.
pub(super) type Misplaced = (Range<usize>, String);

impl Profile {
    /// Reads a profile.
    ///
    /// # Errors
    /// It is no TOML, names what is no setting of its model, or gives one a value that it cannot have. What depends on the
    /// resolution of an SMD3 is not checked here.
    pub(super) fn parse(text: &str) -> Result<Profile, Mistake> {
        let written: Written = toml::from_str(text).map_err(|error| Mistake::of_toml(text, &error))?;
        let misplaced = |(span, message)| Mistake::new(text, Some(span), message);
        Profile::check(&written).map_err(misplaced)
    }

    fn check(written: &Written) -> Result<Profile, Misplaced> {
        let kind = kind(&written.model)?;
        let family = kind.family();
        let mut found: Vec<(Key, f64, Range<usize>)> = Vec::new();
        for (name, value) in &written.settings {
            let key = find(name, family)?;
            if found.iter().any(|(other, ..)| *other == key) {
                return Err((name.span(), format!("{} is set twice; leave one out", key.name())));
            }
            found.push((key, number(key, value, kind.model())?, value.span()));
        }
        let all = Key::all(family);
        found.sort_by_key(|(key, ..)| all.iter().position(|other| other == key));
        let lan = written.lan.as_ref().map(|lan| match family {
            Family::Smsd => lan.get_ref().check(),
            Family::Smd3 => Err((lan.span(), "an SMD3 has no LAN parameters; leave [lan] out".to_owned())),
        });
        Ok(Profile {
            kind,
            settings: found.iter().map(|(key, value, _)| (*key, *value)).collect(),
            spans: found.into_iter().map(|(.., span)| span).collect(),
            lan: lan.transpose()?,
        })
    }

    /// A mistake in the value of a setting.
    pub(super) fn mistake(&self, text: &str, key: Key, message: String) -> Mistake {
        let place = self.settings.iter().position(|(other, _)| *other == key);
        Mistake::new(text, place.and_then(|place| self.spans.get(place)).cloned(), message)
    }
}

/// A profile as text, with what is known of each setting behind it.
pub(super) fn text(
    heading: &str,
    kind: ControllerKind,
    settings: &[Setting],
    lan: Option<&LanParameters>,
) -> String {
    let mut text = String::new();
    // Writing to a String does not fail.
    let _ = writeln!(text, "# {heading}\nmodel = \"{}\"\n\n[settings]", kind.name());
    for (key, value) in settings {
        let setting = format!("{} = {value}", quoted(key.name()));
        let meaning = Some(key.meaning(*value)).filter(|meaning| !meaning.is_empty());
        let meaning = meaning.unwrap_or_else(|| plural(key.unit()));
        let about = key.about().trim_end_matches('.');
        let remark = if meaning.is_empty() { about.to_owned() } else { format!("{meaning}. {about}") };
        let _ = writeln!(text, "{setting:26}  # {remark}");
    }
    if let Some(lan) = lan {
        text.push_str(&lan_text(lan));
    }
    text
}

/// A name as a key of TOML.
fn quoted(name: &str) -> String {
    let bare = name.bytes().all(|byte| byte.is_ascii_alphanumeric() || matches!(byte, b'_' | b'-'));
    if bare { name.to_owned() } else { format!("\"{name}\"") }
}

fn kind(name: &Spanned<String>) -> Result<ControllerKind, Misplaced> {
    ControllerKind::from_name(name.get_ref()).ok_or_else(|| {
        let known = ControllerKind::ALL.map(ControllerKind::name).join(", ");
        (name.span(), format!("unknown model `{}`; there are {known}", shown(name.get_ref())))
    })
}

fn find(name: &Spanned<String>, family: Family) -> Result<Key, Misplaced> {
    let all = Key::all(family);
    let found = all.iter().find(|key| key.name().eq_ignore_ascii_case(name.get_ref()));
    found.copied().ok_or_else(|| {
        let names: Vec<&str> = all.iter().map(|key| key.name()).collect();
        let text =
            format!("unknown setting `{}`; {}", shown(name.get_ref()), instead(name.get_ref(), &names));
        (name.span(), text)
    })
}

fn number(key: Key, value: &Spanned<toml::Value>, model: Option<Model>) -> Result<f64, Misplaced> {
    let number = match value.get_ref() {
        toml::Value::Integer(number) => *number as f64,
        toml::Value::Float(number) => *number,
        toml::Value::Boolean(on) => f64::from(u8::from(*on)),
        toml::Value::String(_) | toml::Value::Datetime(_) | toml::Value::Array(_) | toml::Value::Table(_) => {
            return Err((value.span(), format!("{} takes a number", key.name())));
        }
    };
    // At the coarsest resolution everything goes highest.
    match key.refuses(number, model, 8) {
        None => Ok(number),
        Some(why) => Err((value.span(), format!("{} {why}, not {number}", key.name()))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use stepdrive_spec::smd3::commands::Command;

    fn mistake(text: &str) -> String {
        Profile::parse(text).expect_err(text).render("p.toml")
    }

    #[test]
    fn what_is_written_is_read() {
        for kind in ControllerKind::ALL {
            let settings: Vec<Setting> =
                Key::all(kind.family()).into_iter().map(|key| (key, key.default())).collect();
            let read = Profile::parse(&text("of a test", kind, &settings, None)).expect("a profile");
            assert_eq!((read.kind, read.settings, read.lan), (kind, settings, None));
        }
    }

    #[test]
    fn names_may_be_in_any_case_and_switches_may_be_true_and_false() {
        let text = "model = \"SMD3\"\n[settings]\nvmax = 500\n\"l+\" = true\nRES = 64\n";
        let read = Profile::parse(text).expect("a profile");
        let expected = [
            (Key::Smd3(Command::Res), 64.0),
            (Key::Smd3(Command::LPlus), 1.0),
            (Key::Smd3(Command::Vmax), 500.0),
        ];
        assert_eq!(read.settings, expected);
    }

    #[test]
    fn mistakes_are_told_with_their_place() {
        let smsd = |line: &str| mistake(&format!("model = \"SMSD-4.2LAN\"\n[settings]\n{line}\n"));
        for (line, told) in [
            ("MAX_SPED = 500", "p.toml:3:1: unknown setting `MAX_SPED`; did you mean MAX_SPEED?"),
            ("MAX_SPEED = 5", "p.toml:3:13: MAX_SPEED takes 16 to 15600 full steps/s, not 5"),
            ("MAX_SPEED = \"fast\"", "p.toml:3:13: MAX_SPEED takes a number"),
            ("WORK_CURRENT = 50", "p.toml:3:16: WORK_CURRENT takes 1 to 42 × 0.1 A, not 50"),
            ("ACC = 100\nacc = 200", "p.toml:4:1: ACC is set twice; leave one out"),
        ] {
            assert!(smsd(line).starts_with(told), "{}", smsd(line));
        }
        assert!(
            mistake("model = \"SMSD-5\"")
                .starts_with("p.toml:1:9: unknown model `SMSD-5`; there are SMSD-4.2LAN")
        );
        assert!(mistake("model = \"SMD3\"\n[settings]\nVMAX = nan").contains("VMAX takes 0 to 15000 Hz"));
        let lan = "[lan]\nid = 1\nip = \"10.0.0.2\"\nsubnet_mask = \"255.0.0.0\"\ngateway = \"10.0.0.1\"\ndns = \"0.0.0.0\"\n\
                   port = 502\ndhcp = false\n";
        assert!(mistake(&format!("model = \"SMD3\"\n{lan}")).contains("an SMD3 has no LAN parameters"));
        assert!(
            Profile::parse(&format!("model = \"SMSD-8.0LAN\"\n{lan}"))
                .is_ok_and(|profile| profile.lan.is_some())
        );
    }

    #[test]
    fn no_text_is_too_much() {
        for text in ["", "model", "\u{0}", "model = 3", "settings = 1", "model = \"SMD3\"\nsettings = [1]"] {
            assert!(!mistake(text).is_empty());
        }
    }
}
