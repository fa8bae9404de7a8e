//! `stepdrive rig`: a rig that runs is looked at and controlled, through its control API.

mod client;
mod clock;
mod play;
mod show;
mod sse;
mod state;
pub(crate) mod table;
pub(crate) mod watch;

pub(crate) use client::{At, DEFAULT_API};
pub(crate) use state::DriveState;

use crate::Failure;
use crate::terminal::{print, print_json};
use clap::Subcommand;
use client::{Client, part};
use serde_json::json;
use state::{Done, DriveDetail, Fault, RigState, time};

/// How a rig is controlled.
#[derive(Debug, clap::Args)]
pub(crate) struct RigArgs {
    #[command(flatten)]
    at: At,
    /// Print JSON on stdout, as the control API gives it.
    #[arg(long, global = true)]
    json: bool,
    #[command(subcommand)]
    command: Command,
}

/// What can be done with a rig that runs.
#[derive(Debug, Subcommand)]
enum Command {
    /// Show the drives, the clock and the wires.
    #[command(after_help = "Examples:
  stepdrive rig status
  stepdrive rig status stage         all that is known of the drive `stage`
  stepdrive rig status --json | jq '.drives[0].position'")]
    Status {
        /// One drive, with every quantity that conditions can name.
        drive: Option<String>,
    },
    /// Show or set how rig time passes, or move it forward.
    Clock(clock::ClockArgs),
    /// Force an input, pulse it, or release it to what is wired to it.
    #[command(after_help = "Examples:
  stepdrive rig input stage.IN0 1
  stepdrive rig input stage.IN0 0 for 2s
  stepdrive rig input stage.IN0 pulse 5ms
  stepdrive rig input stage.STEP pulse 5ms x200 every 10ms
  stepdrive rig input stage.IN0 release")]
    Input {
        /// The input, as in stage.IN0.
        #[arg(value_name = "DRIVE.INPUT")]
        input: String,
        /// 1, 0, release, or: pulse WIDTH [xCOUNT every PERIOD]. After 1 and 0: for DURATION.
        #[arg(required = true, value_name = "SIGNAL")]
        signal: Vec<String>,
    },
    /// List the faults that the drives can have, or switch one on or off.
    #[command(after_help = "Examples:
  stepdrive rig fault                          lists them, and which are on
  stepdrive rig fault uhv.thermocouple open
  stepdrive rig fault uhv.thermocouple off
  stepdrive rig fault stage.connection silent for 5s")]
    Fault {
        /// The fault, as in uhv.thermocouple.
        #[arg(value_name = "DRIVE.FAULT", requires = "setting")]
        fault: Option<String>,
        /// One of its settings, or off. Then, if it is to end by itself: for DURATION.
        setting: Vec<String>,
    },
    /// List the wires of the rig file, or cut or mend one.
    #[command(after_help = "Examples:
  stepdrive rig wire                           lists them
  stepdrive rig wire a.relay b.CONTINUE cut
  stepdrive rig wire a.relay b.CONTINUE mend")]
    Wire {
        /// The output at which it begins, as in a.relay.
        #[arg(requires = "to")]
        from: Option<String>,
        /// The input at which it ends, as in b.CONTINUE.
        #[arg(requires = "state")]
        to: Option<String>,
        /// cut or mend.
        state: Option<String>,
    },
    /// Take the supply away from a drive, or bring it back.
    #[command(after_help = "Examples:
  stepdrive rig power stage off
  stepdrive rig power stage on
  stepdrive rig power stage off for 2s         a power cut")]
    Power {
        /// The drive.
        drive: String,
        /// on or off; then, if it is to be taken back by itself: for DURATION.
        #[arg(required = true, value_name = "ON|OFF")]
        state: Vec<String>,
    },
    /// Set the front panel of an SMSD; it is in effect from the next power-up on.
    #[command(after_help = "Examples:
  stepdrive rig panel stage bF 2               the program of memory 2 starts at power-up
  stepdrive rig panel stage LA")]
    Panel {
        /// The drive.
        drive: String,
        /// LA (controlled over the network) or bF (a program starts at power-up).
        #[arg(value_name = "LA|bF")]
        mode: String,
        /// `MODE_N_PROGRAMS`, 0 to 3.
        program: Option<String>,
    },
    /// Do several things at one time, each written as behind `stepdrive rig`; all or, when one is wrong, none.
    #[command(after_help = "Examples:
  stepdrive rig do 'input a.IN0 1' 'input b.IN0 1'
  stepdrive rig do 'wire a.relay b.CONTINUE cut' 'fault b.rotor blocked for 1s'")]
    Do {
        /// What is to be done: input, fault, wire, power, panel.
        #[arg(required = true, value_name = "ACTION")]
        actions: Vec<String>,
    },
    /// Play a scenario, and tell whether it passed.
    Play(play::PlayArgs),
    /// Show live what the drives do, until Ctrl-C.
    Watch(watch::WatchArgs),
}

/// Does what was asked.
pub(crate) fn rig(args: &RigArgs) -> Result<(), Failure> {
    let json = args.json;
    let client = || Client::new(&args.at);
    match &args.command {
        Command::Status { drive: None } => status(&client()?, json),
        Command::Status { drive: Some(drive) } => drive_status(&client()?, drive, json),
        Command::Clock(clock) => clock::clock(&client()?, clock, json),
        Command::Fault { fault: None, .. } => list_faults(&client()?, json),
        Command::Wire { from: None, .. } => list_wires(&client()?, json),
        Command::Play(play) => play::play(client, play, json),
        Command::Watch(watch) => watch::watch(&client()?, watch, json),
        Command::Input { .. }
        | Command::Fault { .. }
        | Command::Wire { .. }
        | Command::Power { .. }
        | Command::Panel { .. }
        | Command::Do { .. } => act(&client()?, &args.command.actions(), json),
    }
}

impl Command {
    /// The actions that it stands for, as the control API and scenarios write them.
    fn actions(&self) -> Vec<String> {
        let one = |action: &str, target: &str, words: &[String]| {
            vec![format!("{action} {target} {}", words.join(" ")).trim_end().to_owned()]
        };
        match self {
            Command::Input { input, signal } => one("input", input, signal),
            Command::Fault { fault: Some(fault), setting } => one("fault", fault, setting),
            Command::Power { drive, state } => one("power", drive, state),
            Command::Panel { drive, mode, program } => {
                let program = program.as_ref().map(|program| format!(" {program}")).unwrap_or_default();
                vec![format!("panel {drive} {mode}{program}")]
            }
            Command::Wire { from: Some(from), to: Some(to), state: Some(state) } => {
                vec![format!("wire {from} {to} {state}")]
            }
            Command::Do { actions } => actions.clone(),
            Command::Fault { .. }
            | Command::Wire { .. }
            | Command::Status { .. }
            | Command::Clock(_)
            | Command::Play(_)
            | Command::Watch(_) => Vec::new(),
        }
    }
}

/// What answers where a rig may be.
#[derive(Debug)]
pub(crate) enum Answering {
    /// Nothing, or what is no rig.
    Nothing,
    /// A rig that lets nobody in without its token; what it says.
    Closed(String),
    /// A rig with these drives.
    Rig(Vec<DriveState>),
}

/// Asks who is there, and says where that is.
pub(crate) fn look_at(at: &At) -> Result<(String, Answering), Failure> {
    let client = Client::new(at)?;
    let rig = client.get("/v1/rig").and_then(|answer| answer.read::<RigState>());
    let answering = match rig {
        Ok(rig) => Answering::Rig(rig.drives),
        Err(refusal) if refusal.wrong => Answering::Closed(refusal.message),
        Err(_) => Answering::Nothing,
    };
    Ok((client.base().to_owned(), answering))
}

fn status(client: &Client, json: bool) -> Result<(), Failure> {
    let answer = client.get("/v1/rig")?;
    if json {
        return print(&answer.line());
    }
    print(&show::picture(&answer.read::<RigState>()?).text())
}

fn drive_status(client: &Client, drive: &str, json: bool) -> Result<(), Failure> {
    let answer = client.get(&format!("/v1/drives/{}", part(drive)))?;
    if json {
        return print(&answer.line());
    }
    print(&show::detail(&answer.read::<DriveDetail>()?))
}

fn list_faults(client: &Client, json: bool) -> Result<(), Failure> {
    let answer = client.get("/v1/faults")?;
    if json {
        return print(&answer.line());
    }
    print(&table::text(&show::fault_list(&answer.read::<Vec<Fault>>()?)))
}

fn list_wires(client: &Client, json: bool) -> Result<(), Failure> {
    let rig: RigState = client.get("/v1/rig")?.read()?;
    if json {
        return print_json(&rig.wires);
    }
    if rig.wires.is_empty() {
        return print("the rig has no wires; a wire is a [[wire]] of the rig file\n");
    }
    print(&table::text(&show::wires(&rig.wires)))
}

/// Does something to the rig.
fn act(client: &Client, actions: &[String], json: bool) -> Result<(), Failure> {
    let answer = client.post("/v1/actions", &json!({ "do": actions }))?;
    if json {
        return print(&answer.line());
    }
    print(&format!("done at rig time {}\n", time(answer.read::<Done>()?.now_ns)))
}
