//! What the drivers of `host` make of a processor, beside other clients of the same server process: tokio-modbus, pymodbus
//! and pyserial; and the bare client, which is the least that one on tokio can do. In rounds that alternate.
//!
//! Each client is a process of its own with one thread, and has drives of its own in the one server process. All ask for
//! the same: of an SMSD FC04 of six registers, SPEED to Inputs; of an SMD3 its position. tokio-modbus is measured as it is,
//! and with a timeout round each request, which our clients always have.
//!
//! Then a thousand axes, each asked ten times a second by one process with a client for each.
//!
//! `cargo bench -p stepdrive-bench --bench host [-- --python PYTHON]`: with a Python that has pymodbus and pyserial,
//! these are measured too.

use std::io;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use stepdrive_bench::clients::{self, ClientProcess};
use stepdrive_bench::load::{Rounds, exchange};
use stepdrive_bench::requests::{adu, log_in, read};
use stepdrive_bench::servers::{self, Kind, SMD3S, ServerProcess};
use stepdrive_host::smd3::Smd3Client;
use stepdrive_host::smsd::{SmsdClient, SmsdOptions};
use stepdrive_host::{Connect, Serial, Tcp, Timeouts};
use stepdrive_spec::modbus::Request;
use stepdrive_spec::smd3::commands::Command as Smd3Command;
use stepdrive_spec::smsd::registers::Reg;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::runtime::Builder;
use tokio::time::{Instant, sleep, sleep_until, timeout};
use tokio_modbus::client::{Context, Reader as _, Writer as _, tcp};
use tokio_modbus::slave::Slave;

/// Rounds of each client.
const ROUNDS: usize = 41;
/// How long a round lasts: less than what else the machine does takes to change.
const ROUND: Duration = Duration::from_millis(250);
/// Connections of a client; eight are the most that a drive takes.
const CONNECTIONS: [usize; 2] = [1, 8];
/// What is asked of an SMSD: six registers.
const REGS: [Reg; 5] = [Reg::Speed, Reg::ElPos, Reg::AbsPos, Reg::StatusWord, Reg::Inputs];
const WORDS: u16 = 6;
/// A timeout that never comes to pass.
const PATIENCE: Duration = Duration::from_secs(1);

/// How many axes.
const AXES: usize = 1000;
/// From one poll of an axis to the next.
const PERIOD: Duration = Duration::from_millis(100);
/// A poll whose values come so long after it was due is late.
const LATE: Duration = Duration::from_millis(10);
/// How long the axes are polled.
const POLL: Duration = Duration::from_secs(10);

/// How a client works: one request after another.
const ASK: &str = "ask";
/// Polls, the axes spread over the period.
const SPREAD: &str = "spread";
/// Polls, all axes at the same instants.
const AT_ONCE: &str = "at once";

const PYMODBUS: &str = include_str!("../pymodbus_client.py");
const PYSERIAL: &str = include_str!("../pyserial_client.py");

fn main() -> io::Result<()> {
    if servers::serve()? {
        return Ok(());
    }
    if let Some(arguments) = clients::arguments() {
        return client(&arguments);
    }
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if !arguments.iter().any(|argument| argument == "--bench") {
        println!("run by `cargo bench`");
        return Ok(());
    }
    let python = arguments.iter().skip_while(|argument| *argument != "--python").nth(1);
    println!("{ROUNDS} rounds of {ROUND:?} each; medians, ratios by pairs of rounds");
    println!(
        "family    connections  client                          reads/s   ratio   client µs/read   ratio"
    );
    Builder::new_current_thread().enable_all().build()?.block_on(compare(python))?;
    println!("{AXES} axes, one SmsdClient or one of another kind each, every {PERIOD:?}, for {POLL:?}");
    println!(
        "client          axes are asked  polls/s  processor   late  latest, ms  memory of an axis  server's processor"
    );
    for mode in [SPREAD, AT_ONCE] {
        for client in [SNAPSHOT, TOKIO_MODBUS] {
            poll_axes(client, mode)?;
        }
    }
    Ok(())
}

/// Clients of both families against one server process.
async fn compare(python: Option<&String>) -> io::Result<()> {
    let names =
        [TOKIO_MODBUS, TOKIO_MODBUS_TIMEOUT, READ_MANY, SNAPSHOT, BARE, PYMODBUS_PLAIN, PYMODBUS_ASYNCIO];
    let drives = names.len() * CONNECTIONS.len();
    let server = ServerProcess::start(Kind::BothFamilies, drives, 1)?;
    let (modbus, lines) = server.addresses().split_at(drives);
    let mut modbus = modbus.iter();
    for connections in CONNECTIONS {
        let mut contestants = Vec::new();
        for (name, address) in names.into_iter().zip(modbus.by_ref()) {
            if let Some(method) = name.strip_prefix("pymodbus ") {
                // The plain one has one connection.
                let can = connections == 1 || method != "plain";
                let Some(python) = python.filter(|_| can) else { continue };
                contestants.push(pymodbus(name, method, python, &address.to_string(), connections)?);
            } else {
                contestants.push(start(ASK, name, &vec![address.to_string(); connections])?);
            }
        }
        measure("SMSD", &mut contestants, connections).await?;
    }
    let [line, bare] = lines else { return Err(io::Error::other(format!("{SMD3S} lines are wanted"))) };
    let mut contestants =
        [start(ASK, BARE_LINE, &[bare.to_string()])?, start(ASK, SMD3_CLIENT, &[line.to_string()])?];
    measure("SMD3 on TCP", &mut contestants, 1).await?;
    let [ours, other] = server.terminals() else { return Err(io::Error::other("terminals are wanted")) };
    let mut contestants = Vec::new();
    if let Some(python) = python {
        let mut client = Command::new(python);
        client.args(["-c", PYSERIAL, other, POSITION]);
        contestants.push(ClientProcess::spawn("pyserial", client)?);
    }
    contestants.push(start(ASK, SMD3_CLIENT, std::slice::from_ref(ours))?);
    measure("SMD3 at a pty", &mut contestants, 1).await
}

fn start(mode: &str, name: &str, places: &[String]) -> io::Result<ClientProcess> {
    let arguments = [mode.to_owned(), name.to_owned()];
    ClientProcess::start(name, &[&arguments[..], places].concat())
}

fn pymodbus(
    name: &str,
    method: &str,
    python: &str,
    place: &str,
    connections: usize,
) -> io::Result<ClientProcess> {
    let Request::WriteRegisters { address, values } = log_in() else { unreachable!("FC10") };
    let first = REGS[0].info().address;
    let mut client = Command::new(python);
    client.args(["-c", PYMODBUS, method, place, &connections.to_string()]);
    client.args([first, WORDS, address].into_iter().chain(values).map(|number| number.to_string()));
    client.stderr(Stdio::null());
    ClientProcess::spawn(name, client)
}

/// Measures the contestants and says what came of it. The ratios are to the first.
async fn measure(family: &str, contestants: &mut [ClientProcess], connections: usize) -> io::Result<()> {
    let rounds = Rounds::measure(contestants, ROUNDS, ROUND).await?;
    for (place, contestant) in contestants.iter().enumerate() {
        println!(
            "{family:13} {connections:7}  {:26} {:12.0} {:7.3} {:16.2} {:7.3}",
            contestant.name(),
            rounds.figure(place, |round| round.rate),
            rounds.ratio(place, 0, |round| round.rate),
            rounds.figure(place, |round| round.cost),
            rounds.ratio(place, 0, |round| round.cost),
        );
    }
    Ok(())
}

/// Lets one process poll all axes, and says what came of it. Memory is the difference to a process with one.
fn poll_axes(name: &str, mode: &str) -> io::Result<()> {
    let server = ServerProcess::start(Kind::Stepdrive, AXES, 1)?;
    let places: Vec<String> = server.addresses().iter().map(ToString::to_string).collect();
    let alone = ServerProcess::start(Kind::Stepdrive, 1, 1)?;
    let mut one = start(mode, name, &[alone.addresses()[0].to_string()])?;
    one.order(PERIOD * 10)?;
    let mut all = start(mode, name, &places)?;
    all.order(PERIOD * 10)?;
    let before = [all.cpu_time()?, server.cpu_time()?];
    let figures = all.order(POLL)?;
    let used = [all.cpu_time()?.saturating_sub(before[0]), server.cpu_time()?.saturating_sub(before[1])];
    let [client, server] = used.map(|used| used.as_secs_f64() / POLL.as_secs_f64() * 100.0);
    let memory = all.resident()?.saturating_sub(one.resident()?) as f64 / 1024.0 / (AXES - 1) as f64;
    let [polls, late, latest] = figures[..] else { return Err(io::Error::other("three figures are wanted")) };
    println!(
        "{name:14}  {mode:14} {:8.0} {client:8.1} % {:4.2} % {:11.1} {memory:14.2} KiB {server:18.1} %",
        polls as f64 / POLL.as_secs_f64(),
        late as f64 / polls as f64 * 100.0,
        latest as f64 / 1e3,
    );
    Ok(())
}

const READ_MANY: &str = "SmsdClient read_many";
const SNAPSHOT: &str = "SmsdClient";
const TOKIO_MODBUS: &str = "tokio-modbus";
const TOKIO_MODBUS_TIMEOUT: &str = "tokio-modbus, timeout";
const BARE: &str = "bare";
const BARE_LINE: &str = "bare line";
const SMD3_CLIENT: &str = "Smd3Client";
const PYMODBUS_PLAIN: &str = "pymodbus plain";
const PYMODBUS_ASYNCIO: &str = "pymodbus asyncio";
/// What is asked of an SMD3.
const POSITION: &str = "PACT";

/// This process is a client: of each of some places.
fn client(arguments: &[String]) -> io::Result<()> {
    let [mode, name, places @ ..] = arguments else { return Err(io::ErrorKind::InvalidInput.into()) };
    match name.as_str() {
        READ_MANY => work::<Many>(mode, places),
        SNAPSHOT => work::<SmsdClient>(mode, places),
        TOKIO_MODBUS => work::<Context>(mode, places),
        TOKIO_MODBUS_TIMEOUT => work::<Timed<Context>>(mode, places),
        BARE => work::<Bare>(mode, places),
        BARE_LINE => work::<BareLine>(mode, places),
        _ => work::<Smd3Client>(mode, places),
    }
}

fn work<A: Asker>(mode: &str, places: &[String]) -> io::Result<()> {
    let runtime = Builder::new_current_thread().enable_all().build()?;
    let mut askers = runtime.block_on(connect::<A>(places))?;
    clients::obey(|time| {
        runtime.block_on(async {
            match mode {
                ASK => ask(&mut askers, time).await,
                _ => poll(&mut askers, time, mode == SPREAD).await,
            }
        })
    })
}

async fn connect<A: Asker>(places: &[String]) -> io::Result<Vec<A>> {
    let mut askers = Vec::new();
    for place in places {
        let mut asker = A::connect(place).await?;
        asker.ask().await?;
        askers.push(asker);
    }
    Ok(askers)
}

/// All ask, one request after another, for so long; gives the number of requests.
async fn ask<A: Asker>(askers: &mut Vec<A>, time: Duration) -> io::Result<Vec<u64>> {
    let ended = Arc::new(AtomicBool::new(false));
    let tasks: Vec<_> =
        askers.drain(..).map(|asker| tokio::spawn(ask_until(asker, Arc::clone(&ended)))).collect();
    sleep(time).await;
    ended.store(true, Ordering::Relaxed);
    let mut requests = 0;
    for task in tasks {
        let (asker, own) = task.await.map_err(io::Error::other)??;
        askers.push(asker);
        requests += own;
    }
    Ok(vec![requests])
}

async fn ask_until<A: Asker>(mut asker: A, ended: Arc<AtomicBool>) -> io::Result<(A, u64)> {
    let mut requests = 0;
    while !ended.load(Ordering::Relaxed) {
        asker.ask().await?;
        requests += 1;
    }
    Ok((asker, requests))
}

/// How polls went.
#[derive(Default)]
struct Polls {
    made: u64,
    late: u64,
    latest: Duration,
}

/// All are polled for so long; gives the number of polls, how many were late, and how late the latest was, in µs.
async fn poll<A: Asker>(askers: &mut Vec<A>, time: Duration, spread: bool) -> io::Result<Vec<u64>> {
    let start = Instant::now() + PERIOD;
    let apart = if spread { PERIOD.div_f64(askers.len() as f64) } else { Duration::ZERO };
    let mut due = start;
    let mut tasks = Vec::new();
    for asker in askers.drain(..) {
        tasks.push(tokio::spawn(poll_until(asker, due, start + time)));
        due += apart;
    }
    let mut all = Polls::default();
    for task in tasks {
        let (asker, polls) = task.await.map_err(io::Error::other)??;
        askers.push(asker);
        all.made += polls.made;
        all.late += polls.late;
        all.latest = all.latest.max(polls.latest);
    }
    Ok(vec![all.made, all.late, u64::try_from(all.latest.as_micros()).unwrap_or(u64::MAX)])
}

async fn poll_until<A: Asker>(mut asker: A, mut due: Instant, end: Instant) -> io::Result<(A, Polls)> {
    let mut polls = Polls::default();
    while due < end {
        sleep_until(due).await;
        asker.ask().await?;
        let behind = due.elapsed();
        polls.made += 1;
        polls.late += u64::from(behind > LATE);
        polls.latest = polls.latest.max(behind);
        due += PERIOD;
    }
    Ok((asker, polls))
}

/// A client that can make the request that is measured.
trait Asker: Sized + Send + 'static {
    async fn connect(place: &str) -> io::Result<Self>;
    fn ask(&mut self) -> impl Future<Output = io::Result<()>> + Send;
}

impl Asker for SmsdClient {
    async fn connect(place: &str) -> io::Result<SmsdClient> {
        Ok(SmsdClient::new(reach(place)?, SmsdOptions::default()))
    }

    async fn ask(&mut self) -> io::Result<()> {
        self.snapshot().await.map(|_| ()).map_err(io::Error::other)
    }
}

/// A client that is asked for the same by the registers' names.
struct Many(SmsdClient);

impl Asker for Many {
    async fn connect(place: &str) -> io::Result<Many> {
        Ok(Many(<SmsdClient as Asker>::connect(place).await?))
    }

    async fn ask(&mut self) -> io::Result<()> {
        let values = self.0.read_many(&REGS).await.map_err(io::Error::other)?;
        if values.len() == REGS.len() { Ok(()) } else { Err(io::Error::other("too few values")) }
    }
}

impl Asker for Context {
    async fn connect(place: &str) -> io::Result<Context> {
        let stream = TcpStream::connect(place).await?;
        stream.set_nodelay(true)?;
        let mut client = tcp::attach_slave(stream, Slave(1));
        let Request::WriteRegisters { address, values } = log_in() else { unreachable!("FC10") };
        let entered = client.write_multiple_registers(address, &values).await.map_err(io::Error::other)?;
        entered.map_err(io::Error::other)?;
        Ok(client)
    }

    async fn ask(&mut self) -> io::Result<()> {
        let words = self.read_input_registers(REGS[0].info().address, WORDS).await;
        let words = words.map_err(io::Error::other)?.map_err(io::Error::other)?;
        if words.len() == usize::from(WORDS) { Ok(()) } else { Err(io::Error::other("too few registers")) }
    }
}

/// A client with a timeout round each request.
struct Timed<A>(A);

impl<A: Asker> Asker for Timed<A> {
    async fn connect(place: &str) -> io::Result<Timed<A>> {
        Ok(Timed(A::connect(place).await?))
    }

    async fn ask(&mut self) -> io::Result<()> {
        timeout(PATIENCE, self.0.ask()).await?
    }
}

/// Sends a request made beforehand, and looks at no more of the reply than its length and function code.
struct Bare {
    stream: TcpStream,
    request: Vec<u8>,
}

impl Asker for Bare {
    async fn connect(place: &str) -> io::Result<Bare> {
        let mut stream = TcpStream::connect(place).await?;
        stream.set_nodelay(true)?;
        exchange(&mut stream, &adu(&log_in())).await?;
        Ok(Bare { stream, request: adu(&read(REGS[0], WORDS)) })
    }

    async fn ask(&mut self) -> io::Result<()> {
        exchange(&mut self.stream, &self.request).await
    }
}

/// The same of an SMD3: looks for the end of the line only.
struct BareLine(TcpStream);

impl Asker for BareLine {
    async fn connect(place: &str) -> io::Result<BareLine> {
        let stream = TcpStream::connect(place).await?;
        stream.set_nodelay(true)?;
        Ok(BareLine(stream))
    }

    async fn ask(&mut self) -> io::Result<()> {
        self.0.write_all(format!("{POSITION}\r\n").as_bytes()).await?;
        let (mut reply, mut filled) = ([0; 64], 0);
        while !reply[..filled].ends_with(b"\r\n") {
            let count = self.0.read(&mut reply[filled..]).await?;
            if count == 0 {
                return Err(io::ErrorKind::UnexpectedEof.into());
            }
            filled += count;
        }
        Ok(())
    }
}

impl Asker for Smd3Client {
    async fn connect(place: &str) -> io::Result<Smd3Client> {
        Ok(Smd3Client::new(reach(place)?, Timeouts::default()))
    }

    async fn ask(&mut self) -> io::Result<()> {
        self.get(Smd3Command::Pact).await.map(|_| ()).map_err(io::Error::other)
    }
}

/// The way to a place: the path of a terminal, or a host with its port.
fn reach(place: &str) -> io::Result<Box<dyn Connect>> {
    if place.starts_with('/') {
        return Ok(Box::new(Serial::new(place)));
    }
    let (host, port) = place.rsplit_once(':').ok_or(io::ErrorKind::InvalidInput)?;
    Ok(Box::new(Tcp::new(host, port.parse().map_err(io::Error::other)?)))
}
