//! How fast user programs run on virtual time: a shuttle against the clock on the wall, and a tight loop in instructions
//! a second.
//!
//! Prints a table; the figures in `docs/performance.md` are from it.

use std::time::{Duration, Instant};
use stepdrive_bench::programs::{SHUTTLE, words};
use stepdrive_rig::file::{DEMO, RigFile};

/// Odd, so that there is a median.
const ROUNDS: usize = 9;

const TIGHT: &str = "
again:
SET_RELE
CLR_RELE
GOTO_PROGRAM again
";

fn main() {
    let (shuttle, tight) = (words(SHUTTLE), words(TIGHT));

    // Long enough that the round is no matter of the timer, short enough for nine of them.
    let hour = Duration::from_hours(1);
    let (_, day) = measure(&shuttle, 24 * hour);
    println!(
        "shuttle, a day of it       {:>12.0} x real time",
        24.0 * hour.as_secs_f64() / day.as_secs_f64()
    );
    let (instructions, wall) = measure(&tight, hour);
    println!("tight loop                 {:>12.0} instructions/s", instructions as f64 / wall.as_secs_f64());
    println!("tight loop                 {:>12.0} x real time", hour.as_secs_f64() / wall.as_secs_f64());
}

/// Runs a program for so long on virtual time: how many instructions ran, and the median of what it took.
fn measure(program: &[u32], time: Duration) -> (u64, Duration) {
    let rig = RigFile::parse(DEMO).expect("the demo rig is valid");
    let drive = rig.drives.first().expect("the demo rig has a drive");
    let section = drive.smsd().expect("and it is an SMSD");
    let mut walls = [Duration::ZERO; ROUNDS];
    let mut executed = 0;
    for wall in &mut walls {
        let mut machine = section.start_program(drive, [program, &[], &[], &[]], 0);
        let start = now();
        machine.advance(stepdrive_spec::time::Instant::ZERO + time);
        *wall = start.elapsed();
        executed = machine.drive().program().executed;
    }
    walls.sort_unstable();
    (executed, walls[ROUNDS / 2])
}

#[allow(clippy::disallowed_methods, reason = "a benchmark is about the clock on the wall")]
fn now() -> Instant {
    Instant::now()
}
