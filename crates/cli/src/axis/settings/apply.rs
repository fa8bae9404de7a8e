//! `stepdrive settings apply`: the plan is shown, carried out, and verified by reading back.

use super::drive::{identity, lan_of, sent_for, untold as untold_of};
use super::lan::differences as lan_differences;
use super::{LanDifference, Read, difference_table, file_of, json_of, number, shown};
use crate::Failure;
use crate::axis::progress::Progress;
use crate::axis::{AxisArgs, Client, Opened, act_on};
use crate::rig::table::{Align, table, text};
use crate::terminal::{print, print_json, tell};
use serde_json::{Value, json};
use std::path::PathBuf;
use stepdrive_host::Error;
use stepdrive_host::settings::{Change, Difference, Family, changes, differences, objection};
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
    /// What is sent for each.
    sent: Vec<String>,
    /// The settings among them that cannot be read back.
    untold: Option<String>,
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
        opened.client().check_state(opened.name(), &plan.changes).await?;
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
    let now = opened.client().read_settings().await?;
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
    let mut changes = changes(wanted, &now);
    // What cannot be read may be anything.
    let untold = wanted.iter().filter(|(key, _)| !opened.client().tells(*key));
    changes.extend(untold.map(|(key, to)| Change { key: *key, now: None, to: *to }));
    let mut sent = Vec::new();
    for change in &changes {
        sent.push(sent_for(opened, change).await?);
    }
    let untold = untold_of(opened, changes.iter().map(|change| change.key));
    let lan = if args.lan { lan_plan(opened, &file).await? } else { None };
    if !args.lan && file.profile.lan.is_some() {
        tell("the LAN parameters are left as they are; --lan applies them too");
    }
    Ok(Plan { file, changes, sent, untold, lan })
}

async fn lan_plan(
    opened: &Opened,
    file: &Read,
) -> Result<Option<(LanParameters, Vec<LanDifference>)>, Failure> {
    let Some(wanted) = file.profile.lan else {
        return Err(Failure::Usage(format!("{} has no [lan]; leave --lan out", file.name)));
    };
    let Some(now) = lan_of(opened).await? else { return Ok(None) };
    if wanted.id.is_some() && now.id.is_none() {
        return Err(Failure::Usage(format!(
            "{} gives an id in [lan], and {} has the standard firmware, which has none; take it out; nothing was sent",
            file.name,
            opened.name()
        )));
    }
    let wanted = LanParameters { mac: now.mac, ..wanted };
    Ok(Some((wanted, lan_differences(&wanted, &now))))
}

fn plan_text(opened: &Opened, plan: &Plan) -> String {
    let nothing = plan.changes.is_empty() && plan.lan.as_ref().is_none_or(|(_, lan)| lan.is_empty());
    if nothing {
        return format!("{} is as {} says\n", opened.name(), plan.file.name);
    }
    let of_change = |(change, sent): (&Change, &String)| {
        let name = change.key.name().to_owned();
        let now = change.now.map_or_else(|| "not told".to_owned(), |now| shown(change.key, now));
        [name, now, shown(change.key, change.to), sent.clone()]
    };
    let of_lan = |(name, file, now): &LanDifference| {
        [format!("lan.{name}"), now.clone(), file.clone(), "with all LAN parameters".to_owned()]
    };
    let lan = plan.lan.iter().flat_map(|(_, lan)| lan.iter().map(of_lan));
    let changes = plan.changes.iter().zip(&plan.sent).map(of_change);
    let rows: Vec<[String; 4]> = changes.chain(lan).collect();
    let columns =
        [("SETTING", Align::Left), ("NOW", Align::Left), ("THEN", Align::Left), ("SENT", Align::Left)];
    text(&table(columns, &rows))
}

/// Sends the changes one after another.
async fn carry_out(opened: &Opened, changes: &[Change]) -> Result<(), Failure> {
    let mut progress = Progress::new("setting");
    Ok(opened.client().apply(changes, |number| progress.show(number, changes.len())).await?)
}

/// Reads everything back, and has it stored where that is wanted and all is well.
async fn verify(opened: &Opened, args: &ApplyArgs, plan: &Plan) -> Result<Outcome, Failure> {
    let now = opened.client().read_settings().await.map_err(|cause| unverified(plan, cause))?;
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

fn unverified(plan: &Plan, cause: Error) -> Failure {
    let done = format!("{} settings were sent, but could not be read back", plan.changes.len());
    Error::Partly { done, cause: Box::new(cause) }.into()
}

/// Says how it ended.
fn conclude(opened: &Opened, plan: &Plan, outcome: &Outcome) -> Result<(), Failure> {
    if !outcome.differences.is_empty() {
        return print(&format!("\n{}", text(&difference_table(&outcome.differences, &[]))));
    }
    if !plan.changes.is_empty() {
        print(&format!("set, and {}\n", verified(plan)))?;
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

/// What was read back, and what could not be.
fn verified(plan: &Plan) -> String {
    let count = plan.file.profile.settings.len();
    match &plan.untold {
        None => format!("all {count} settings of the file read back as they should"),
        Some(names) => {
            let told = count - plan.changes.iter().filter(|change| change.now.is_none()).count();
            format!("{told} settings of the file read back as they should; not told over this line: {names}")
        }
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
    client.configure_lan(wanted).await?;
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
    let change = |(change, sent): (&Change, &String)| {
        json!({
            "name": change.key.name(),
            "now": change.now.map(number),
            "to": number(change.to),
            "unit": change.key.unit(),
            "sent": sent,
        })
    };
    let lan = plan.lan.as_ref().map(|(_, lan)| json_of(&[], lan));
    json!({
        "axis": opened.name(),
        "file": plan.file.name,
        "dry_run": args.dry_run,
        "changes": plan.changes.iter().zip(&plan.sent).map(change).collect::<Vec<Value>>(),
        "not_told": plan.untold,
        "lan": lan,
        "verified": outcome.map(|outcome| outcome.differences.is_empty()),
        "differences": outcome.map(|outcome| json_of(&outcome.differences, &[])),
        "stored": outcome.is_some_and(|outcome| outcome.stored),
    })
}
