//! Ten thousand drives in one process, a thousand of them going to and fro by a program and being asked over the wire,
//! beside a process with one drive that does the same.
//!
//! First what they cost while nobody asks: the time to start, processor time, and memory as the difference to the process
//! with one drive, so that the program itself does not count. Then requests, in rounds that alternate; with them an echo
//! with as many listeners and connections, which shows what so many sockets cost by themselves.
//!
//! `cargo bench -p stepdrive-bench --bench many [-- --workers N]`. A drive takes a file descriptor of its server, a
//! client another one and one here; where a process may not have so many, there are fewer drives.

use std::io;
use std::time::Duration;
use stepdrive_bench::load::{Contender, Rounds, exchange};
use stepdrive_bench::process::allow_many_files;
use stepdrive_bench::programs::{SHUTTLE, words};
use stepdrive_bench::requests::{adu, command, log_in, write_many};
use stepdrive_bench::servers::{self, Kind, ServerProcess};
use stepdrive_spec::modbus::Request;
use stepdrive_spec::smsd::instructions::Opcode;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::timing::FRAM_TIME;
use tokio::net::TcpStream;
use tokio::time::Instant;

/// How many drives.
const DRIVES: usize = 10_000;
/// How many of them move and are asked, by a client each.
const MOVING: usize = 1000;
/// Clients of the drive that is alone: one, and the most that it takes.
const ALONE: [usize; 2] = [1, 8];
/// Descriptors of a process for anything else.
const SPARE: usize = 100;
/// How long the processes are left alone before anything is measured.
const SETTLE: Duration = Duration::from_secs(3);
/// How long they are watched.
const WATCH: Duration = Duration::from_secs(10);
/// Rounds of each server.
const ROUNDS: usize = 31;
/// How long a round lasts.
const ROUND: Duration = Duration::from_millis(500);

fn main() -> io::Result<()> {
    if servers::serve()? {
        return Ok(());
    }
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if !arguments.iter().any(|argument| argument == "--bench") {
        println!("run by `cargo bench`");
        return Ok(());
    }
    let after = |name: &str| arguments.iter().skip_while(|argument| *argument != name).nth(1);
    let workers = after("--workers").and_then(|number| number.parse().ok()).unwrap_or(1);
    let (drives, moving) = affordable()?;
    println!("{drives} drives, {moving} of them moving; {workers} worker threads a server");
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    runtime.block_on(compare(drives, moving, workers))
}

/// As many drives as the limit of descriptors lets a server have, and how many of them are to move.
fn affordable() -> io::Result<(usize, usize)> {
    let files = allow_many_files()?.saturating_sub(SPARE);
    // The bench connects to them and to as many echoes.
    let moving = MOVING.min(files / 2);
    let drives = DRIVES.min(files - moving);
    if drives < DRIVES || moving < MOVING {
        println!(
            "a process may have {files} files here besides {SPARE} for itself: too few for {DRIVES} drives"
        );
    }
    Ok((drives, moving))
}

async fn compare(drives: usize, moving: usize, workers: usize) -> io::Result<()> {
    let (one, alone) = start(1, workers)?;
    let (many, all) = start(drives, workers)?;
    println!("started in {:.1} ms with one drive, {:.1} ms with all", alone * 1e3, all * 1e3);
    println!(
        "nobody asks      processor time in {WATCH:?}: one drive         all   memory of a drive   in all"
    );
    watch("at rest", &one, &many).await?;

    let mut one = connect("one drive", one, ALONE[0]).await?;
    let mut many = connect("all drives", many, moving).await?;
    for contender in [&mut one, &mut many] {
        set_moving(contender.connections()).await?;
    }
    watch("moving", one.server(), many.server()).await?;

    let mut eight = connect("one drive", start(1, workers)?.0, ALONE[1]).await?;
    set_moving(&mut eight.connections()[..1]).await?;
    each(&mut eight.connections()[1..], &[log_in()]).await?;
    let echo = connect("echo", ServerProcess::start(Kind::Echo, moving, workers)?, moving).await?;
    ask(&mut [one, eight, many, echo]).await
}

/// Starts a server, and tells how many seconds it took until it listened everywhere.
fn start(drives: usize, workers: usize) -> io::Result<(ServerProcess, f64)> {
    let start = Instant::now();
    let server = ServerProcess::start(Kind::Stepdrive, drives, workers)?;
    Ok((server, start.elapsed().as_secs_f64()))
}

/// So many connections, spread over the listeners.
async fn connect(name: &str, server: ServerProcess, connections: usize) -> io::Result<Contender> {
    let places: Vec<_> = server.addresses().iter().copied().cycle().take(connections).collect();
    Contender::connect(name, server, places).await
}

/// Lets the drive behind each connection run the shuttle.
async fn set_moving(connections: &mut [TcpStream]) -> io::Result<()> {
    let program = words(SHUTTLE);
    let halves = program.iter().flat_map(|word| [word & 0xFFFF, word >> 16]);
    let halves = halves.map(|half| u16::try_from(half).map_err(io::Error::other));
    let buffer = Request::WriteRegisters {
        address: Reg::CmdBuffer.info().address,
        values: halves.collect::<io::Result<_>>()?,
    };
    let lines = u16::try_from(program.len()).map_err(io::Error::other)?;
    // The instructions into area 0 from its first line on; how many they are; go.
    let store = write_many(Reg::NProg, [0, 0, lines, 0, 1]);
    let size = write_many(Reg::NProg, [0, 0, 1, lines, 4]);
    for requests in [&[log_in(), buffer, store][..], &[size], &[command(Opcode::StartProgramMem0)]] {
        each(connections, requests).await?;
        tokio::time::sleep(2 * FRAM_TIME).await;
    }
    Ok(())
}

/// Lets each client send requests and wait for the replies, one client after the other.
async fn each(connections: &mut [TcpStream], requests: &[Request]) -> io::Result<()> {
    for stream in connections {
        for request in requests {
            exchange(stream, &adu(request)).await?;
        }
    }
    Ok(())
}

/// Watches both for a while, and says what they used.
async fn watch(state: &str, one: &ServerProcess, many: &ServerProcess) -> io::Result<()> {
    tokio::time::sleep(SETTLE).await;
    let before = [one.cpu_time()?, many.cpu_time()?];
    tokio::time::sleep(WATCH).await;
    let used = [one.cpu_time()?.saturating_sub(before[0]), many.cpu_time()?.saturating_sub(before[1])];
    let [one_used, many_used] = used.map(|used| used.as_secs_f64() * 1e3);
    let memory = many.resident()?.saturating_sub(one.resident()?) as f64 / 1024.0;
    let others = many.addresses().len() - one.addresses().len();
    println!(
        "{state:16} {one_used:34.2} ms {many_used:8.2} ms {:14.1} KiB {:4.1} MiB",
        memory / others as f64,
        many.resident()? as f64 / 1024.0 / 1024.0
    );
    Ok(())
}

/// Measures the contenders and says what came of it. The ratios are to the drive that is alone with the most clients it
/// takes, the second.
async fn ask(contenders: &mut [Contender]) -> io::Result<()> {
    let rounds = Rounds::measure(contenders, ROUNDS, ROUND).await?;
    println!("{ROUNDS} rounds of {ROUND:?} each; medians, ratios by pairs of rounds");
    println!("server      connections  requests/s   ratio   server µs/request   ratio");
    for (place, contender) in contenders.iter_mut().enumerate() {
        println!(
            "{:10} {:12} {:11.0} {:7.3} {:19.2} {:7.3}",
            contender.name().to_owned(),
            contender.connections().len(),
            rounds.figure(place, |round| round.rate),
            rounds.ratio(place, 1, |round| round.rate),
            rounds.figure(place, |round| round.cost),
            rounds.ratio(place, 1, |round| round.cost),
        );
    }
    Ok(())
}
