//! `stepdrive panel`, and the panel of `stepdrive up`, from a shell.
#![cfg(unix)]

#[path = "../axis/bench.rs"]
#[allow(dead_code, reason = "each test program uses a part of it")]
mod bench;
#[path = "../rig/bench.rs"]
#[allow(dead_code, reason = "each test program uses a part of it")]
mod rig;
#[path = "../up/bench.rs"]
#[allow(dead_code, reason = "each test program uses a part of it")]
mod up;

mod serving;
