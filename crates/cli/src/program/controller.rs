//! `stepdrive program store`, `fetch`, `start` and `stop`: the programs in an SMSD's memory.

use super::files::{Memories, Program};
use super::follow::{Listing, watch};
use super::{plural, show};
use crate::axis::progress::Progress;
use crate::axis::{AxisArgs, Client, Opened, act_on, look_at};
use crate::terminal::{print, print_json, tell};
use crate::{Failure, disk};
use serde_json::json;
use std::path::PathBuf;
use stepdrive_asm::{Image, disassemble};
use stepdrive_host::Error;
use stepdrive_host::smsd::Smsd;
use stepdrive_spec::smsd::instructions::{Instruction, PROGRAM_AREAS};

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stepdrive program store shuttle.smsd --mem 0 -a stage
  stepdrive program store all.bin -a 192.168.1.2:502

The program is checked before anything is sent, stored, and read back. A text without `.mem` may go to any memory.")]
pub(crate) struct StoreArgs {
    /// The program: a text, or an image made by `build`. `-` reads a text from stdin.
    file: PathBuf,
    /// The memory, 0 to 3, to store it in; by default every memory that the program has instructions for.
    #[arg(long, value_parser = clap::value_parser!(u8).range(0..=3))]
    mem: Option<u8>,
    #[command(flatten)]
    axis: AxisArgs,
}

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stepdrive program fetch --mem 0 -a stage
  stepdrive program fetch -a stage -o backup.smsd")]
pub(crate) struct FetchArgs {
    /// The memory, 0 to 3; by default all four.
    #[arg(long, value_parser = clap::value_parser!(u8).range(0..=3))]
    mem: Option<u8>,
    /// Write the text to this file; what was there is replaced.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    #[command(flatten)]
    axis: AxisArgs,
}

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stepdrive program start 0 -a stage
  stepdrive program start 0 --follow -a stage

A program moves the motor as it is written: no soft limit holds it.")]
pub(crate) struct StartArgs {
    /// The memory, 0 to 3, whose program is started. One that runs ends.
    #[arg(value_parser = clap::value_parser!(u8).range(0..=3))]
    mem: u8,
    /// Print the running line until the program ends.
    #[arg(long)]
    follow: bool,
    #[command(flatten)]
    axis: AxisArgs,
}

#[derive(Debug, clap::Args)]
pub(crate) struct StopArgs {
    #[command(flatten)]
    axis: AxisArgs,
}

/// The client of an SMSD; programs are for no other.
pub(super) fn smsd(opened: &Opened) -> Result<&dyn Smsd, Failure> {
    match opened.client() {
        Client::Smsd(client) => Ok(client),
        Client::Smd3(_) => {
            let name = opened.name();
            Err(Failure::Usage(format!(
                "{name} is an SMD3, which has no user programs; they are for an SMSD"
            )))
        }
    }
}

/// Stores a program and reads it back.
pub(super) fn store(args: &StoreArgs) -> Result<(), Failure> {
    let program = Program::read(&args.file, None)?;
    show(&program);
    let memories = program.memories_for(args.mem)?;
    act_on(&args.axis, async |opened| {
        let client = smsd(opened)?;
        if let Some(model) = client.model().await? {
            program.show_more(model);
        }
        for (number, (memory, instructions)) in memories.iter().enumerate() {
            let stored = store_one(client, *memory, instructions).await;
            stored.map_err(|cause| after(&memories, number, cause))?;
        }
        if args.axis.reach.json {
            let stored = |(memory, instructions): &(u8, Vec<Instruction>)| json!({ "memory": memory, "instructions": instructions.len() });
            return print_json(&json!({
                "axis": opened.name(),
                "stored": memories.iter().map(stored).collect::<Vec<_>>(),
                "verified": true,
            }));
        }
        for (memory, instructions) in &memories {
            let count = plural(instructions.len(), "instruction");
            print(&format!("{}: {count} stored in memory {memory} and read back\n", opened.name()))?;
        }
        Ok(())
    })
}

async fn store_one(client: &dyn Smsd, memory: u8, instructions: &[Instruction]) -> Result<(), Error> {
    let mut progress = Progress::new(format!("storing memory {memory}"));
    // Written, and read back.
    let all = 2 * instructions.len();
    progress.show(0, all);
    client.store_program_with(memory, instructions, &mut |count| progress.show(count, all)).await
}

/// The error for a memory that could not be stored, when others had been.
fn after(memories: &Memories, number: usize, cause: Error) -> Error {
    let names: Vec<String> =
        memories.iter().take(number).map(|(memory, _)| format!("memory {memory}")).collect();
    if names.is_empty() {
        return cause;
    }
    Error::Partly { done: format!("{} had been stored", names.join(", ")), cause: Box::new(cause) }
}

/// Reads programs as text.
pub(super) fn fetch(args: &FetchArgs) -> Result<(), Failure> {
    look_at(&args.axis, async |opened| {
        let client = smsd(opened)?;
        let mut image = Image::new();
        for memory in (0..PROGRAM_AREAS).filter(|area| args.mem.is_none_or(|mem| usize::from(mem) == *area)) {
            let words = fetch_one(client, memory).await?;
            image.set_area(memory, &words).map_err(|error| Failure::Failed(error.to_string()))?;
        }
        let text = disassemble(&image);
        if let Some(output) = &args.output {
            disk::replace(output, text.as_bytes())?;
            tell(&format!("{}: {} to {}", opened.name(), sizes(&image), output.display()));
        }
        if args.axis.reach.json {
            let memories: [Vec<u32>; PROGRAM_AREAS] = std::array::from_fn(|area| image.area(area).to_vec());
            return print_json(&json!({ "axis": opened.name(), "memories": memories, "text": text }));
        }
        if args.output.is_some() {
            return Ok(());
        }
        if text.is_empty() {
            tell(&format!("{}: {}", opened.name(), sizes(&image)));
        }
        print(&text)
    })
}

async fn fetch_one(client: &dyn Smsd, memory: usize) -> Result<Vec<u32>, Error> {
    let mut progress = Progress::new(format!("reading memory {memory}"));
    let most = stepdrive_spec::smsd::instructions::PROGRAM_LINES;
    let area = u8::try_from(memory).unwrap_or(u8::MAX);
    let instructions = client.fetch_program_with(area, &mut |count| progress.show(count, most)).await?;
    Ok(instructions.iter().map(|instruction| instruction.word()).collect())
}

fn sizes(image: &Image) -> String {
    super::sizes(std::array::from_fn(|memory| image.area(memory).len()))
}

/// Starts a program.
pub(super) fn start(args: &StartArgs) -> Result<(), Failure> {
    let json = args.axis.reach.json;
    act_on(&args.axis, async |opened| {
        let client = smsd(opened)?;
        if args.follow {
            let listing = Listing::read(client, Some(args.mem)).await;
            client.start_program(args.mem).await?;
            return watch(opened, client, listing, json).await;
        }
        client.start_program(args.mem).await?;
        if json {
            return print_json(&json!({ "axis": opened.name(), "started": args.mem }));
        }
        print(&format!("{}: the program in memory {} was started\n", opened.name(), args.mem))
    })
}

/// Stops the program that runs.
pub(super) fn stop(args: &StopArgs) -> Result<(), Failure> {
    act_on(&args.axis, async |opened| {
        let client = smsd(opened)?;
        let ran = client.program().await?.running;
        client.stop_program().await?;
        let moving = client.snapshot().await?.is_moving();
        if args.axis.reach.json {
            return print_json(&json!({ "axis": opened.name(), "ran": ran, "moving": moving }));
        }
        let name = opened.name();
        let program = match ran {
            Some(true) => "the program was stopped",
            Some(false) => "no program ran",
            None => "the program was stopped, if one ran",
        };
        let motor = if moving { "; the motor goes on as it was, `stepdrive stop` stops it" } else { "" };
        print(&format!("{name}: {program}{motor}\n"))
    })
}
