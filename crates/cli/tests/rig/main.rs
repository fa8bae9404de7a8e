//! `stepdrive rig`, `stepdrive up --record` and `stepdrive replay`, from a shell, with rigs that run.
#![cfg(unix)]

mod bench;
mod change;
mod clock;
mod look;
mod options;
mod play;
mod record;
mod refusals;
#[path = "../up/bench.rs"]
#[allow(dead_code, reason = "each of the two test programs uses a part of it")]
mod up;
mod watch;
