//! The commands on an axis, from a shell, with rigs that run.
#![cfg(unix)]

mod bake;
mod bench;
mod examples;
mod liars;
mod look;
mod manual;
mod memory;
mod motion;
mod plot;
mod ports;
mod readme;
mod record;
mod regs;
#[path = "../rig/bench.rs"]
#[allow(dead_code, reason = "each test program uses a part of it")]
mod rig;
mod screen;
mod settings;
mod stopping;
mod targets;
mod term;
mod trouble;
#[path = "../up/bench.rs"]
#[allow(dead_code, reason = "each test program uses a part of it")]
mod up;
mod usb;
mod values;
mod watch;
