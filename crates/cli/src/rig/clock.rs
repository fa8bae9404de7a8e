//! `stepdrive rig clock`.

use super::client::Client;
use super::show;
use super::state::{Arrived, ClockSet, Done, RigState, time};
use crate::Failure;
use crate::terminal::{print, print_json};
use serde_json::{Value, json};

/// What to do with the clock.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stepdrive rig clock                               how rig time passes, and what time it is
  stepdrive rig clock x100                          a hundred times as fast as the real one
  stepdrive rig clock pause
  stepdrive rig clock step 5s                       at once, then paused
  stepdrive rig clock run-until idle                until nothing will happen by itself, then paused
  stepdrive rig clock run-until 'stage.ABS_POS>=5000' --within 10min

`step` and `run-until` let rig time pass as fast as this computer can. Exit code 2 when a condition has not come.")]
pub(super) struct ClockArgs {
    /// real, xFACTOR (0.01 to 1 000 000), pause, step DURATION, run-until idle, run-until CONDITION.
    #[arg(value_name = "WHAT")]
    words: Vec<String>,
    /// How much rig time `run-until` may take; 1h by default.
    #[arg(long, value_name = "DURATION")]
    within: Option<String>,
}

/// How much rig time `run-until` may take when it is not said.
const WITHIN: &str = "1h";

/// Shows the clock, sets it, or moves rig time.
pub(super) fn clock(client: &Client, args: &ClockArgs, json: bool) -> Result<(), Failure> {
    let words: Vec<&str> = args.words.iter().map(String::as_str).collect();
    if args.within.is_some() && words.first() != Some(&"run-until") {
        return Err(Failure::Usage("--within goes with run-until".to_owned()));
    }
    let within = args.within.as_deref().unwrap_or(WITHIN);
    match words.as_slice() {
        [] => show_clock(client, json),
        ["step"] => Err(Failure::Usage("say how far: step DURATION, as in `rig clock step 5s`".to_owned())),
        ["step", time @ ..] => step(client, &time.join(" "), json),
        ["run-until"] => {
            let message =
                "say until when: run-until idle, or a condition as in `rig clock run-until 'a.READY'`";
            Err(Failure::Usage(message.to_owned()))
        }
        ["run-until", condition @ ..] => run_until(client, &condition.join(" "), within, json),
        ["pause"] => set(client, "paused", json),
        mode => set(client, &mode.join(" "), json),
    }
}

fn show_clock(client: &Client, json: bool) -> Result<(), Failure> {
    let answer = client.get("/v1/rig")?;
    let rig: RigState = answer.read()?;
    if json {
        let mut object: Value = answer.read()?;
        let mut clock = object["clock"].take();
        clock["now_ns"] = rig.now_ns.into();
        return print_json(&clock);
    }
    print(&format!("{}, rig time {}\n", show::clock(&rig.clock), time(rig.now_ns)))
}

fn set(client: &Client, mode: &str, json: bool) -> Result<(), Failure> {
    let answer = client.put("/v1/clock", &json!({ "mode": mode }))?;
    if json {
        return print(&answer.line());
    }
    let ClockSet { mode, now_ns } = answer.read()?;
    print(&format!("clock {mode}, rig time {}\n", time(now_ns)))
}

fn step(client: &Client, duration: &str, json: bool) -> Result<(), Failure> {
    let answer = client.post("/v1/clock/step", &json!({ "for": duration }))?;
    if json {
        return print(&answer.line());
    }
    print(&format!("clock paused, rig time {}\n", time(answer.read::<Done>()?.now_ns)))
}

fn run_until(client: &Client, condition: &str, within: &str, json: bool) -> Result<(), Failure> {
    let answer = client.post("/v1/clock/run-until", &json!({ "until": condition, "within": within }))?;
    let Arrived { reached, now_ns } = answer.read()?;
    if json {
        print(&answer.line())?;
    }
    if !reached {
        return Err(Failure::Failed(format!(
            "`{condition}` has not come within {within}; rig time is {} and the clock is paused: give it longer with \
             --within, or see with `stepdrive rig status` what the rig does",
            time(now_ns)
        )));
    }
    if json { Ok(()) } else { print(&format!("{condition} at rig time {}; clock paused\n", time(now_ns))) }
}
