//! The lines that `program run` prints.

use serde::Serialize;
use stepdrive_asm::bare;
use stepdrive_rig::file::DriveSection;
use stepdrive_rig::simulation::{End, State, Step, What};
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::Instruction;
use stepdrive_spec::smsd::status::MotStatus;

/// Turns steps into lines of text or JSON.
pub(super) struct Timeline {
    json: bool,
    before: Option<State>,
    steps_per_rev: u32,
}

/// A line of `--json`. `t_ns` is the drive's time in nanoseconds, `position` is in microsteps, `speed` in full steps
/// per second.
#[derive(Serialize)]
#[allow(clippy::struct_field_names, reason = "the key is the maker's word for a place in a program")]
struct Line<'a> {
    event: &'static str,
    t_ns: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    line: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    word: Option<String>,
    text: &'a str,
    position: i32,
    speed: f64,
    status: u16,
    inputs: Vec<&'static str>,
    relay: bool,
    stalled: bool,
}

impl Timeline {
    /// What the columns of a line of text are.
    pub(super) const HEADING: &'static str =
        "         time  line      position    speed  inputs        instruction";

    /// A timeline of what this drive does.
    pub(super) fn new(json: bool, drive: &DriveSection) -> Timeline {
        Timeline { json, before: None, steps_per_rev: drive.steps_per_rev }
    }

    /// Takes notice of a step that is not told.
    pub(super) fn pass_over(&mut self, step: &Step) {
        self.before = Some(step.state);
    }

    /// The line of a step.
    pub(super) fn line(&mut self, step: &Step) -> String {
        let before = self.before.replace(step.state);
        match step.what {
            What::Instruction(place, word) => {
                let text = instruction(word);
                self.show(step, "instruction", Some((place.to_string(), word)), &text)
            }
            What::Change | What::End(_) => {
                self.show(step, "change", None, &changes(before.as_ref(), &step.state))
            }
        }
    }

    /// The last line.
    pub(super) fn end(&mut self, step: &Step, end: &End) -> String {
        if self.json {
            return self.show(step, "end", None, &how(end));
        }
        let how = match end {
            // The refusal itself is told as the command's failure.
            End::Refused(_) => "stopped by an instruction that was refused".to_owned(),
            End::Ended(_) | End::Waiting(..) | End::TimeOver(_) => how(end),
        };
        let state = &step.state;
        let turns = state.speed / f64::from(self.steps_per_rev.max(1));
        let motion = match state.status.motion {
            MotStatus::Stopped if state.status.hi_z => "the motor is de-energised".to_owned(),
            MotStatus::Stopped => "the motor holds".to_owned(),
            MotStatus::Accelerating | MotStatus::Decelerating | MotStatus::ConstantSpeed => {
                format!("the motor turns at {:.1} full steps/s, {turns:.2} turns/s", state.speed)
            }
        };
        format!("\n{how}, after {} at position {}; {motion}", state.at, state.position)
    }

    fn show(&self, step: &Step, event: &'static str, place: Option<(String, u32)>, text: &str) -> String {
        let state = &step.state;
        let inputs = names(state.inputs);
        if self.json {
            let (line, word) = place.map(|(line, word)| (line, format!("{word:#010X}"))).unzip();
            let line = Line {
                event,
                t_ns: state.at.as_nanos(),
                line,
                word,
                text,
                position: state.position,
                speed: state.speed,
                status: state.status.word(),
                inputs,
                relay: state.relay,
                stalled: state.stalled,
            };
            return serde_json::to_string(&line).unwrap_or_default();
        }
        let seconds = state.at.as_nanos() as f64 / 1e9;
        let place = place.map_or_else(String::new, |(line, _)| line);
        let text = if place.is_empty() { format!("· {text}") } else { text.to_owned() };
        let inputs = if inputs.is_empty() { "-".to_owned() } else { inputs.join(" ") };
        format!("{seconds:13.6}  {place:<8} {:>9} {:>8.1}  {inputs:<12}  {text}", state.position, state.speed)
    }
}

fn instruction(word: u32) -> String {
    Instruction::from_word(word).map_or_else(|_| format!(".word {word:#010X}"), bare)
}

fn names(bits: u8) -> Vec<&'static str> {
    Input::ALL.into_iter().filter(|input| bits & input.bit() != 0).map(Input::name).collect()
}

/// What differs between two states, in words.
fn changes(before: Option<&State>, after: &State) -> String {
    let mut parts = Vec::new();
    let was = |differs: fn(&State, &State) -> bool| before.is_none_or(|before| differs(before, after));
    if was(|before, after| before.status.motion != after.status.motion) {
        parts.push(motion(after.status.motion).to_owned());
    }
    if was(|before, after| before.status.forward != after.status.forward) {
        parts.push(if after.status.forward { "forward" } else { "backward" }.to_owned());
    }
    if before.is_some_and(|before| before.status.ready != after.status.ready) {
        parts.push(if after.status.ready { "READY" } else { "busy" }.to_owned());
    }
    if before.is_some_and(|before| before.status.hi_z != after.status.hi_z) {
        parts.push(if after.status.hi_z { "HiZ" } else { "energised" }.to_owned());
    }
    if before.is_some_and(|before| before.relay != after.relay) {
        parts.push(if after.relay { "relay on" } else { "relay off" }.to_owned());
    }
    if before.is_some_and(|before| before.stalled != after.stalled) {
        parts.push(if after.stalled { "stalled at the end of the travel" } else { "off the end" }.to_owned());
    }
    let changed = before.map_or(after.inputs, |before| before.inputs ^ after.inputs);
    for name in names(changed) {
        let present = names(after.inputs).contains(&name);
        parts.push(format!("{name} {}", if present { "on" } else { "off" }));
    }
    parts.join(", ")
}

fn motion(motion: MotStatus) -> &'static str {
    match motion {
        MotStatus::Stopped => "stopped",
        MotStatus::Accelerating => "accelerating",
        MotStatus::Decelerating => "decelerating",
        MotStatus::ConstantSpeed => "constant speed",
    }
}

/// How it ended, in words.
fn how(end: &End) -> String {
    match end {
        End::Ended(place) => format!("ended at {place}"),
        End::Refused(refusal) => refusal.to_string(),
        End::Waiting(place, 0) => format!("waits at {place} for a motion that never ends"),
        End::Waiting(place, inputs) => {
            let names = names(*inputs);
            let give = names.first().map(|name| format!("--input {name}=at:1s")).unwrap_or_default();
            format!("waits at {place} for {}, which never comes; give it with {give}", names.join(" or "))
        }
        End::TimeOver(place) => format!("still running at {place} when the time was over"),
    }
}
