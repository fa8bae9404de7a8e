//! `stepdrive replay`: a recording is run again, and compared with what was recorded.

use crate::Failure;
use crate::terminal::{print, print_json};
use std::fs::File;
use std::io::{self, BufRead, BufReader};
use std::path::PathBuf;
use stepdrive_server::replay::{self, ReplayError, Replayed};

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stepdrive up --record session.jsonl
  stepdrive replay session.jsonl
  stepdrive replay session.jsonl --json | jq -r .digest

Exit codes: 0 all is identical, 1 it is no recording or one of another version, 2 it cannot be read, 10 something differs.
A recording that was cut short, as by a kill, is replayed as far as it goes.")]
pub(crate) struct ReplayArgs {
    /// The recording, made by `stepdrive up --record FILE`. `-` reads it from stdin.
    file: PathBuf,
    /// Print a line of JSON on stdout.
    #[arg(long)]
    json: bool,
}

/// Runs a recording again and tells what came of it.
pub(crate) fn replay(args: &ReplayArgs) -> Result<(), Failure> {
    let (name, source) = open(args)?;
    let replayed = replay::replay(source).map_err(|error| cannot_replay(&name, &error))?;
    if args.json {
        print_json(&replayed)?;
    } else {
        print(&format!("{name}: {replayed}\n"))?;
    }
    verdict(&name, &replayed)
}

fn open(args: &ReplayArgs) -> Result<(String, Box<dyn BufRead>), Failure> {
    if args.file.as_os_str() == "-" {
        return Ok(("stdin".to_owned(), Box::new(io::stdin().lock())));
    }
    let name = args.file.display().to_string();
    let file = File::open(&args.file);
    let file = file.map_err(|error| Failure::Failed(format!("cannot read the recording {name}: {error}")))?;
    Ok((name, Box::new(BufReader::new(file))))
}

fn cannot_replay(name: &str, error: &ReplayError) -> Failure {
    let message = format!("{name}: {error}");
    match error {
        // What is no text is no recording either; everything else that goes wrong here is the disk's doing.
        ReplayError::Read { error, .. } if error.kind() != io::ErrorKind::InvalidData => {
            Failure::Failed(message)
        }
        ReplayError::Read { .. }
        | ReplayError::NoRecording(_)
        | ReplayError::Version { .. }
        | ReplayError::Rig(_)
        | ReplayError::Entry { .. }
        | ReplayError::TooMuch { .. } => Failure::Usage(message),
    }
}

fn verdict(name: &str, replayed: &Replayed) -> Result<(), Failure> {
    let differs = || Failure::Differs(format!("{name}: the replay is not as it was recorded"));
    replayed.identical.then_some(()).ok_or_else(differs)
}
