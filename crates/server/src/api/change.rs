//! What changes the rig.

use super::rows::ClockRow;
use super::{Api, TheApi};
use crate::control::Until;
use axum::extract::State;
use serde::{Deserialize, Serialize};
use std::time::Duration;
use stepdrive_rig::action::Action;
use stepdrive_rig::duration;
use stepdrive_rig::fault::Fault;
use stepdrive_rig::file::ClockMode;
use stepdrive_spec::time::Instant;
use stepdrive_web::{Asked, Named, Problem, Reply};

/// The most actions in a request.
const MOST_ACTIONS: usize = 1000;

/// How far rig time goes at most when a request does not say: `within` of a run.
const WITHIN: Duration = Duration::from_hours(1);

/// When it was done.
#[derive(Serialize)]
pub(super) struct Now {
    now_ns: u64,
}

/// The clock after it was set.
#[derive(Serialize)]
pub(super) struct ClockNow {
    now_ns: u64,
    #[serde(flatten)]
    clock: ClockRow,
}

/// How a run ended.
#[derive(Serialize)]
pub(super) struct Ran {
    reached: bool,
    now_ns: u64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SetClock {
    mode: String,
}

pub(super) async fn clock(
    State(api): TheApi,
    Asked(SetClock { mode }): Asked<SetClock>,
) -> Result<Reply<ClockNow>, Problem> {
    let mode = ClockMode::parse(&mode).map_err(Problem::impossible)?;
    api.control.set_clock(mode);
    let now_ns = api.control.now().as_nanos();
    Ok(Reply(ClockNow { now_ns, clock: ClockRow::of(&api.control) }))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Step {
    r#for: String,
}

pub(super) async fn step(
    State(api): TheApi,
    Asked(Step { r#for }): Asked<Step>,
) -> Result<Reply<Now>, Problem> {
    let moved = api.control.run(&Until::Time, time(&r#for)?).await.ok_or_else(playing)?;
    if moved.reached { Ok(now(moved.now)) } else { Err(set_going()) }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RunUntil {
    until: String,
    #[serde(default)]
    within: Option<String>,
}

pub(super) async fn run_until(
    State(api): TheApi,
    Asked(RunUntil { until, within }): Asked<RunUntil>,
) -> Result<Reply<Ran>, Problem> {
    let until = Until::parse(&until, api.control.rig()).map_err(Problem::impossible)?;
    let within = within.as_deref().map_or(Ok(WITHIN), time)?;
    let moved = api.control.run(&until, within).await.ok_or_else(playing)?;
    if !moved.reached && api.control.clock() != ClockMode::Paused {
        return Err(set_going());
    }
    Ok(Reply(Ran { reached: moved.reached, now_ns: moved.now.as_nanos() }))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Actions {
    r#do: Vec<String>,
}

pub(super) async fn actions(
    State(api): TheApi,
    Asked(Actions { r#do }): Asked<Actions>,
) -> Result<Reply<Now>, Problem> {
    if r#do.is_empty() || r#do.len() > MOST_ACTIONS {
        return Err(Problem::impossible(format!(
            "`do` has {} actions; it takes 1 to {MOST_ACTIONS}",
            r#do.len()
        )));
    }
    let alone = r#do.len() == 1;
    let actions = (1..).zip(&r#do).map(|(number, text)| {
        let which = if alone { String::new() } else { format!("action {number}: ") };
        let action = Action::parse(text, api.control.rig());
        action.map_err(|error| Problem::impossible(format!("{which}{error}; nothing was done")))
    });
    let actions = actions.collect::<Result<Vec<Action>, Problem>>()?;
    for action in &actions {
        api.world.apply(action);
    }
    Ok(now(api.control.now()))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SetInput {
    set: String,
    #[serde(default)]
    r#for: Option<String>,
}

pub(super) async fn input(
    State(api): TheApi,
    Named((drive, input)): Named<(String, String)>,
    Asked(SetInput { set, r#for }): Asked<SetInput>,
) -> Result<Reply<Now>, Problem> {
    let (number, drive) = api.find_drive(&drive)?;
    let input = api.control.rig().find_input(number, &input).map_err(Problem::impossible)?;
    api.act(&format!("input {drive}.{input} {set}"), r#for.as_deref())
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SetFault {
    setting: String,
    #[serde(default)]
    r#for: Option<String>,
}

pub(super) async fn fault(
    State(api): TheApi,
    Named((drive, fault)): Named<(String, String)>,
    Asked(SetFault { setting, r#for }): Asked<SetFault>,
) -> Result<Reply<Now>, Problem> {
    let (number, drive) = api.find_drive(&drive)?;
    let fault = Fault::parse(api.control.rig(), number, &fault, &setting).map_err(Problem::impossible)?;
    let (name, setting) = fault.text();
    api.act(&format!("fault {drive}.{name} {setting}"), r#for.as_deref())
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SetPower {
    on: bool,
    #[serde(default)]
    r#for: Option<String>,
}

pub(super) async fn power(
    State(api): TheApi,
    Named(drive): Named<String>,
    Asked(SetPower { on, r#for }): Asked<SetPower>,
) -> Result<Reply<Now>, Problem> {
    let (_, drive) = api.find_drive(&drive)?;
    let state = if on { "on" } else { "off" };
    api.act(&format!("power {drive} {state}"), r#for.as_deref())
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SetPanel {
    mode: PanelMode,
    #[serde(default)]
    program: Option<u8>,
}

/// What the front panel of an SMSD shows.
#[derive(Deserialize)]
enum PanelMode {
    #[serde(rename = "LA")]
    La,
    #[serde(rename = "bF")]
    Bf,
}

pub(super) async fn panel(
    State(api): TheApi,
    Named(drive): Named<String>,
    Asked(SetPanel { mode, program }): Asked<SetPanel>,
) -> Result<Reply<Now>, Problem> {
    let (_, drive) = api.find_drive(&drive)?;
    let mode = match mode {
        PanelMode::La => "LA",
        PanelMode::Bf => "bF",
    };
    let program = program.map_or(String::new(), |program| program.to_string());
    api.act(&format!("panel {drive} {mode} {program}"), None)
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SetWire {
    from: String,
    to: String,
    connected: bool,
}

pub(super) async fn wire(
    State(api): TheApi,
    Asked(SetWire { from, to, connected }): Asked<SetWire>,
) -> Result<Reply<Now>, Problem> {
    let state = if connected { "mend" } else { "cut" };
    api.act(&format!("wire {} {} {state}", word(&from)?, word(&to)?), None)
}

impl Api {
    /// A drive by its number and its name as the rig file has it.
    pub(super) fn find_drive(&self, name: &str) -> Result<(usize, &str), Problem> {
        let rig = self.control.rig();
        let number = rig.find_drive(name).map_err(Problem::impossible)?;
        Ok((number, rig.drives.get(number).map_or("", |drive| &drive.name)))
    }

    /// Carries out an action, to be taken back after a time if one is given.
    fn act(&self, text: &str, back_after: Option<&str>) -> Result<Reply<Now>, Problem> {
        let text = match back_after {
            Some(after) => format!("{text} for {}", duration::display(time(after)?)),
            None => text.to_owned(),
        };
        let action = Action::parse(&text, self.control.rig()).map_err(Problem::impossible)?;
        self.world.apply(&action);
        Ok(now(self.control.now()))
    }
}

/// One of the words of an action: it must not be taken for several.
fn word(text: &str) -> Result<&str, Problem> {
    if text.is_empty() || text.contains(char::is_whitespace) {
        return Err(Problem::impossible("a name has at least one letter and no spaces"));
    }
    Ok(text)
}

fn time(text: &str) -> Result<Duration, Problem> {
    duration::parse(text).map_err(Problem::impossible)
}

fn now(now: Instant) -> Reply<Now> {
    Reply(Now { now_ns: now.as_nanos() })
}

fn playing() -> Problem {
    let message =
        "a scenario is being played, which waits for conditions itself; wait for its end, or end it";
    Problem::refused(message)
}

fn set_going() -> Problem {
    Problem::refused("somebody else set the clock meanwhile, which ended this")
}
