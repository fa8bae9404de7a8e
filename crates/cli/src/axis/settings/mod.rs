//! `stepdrive settings`: a controller's settings as a file.

mod apply;
mod drive;
mod kind;
mod lan;
mod profile;

use super::{AxisArgs, Opened, look_at};
use crate::rig::table::{Align, table, text};
use crate::terminal::{print, print_json, tell};
use crate::{Failure, disk};
use clap::Subcommand;
use drive::{identity, lan_of, untold};
use kind::ControllerKind;
use lan::differences as lan_differences;
use profile::Profile;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use stepdrive_host::settings::{Difference, Family, Key, differences};

/// What can be done with settings.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Write the settings of a controller to a file, with what each means.
    Save(SaveArgs),
    /// Tell where a controller is not as a file says; exit with 10 when there is such a place.
    Diff(DiffArgs),
    /// Bring a controller to what a file says, and read it back.
    Apply(apply::ApplyArgs),
}

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stepdrive settings save stage.profile.toml -a stage
  stepdrive settings save - -a /dev/ttyACM0")]
pub(crate) struct SaveArgs {
    /// The file; what was there is replaced. `-` writes to stdout. By default the profile that stepdrive.toml names.
    file: Option<PathBuf>,
    /// An SMSD's LAN parameters too.
    #[arg(long)]
    lan: bool,
    #[command(flatten)]
    axis: AxisArgs,
}

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stepdrive settings diff stage.profile.toml -a stage
  stepdrive settings diff -a stage --json | jq '.differences[].name'")]
pub(crate) struct DiffArgs {
    /// The file. By default the profile that stepdrive.toml names.
    file: Option<PathBuf>,
    #[command(flatten)]
    axis: AxisArgs,
}

/// Does what was asked.
pub(crate) fn settings(command: &Command) -> Result<(), Failure> {
    match command {
        Command::Save(args) => save(args),
        Command::Diff(args) => diff(args),
        Command::Apply(args) => apply::apply(args),
    }
}

/// The file that is meant.
fn file_of<'a>(given: Option<&'a Path>, opened: &'a Opened) -> Result<&'a Path, Failure> {
    given.or(opened.found.profile.as_deref()).ok_or_else(|| {
        let name = opened.name();
        Failure::Usage(format!("name a file: stepdrive.toml says no `profile` for {name}"))
    })
}

/// A profile that was read, and what is needed to speak of it.
struct Read {
    name: String,
    text: String,
    profile: Profile,
}

impl Read {
    fn from(file: &Path) -> Result<Read, Failure> {
        let name = file.display().to_string();
        let text = std::fs::read_to_string(file)
            .map_err(|error| Failure::Usage(format!("cannot read {name}: {error}")))?;
        let profile = Profile::parse(&text).map_err(|mistake| Failure::Usage(mistake.render(&name)))?;
        Ok(Read { name, text, profile })
    }

    /// A mistake in the value of a setting.
    fn mistake(&self, key: Key, message: String) -> Failure {
        Failure::Usage(self.profile.mistake(&self.text, key, message).render(&self.name))
    }

    /// That it is for a controller of this kind.
    fn check_kind(&self, opened: &Opened, is: ControllerKind) -> Result<(), Failure> {
        let (name, of) = (opened.name(), self.profile.kind);
        if of.family() != is.family() {
            return Err(Failure::Usage(format!("{} is for an {of}, and {name} is an {is}", self.name)));
        }
        if of != is {
            tell(&format!("{} was made for an {of}; {name} is an {is}", self.name));
        }
        Ok(())
    }
}

fn save(args: &SaveArgs) -> Result<(), Failure> {
    look_at(&args.axis, async |opened| {
        let file = file_of(args.file.as_deref(), opened)?;
        let kind = identity(opened).await?;
        if args.lan && kind.family() == Family::Smd3 {
            return Err(Failure::Usage("an SMD3 has no LAN parameters; leave --lan out".to_owned()));
        }
        let settings = opened.client().read_settings().await?;
        if let Some(names) = untold(opened, Key::all(kind.family())) {
            tell(&format!("{} does not tell all over this line; left out: {names}", opened.name()));
        }
        let lan = if args.lan { lan_of(opened).await? } else { None };
        let heading =
            format!("The settings of {}, read by stepdrive {}.", opened.name(), env!("CARGO_PKG_VERSION"));
        let profile = profile::text(&heading, kind, &settings, lan.as_ref());
        if file.as_os_str() == "-" {
            return print(&profile);
        }
        disk::replace(file, profile.as_bytes())?;
        let shown = file.display();
        if args.axis.reach.json {
            return print_json(&json!({
                "axis": opened.name(), "file": shown.to_string(), "settings": settings.len(), "lan": lan.is_some(),
            }));
        }
        print(&format!("{} settings of {} to {shown}\n", settings.len(), opened.name()))
    })
}

fn diff(args: &DiffArgs) -> Result<(), Failure> {
    look_at(&args.axis, async |opened| {
        let read_file = Read::from(file_of(args.file.as_deref(), opened)?)?;
        read_file.check_kind(opened, identity(opened).await?)?;
        let found = differences(&read_file.profile.settings, &opened.client().read_settings().await?);
        let lan = lan_difference(opened, &read_file.profile).await?;
        if let Some(names) = untold(opened, read_file.profile.settings.iter().map(|(key, _)| *key)) {
            tell(&format!("{} does not tell all over this line; not compared: {names}", opened.name()));
        }
        if args.axis.reach.json {
            print_json(&json!({
                "axis": opened.name(),
                "file": read_file.name,
                "same": found.is_empty() && lan.is_empty(),
                "differences": json_of(&found, &lan),
            }))?;
        } else if found.is_empty() && lan.is_empty() {
            print(&format!("{} is as {} says\n", opened.name(), read_file.name))?;
        } else {
            print(&text(&difference_table(&found, &lan)))?;
        }
        match found.len() + lan.len() {
            0 => Ok(()),
            count => Err(differs(count, opened, &read_file.name)),
        }
    })
}

fn differs(count: usize, opened: &Opened, file: &str) -> Failure {
    let settings = if count == 1 { "1 setting".to_owned() } else { format!("{count} settings") };
    Failure::Differs(format!("{settings} of {} not as {file} says", opened.name()))
}

/// A LAN parameter that is not the same: its name, the value in the file, and that in the controller.
type LanDifference = (&'static str, String, String);

async fn lan_difference(opened: &Opened, profile: &Profile) -> Result<Vec<LanDifference>, Failure> {
    let Some(wanted) = &profile.lan else { return Ok(Vec::new()) };
    let found = lan_of(opened).await?;
    Ok(found.map_or_else(Vec::new, |found| lan_differences(wanted, &found)))
}

fn difference_table(found: &[Difference], lan: &[LanDifference]) -> Vec<String> {
    let of_setting =
        |one: &Difference| [one.key.name().to_owned(), shown(one.key, one.wanted), shown(one.key, one.found)];
    let of_lan = |(name, file, now): &LanDifference| [format!("lan.{name}"), file.clone(), now.clone()];
    let rows: Vec<[String; 3]> = found.iter().map(of_setting).chain(lan.iter().map(of_lan)).collect();
    table([("SETTING", Align::Left), ("FILE", Align::Left), ("CONTROLLER", Align::Left)], &rows)
}

fn json_of(found: &[Difference], lan: &[LanDifference]) -> Vec<Value> {
    let of_setting = |one: &Difference| {
        json!({
            "name": one.key.name(),
            "file": number(one.wanted),
            "controller": number(one.found),
            "unit": one.key.unit(),
        })
    };
    let of_lan = |(name, file, now): &LanDifference| json!({ "name": format!("lan.{name}"), "file": unquoted(file), "controller": unquoted(now), "unit": "" });
    found.iter().map(of_setting).chain(lan.iter().map(of_lan)).collect()
}

/// A value of a profile without its quotation marks.
fn unquoted(text: &str) -> &str {
    text.trim_matches('"')
}

/// A value with its unit and what it means.
fn shown(key: Key, value: f64) -> String {
    let unit = super::map::unit(key.unit());
    let meaning = key.meaning(value);
    if meaning.is_empty() { format!("{value}{unit}") } else { format!("{value} ({meaning})") }
}

/// A number for JSON: a whole one without a fraction.
pub(super) fn number(value: f64) -> Value {
    // Within 2^53 nothing is lost by it.
    #[allow(clippy::cast_possible_truncation, reason = "whole, and within 53 bits")]
    if value.fract() == 0.0 && value.abs() < 9e15 { (value as i64).into() } else { value.into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_numbers_have_no_fraction_in_json() {
        assert_eq!(number(1000.0).to_string(), "1000");
        assert_eq!(number(-0.5).to_string(), "-0.5");
        assert_eq!(number(1e300).to_string(), "1e+300");
    }
}
