//! `stepdrive rig play`.

use super::client::{Client, Refusal};
use crate::terminal::{print, print_json, tell};
use crate::{Failure, disk, rigs};
use serde_json::json;
use std::fs;
use std::io::{self, Read};
use std::ops::Range;
use std::path::{Path, PathBuf};
use stepdrive_server::Recording;
use stepdrive_server::scenario::{Mistake, Report, Scenario, StepEvent, record_headless, run_headless};

/// What to play, and where.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stepdrive rig play shuttle.toml                                on the rig that runs
  stepdrive rig play shuttle.toml --headless                     on a rig of its own, on virtual time
  stepdrive rig play shuttle.toml --headless --junit result.xml  for continuous integration

Exit codes: 0 it passed, 1 wrong arguments or a mistake in a file, 2 it could not be played, 11 it did not pass.")]
pub(super) struct PlayArgs {
    /// The scenario. `-` reads it from stdin.
    file: PathBuf,
    /// Play it without a rig that runs, as fast as this computer can: on the rig that the scenario names, or the demo rig.
    #[arg(long)]
    headless: bool,
    /// Play it headless on this rig, and not on the one that the scenario names.
    #[arg(long, requires = "headless")]
    rig: Option<PathBuf>,
    /// Record the headless run to this new file, for `stepdrive replay`.
    #[arg(long, value_name = "FILE", requires = "headless")]
    record: Option<PathBuf>,
    #[arg(long, value_name = "FILE", help = "Write the report also to this file, as JUnit XML")]
    junit: Option<PathBuf>,
}

/// A scenario as it was read.
struct Source {
    /// What it is called in messages.
    name: String,
    text: String,
}

/// Plays a scenario, and tells whether it passed.
pub(super) fn play(
    client: impl FnOnce() -> Result<Client, Failure>,
    args: &PlayArgs,
    json: bool,
) -> Result<(), Failure> {
    let source = read(&args.file)?;
    let report = if args.headless { play_headless(&source, args)? } else { play_on(&client()?, &source)? };
    if json {
        print_json(&report)?;
    } else {
        print(&format!("{report}\n"))?;
    }
    if let Some(file) = &args.junit {
        disk::replace(file, report.to_junit().as_bytes())?;
    }
    let failed = || Failure::Scenario(format!("{}: the scenario did not pass", source.name));
    report.passed.then_some(()).ok_or_else(failed)
}

fn read(file: &Path) -> Result<Source, Failure> {
    let (name, text) = if file.as_os_str() == "-" {
        ("stdin".to_owned(), io::read_to_string(io::stdin().lock().take(MOST_BYTES)))
    } else {
        (file.display().to_string(), read_file(file))
    };
    let text = text.map_err(|error| Failure::Usage(format!("cannot read the scenario {name}: {error}")))?;
    Ok(Source { name, text })
}

/// The most that is read: more than the control API takes.
const MOST_BYTES: u64 = 16 << 20;

fn read_file(file: &Path) -> io::Result<String> {
    io::read_to_string(fs::File::open(file)?.take(MOST_BYTES))
}

/// Plays it on a rig of its own.
fn play_headless(source: &Source, args: &PlayArgs) -> Result<Report, Failure> {
    let mistake = |mistake: Mistake| Failure::Usage(mistake.render(&source.name));
    let rig = match &args.rig {
        Some(rig) => Some(rig.clone()),
        None => Scenario::rig_named(&source.text).map_err(mistake)?.map(|rig| beside(&args.file, &rig)),
    };
    let (name, text) = rigs::read_text(rig.as_deref())?;
    let rig = rigs::parse(&name, &text)?;
    let scenario = Scenario::parse(&source.text, &rig).map_err(mistake)?;
    let Some(file) = args.record.clone() else { return Ok(run_headless(&rig, &scenario)) };
    let shown = file.display().to_string();
    let recorded = record_headless(&rig, &scenario, &Recording { file, rig: text });
    recorded.map_err(|error| Failure::Failed(format!("cannot record to {shown}: {error}")))
}

/// A file that another one names.
fn beside(file: &Path, named: &str) -> PathBuf {
    file.parent().unwrap_or(Path::new("")).join(named)
}

/// Plays it on the rig that runs, and tells meanwhile how far it is.
fn play_on(client: &Client, source: &Source) -> Result<Report, Failure> {
    let events = client.post_and_listen("/v1/play", &json!({ "scenario": source.text }));
    for event in events.map_err(|refusal| refused(refusal, source))? {
        let Ok(event) = event else { break };
        match event.name.as_str() {
            "step" => tell(&told::<StepEvent>(client, &event.data)?.text(0)),
            "report" => return told(client, &event.data),
            _ => {}
        }
    }
    Err(Failure::Failed(format!("the rig at {} ended before the scenario did", client.base())))
}

fn told<T: serde::de::DeserializeOwned>(client: &Client, data: &str) -> Result<T, Failure> {
    serde_json::from_str(data).map_err(|error| {
        let base = client.base();
        Failure::Failed(format!("what the rig at {base} tells of the scenario cannot be read: {error}"))
    })
}

/// A mistake in the scenario is told with its place in the file.
fn refused(refusal: Refusal, source: &Source) -> Failure {
    let Some((line, column)) = refusal.place else { return refusal.into() };
    let mistake = Mistake::new(&source.text, span(&source.text, line, column), refusal.message);
    Failure::Usage(mistake.render(&source.name))
}

/// The character at a line and a column, both from 1, in bytes.
fn span(text: &str, line: usize, column: usize) -> Option<Range<usize>> {
    let before: usize = text.split_inclusive('\n').take(line.checked_sub(1)?).map(str::len).sum();
    let (at, found) = text.get(before..)?.char_indices().nth(column.checked_sub(1)?)?;
    Some(before + at..before + at + found.len_utf8())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_is_found_in_the_text() {
        let text = "a\nµb\n";
        assert_eq!(span(text, 1, 1), Some(0..1));
        assert_eq!(span(text, 2, 1), Some(2..4));
        assert_eq!(span(text, 2, 2), Some(4..5));
        for (line, column) in [(0, 1), (1, 0), (9, 1), (2, 9)] {
            assert_eq!(span(text, line, column), None, "{line}:{column}");
        }
    }

    #[test]
    fn a_rig_is_looked_for_beside_the_scenario_that_names_it() {
        assert_eq!(beside(Path::new("tests/s.toml"), "r.toml"), Path::new("tests/r.toml"));
        assert_eq!(beside(Path::new("s.toml"), "r.toml"), Path::new("r.toml"));
        assert_eq!(beside(Path::new("tests/s.toml"), "/rigs/r.toml"), Path::new("/rigs/r.toml"));
    }
}
