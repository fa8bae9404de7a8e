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
use std::net::SocketAddr;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use stepdrive_bench::median;
use stepdrive_bench::requests::{adu, command, log_in, read, write};
use stepdrive_bench::servers::{self, Kind, ServerProcess};
use stepdrive_spec::modbus::Request;
use stepdrive_spec::smsd::instructions::Opcode;
use stepdrive_spec::smsd::registers::Reg;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::time::Instant;

/// Rounds of each server at each number of connections.
const ROUNDS: usize = 61;
/// How long a round lasts: less than what else the machine does takes to change.
const ROUND: Duration = Duration::from_millis(250);
/// How long requests are sent before the first round.
const WARM_UP: Duration = Duration::from_millis(300);
/// A drive takes so many connections.
const PER_DRIVE: usize = 8;
/// The most that the bench opens.
const DRIVES: usize = 8;
/// The function code's place in a frame.
const FUNCTION: usize = 7;

/// pymodbus' own server, with registers where the requests look for them.
const PYMODBUS: &str = include_str!("../pymodbus_server.py");

/// A server and the connections to it.
struct Contender {
    name: &'static str,
    server: ServerProcess,
    connections: Vec<TcpStream>,
}

/// What a round gave.
#[derive(Clone, Copy)]
struct Round {
    /// Requests in a second.
    rate: f64,
    /// Processor time of the server for a request, in microseconds.
    cost: f64,
}

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
            Contender::connect("echo", ServerProcess::start(Kind::Echo, DRIVES, workers)?, connections)
                .await?,
            stepdrive("at rest", &[log_in()], workers, connections).await?,
        ];
        if let Some(python) = python.filter(|_| connections <= PER_DRIVE) {
            let mut server = Command::new(python);
            server.args(["-c", PYMODBUS]).stderr(Stdio::null());
            contenders
                .push(Contender::connect("pymodbus", ServerProcess::spawn(server)?, connections).await?);
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
    let mut contender = Contender::connect(name, server, connections).await?;
    for stream in &mut contender.connections {
        for request in first {
            exchange(stream, &adu(request)).await?;
        }
    }
    Ok(contender)
}

/// Measures every contender in turn, round by round, and says what came of it. The ratios are to the echo, the second.
async fn measure(contenders: &mut [Contender], connections: usize) -> io::Result<()> {
    for contender in contenders.iter_mut() {
        contender.round(WARM_UP).await?;
    }
    let mut rounds: Vec<Vec<Round>> = vec![Vec::new(); contenders.len()];
    for number in 0..ROUNDS {
        // Every other time the other way round, so that none always comes first.
        let mut order: Vec<usize> = (0..contenders.len()).collect();
        if number % 2 == 1 {
            order.reverse();
        }
        for place in order {
            rounds[place].push(contenders[place].round(ROUND).await?);
        }
    }
    let figure = |place: usize, of: fn(&Round) -> f64| median(rounds[place].iter().map(of));
    let ratio = |place: usize, of: fn(&Round) -> f64| {
        median(rounds[place].iter().zip(&rounds[1]).map(|(this, echo)| of(this) / of(echo)))
    };
    for (place, contender) in contenders.iter().enumerate() {
        println!(
            "{connections:11}  {:10} {:11.0} {:7.3} {:19.2} {:7.3}",
            contender.name,
            figure(place, |round| round.rate),
            ratio(place, |round| round.rate),
            figure(place, |round| round.cost),
            ratio(place, |round| round.cost),
        );
    }
    Ok(())
}

impl Contender {
    /// Spreads connections over the listeners, as many to each as a drive takes.
    async fn connect(name: &'static str, server: ServerProcess, connections: usize) -> io::Result<Contender> {
        let places = server.addresses().iter().flat_map(|address| [*address; PER_DRIVE]);
        let places: Vec<SocketAddr> = places.take(connections).collect();
        let mut connections = Vec::new();
        for address in places {
            let stream = TcpStream::connect(address).await?;
            stream.set_nodelay(true)?;
            connections.push(stream);
        }
        Ok(Contender { name, server, connections })
    }

    /// Sends requests over all connections for so long.
    async fn round(&mut self, time: Duration) -> io::Result<Round> {
        let ended = Arc::new(AtomicBool::new(false));
        let (start, used) = (Instant::now(), self.server.cpu_time()?);
        let clients: Vec<_> = self
            .connections
            .drain(..)
            .map(|stream| tokio::spawn(client(stream, Arc::clone(&ended))))
            .collect();
        tokio::time::sleep(time).await;
        ended.store(true, Ordering::Relaxed);
        let mut requests = 0.0;
        for client in clients {
            let (stream, count) = client.await.map_err(io::Error::other)??;
            self.connections.push(stream);
            requests += f64::from(count);
        }
        let (time, used) = (start.elapsed(), self.server.cpu_time()?.saturating_sub(used));
        Ok(Round { rate: requests / time.as_secs_f64(), cost: used.as_secs_f64() * 1e6 / requests })
    }
}

/// One request after another until told to end; gives their number.
async fn client(mut stream: TcpStream, ended: Arc<AtomicBool>) -> io::Result<(TcpStream, u32)> {
    let requests: [Request; 2] = [read(Reg::MaxSpeed, 1), read(Reg::Speed, 6)];
    let requests = requests.map(|request| adu(&request));
    let mut count = 0;
    for request in requests.iter().cycle() {
        if ended.load(Ordering::Relaxed) {
            break;
        }
        exchange(&mut stream, request).await?;
        count += 1;
    }
    Ok((stream, count))
}

/// Sends a request and waits for the whole reply, which must be no exception.
async fn exchange(stream: &mut TcpStream, request: &[u8]) -> io::Result<()> {
    stream.write_all(request).await?;
    let mut reply = [0; 260];
    let mut filled = 0;
    loop {
        let count = stream.read(&mut reply[filled..]).await?;
        if count == 0 {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        filled += count;
        if filled > FUNCTION && filled >= 6 + usize::from(reply[5]) {
            break;
        }
    }
    // The echo knows sizes only.
    let function = reply[FUNCTION];
    if function == 0 || function == request[FUNCTION] {
        Ok(())
    } else {
        Err(io::Error::other("an exception"))
    }
}
