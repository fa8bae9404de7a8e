//! `stepdrive`: virtual stepper motor controllers on the wire.
//!
//! Results go to stdout, talk to stderr. Exit codes: 0 done; 1 the arguments or the rig file are wrong; 2 it failed; 9 a
//! program has errors; 10 a file is not as it should be.

mod program;
mod rigs;
mod up;

use clap::{Parser, Subcommand};
use std::io::{self, Write};
use std::path::PathBuf;
use std::process::ExitCode;

/// Virtual stepper motor controllers that any client written for the real ones can use.
#[derive(Debug, Parser)]
#[command(
    version,
    after_help = "Exit codes: 0 done, 1 wrong arguments or rig file, 2 failed, 9 the program has errors, 10 not laid out properly."
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Bring up a rig of virtual controllers and keep it running until Ctrl-C or SIGTERM.
    Up(UpArgs),
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
        Command::ExampleRig => print(stepdrive_rig::file::DEMO),
        Command::Program(command) => program::program(&command),
    };
    let (message, code) = match outcome {
        Ok(()) => return ExitCode::SUCCESS,
        Err(Failure::Usage(message)) => (message, 1),
        Err(Failure::Failed(message)) => (message, 2),
        Err(Failure::Program(message)) => (message, 9),
        Err(Failure::Differs(message)) => (message, 10),
    };
    // Without a stderr there is nobody to tell.
    let _ = writeln!(io::stderr(), "stepdrive: {message}");
    ExitCode::from(code)
}

/// Writes a result to stdout. A reader that has gone, as in `stepdrive example-rig | head -1`, is no failure.
fn print(text: &str) -> Result<(), Failure> {
    let mut stdout = io::stdout().lock();
    match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(Failure::Failed(format!("cannot write to stdout: {error}")))
        }
        _ => Ok(()),
    }
}
