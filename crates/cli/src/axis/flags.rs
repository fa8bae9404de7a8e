//! `stepdrive flags` and `stepdrive clear`.

use super::{AxisArgs, Client, Opened, act_on, look_at};
use crate::Failure;
use crate::rig::table::{Align, table, text};
use crate::terminal::{print, print_json};
use serde_json::{Value, json};
use stepdrive_host::Error;
use stepdrive_host::axis::Fault;
use stepdrive_host::smsd::Smsd;
use stepdrive_spec::smd3::flags::{ERROR_FLAGS, FlagBits, FlagInfo, STATUS_FLAGS};
use stepdrive_spec::smsd::registers::Reg;

/// The flags of an SMSD's status, as they stand in its map.
const SMSD_FLAGS: [Reg; 10] = [
    Reg::HiZ,
    Reg::Stop,
    Reg::ConstSpeed,
    Reg::AccFlag,
    Reg::DecFlag,
    Reg::Ready,
    Reg::SwF,
    Reg::SwEvn,
    Reg::DirFlag,
    Reg::CmdError,
];

/// Which axis' flags are shown.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stepdrive flags -a uhv
  stepdrive flags -a uhv --json | jq '.flags[] | select(.set) | .name'

  $ stepdrive flags -a uhv
  FLAG                 KIND    SET  WHAT IT SAYS
  JSCON                status  no   A joystick is plugged in.
  STANDBY              status  yes  The motor stands, and `TZW` has passed.
  EMERGENCY STOP       error   yes  `ESTOP` was sent.")]
pub(crate) struct FlagsArgs {
    #[command(flatten)]
    axis: AxisArgs,
}

/// Which axis' faults are cleared.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stepdrive clear -a uhv

  $ stepdrive clear -a uhv
  uhv: EMERGENCY STOP is cleared

A fault whose cause is still there stays: exit code 8. Nothing moves by it.")]
pub(crate) struct ClearArgs {
    #[command(flatten)]
    axis: AxisArgs,
}

/// A flag as it is now.
struct Flag {
    name: &'static str,
    kind: &'static str,
    set: bool,
    about: &'static str,
}

/// Shows the flags of an axis.
pub(crate) fn flags(args: &FlagsArgs) -> Result<(), Failure> {
    look_at(&args.axis, async |opened| {
        let flags = match opened.client() {
            Client::Smsd(client) => of_smsd(client).await?,
            Client::Smd3(client) => {
                let flags = client.flags().await?;
                let status = of_table(&STATUS_FLAGS, "status", flags.status);
                status.chain(of_table(&ERROR_FLAGS, "error", flags.error)).collect()
            }
        };
        // What they say of the position counts.
        opened.axis().state().await?;
        if args.axis.reach.json {
            let flags: Vec<Value> = flags.iter().map(Flag::json).collect();
            return print_json(&json!({ "axis": opened.name(), "flags": flags }));
        }
        let columns = [
            ("FLAG", Align::Left),
            ("KIND", Align::Left),
            ("SET", Align::Left),
            ("WHAT IT SAYS", Align::Left),
        ];
        let rows: Vec<[String; 4]> = flags.iter().map(Flag::row).collect();
        print(&text(&table(columns, &rows)))
    })
}

async fn of_smsd(client: &dyn Smsd) -> Result<Vec<Flag>, Error> {
    let values = client.read_many(&SMSD_FLAGS).await?;
    let flag = |(reg, value): (&Reg, i64)| {
        let row = reg.info();
        let kind = if *reg == Reg::CmdError { "error" } else { "status" };
        Flag { name: row.name, kind, set: value != 0, about: row.about }
    };
    Ok(SMSD_FLAGS.iter().zip(values).map(flag).collect())
}

fn of_table(table: &'static [FlagInfo], kind: &'static str, bits: FlagBits) -> impl Iterator<Item = Flag> {
    table.iter().map(move |flag| {
        // Where the manual is silent is of interest to who reads its table.
        let about = flag.about.split_once(" ASSUMED").map_or(flag.about, |(about, _)| about);
        Flag { name: flag.name, kind, set: flag.is_in(bits), about }
    })
}

impl Flag {
    fn row(&self) -> [String; 4] {
        [self.name, self.kind, if self.set { "yes" } else { "no" }, self.about].map(str::to_owned)
    }

    fn json(&self) -> Value {
        json!({ "name": self.name, "kind": self.kind, "set": self.set, "about": self.about })
    }
}

/// Clears the faults of an axis whose cause is gone.
pub(crate) fn clear(args: &ClearArgs) -> Result<(), Failure> {
    act_on(&args.axis, async |opened| {
        let before = opened.axis().faults().await?;
        let left = opened.axis().clear_faults().await?;
        let cleared: Vec<&str> =
            before.iter().filter(|fault| !left.contains(fault)).map(|fault| fault.name).collect();
        if !left.is_empty() {
            return Err(still_there(opened, &cleared, &left));
        }
        if args.axis.reach.json {
            return print_json(&json!({ "axis": opened.name(), "cleared": cleared }));
        }
        let name = opened.name();
        print(&match cleared.as_slice() {
            [] => format!("{name}: no fault was latched\n"),
            [one] => format!("{name}: {one} is cleared\n"),
            several => format!("{name}: {} are cleared\n", several.join(", ")),
        })
    })
}

fn still_there(opened: &Opened, cleared: &[&str], left: &[Fault]) -> Failure {
    let told = left.iter().map(|fault| format!("{} ({})", fault.name, fault.about.trim_end_matches('.')));
    let told = told.collect::<Vec<String>>().join(", ");
    let cleared =
        if cleared.is_empty() { String::new() } else { format!("; {} is cleared", cleared.join(", ")) };
    Failure::Host(Error::Fault(format!(
        "{} is not clear: {told}; the cause is still there, remove it and clear again{cleared}",
        opened.name()
    )))
}
