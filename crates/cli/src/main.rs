//! `stepdrive`: stepper motor controllers, virtual ones on the wire and both kinds under control.
//!
//! Results go to stdout, talk to stderr. Exit codes: 0 done; 1 the arguments, or a file named in them, are wrong; 2 it
//! failed; 3 there is no such axis; 4 there are several; 5 trouble on the line; 6 not authorised; 7 refused by a limit or
//! interlock; 8 a fault is latched in the drive; 9 a program has errors; 10 something is not as it should be; 11 a scenario
//! did not pass.

mod axis;
mod disk;
mod manual;
mod panel;
mod plot;
mod program;
mod replay;
mod rig;
mod rigs;
mod table;
mod terminal;
mod up;

use clap::{CommandFactory, Parser, Subcommand};
use std::fmt;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;
use stepdrive_rig::file::ClockMode;
use terminal::{print, tell};

/// SMSD and SMD3 stepper motor controllers: real and virtual ones under control, and virtual ones for any client.
#[derive(Debug, Parser)]
#[command(
    version,
    after_help = "Exit codes: 0 done, 1 wrong arguments, or a mistake in a file, 2 it could not be done, 3 there is no such axis, \
4 there are several, 5 trouble on the line, 6 not authorised, 7 refused by a limit or interlock, 8 a fault is latched in the \
drive, 9 the program has errors, 10 what was verified differs, a program is not laid out properly, or a replay differs, 11 the \
scenario did not pass."
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Show how an axis stands: position and whether it can be trusted, motion, limits, faults.
    Status(axis::StatusArgs),
    /// Show live how one or several axes stand, until Ctrl-C.
    Watch(axis::WatchArgs),
    /// Move an axis to a position or by a distance, and wait until it is there.
    Move(axis::MoveArgs),
    /// Let an axis run in a direction until it is stopped.
    Run(axis::RunArgs),
    /// Stop an axis.
    Stop(axis::StopArgs),
    /// Look for the home switch of an axis, and take its place as zero.
    Home(axis::HomeArgs),
    /// Take the place where an axis stands as zero.
    Zero(axis::ZeroArgs),
    /// Read registers of an SMSD, or values of an SMD3.
    Get(axis::GetArgs),
    /// Set a register of an SMSD, or a value of an SMD3.
    Set(axis::SetArgs),
    /// Show everything that a controller holds, decoded: the register map of an SMSD, the values of an SMD3.
    Regs(axis::RegsArgs),
    /// Save, compare and apply the settings of a controller as a file.
    #[command(subcommand)]
    Settings(axis::SettingsCommand),
    /// Show the status and error flags of a controller.
    Flags(axis::FlagsArgs),
    /// Clear the faults that are latched in a controller.
    Clear(axis::ClearArgs),
    /// Warm the motor of an SMD3 through its phases, or end that.
    Bake(axis::BakeArgs),
    /// Talk with a controller in its own words, explained.
    Term(axis::TermArgs),
    /// List where controllers may be found: serial ports, and the drives of a rig that runs here.
    Ports(axis::PortsArgs),
    /// Show axes in a browser, and drive them from there: jog, move, home, settings, programs.
    Panel(panel::PanelArgs),
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
    /// Record quantities of axes over time to CSV or Parquet.
    Record(axis::RecordArgs),
    /// Draw a recording: its quantities over time, a panel for each unit.
    Plot(plot::PlotArgs),
    /// Print what makes a shell complete the words of stepdrive.
    Completions(manual::CompletionsArgs),
    /// Write manual pages for `man`.
    Man(manual::ManArgs),
}

#[derive(Debug, clap::Args)]
struct UpArgs {
    /// The rig file; without one, the built-in demo rig: an SMSD-4.2LAN named `stage` on 127.0.0.1:5020, and an SMD3 named
    /// `uhv`.
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
    /// There is no such axis: exit code 3.
    NotFound(String),
    /// There are several of which it may be: exit code 4.
    Several(String),
    /// A controller could not be brought to do it: the exit code is the error's own, 1 to 10.
    Host(stepdrive_host::Error),
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
        Command::Status(args) => axis::status(&args),
        Command::Watch(args) => axis::watch(&args),
        Command::Move(args) => axis::r#move(&args),
        Command::Run(args) => axis::run(&args),
        Command::Stop(args) => axis::stop(&args),
        Command::Home(args) => axis::home(&args),
        Command::Zero(args) => axis::zero(&args),
        Command::Get(args) => axis::get(&args),
        Command::Set(args) => axis::set(&args),
        Command::Regs(args) => axis::regs(&args),
        Command::Settings(command) => axis::settings(&command),
        Command::Flags(args) => axis::flags(&args),
        Command::Clear(args) => axis::clear(&args),
        Command::Bake(args) => axis::bake(&args),
        Command::Term(args) => axis::term(&args),
        Command::Ports(args) => axis::ports(&args),
        Command::Panel(args) => panel::panel(&args),
        Command::Up(args) => up::up(&args),
        Command::Rig(args) => rig::rig(&args),
        Command::Replay(args) => replay::replay(&args),
        Command::ExampleRig => print(stepdrive_rig::file::DEMO),
        Command::Program(command) => program::program(&command),
        Command::Record(args) => axis::record(&args),
        Command::Plot(args) => plot::plot(&args),
        Command::Completions(args) => manual::completions(Cli::command(), &args),
        Command::Man(args) => manual::man(Cli::command(), &args),
    };
    let Err(failure) = outcome else { return ExitCode::SUCCESS };
    tell(&format!("stepdrive: {failure}"));
    ExitCode::from(failure.exit_code())
}

impl Failure {
    fn exit_code(&self) -> u8 {
        match self {
            Failure::Usage(_) => 1,
            Failure::Failed(_) => 2,
            Failure::NotFound(_) => 3,
            Failure::Several(_) => 4,
            Failure::Host(error) => error.exit_code(),
            Failure::Program(_) => 9,
            Failure::Differs(_) => 10,
            Failure::Scenario(_) => 11,
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Failure::Usage(message)
            | Failure::Failed(message)
            | Failure::NotFound(message)
            | Failure::Several(message)
            | Failure::Program(message)
            | Failure::Differs(message)
            | Failure::Scenario(message) => f.write_str(message),
            Failure::Host(error) => error.fmt(f),
        }
    }
}

impl From<stepdrive_host::Error> for Failure {
    fn from(error: stepdrive_host::Error) -> Failure {
        Failure::Host(error)
    }
}
