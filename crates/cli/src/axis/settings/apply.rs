//! `stepdrive settings apply`: the plan is shown, carried out, and verified by reading back.

use super::drive::{check_state, identity, lan_of, read, send, sent_for};
use super::key::Family;
use super::lan::differences as lan_differences;
use super::plan::{Change, Difference, changes, differences, objection};
use super::{LanDifference, Read, difference_table, file_of, json_of, number, shown};
use crate::Failure;
use crate::axis::progress::Progress;
use crate::axis::{AxisArgs, Client, Opened, act_on};
use crate::rig::table::{Align, table, text};
use crate::terminal::{print, print_json, tell};
use serde_json::{Value, json};
use std::path::PathBuf;
use stepdrive_host::Error;
use stepdrive_host::smsd::LanParameters;

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stepdrive settings apply stage.profile.toml -a stage --dry-run
  stepdrive settings apply uhv.profile.toml -a /dev/ttyACM0 --store

What the file does not name is left as it is. An SMSD keeps its motor configuration by itself; MIN_SPEED to FS_SPEED and Mask
are lost at power-off. An SMD3 loses all settings at power-off that were not stored.")]
pub(crate) struct ApplyArgs {
    /// The file. By default the profile that stepdrive.toml names.
    file: Option<PathBuf>,
    /// Show what would be sent, and send nothing.
    #[arg(long)]
    dry_run: bool,
    /// SMD3: store the settings afterwards, so that they survive power-off.
    #[arg(long)]
    store: bool,
    /// SMSD: the LAN parameters too, if the file has them. The controller closes all connections then.
    #[arg(long)]
    lan: bool,
    #[command(flatten)]
    axis: AxisArgs,
}

/// What is to be done.
struct Plan {
    file: Read,
    changes: Vec<Change>,
    /// The LAN parameters that are to be, and what of them is not so yet.
    lan: Option<(LanParameters, Vec<LanDifference>)>,
}

/// What has become of it.
#[derive(Default)]
struct Outcome {
    differences: Vec<Difference>,
    stored: bool,
}

/// Brings a controller to what a file says.
pub(super) fn apply(args: &ApplyArgs) -> Result<(), Failure> {
    act_on(&args.axis, async |opened| {
        let plan = make(opened, args).await?;
        if !args.axis.reach.json {
            print(&plan_text(opened, &plan))?;
        }
        if args.dry_run {
            return if args.axis.reach.json {
                print_json(&report(opened, args, &plan, None))
            } else {
                Ok(())
            };
        }
        check_state(opened, &plan.changes).await?;
        carry_out(opened, &plan.changes).await?;
        let outcome = verify(opened, args, &plan).await?;
        if args.axis.reach.json {
            print_json(&report(opened, args, &plan, Some(&outcome)))?;
        } else {
            conclude(opened, &plan, &outcome)?;
        }
        match outcome.differences.len() {
            0 => apply_lan(opened, &plan).await,
            count => Err(not_as_written(opened, &plan, count, args)),
        }
    })
}

/// Reads the file and the controller, and compares them.
async fn make(opened: &Opened, args: &ApplyArgs) -> Result<Plan, Failure> {
    let file = Read::from(file_of(args.file.as_deref(), opened)?)?;
    let kind = identity(opened).await?;
    file.check_kind(opened, kind)?;
    if args.store && kind.family() == Family::Smsd {
        return Err(Failure::Usage(
            "an SMSD stores its motor configuration by itself; leave --store out".to_owned(),
        ));
    }
    let now = read(opened).await?;
    let wanted = &file.profile.settings;
    for (key, value) in wanted {
        // The model may be another than the file was made for.
        if let Some(why) = key.refuses(*value, kind.model(), 8) {
            return Err(file.mistake(*key, format!("{} {why}, not {value}", key.name())));
        }
    }
    if let Some((key, why)) = objection(wanted, &now) {
        return Err(file.mistake(key, why));
    }
    let changes = changes(wanted, &now);
    let lan = if args.lan { lan_plan(opened, &file).await? } else { None };
    if !args.lan && file.profile.lan.is_some() {
        tell("the LAN parameters are left as they are; --lan applies them too");
    }
    Ok(Plan { file, changes, lan })
}

async fn lan_plan(
    opened: &Opened,
    file: &Read,
) -> Result<Option<(LanParameters, Vec<LanDifference>)>, Failure> {
    let Some(wanted) = file.profile.lan else {
        return Err(Failure::Usage(format!("{} has no [lan]; leave --lan out", file.name)));
    };
    let Some(now) = lan_of(opened).await? else { return Ok(None) };
    let wanted = LanParameters { mac: now.mac, ..wanted };
    Ok(Some((wanted, lan_differences(&wanted, &now))))
}

fn plan_text(opened: &Opened, plan: &Plan) -> String {
    let nothing = plan.changes.is_empty() && plan.lan.as_ref().is_none_or(|(_, lan)| lan.is_empty());
    if nothing {
        return format!("{} is as {} says\n", opened.name(), plan.file.name);
    }
    let of_change = |change: &Change| {
        let name = change.key.name().to_owned();
        [name, shown(change.key, change.now), shown(change.key, change.to), sent_for(change)]
    };
    let of_lan = |(name, file, now): &LanDifference| {
        [format!("lan.{name}"), now.clone(), file.clone(), "with all LAN parameters".to_owned()]
    };
    let lan = plan.lan.iter().flat_map(|(_, lan)| lan.iter().map(of_lan));
    let rows: Vec<[String; 4]> = plan.changes.iter().map(of_change).chain(lan).collect();
    let columns =
        [("SETTING", Align::Left), ("NOW", Align::Left), ("THEN", Align::Left), ("SENT", Align::Left)];
    text(&table(columns, &rows))
}

/// Sends the changes one after another.
async fn carry_out(opened: &Opened, changes: &[Change]) -> Result<(), Failure> {
    let mut progress = Progress::new("setting");
    for (number, change) in changes.iter().enumerate() {
        progress.show(number, changes.len());
        if let Err(cause) = send(opened, change).await {
            return Err(halted(changes, number, cause).into());
        }
    }
    Ok(())
}

/// The error for a change that failed: what was done before it, and what was not.
fn halted(changes: &[Change], number: usize, cause: Error) -> Error {
    let names =
        |changes: &[Change]| changes.iter().map(|change| change.key.name()).collect::<Vec<&str>>().join(", ");
    let (before, rest) = changes.split_at_checked(number).unwrap_or((changes, &[]));
    let done = match before {
        [] => "no setting before it was changed".to_owned(),
        _ => format!("{} had been set", names(before)),
    };
    let left = rest.get(1..).filter(|left| !left.is_empty());
    let left = left.map_or_else(String::new, |left| format!("; {} not tried", names(left)));
    Error::Partly { done: format!("{done}{left}"), cause: Box::new(cause) }
}

/// Reads everything back, and has it stored where that is wanted and all is well.
async fn verify(opened: &Opened, args: &ApplyArgs, plan: &Plan) -> Result<Outcome, Failure> {
    let now = read(opened).await.map_err(|failure| unverified(plan, failure))?;
    let differences = differences(&plan.file.profile.settings, &now);
    let stored = match opened.client() {
        Client::Smd3(client) if args.store && differences.is_empty() => {
            client.store().await.map_err(|cause| Error::Partly {
                done: "all settings are in force and read back as they should".to_owned(),
                cause: Box::new(cause),
            })?;
            true
        }
        Client::Smd3(_) | Client::Smsd(_) => false,
    };
    Ok(Outcome { differences, stored })
}

fn unverified(plan: &Plan, failure: Failure) -> Failure {
    let Failure::Host(cause) = failure else { return failure };
    let done = format!("{} settings were sent, but could not be read back", plan.changes.len());
    Error::Partly { done, cause: Box::new(cause) }.into()
}

/// Says how it ended.
fn conclude(opened: &Opened, plan: &Plan, outcome: &Outcome) -> Result<(), Failure> {
    if !outcome.differences.is_empty() {
        return print(&format!("\n{}", text(&difference_table(&outcome.differences, &[]))));
    }
    if !plan.changes.is_empty() {
        let count = plan.file.profile.settings.len();
        print(&format!("set, and all {count} settings of the file read back as they should\n"))?;
    }
    let lost = plan.changes.iter().any(|change| change.key.is_volatile());
    match opened.client() {
        Client::Smd3(_) if outcome.stored => print("stored\n"),
        Client::Smd3(_) if !plan.changes.is_empty() => {
            tell("the settings are in force until power-off; --store keeps them");
            Ok(())
        }
        Client::Smsd(_) if lost => {
            tell("MIN_SPEED to FS_SPEED and Mask are in force until power-off");
            Ok(())
        }
        Client::Smd3(_) | Client::Smsd(_) => Ok(()),
    }
}

fn not_as_written(opened: &Opened, plan: &Plan, count: usize, args: &ApplyArgs) -> Failure {
    let Failure::Differs(text) = super::differs(count, opened, &plan.file.name) else {
        return super::differs(count, opened, &plan.file.name);
    };
    let stored = if args.store { "; nothing was stored" } else { "" };
    let lan = if args.lan { "; the LAN parameters are as they were" } else { "" };
    Failure::Differs(format!("{text}, though all were set{stored}{lan}"))
}

/// The LAN parameters last: afterwards the controller may be elsewhere.
async fn apply_lan(opened: &Opened, plan: &Plan) -> Result<(), Failure> {
    let Some((wanted, differences)) = &plan.lan else { return Ok(()) };
    let Client::Smsd(client) = opened.client() else { return Ok(()) };
    if differences.is_empty() {
        return Ok(());
    }
    client.set_lan_parameters(wanted).await?;
    client.apply_lan_parameters().await.map_err(|cause| Error::Partly {
        done: "the LAN parameters were written, but may not be in effect".to_owned(),
        cause: Box::new(cause),
    })?;
    let [a, b, c, d] = wanted.ip;
    let place =
        if wanted.dhcp { "where its DHCP server puts it".to_owned() } else { format!("{a}.{b}.{c}.{d}") };
    tell(&format!(
        "the LAN parameters are in effect; the controller is now at {place}, port {}",
        wanted.port
    ));
    Ok(())
}

/// All of it as JSON; `outcome` is `None` when nothing was sent.
fn report(opened: &Opened, args: &ApplyArgs, plan: &Plan, outcome: Option<&Outcome>) -> Value {
    let change = |change: &Change| {
        json!({
            "name": change.key.name(),
            "now": number(change.now),
            "to": number(change.to),
            "unit": change.key.unit(),
            "sent": sent_for(change),
        })
    };
    let lan = plan.lan.as_ref().map(|(_, lan)| json_of(&[], lan));
    json!({
        "axis": opened.name(),
        "file": plan.file.name,
        "dry_run": args.dry_run,
        "changes": plan.changes.iter().map(change).collect::<Vec<Value>>(),
        "lan": lan,
        "verified": outcome.map(|outcome| outcome.differences.is_empty()),
        "differences": outcome.map(|outcome| json_of(&outcome.differences, &[])),
        "stored": outcome.is_some_and(|outcome| outcome.stored),
    })
}

#[cfg(test)]
mod tests {
    use super::super::key::Key;
    use super::*;
    use stepdrive_spec::smd3::commands::Command;

    #[test]
    fn a_change_that_fails_says_what_was_done_and_what_was_not() {
        let change = |command| Change { key: Key::Smd3(command), now: 0.0, to: 1.0 };
        let changes = [Command::Vmax, Command::Ir, Command::Ih].map(change);
        let told = |number| halted(&changes, number, Error::Refused("IR refused".to_owned())).to_string();
        assert_eq!(told(0), "IR refused; no setting before it was changed; IR, IH not tried");
        assert_eq!(told(1), "IR refused; VMAX had been set; IH not tried");
        assert_eq!(told(2), "IR refused; VMAX, IR had been set");
    }
}
