//! A scenario as it is written: TOML, with the place of everything that may be wrong.

use super::act::Act;
use super::{Mistake, Scenario, Start, Step};
use serde::Deserialize;
use std::ops::Range;
use std::time::Duration;
use stepdrive_rig::condition::{Condition, ConditionError};
use stepdrive_rig::duration;
use stepdrive_rig::file::RigFile;
use stepdrive_spec::smsd::registers::Reg;
use toml::Spanned;

/// The deadline of a scenario that names none.
const USUAL_DEADLINE: Duration = Duration::from_hours(1);

/// The most characters of a name.
const LONGEST_NAME: usize = 200;

/// A mistake and its place.
type Misplaced = (Range<usize>, String);

/// A scenario.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenScenario {
    name: Spanned<String>,
    rig: Option<Spanned<String>>,
    deadline: Option<Spanned<String>>,
    #[serde(default)]
    keep_going: bool,
    password: Option<Spanned<String>>,
    #[serde(rename = "step", default)]
    steps: Vec<Spanned<WrittenStep>>,
}

/// `[[step]]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenStep {
    name: Option<Spanned<String>>,
    at: Option<Spanned<String>>,
    after: Option<Spanned<String>>,
    when: Option<Spanned<String>>,
    within: Option<Spanned<String>>,
    #[serde(rename = "do", default)]
    acts: Vec<Spanned<String>>,
    expect: Option<Spanned<String>>,
}

/// Reads a scenario.
pub(super) fn parse(text: &str, rig: &RigFile) -> Result<Scenario, Mistake> {
    let text = without_mark(text);
    let written = read(text)?;
    if written.steps.is_empty() {
        let message = "the scenario has no step; begin one with [[step]]".to_owned();
        return Err(Mistake::new(text, None, message));
    }
    let checked = Reader { text, rig }.scenario(&written);
    checked.map_err(|(span, message)| Mistake::new(text, Some(span), message))
}

/// The rig file that a scenario names.
pub(super) fn rig_named(text: &str) -> Result<Option<String>, Mistake> {
    Ok(read(without_mark(text))?.rig.map(Spanned::into_inner))
}

fn without_mark(text: &str) -> &str {
    text.strip_prefix('\u{FEFF}').unwrap_or(text)
}

fn read(text: &str) -> Result<WrittenScenario, Mistake> {
    let written: WrittenScenario = toml::from_str(text).map_err(|error| Mistake::of_toml(text, &error))?;
    match &written.rig {
        Some(rig) if rig.get_ref().is_empty() || rig.get_ref().contains(char::is_control) => {
            Err(Mistake::new(text, Some(rig.span()), "rig is no path, as in rig = \"rig.toml\"".to_owned()))
        }
        _ => Ok(written),
    }
}

/// What a scenario is checked with.
struct Reader<'a> {
    text: &'a str,
    rig: &'a RigFile,
}

impl Reader<'_> {
    fn scenario(&self, written: &WrittenScenario) -> Result<Scenario, Misplaced> {
        let deadline = written.deadline.as_ref().map(|deadline| time(deadline, "deadline")).transpose()?;
        let deadline = deadline.unwrap_or(USUAL_DEADLINE);
        let mut steps = Vec::new();
        let mut latest = Duration::ZERO;
        for step in &written.steps {
            let checked = self.step(step)?;
            if let (Start::At(at), Some(place)) = (&checked.start, &step.get_ref().at) {
                latest = check_order(*at, latest, deadline).map_err(|message| (place.span(), message))?;
            }
            steps.push(checked);
        }
        Ok(Scenario {
            name: check_name(&written.name)?,
            deadline,
            keep_going: written.keep_going,
            password: written.password.as_ref().map_or(Ok(factory_password()), password)?,
            steps: steps.into(),
        })
    }

    fn step(&self, place: &Spanned<WrittenStep>) -> Result<Step, Misplaced> {
        let written = place.get_ref();
        let start = self.start(written)?;
        let acts = written.acts.iter().map(|text| {
            let act = Act::parse(text.get_ref(), self.rig);
            act.map_err(|message| (text.span(), message))
        });
        let acts: Vec<Act> = acts.collect::<Result<_, _>>()?;
        let expect = written.expect.as_ref().map(|expect| self.condition(expect)).transpose()?;
        if acts.is_empty() && expect.is_none() {
            return Err((
                place.span(),
                "the step has nothing to do and nothing to expect; give it do or expect".to_owned(),
            ));
        }
        let within = written.within.as_ref().map(|within| time(within, "within")).transpose()?;
        if let Some(within) = &written.within
            && written.when.is_none()
            && written.expect.is_none()
        {
            return Err((
                within.span(),
                "within without when or expect; there is nothing to come".to_owned(),
            ));
        }
        let name = match &written.name {
            Some(name) => check_name(name)?,
            None => usual_name(&acts, expect.as_ref()),
        };
        Ok(Step { name, start, within, acts, expect })
    }

    fn start(&self, written: &WrittenStep) -> Result<Start, Misplaced> {
        let WrittenStep { at, after, when, .. } = written;
        let given = [("at", at), ("after", after), ("when", when)];
        let mut given = given.into_iter().filter_map(|(key, written)| Some((key, written.as_ref()?)));
        if let (Some((first, _)), Some((second, place))) = (given.next(), given.next()) {
            let message = format!("a step has one of at, after and when; here are {first} and {second}");
            return Err((place.span(), message));
        }
        if let Some(at) = at {
            time(at, "at").map(Start::At)
        } else if let Some(after) = after {
            time(after, "after").map(Start::After)
        } else if let Some(when) = when {
            self.condition(when).map(Start::When)
        } else {
            Ok(Start::AtOnce)
        }
    }

    fn condition(&self, written: &Spanned<String>) -> Result<Condition, Misplaced> {
        let wrong = |error: ConditionError| match self.place_within(written, error.column) {
            Some(place) => (place, error.message),
            None => (written.span(), error.to_string()),
        };
        Condition::parse(written.get_ref(), self.rig).map_err(wrong)
    }

    /// Where in the file the word at this column of a text stands; `None` when the text is not written out there as it is.
    fn place_within(&self, written: &Spanned<String>, column: usize) -> Option<Range<usize>> {
        let Range { start, end } = written.span();
        let (start, end) = (start + 1, end.checked_sub(1)?);
        let text = written.get_ref();
        if self.text.get(start..end)? != text {
            return None;
        }
        let at = text.char_indices().nth(column.checked_sub(1)?).map_or(text.len(), |(at, _)| at);
        let in_word = |c: char| c.is_alphanumeric() || matches!(c, '_' | '-');
        let rest = text.get(at..)?;
        let length = rest.find(|c| !in_word(c)).unwrap_or(rest.len());
        let one = rest.chars().next().map_or(0, char::len_utf8);
        Some(start + at..start + at + length.max(one))
    }
}

fn time(written: &Spanned<String>, key: &str) -> Result<Duration, Misplaced> {
    let wrong = |error| (written.span(), format!("{key} is no duration: {error}"));
    duration::parse(written.get_ref()).map_err(wrong)
}

/// Times of steps come one after the other, and before the deadline.
fn check_order(at: Duration, latest: Duration, deadline: Duration) -> Result<Duration, String> {
    if at < latest {
        let latest = duration::display(latest);
        return Err(format!(
            "a step before is at {latest} already; steps are written in the order of their times"
        ));
    }
    if at > deadline {
        return Err(format!("this is after the scenario's deadline of {}", duration::display(deadline)));
    }
    Ok(at)
}

fn check_name(name: &Spanned<String>) -> Result<String, Misplaced> {
    let text = name.get_ref();
    let length = text.chars().count();
    if (1..=LONGEST_NAME).contains(&length) && !text.contains(char::is_control) {
        return Ok(text.clone());
    }
    Err((name.span(), format!("the name is not 1 to {LONGEST_NAME} characters without line ends")))
}

/// What a step is called that has no name.
fn usual_name(acts: &[Act], expect: Option<&Condition>) -> String {
    match (acts, expect) {
        ([only], _) => only.text().to_owned(),
        ([first, ..], _) => format!("{} and more", first.text()),
        ([], Some(condition)) => format!("expect {condition}"),
        ([], None) => String::new(),
    }
}

fn password(written: &Spanned<String>) -> Result<u64, Misplaced> {
    let text = written.get_ref();
    let digits = text.strip_prefix("0x").unwrap_or(text);
    let all_digits = !digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_hexdigit());
    let number = all_digits.then(|| u64::from_str_radix(digits, 16).ok()).flatten();
    number.ok_or_else(|| {
        let message = "the password is 1 to 16 hexadecimal digits, as in 0x0123456789ABCDEF".to_owned();
        (written.span(), message)
    })
}

fn factory_password() -> u64 {
    let half = |reg: Reg| u64::try_from(reg.info().default).unwrap_or(0);
    half(Reg::PasswordHigh32) << 32 | half(Reg::PasswordLow32)
}
