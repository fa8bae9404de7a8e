//! `stepdrive status`.

use super::{AxisArgs, Client, Opened, look_at};
use crate::Failure;
use crate::terminal::{print, print_json};
use serde_json::{Map, Value, json};
use std::fmt::Write as _;
use stepdrive_host::axis::{Axis, AxisState};
use stepdrive_host::smsd::ProgramState;
use stepdrive_host::trust::Trust;
use stepdrive_host::units::{Amount, Decimal, Unit};

/// Which axis is looked at.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stepdrive status -a stage
  stepdrive status -a 192.168.1.2:502
  stepdrive status -a /dev/ttyACM0
  stepdrive status -a stage --json | jq .position_mm

  $ stepdrive status -a stage
  stage  smsd+tcp://stage.lab:502?unit=1
    controller  SMSD-4.2LAN, hardware 1, firmware 1.3, register map 4.3
    mode        commands
    position    12.5mm (500 full steps), trusted
    motion      stands, energised
    soft limits -10 to 200 mm, within them
    switches    none active
    faults      none")]
pub(crate) struct StatusArgs {
    #[command(flatten)]
    axis: AxisArgs,
}

/// Shows how an axis stands.
pub(crate) fn status(args: &StatusArgs) -> Result<(), Failure> {
    look_at(&args.axis, async |opened| {
        let seen = Seen {
            controller: identity(opened).await?,
            mode: mode(opened).await?,
            state: opened.axis().state().await?,
        };
        if args.axis.reach.json { print_json(&as_json(opened, &seen)) } else { print(&text(opened, &seen)) }
    })
}

/// What is seen of an axis.
struct Seen {
    controller: String,
    mode: String,
    state: AxisState,
}

/// What moves the motor.
async fn mode(opened: &Opened) -> Result<String, Failure> {
    Ok(match opened.client() {
        Client::Smsd(client) => {
            let ProgramState { running, area, line, .. } = client.program().await?;
            match running {
                Some(true) => format!("the user program of mem{area} runs, at line {line}"),
                Some(false) => "commands".to_owned(),
                None => {
                    format!(
                        "commands, or the user program at mem{area}:{line}; the standard protocol does not tell which"
                    )
                }
            }
        }
        Client::Smd3(client) => client.mode().await?.name().to_owned(),
    })
}

/// What the controller says that it is.
async fn identity(opened: &Opened) -> Result<String, Failure> {
    Ok(match opened.client() {
        Client::Smsd(client) => client.identity().await?.to_string(),
        Client::Smd3(client) => {
            let (serial, firmware) = (client.serial_number().await?, client.firmware().await?);
            format!("SMD3, serial number {serial}, firmware {firmware}")
        }
    })
}

fn text(opened: &Opened, seen: &Seen) -> String {
    let state = &seen.state;
    let (name, target) = (opened.name(), opened.found.target.to_string());
    let mut text = if name == target { format!("{target}\n") } else { format!("{name}  {target}\n") };
    let rows = [
        ("controller", seen.controller.clone()),
        ("mode", seen.mode.clone()),
        ("position", position(state)),
        ("motion", motion(opened.axis(), state)),
        ("soft limits", soft_limits(opened.axis(), state)),
        ("switches", switches(state)),
        ("faults", faults(state)),
    ];
    for (name, value) in rows {
        // Writing to a String does not fail.
        let _ = writeln!(text, "  {name:11} {value}");
    }
    text
}

/// Where it is, and whether that can be believed.
pub(super) fn position(state: &AxisState) -> String {
    let steps = match state.position.unit {
        Unit::Step => String::new(),
        Unit::Mm | Unit::Deg | Unit::Turn => format!(" ({} full steps)", plain(state.full_steps)),
    };
    format!("{}{steps}, {}", state.position, trust(state))
}

/// Whether its position can be believed, and why not.
pub(super) fn trust(state: &AxisState) -> String {
    match state.doubt {
        Some(doubt) => format!("{}: {doubt}", state.trust),
        None => Trust::Trusted.to_string(),
    }
}

/// What it does.
pub(super) fn motion(axis: &dyn Axis, state: &AxisState) -> String {
    match (state.moving, state.energised) {
        (true, _) => format!("moves at {} {}/s", plain(state.speed), axis.scale().unit()),
        (false, true) => "stands, energised".to_owned(),
        (false, false) => "stands, de-energised".to_owned(),
    }
}

fn soft_limits(axis: &dyn Axis, state: &AxisState) -> String {
    let Some((low, high)) = axis.soft_limits().range() else { return "none".to_owned() };
    let within = if state.within_soft_limits { "within them" } else { "beyond them" };
    format!("{low} to {high} {}, {within}", axis.scale().unit())
}

fn switches(state: &AxisState) -> String {
    match (state.limit_negative, state.limit_positive) {
        (false, false) => "none active",
        (true, false) => "the negative limit is active",
        (false, true) => "the positive limit is active",
        (true, true) => "both limits are active",
    }
    .to_owned()
}

/// The names of its faults.
pub(super) fn faults(state: &AxisState) -> String {
    let names: Vec<&str> = state.faults.iter().map(|fault| fault.name).collect();
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}

/// A number for people, to the millionth.
pub(super) fn plain(value: f64) -> Decimal {
    Amount::of((value * 1e6).round() / 1e6, Unit::Step).map(|amount| amount.value).unwrap_or_default()
}

/// How a unit is called in the names of JSON.
pub(super) fn unit_key(unit: Unit) -> &'static str {
    match unit {
        Unit::Mm => "mm",
        Unit::Deg => "deg",
        Unit::Turn => "turns",
        Unit::Step => "full_steps",
    }
}

fn as_json(opened: &Opened, seen: &Seen) -> Value {
    let mut object = state_json(opened, &seen.state);
    object.insert("target".to_owned(), opened.found.target.to_string().into());
    object.insert("controller".to_owned(), seen.controller.as_str().into());
    object.insert("mode".to_owned(), seen.mode.as_str().into());
    object.into()
}

/// How it stands, with the units in the names.
pub(super) fn state_json(opened: &Opened, state: &AxisState) -> Map<String, Value> {
    let axis = opened.axis();
    let unit = unit_key(axis.scale().unit());
    let limits = axis.soft_limits().range().map(|(low, high)| [low.as_f64(), high.as_f64()]);
    let faults: Vec<Value> =
        state.faults.iter().map(|fault| json!({ "name": fault.name, "about": fault.about })).collect();
    let entries = [
        ("axis".to_owned(), opened.name().into()),
        (format!("position_{unit}"), state.position.value.as_f64().into()),
        ("position_full_steps".to_owned(), state.full_steps.into()),
        (format!("speed_{unit}_per_s"), state.speed.into()),
        ("moving".to_owned(), state.moving.into()),
        ("energised".to_owned(), state.energised.into()),
        ("trust".to_owned(), state.trust.name().into()),
        ("doubt".to_owned(), state.doubt.map(|doubt| doubt.to_string()).into()),
        ("faults".to_owned(), faults.into()),
        ("limit_negative".to_owned(), state.limit_negative.into()),
        ("limit_positive".to_owned(), state.limit_positive.into()),
        (format!("soft_limits_{unit}"), json!(limits)),
        ("within_soft_limits".to_owned(), state.within_soft_limits.into()),
    ];
    entries.into_iter().collect()
}
