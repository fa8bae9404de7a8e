//! A program tried out on virtual time.

use super::{Program, model};
use crate::Shared;
use crate::api::{ThePanel, find};
use axum::extract::State;
use axum::http::StatusCode;
use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use std::fmt;
use std::time::Duration;
use stepdrive_asm::bare;
use stepdrive_rig::duration;
use stepdrive_rig::file::{DEMO, DriveSection, RigFile, SmsdSection};
use stepdrive_rig::simulation::{End, Signal, Simulation, State as Moment, Step, What, signals};
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::{Instruction, PROGRAM_AREAS};
use stepdrive_spec::time::Instant as SimTime;
use stepdrive_web::{Asked, Problem, Reply};
use tokio::sync::Semaphore;
use tokio::time::Instant;

/// How long a program is run when nothing is said.
const USUAL: Duration = Duration::from_mins(1);
/// The longest that one may be run, in the drive's own time.
const LONGEST: Duration = Duration::from_hours(1);
/// The most of the processor that may go into running it, and as much again into its curve.
const PROCESSOR: Duration = Duration::from_secs(1);
/// The most steps that are told.
const MOST_STEPS: usize = 5000;
/// The most points of the curve, with those at both ends.
const MOST_POINTS: u32 = 2000;
/// How many are tried out at once; more wait for their turn.
static TURNS: Semaphore = Semaphore::const_new(2);

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Simulate {
    text: String,
    #[serde(default)]
    mem: u8,
    r#for: Option<String>,
    #[serde(default)]
    inputs: Inputs,
    /// The axis whose controller and mechanics it is tried out on.
    axis: Option<String>,
}

/// What comes to which input, in the order in which it is given: what names an input twice is noticed.
#[derive(Debug, Default)]
struct Inputs(Vec<(String, String)>);

impl<'de> Deserialize<'de> for Inputs {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Inputs, D::Error> {
        deserializer.deserialize_map(InputsVisitor)
    }
}

struct InputsVisitor;

impl<'de> Visitor<'de> for InputsVisitor {
    type Value = Inputs;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("inputs, each with what comes to it, as in {\"IN0\": \"at:2s\"}")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Inputs, A::Error> {
        let mut inputs = Vec::new();
        while let Some(input) = map.next_entry()? {
            inputs.push(input);
        }
        Ok(Inputs(inputs))
    }
}

impl Inputs {
    fn signals(&self) -> Result<Vec<Signal>, String> {
        let mut all: Vec<Signal> = Vec::new();
        for (name, times) in &self.0 {
            let mine = signals(name, times, duration::parse)?;
            if let Some(again) = mine.iter().find(|signal| all.iter().any(|one| one.input == signal.input)) {
                let name = again.input.name();
                return Err(format!(
                    "{name} is given twice; put its times together, as in {name}=at:1s..2s,at:5s"
                ));
            }
            all.extend(mine);
        }
        Ok(all)
    }
}

#[derive(Debug, Default, Serialize)]
pub(crate) struct Simulated {
    steps: Vec<StepRow>,
    /// More happened than is told.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    cut: bool,
    /// Seconds, microsteps, full steps a second, negative backward.
    curve: Vec<[f64; 3]>,
    end: String,
    /// The line of the text where it was then.
    #[serde(skip_serializing_if = "Option::is_none")]
    end_line: Option<usize>,
}

/// An instruction that ran, and the drive right after it.
#[derive(Debug, Serialize)]
struct StepRow {
    t: f64,
    mem: u8,
    line: u16,
    source_line: Option<usize>,
    text: String,
    position: i32,
    /// Full steps a second, negative backward.
    speed: f64,
    relay: bool,
    inputs: Vec<&'static str>,
}

/// What is tried out.
struct Trial {
    program: Program,
    drive: DriveSection,
    smsd: SmsdSection,
    mem: u8,
    time: Duration,
    signals: Vec<Signal>,
}

pub(crate) async fn simulate(
    State(panel): ThePanel,
    Asked(asked): Asked<Simulate>,
) -> Result<Reply<Simulated>, Problem> {
    let trial = Trial::new(&panel, asked)?;
    let failed =
        |why: &dyn std::fmt::Display| Problem::new(StatusCode::INTERNAL_SERVER_ERROR, why.to_string());
    let _turn = TURNS.acquire().await.map_err(|error| failed(&error))?;
    let done = tokio::task::spawn_blocking(move || trial.run()).await;
    done.map_err(|error| failed(&error))?.map(Reply)
}

impl Trial {
    fn new(panel: &Shared, asked: Simulate) -> Result<Trial, Problem> {
        let (drive, smsd) = stage(panel, asked.axis.as_deref())?;
        if usize::from(asked.mem) >= PROGRAM_AREAS {
            return Err(Problem::impossible("there is no such memory; they are numbered 0 to 3"));
        }
        let time = asked.r#for.as_deref().map_or(Ok(USUAL), duration::parse).map_err(Problem::impossible)?;
        if time > LONGEST {
            let longest = duration::display(LONGEST);
            return Err(Problem::impossible(format!("a program is tried out for {longest} at most")));
        }
        let signals = asked.inputs.signals().map_err(Problem::impossible)?;
        let program = Program::new(asked.text, Some(smsd.model));
        program.image()?;
        Ok(Trial { program, drive, smsd, mem: asked.mem, time, signals })
    }

    fn run(&self) -> Result<Simulated, Problem> {
        let (mut simulated, end) = self.steps(Instant::now() + PROCESSOR)?;
        simulated.curve = self.curve(end, Instant::now() + PROCESSOR)?;
        Ok(simulated)
    }

    /// The drive as it leaves the factory, just switched on with the program in it.
    fn begin(&self, signals: Vec<Signal>, time: Duration) -> Result<Simulation, Problem> {
        let image = self.program.image()?;
        let programs = std::array::from_fn(|memory| image.area(memory));
        Ok(Simulation::new(self.smsd.start_program(&self.drive, programs, self.mem), signals, time))
    }

    /// The instructions that run, and when it is over.
    fn steps(&self, latest: Instant) -> Result<(Simulated, SimTime), Problem> {
        let mut simulated = Simulated::default();
        let mut at = SimTime::ZERO;
        for step in self.begin(self.signals.clone(), self.time)? {
            at = step.state.at;
            match step.what {
                What::Instruction(place, word) if simulated.steps.len() < MOST_STEPS => {
                    simulated.steps.push(self.row(&step, place.area, place.line, word));
                }
                What::Instruction(..) => simulated.cut = true,
                What::Change => {}
                What::End(end) => {
                    simulated.end = told(&end);
                    simulated.end_line = self.end_line(&end);
                }
            }
            if Instant::now() >= latest {
                let seconds = seconds(at);
                simulated.end = format!("given up at {seconds} s, as it took {PROCESSOR:?} of the processor");
                simulated.cut = true;
                break;
            }
        }
        Ok((simulated, at))
    }

    fn row(&self, step: &Step, mem: u8, line: u16, word: u32) -> StepRow {
        let state = &step.state;
        StepRow {
            t: seconds(state.at),
            mem,
            line,
            source_line: self.program.line_of(mem.into(), line.into()),
            text: Instruction::from_word(word).map_or_else(|_| format!(".word {word:#010X}"), bare),
            position: state.position,
            speed: velocity(state),
            relay: state.relay,
            inputs: names(state.inputs),
        }
    }

    fn end_line(&self, end: &End) -> Option<usize> {
        let place = match end {
            End::Refused(refusal) => refusal.place?,
            End::Ended(place) | End::Waiting(place, _) | End::TimeOver(place) => *place,
        };
        self.program.line_of(place.area.into(), place.line.into())
    }

    /// Where the motor is, and how fast, at equal distances of time.
    fn curve(&self, end: SimTime, latest: Instant) -> Result<Vec<[f64; 3]>, Problem> {
        let pace = (Duration::from_nanos(end.as_nanos()) / (MOST_POINTS - 1)).max(Duration::from_nanos(1));
        let mut signals = self.signals.clone();
        signals.sort_by_key(|signal| signal.at);
        let mut simulation = self.begin(Vec::new(), Duration::ZERO)?;
        let mut points = Vec::new();
        for number in 0..MOST_POINTS {
            let time = pace * number;
            let at = SimTime::ZERO + time;
            let due = signals.iter().take_while(|signal| signal.at <= at).count();
            let due: Vec<Signal> = signals.drain(..due).collect();
            simulation = Simulation::new(simulation.machine().clone(), due, time);
            // What happens up to then is told by the steps.
            simulation.by_ref().for_each(drop);
            let moment = Moment::of(simulation.machine(), at);
            points.push([seconds(at), moment.position.into(), velocity(&moment)]);
            if at >= end || Instant::now() >= latest {
                break;
            }
        }
        Ok(points)
    }
}

/// The drive that it is tried out on.
fn stage(panel: &Shared, axis: Option<&str>) -> Result<(DriveSection, SmsdSection), Problem> {
    let Some(name) = axis else { return usual() };
    let member = find(panel, name)?;
    member.smsd().map_err(crate::api::problem)?;
    if let Some(drive) = member.simulated_as()
        && let Some(smsd) = drive.smsd()
    {
        return Ok((drive.clone(), smsd.clone()));
    }
    let (drive, smsd) = usual()?;
    let known = member.model().and_then(|name| model(Some(name)).ok().flatten());
    Ok((drive, SmsdSection { model: known.unwrap_or(smsd.model), ..smsd }))
}

/// The SMSD of the demo rig, with a zero switch and a sensor.
fn usual() -> Result<(DriveSection, SmsdSection), Problem> {
    let rig = RigFile::parse(DEMO).ok();
    let drive = rig.and_then(|rig| rig.drives.into_iter().find(|drive| drive.smsd().is_some()));
    let found = drive.and_then(|drive| drive.smsd().cloned().map(|smsd| (drive, smsd)));
    found.ok_or_else(|| Problem::new(StatusCode::INTERNAL_SERVER_ERROR, "the demo rig has no SMSD"))
}

fn seconds(at: SimTime) -> f64 {
    at.as_nanos() as f64 / 1e9
}

/// The speed with the sign of its direction.
fn velocity(state: &Moment) -> f64 {
    if state.status.forward { state.speed } else { 0.0 - state.speed }
}

fn names(bits: u8) -> Vec<&'static str> {
    Input::ALL.into_iter().filter(|input| bits & input.bit() != 0).map(Input::name).collect()
}

/// How it ended, in words.
fn told(end: &End) -> String {
    match end {
        End::Ended(place) => format!("ended at {place}"),
        End::Refused(refusal) => refusal.to_string(),
        End::Waiting(place, 0) => format!("waits at {place} for a motion that never ends"),
        End::Waiting(place, inputs) => {
            format!(
                "waits at {place} for {}, which never comes; give it a signal",
                names(*inputs).join(" or ")
            )
        }
        End::TimeOver(place) => format!("still running at {place} when the time was over"),
    }
}
