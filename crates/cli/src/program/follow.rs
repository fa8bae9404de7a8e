//! `stepdrive program follow`: the running line, live.

use super::controller::smsd;
use crate::Failure;
use crate::axis::{AxisArgs, Opened, look_at};
use crate::rig::table::number;
use crate::terminal::{print, print_json, tell};
use crate::up::end_requested;
use serde_json::json;
use std::time::Duration;
use stepdrive_asm::{Image, Place, bare};
use stepdrive_host::Error;
use stepdrive_host::smsd::{ProgramState, Smsd, Snapshot};
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};
use stepdrive_spec::smsd::registers::Reg;
use tokio::time::{Instant, sleep};

/// Time between two looks.
const PACE: Duration = Duration::from_millis(20);

/// What is to be known where it is not told whether a program runs.
const UNTOLD: &str = "this line does not tell whether a program runs; its end is seen at END, behind its last line, and when \
                      an instruction was refused; Ctrl-C ends the looking";

/// Columns of the lines.
const HEADING: &str = "      time  line      position  speed  instruction\n";

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stepdrive program follow -a stage
  stepdrive program follow -a stage --json

Ctrl-C ends the looking, not the program. Lines that take less than 20 ms may not be seen.")]
pub(crate) struct FollowArgs {
    #[command(flatten)]
    axis: AxisArgs,
}

/// Prints the running line until the program ends.
pub(super) fn follow(args: &FollowArgs) -> Result<(), Failure> {
    look_at(&args.axis, async |opened| {
        let client = smsd(opened)?;
        let state = client.program().await?;
        let nothing = || end(opened, client, args.axis.reach.json, Seen::Nothing);
        if state.running == Some(false) {
            return nothing().await;
        }
        let listing = Listing::read(client, None).await;
        if listing.ends_at(state) {
            return nothing().await;
        }
        watch(opened, client, listing, args.axis.reach.json).await
    })
}

/// The programs, so that lines can be shown as text. What cannot be read now is not shown.
pub(super) struct Listing {
    image: Image,
    /// The memories that could be read.
    read: Vec<u8>,
}

impl Listing {
    /// Reads the programs that may run: that of `first`, and others to which it may jump; all where it is not known.
    pub(super) async fn read(client: &dyn Smsd, first: Option<u8>) -> Listing {
        // Where it is not told whether a program runs, that is seen by its text, wherever it jumps to.
        let first = first.filter(|_| client.check_readable(Reg::ProgramRun).is_ok());
        let mut listing = Listing { image: Image::new(), read: Vec::new() };
        for memory in (0..4).filter(|memory| first.is_none_or(|first| first == *memory)) {
            if let Ok(instructions) = client.fetch_program(memory).await {
                let words: Vec<u32> = instructions.iter().map(|line| line.word()).collect();
                // A controller's memory is no longer than an image's.
                let _ = listing.image.set_area(memory.into(), &words);
                listing.read.push(memory);
            }
        }
        listing
    }

    fn instruction(&self, place: Place) -> Option<Instruction> {
        self.image.word(place).and_then(|word| Instruction::from_word(word).ok())
    }

    /// Whether the program has ended, where it is not told whether one runs: it stands at `END`, or behind the last line.
    fn ends_at(&self, state: ProgramState) -> bool {
        let Some(place) = place(state).filter(|place| self.read.contains(&place.memory)) else {
            return false;
        };
        state.running.is_none() && self.instruction(place).is_none_or(|line| line.opcode == Opcode::End)
    }
}

/// Prints every line that is seen running, until the program ends or the person has seen enough.
pub(super) async fn watch(
    opened: &Opened,
    client: &dyn Smsd,
    listing: Listing,
    json: bool,
) -> Result<(), Failure> {
    let enough =
        end_requested().map_err(|error| Failure::Failed(format!("cannot catch signals: {error}")))?;
    tokio::pin!(enough);
    let before = client.status().await?.cmd_error;
    let mut view = View { listing, json, began: Instant::now(), last: None };
    if client.check_readable(Reg::ProgramRun).is_err() {
        tell(&format!("{}: {UNTOLD}", opened.name()));
    }
    if !json {
        print(HEADING)?;
    }
    let mut ended_before = false;
    loop {
        let state = client.program().await?;
        let motor = client.snapshot().await?;
        let refused = state.running.is_none() && motor.status.cmd_error && !before;
        let ended = refused || view.listing.ends_at(state);
        // By its text alone it has ended only when it is there still: it may be about to begin.
        if state.running == Some(false) || ended && ended_before {
            // What was refused before has nothing to do with this program.
            return end(opened, client, json, if before { Seen::Run } else { Seen::RunWithoutError }).await;
        }
        ended_before = ended;
        view.show(state, &motor)?;
        tokio::select! {
            () = &mut enough => {
                tell(&format!("{}: the program goes on; `stepdrive program stop` stops it", opened.name()));
                return Ok(());
            }
            () = sleep(PACE) => {}
        }
    }
}

struct View {
    listing: Listing,
    json: bool,
    began: Instant,
    last: Option<Place>,
}

impl View {
    /// Shows where the program is, if that is elsewhere than before.
    fn show(&mut self, state: ProgramState, motor: &Snapshot) -> Result<(), Failure> {
        let Some(place) = place(state).filter(|place| Some(*place) != self.last) else { return Ok(()) };
        self.last = Some(place);
        let seconds = self.began.elapsed().as_secs_f64();
        let instruction = self.listing.instruction(place).map(bare);
        if self.json {
            return print_json(&json!({
                "event": "line",
                "time_s": seconds,
                "line": place.to_string(),
                "instruction": instruction,
                "position_microsteps": motor.position,
                "speed_full_steps_per_s": motor.speed,
            }));
        }
        let (position, speed) = (number(motor.position.into()), motor.speed);
        let instruction = instruction.unwrap_or_default();
        print(
            format!("{seconds:10.3}  {:8}{position:>10}{speed:>7}  {instruction}", place.to_string())
                .trim_end(),
        )?;
        print("\n")
    }
}

fn place(state: ProgramState) -> Option<Place> {
    let (memory, line) = (u8::try_from(state.area).ok()?, u8::try_from(state.line).ok()?);
    Some(Place { memory, line })
}

/// What was seen of a program that has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Seen {
    /// It did not run when it was looked for.
    Nothing,
    /// It ran, with `CMD_ERROR` set by something before.
    Run,
    /// It ran, and `CMD_ERROR` was not set.
    RunWithoutError,
}

/// Says how the program ended.
async fn end(opened: &Opened, client: &dyn Smsd, json: bool, seen: Seen) -> Result<(), Failure> {
    let motor = client.snapshot().await?;
    let state = client.program().await?;
    let line = place(state).map(|place| place.to_string()).unwrap_or_default();
    let refused = seen == Seen::RunWithoutError && motor.status.cmd_error;
    if json {
        print_json(&json!({
            "event": "end",
            "line": line,
            "ran": seen != Seen::Nothing,
            "refused": refused,
            "position_microsteps": motor.position,
            "moving": motor.is_moving(),
        }))?;
    } else if seen == Seen::Nothing {
        tell(&format!("{}: no program runs", opened.name()));
    } else {
        print(&format!("ended at {line}; {motor}\n"))?;
    }
    if refused {
        return Err(Error::Fault(format!(
            "{}: CMD_ERROR is set: the controller refused an instruction, and the program ended at {line}",
            opened.name()
        ))
        .into());
    }
    Ok(())
}
