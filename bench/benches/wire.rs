//! What a server makes of two processors over loopback: stepdrive beside a bare tokio echo of the same sizes, in rounds
//! that alternate, so that whatever else the machine does falls on both.
//!
//! Each server is a process of its own. The clients are one thread here: each connection has one request in flight, in
//! turn FC03 of one register and FC04 of six. stepdrive is measured twice: with motors that turn meanwhile, so that speed
//! and position have to be computed for each reply, and with motors at rest.
//!
//! `cargo bench -p stepdrive-bench --bench wire [-- [--workers N] [--python PYTHON]]`: with a Python that has pymodbus,
//! its server is measured too.

use std::io;
use std::process::{Command, Stdio};
use std::time::Duration;
use stepdrive_bench::load::{Contender, Rounds, exchange};
use stepdrive_bench::requests::{adu, command, log_in, write};
use stepdrive_bench::servers::{self, Kind, ServerProcess};
use stepdrive_spec::modbus::Request;
use stepdrive_spec::smsd::instructions::Opcode;
use stepdrive_spec::smsd::registers::Reg;

/// Rounds of each server at each number of connections.
const ROUNDS: usize = 61;
/// How long a round lasts: less than what else the machine does takes to change.
const ROUND: Duration = Duration::from_millis(250);
/// A drive takes so many connections.
const PER_DRIVE: usize = 8;
/// The most that the bench opens.
const DRIVES: usize = 8;

/// pymodbus' own server, with registers where the requests look for them.
const PYMODBUS: &str = include_str!("../pymodbus_server.py");

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
    println!(
        "{workers} worker threads a server, {ROUNDS} rounds of {ROUND:?} each; medians, ratios by pairs of rounds"
    );
    tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()?
        .block_on(compare(workers, after("--python")))
}

async fn compare(workers: usize, python: Option<&String>) -> io::Result<()> {
    let turning = [log_in(), write(Reg::TargetSpeed, 1000), command(Opcode::RunF)];
    println!("connections  server      requests/s   ratio   server µs/request   ratio");
    for connections in [1, 8, 64] {
        let mut contenders = vec![
            stepdrive("turning", &turning, workers, connections).await?,
            connect("echo", ServerProcess::start(Kind::Echo, DRIVES, workers)?, connections).await?,
            stepdrive("at rest", &[log_in()], workers, connections).await?,
        ];
        if let Some(python) = python.filter(|_| connections <= PER_DRIVE) {
            let mut server = Command::new(python);
            server.args(["-c", PYMODBUS]).stderr(Stdio::null());
            contenders.push(connect("pymodbus", ServerProcess::spawn(server)?, connections).await?);
        }
        measure(&mut contenders, connections).await?;
    }
    Ok(())
}

/// stepdrive, with requests that every connection sends first.
async fn stepdrive(
    name: &'static str,
    first: &[Request],
    workers: usize,
    connections: usize,
) -> io::Result<Contender> {
    let server = ServerProcess::start(Kind::Stepdrive, DRIVES, workers)?;
    let mut contender = connect(name, server, connections).await?;
    for stream in contender.connections() {
        for request in first {
            exchange(stream, &adu(request)).await?;
        }
    }
    Ok(contender)
}

/// Spreads connections over the listeners, as many to each as a drive takes.
async fn connect(name: &str, server: ServerProcess, connections: usize) -> io::Result<Contender> {
    let places = server.addresses().iter().flat_map(|address| [*address; PER_DRIVE]);
    let places: Vec<_> = places.take(connections).collect();
    Contender::connect(name, server, places).await
}

/// Measures the contenders and says what came of it. The ratios are to the echo, the second.
async fn measure(contenders: &mut [Contender], connections: usize) -> io::Result<()> {
    let rounds = Rounds::measure(contenders, ROUNDS, ROUND).await?;
    for (place, contender) in contenders.iter().enumerate() {
        println!(
            "{connections:11}  {:10} {:11.0} {:7.3} {:19.2} {:7.3}",
            contender.name(),
            rounds.figure(place, |round| round.rate),
            rounds.ratio(place, 1, |round| round.rate),
            rounds.figure(place, |round| round.cost),
            rounds.ratio(place, 1, |round| round.cost),
        );
    }
    Ok(())
}
