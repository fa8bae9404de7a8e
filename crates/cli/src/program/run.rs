//! `stepdrive program run`.

use super::files::Program;
use super::show;
use super::signals::{Signals, signals, time};
use super::timeline::Timeline;
use crate::terminal::{cannot_write, tell};
use crate::{Failure, rigs};
use std::io::{self, BufWriter, Write};
use std::path::PathBuf;
use std::time::Duration;
use stepdrive_rig::file::DriveSection;
use stepdrive_rig::simulation::{End, Simulation, What};

#[derive(Debug, clap::Args)]
pub(crate) struct RunArgs {
    /// The program: a text, or an image made by `build`. `-` reads a text from stdin.
    file: PathBuf,
    /// The memory, 0 to 3, whose program is started.
    #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u8).range(0..=3))]
    mem: u8,
    /// A signal at an input: `IN1=at:2.5s` from then on, `IN1=at:1s..2s` between, `IN1=on`; may be given again.
    #[arg(long, value_name = "NAME=WHEN", value_parser = signals)]
    input: Vec<Signals>,
    /// How long to run it at most, in the drive's own time: 500ms, 90s, 10min, 1h.
    #[arg(long = "for", value_name = "TIME", default_value = "1min", value_parser = time)]
    time: Duration,
    /// Tell also what the motor, the inputs and the relay do between instructions.
    #[arg(long)]
    trace: bool,
    /// The rig whose first SMSD runs it; by default the demo rig's, with a zero switch and a sensor.
    #[arg(long)]
    rig: Option<PathBuf>,
    /// Print one JSON object a line.
    #[arg(long)]
    json: bool,
}

/// Runs a program and prints what happens.
pub(crate) fn run(args: &RunArgs) -> Result<(), Failure> {
    let (name, rig) = rigs::read(args.rig.as_deref())?;
    let smsd = rig.drives.iter().find_map(|drive| Some((drive, drive.smsd()?)));
    let (drive, smsd) =
        smsd.ok_or_else(|| Failure::Usage(format!("{name} has no SMSD, which programs are for")))?;
    let program = Program::read(&args.file, Some(smsd.model))?;
    show(&program);
    let image = program.image()?;
    if !args.json {
        tell(&format!("{} on a virtual {} of {name}, on virtual time", program.name, smsd.model));
    }
    let machine = smsd.start_program(drive, std::array::from_fn(|memory| image.area(memory)), args.mem);
    let signals = args.input.iter().flat_map(|input| input.0.clone()).collect();
    let simulation = Simulation::new(machine, signals, args.time);
    match play(args, drive, simulation) {
        Ok(Some(End::Refused(refusal))) => Err(Failure::Program(format!("{}: {refusal}", program.name))),
        Ok(_) => Ok(()),
        // Whoever read it has seen enough, as in `| head`.
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        Err(error) => Err(cannot_write(&error)),
    }
}

/// Prints every step, and returns how it ended.
fn play(args: &RunArgs, drive: &DriveSection, simulation: Simulation) -> io::Result<Option<End>> {
    let mut out = BufWriter::new(io::stdout().lock());
    let mut timeline = Timeline::new(args.json, drive);
    if !args.json {
        writeln!(out, "{}", Timeline::HEADING)?;
    }
    let mut end = None;
    for step in simulation {
        match step.what {
            What::Change if !args.trace => timeline.pass_over(&step),
            What::End(ended) => {
                end = Some(ended);
                writeln!(out, "{}", timeline.end(&step, &ended))?;
            }
            What::Change | What::Instruction(..) => writeln!(out, "{}", timeline.line(&step))?,
        }
    }
    out.flush()?;
    Ok(end)
}
