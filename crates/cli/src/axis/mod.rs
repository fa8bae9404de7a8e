//! An axis: a real or virtual controller that is looked at and moved.
//!
//! Every command takes [`AxisArgs`] and works on an [`Opened`] axis, which [`look_at`] and [`act_on`] find and open. Nothing
//! moves by that.

mod attend;
mod bake;
mod config;
mod flags;
mod map;
mod meaning;
mod motion;
mod names;
mod ports;
pub(crate) mod progress;
mod record;
mod regs;
mod settings;
mod status;
mod target;
mod term;
mod trust;
mod values;
mod watch;

pub(crate) use bake::{BakeArgs, bake};
pub(crate) use flags::{ClearArgs, FlagsArgs, clear, flags};
pub(crate) use motion::{HomeArgs, MoveArgs, RunArgs, StopArgs, ZeroArgs, home, r#move, run, stop, zero};
pub(crate) use names::instead;
pub(crate) use ports::{PortsArgs, ports};
pub(crate) use record::{RecordArgs, record};
pub(crate) use regs::{RegsArgs, regs};
pub(crate) use settings::{Command as SettingsCommand, settings};
pub(crate) use status::{StatusArgs, status};
pub(crate) use target::{Found, find, find_all, measured};
pub(crate) use term::{TermArgs, term};
pub(crate) use trust::{Record, Remembered};
pub(crate) use values::{GetArgs, SetArgs, get, set};
pub(crate) use watch::{WatchArgs, watch};

use crate::Failure;
use std::path::PathBuf;
use std::time::Duration;
use stepdrive_host::Timeouts;
use stepdrive_host::axis::Axis;
pub(crate) use stepdrive_host::settings::Client;
use stepdrive_panel::Controller;
use stepdrive_rig::duration;
use tokio::runtime;
use trust::Keep;

/// Under which these options stand in help texts.
const HEADING: &str = "Which axis, and how to reach it";

/// Which axis, and how it is reached.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct AxisArgs {
    /// The axis: its name in stepdrive.toml, or where its controller is, as in `smsd+tcp://HOST:PORT?unit=1`,
    /// `smsd+usb:///dev/ttyACM0`, `smsd+usb+tcp://HOST:PORT`, `smsd+std://HOST:5000`, `smd3+serial:///dev/ttyACM0`,
    /// `smd3+tcp://HOST:PORT`, `HOST:PORT` (an SMSD), `/dev/ttyACM0` (an SMD3). By default the only one in stepdrive.toml.
    #[arg(short, long, value_name = "NAME|URI", help_heading = HEADING)]
    pub(crate) axis: Option<String>,
    #[command(flatten)]
    pub(crate) reach: Reach,
}

/// How axes are reached, and how results are printed.
#[derive(Clone, Debug, clap::Args)]
pub(crate) struct Reach {
    /// Where axes are described; by default stepdrive.toml here, or else in the platform's folder for configuration.
    #[arg(long, value_name = "FILE", help_heading = HEADING)]
    pub(crate) config: Option<PathBuf>,
    /// The variable of the environment that holds an SMSD's password, in hexadecimal; the factory's by default.
    #[arg(long, value_name = "VARIABLE", help_heading = HEADING)]
    pub(crate) password_env: Option<String>,
    /// The file that holds an SMSD's password.
    #[arg(long, value_name = "FILE", conflicts_with = "password_env", help_heading = HEADING)]
    pub(crate) password_file: Option<PathBuf>,
    /// How long a connection may take to come about.
    #[arg(long, value_name = "DURATION", default_value = "3s", value_parser = some_time, help_heading = HEADING)]
    pub(crate) connect_timeout: Duration,
    /// How long the controller may take to answer.
    #[arg(long, value_name = "DURATION", default_value = "1s", value_parser = some_time, help_heading = HEADING)]
    pub(crate) reply_timeout: Duration,
    /// Print JSON on stdout.
    #[arg(long)]
    pub(crate) json: bool,
}

impl Reach {
    fn timeouts(&self) -> Timeouts {
        Timeouts { connect: self.connect_timeout, reply: self.reply_timeout }
    }
}

/// A duration that is not 0.
pub(crate) fn some_time(text: &str) -> Result<Duration, String> {
    match duration::parse(text).map_err(|error| error.to_string())? {
        Duration::ZERO => Err("it is longer than 0s".to_owned()),
        some => Ok(some),
    }
}

/// An axis that can be worked on. It connects when it is first asked for something.
#[derive(Debug)]
pub(crate) struct Opened {
    /// What it is called, and what is known of it beforehand.
    pub(crate) found: Found,
    controller: Controller,
    record: Record,
}

impl Opened {
    /// What it is called.
    pub(crate) fn name(&self) -> &str {
        &self.found.name
    }

    /// What both families can do.
    pub(crate) fn axis(&self) -> &dyn Axis {
        self.controller.axis()
    }

    /// What turns it, and what is remembered of it.
    pub(crate) fn into_parts(self) -> (Controller, Record) {
        (self.controller, self.record)
    }

    /// Notes that it is about to be moved from here: from now on it may be anywhere.
    fn note_departure(&self) {
        let mut trust = self.axis().trust();
        trust.saw(None);
        self.record.keep(trust, Keep::Acts);
    }

    /// Its controller's client.
    pub(crate) fn client(&self) -> Client<'_> {
        match &self.controller {
            Controller::Smsd(axis) => Client::Smsd(axis.motor().client()),
            Controller::Smd3(axis) => Client::Smd3(axis.motor().client()),
        }
    }
}

/// Finds an axis and looks at it. If that shows that its position cannot be trusted any more, the next command will know.
pub(crate) fn look_at<T>(
    args: &AxisArgs,
    work: impl AsyncFnOnce(&Opened) -> Result<T, Failure>,
) -> Result<T, Failure> {
    let opened = find(args)?.open(&args.reach)?;
    let done = block_on(work(&opened))?;
    opened.record.keep(opened.axis().trust(), Keep::Doubts);
    done
}

/// Finds an axis and does something with it. What becomes of the trust in its position the next command will know.
pub(crate) fn act_on<T>(
    args: &AxisArgs,
    work: impl AsyncFnOnce(&Opened) -> Result<T, Failure>,
) -> Result<T, Failure> {
    let opened = find(args)?.open(&args.reach)?;
    let done = block_on(work(&opened))?;
    opened.record.keep(opened.axis().trust(), Keep::Acts);
    done
}

/// Runs something that waits.
pub(crate) fn block_on<T>(work: impl Future<Output = T>) -> Result<T, Failure> {
    let runtime = runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.map_err(|error| Failure::Failed(format!("cannot start to wait: {error}")))?;
    Ok(runtime.block_on(work))
}
