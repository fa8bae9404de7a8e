//! `stepdrive`: virtual stepper motor controllers on the wire.
//!
//! Results go to stdout, talk to stderr. Exit codes: 0 done; 1 the arguments, or a file named in them, are wrong; 2 it
//! failed; 9 a program has errors; 10 a file is not as it should be; 11 a scenario did not pass.

mod disk;
mod program;
mod replay;
mod rig;
mod rigs;
mod terminal;
mod up;

use clap::{Parser, Subcommand};
use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;
use stepdrive_rig::file::ClockMode;
use terminal::{print, tell};

/// Virtual stepper motor controllers that any client written for the real ones can use.
#[derive(Debug, Parser)]
#[command(
    version,
    after_help = "Exit codes: 0 done, 1 wrong arguments, or a mistake in a file, 2 it could not be done, 9 the program has errors, \
10 not laid out properly, or a replay differs, 11 the scenario did not pass."
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Bring up a rig of virtual controllers and keep it running until Ctrl-C or SIGTERM.
    Up(UpArgs),
    /// Look at a rig that runs, and control it: its clock, inputs, faults, wires, power.
    Rig(rig::RigArgs),
    /// Run a recording again, headless, and tell whether every reply and the final state are identical.
    Replay(replay::ReplayArgs),
    /// Print the demo rig file, commented: the starting point for one's own.
    ExampleRig,
    /// Check, build, read, lay out and run user programs of the SMSD.
    #[command(subcommand)]
    Program(program::Command),
}

#[derive(Debug, clap::Args)]
struct UpArgs {
    /// The rig file; without one, the built-in demo rig: an SMSD-4.2LAN named `stage` on 127.0.0.1:5020.
    rig: Option<PathBuf>,
    /// Print one line of JSON when everything is up, and nothing else, on stdout.
    #[arg(long)]
    json: bool,
    /// Where non-volatile memory lives; by default a folder for this rig in the platform's state folder.
    #[arg(long, value_name = "DIR")]
    state: Option<PathBuf>,
    /// Record everything that goes into the rig to this new file, for `stepdrive replay`.
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Where the rig is controlled from, instead of where its file says; port 0 takes a free one. Others than this
    /// computer are let in only when the rig file has an `api_token`.
    #[arg(long, value_name = "ADDRESS")]
    api: Option<SocketAddr>,
    /// How rig time passes, instead of as the rig file says: real, xFACTOR (0.01 to 1 000 000), paused.
    #[arg(long, value_name = "MODE", value_parser = ClockMode::parse)]
    clock: Option<ClockMode>,
}

/// A command that did not do what it was asked to.
#[derive(Debug)]
enum Failure {
    /// The arguments, or a file named in them, are wrong: exit code 1.
    Usage(String),
    /// It could not be done: exit code 2.
    Failed(String),
    /// A program has errors, or was refused while it ran: exit code 9.
    Program(String),
    /// A file is not as it should be: exit code 10.
    Differs(String),
    /// A scenario did not pass: exit code 11.
    Scenario(String),
}

fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            // Help and version are results; a mistake is talk. clap knows which goes where.
            let _ = error.print();
            return ExitCode::from(u8::from(error.use_stderr()));
        }
    };
    let outcome = match cli.command {
        Command::Up(args) => up::up(&args),
        Command::Rig(args) => rig::rig(&args),
        Command::Replay(args) => replay::replay(&args),
        Command::ExampleRig => print(stepdrive_rig::file::DEMO),
        Command::Program(command) => program::program(&command),
    };
    let (message, code) = match outcome {
        Ok(()) => return ExitCode::SUCCESS,
        Err(Failure::Usage(message)) => (message, 1),
        Err(Failure::Failed(message)) => (message, 2),
        Err(Failure::Program(message)) => (message, 9),
        Err(Failure::Differs(message)) => (message, 10),
        Err(Failure::Scenario(message)) => (message, 11),
    };
    tell(&format!("stepdrive: {message}"));
    ExitCode::from(code)
}
