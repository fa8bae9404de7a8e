//! Programs in a controller's memory.

use super::{Formatted, Program, Text};
use crate::api::{Nothing, ThePanel, find, problem};
use crate::member::Member;
use crate::motion::to_the_end;
use crate::stopping;
use axum::extract::State;
use serde::Serialize;
use std::sync::Arc;
use stepdrive_asm::{Image, disassemble};
use stepdrive_host::Error;
use stepdrive_host::smsd::Smsd;
use stepdrive_spec::smsd::instructions::{Instruction, PROGRAM_AREAS};
use stepdrive_web::{Asked, Named, Problem, Reply};
use tokio::time::Instant;

#[derive(Debug, Serialize)]
pub(crate) struct Stored {
    stored: Vec<StoredMemory>,
}

#[derive(Debug, Serialize)]
struct StoredMemory {
    mem: u8,
    instructions: usize,
}

/// The numbers of the memories.
fn areas() -> impl Iterator<Item = u8> {
    (0..PROGRAM_AREAS).filter_map(|area| u8::try_from(area).ok())
}

/// All that is stored, as text.
pub(crate) async fn fetch(
    State(panel): ThePanel,
    Named(name): Named<String>,
) -> Result<Reply<Formatted>, Problem> {
    let member = find(&panel, &name)?;
    let client = member.smsd().map_err(problem)?;
    let image = member.work(read(client)).await.map_err(problem)?;
    Ok(Reply(Formatted { text: disassemble(&image) }))
}

async fn read(client: &dyn Smsd) -> Result<Image, Error> {
    let mut image = Image::new();
    for area in areas() {
        let words = client.fetch_program(area).await?;
        let words: Vec<u32> = words.iter().map(|instruction| instruction.word()).collect();
        image.set_area(area.into(), &words).map_err(|error| Error::Device(error.to_string()))?;
    }
    Ok(image)
}

/// Stores every memory that a text has instructions for.
pub(crate) async fn store(
    State(panel): ThePanel,
    Named(name): Named<String>,
    Asked(Text { text }): Asked<Text>,
) -> Result<Reply<Stored>, Problem> {
    let member = find(&panel, &name)?;
    member.smsd().map_err(problem)?;
    let memories = memories(&Program::new(text, None))?;
    to_the_end(async move {
        member.work(put(member.smsd()?, member.name(), &memories)).await?;
        let stored = |(mem, instructions): &(u8, Vec<Instruction>)| StoredMemory {
            mem: *mem,
            instructions: instructions.len(),
        };
        Ok(Reply(Stored { stored: memories.iter().map(stored).collect() }))
    })
    .await
}

/// The instructions for each memory that has some.
fn memories(program: &Program) -> Result<Vec<(u8, Vec<Instruction>)>, Problem> {
    let image = program.image()?;
    let mut memories = Vec::new();
    for area in areas().filter(|area| !image.area((*area).into()).is_empty()) {
        let words = image.area(area.into()).iter().enumerate();
        let instruction = |(line, word): (usize, &u32)| {
            Instruction::from_word(*word).map_err(|error| {
                Problem::impossible(format!("mem{area}:{line} is {word:#010X}: {error}; nothing was sent"))
            })
        };
        memories.push((area, words.map(instruction).collect::<Result<Vec<Instruction>, Problem>>()?));
    }
    if memories.is_empty() {
        return Err(Problem::impossible("the program has no instructions; nothing was sent"));
    }
    Ok(memories)
}

async fn put(client: &dyn Smsd, name: &str, memories: &[(u8, Vec<Instruction>)]) -> Result<(), Error> {
    if client.program().await?.running == Some(true) {
        return Err(Error::Refused(format!("a program runs in {name}; stop it first; nothing was sent")));
    }
    for (number, (area, instructions)) in memories.iter().enumerate() {
        if let Err(cause) = client.store_program(*area, instructions).await {
            let before: Vec<String> =
                memories.iter().take(number).map(|(area, _)| format!("memory {area}")).collect();
            if before.is_empty() {
                return Err(cause);
            }
            return Err(Error::Partly {
                done: format!("{} had been stored", before.join(", ")),
                cause: Box::new(cause),
            });
        }
    }
    Ok(())
}

/// Starts the program of a memory. It moves the motor as it is written: no soft limit holds it.
pub(crate) async fn start(
    State(panel): ThePanel,
    Named((name, mem)): Named<(String, String)>,
) -> Result<Reply<Nothing>, Problem> {
    let member = find(&panel, &name)?;
    let area = areas().find(|area| area.to_string() == mem);
    let area =
        area.ok_or_else(|| Problem::impossible("there is no such memory; they are numbered 0 to 3"))?;
    // A stop counts from here on, however long it takes to begin.
    let stops = member.stops();
    to_the_end(async move {
        member.check_idle()?;
        member.doing().aim = None;
        begin(&member, area, stops).await?;
        member.nudge.notify_one();
        Ok(Reply(Nothing {}))
    })
    .await
}

/// Starts a program, unless the member is told to stop more often than `stops` times: a stop that comes meanwhile wins.
async fn begin(member: &Arc<Member>, area: u8, stops: u32) -> Result<(), Error> {
    let begun = member.work(member.depart(stops, member.smsd()?.start_program(area))).await;
    if member.stops() == stops {
        return begun;
    }
    // It may have come to the controller before the start did. It is told until it gets through, however long that takes.
    let _ = stopping::repeat(member, stops).by(Instant::now() + stopping::PATIENCE).await;
    Err(Error::Refused(format!("{} was told to stop while its program was being started", member.name())))
}

/// Stops the program that runs; the motor goes on as it was.
pub(crate) async fn stop(
    State(panel): ThePanel,
    Named(name): Named<String>,
) -> Result<Reply<Nothing>, Problem> {
    let member = find(&panel, &name)?;
    to_the_end(async move {
        member.work(member.smsd()?.stop_program()).await?;
        member.nudge.notify_one();
        Ok(Reply(Nothing {}))
    })
    .await
}
