//! What it costs to watch a rig from a browser: processor time of the server, and bytes to whoever watches.
//!
//! The server is a process of its own with as many worker threads as there are processors, which has a rig and its panel
//! over lines within the process, as `stepdrive up` has, but remembers no trust in positions. Those who watch are
//! connections from here that read what comes. The rig is at rest, then ten of its motors turn, then all of them, at
//! constant speed: that by itself costs a rig nothing, so that what is measured is the watching.
//!
//! Beside the panel's stream the one of the rig's own API, which tells more of each drive, but looks at it without a line.
//! Who watches changes from one round to the next, so that whatever else the machine does falls on all. In the rounds in
//! which nobody watches somebody has just left: then nothing may go on.
//!
//! `cargo bench -p stepdrive-bench --bench panel [-- --rounds N] [--drives N]`: N rounds a row, 3 by default; one size of
//! rig instead of three.

use std::fmt::Write as _;
use std::io::{self, Read, Write};
use std::net::SocketAddr;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;
use stepdrive_bench::load::exchange;
use stepdrive_bench::median;
use stepdrive_bench::process::allow_many_files;
use stepdrive_bench::requests::{adu, command, log_in, write};
use stepdrive_bench::servers::ServerProcess;
use stepdrive_host::axis::{DriveAxis, SmsdMotor};
use stepdrive_host::from_fn;
use stepdrive_host::smsd::{SmsdClient, SmsdOptions};
use stepdrive_panel::{Controller, Panel, PanelAxis};
use stepdrive_rig::file::{ApiSection, RigFile};
use stepdrive_server::{Connector, Options, ServedDrive, Server};
use stepdrive_spec::smsd::instructions::Opcode;
use stepdrive_spec::smsd::registers::Reg;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::task::JoinSet;
use tokio::time::sleep;

/// Sizes of rigs.
const DRIVES: [usize; 3] = [1, 100, 1000];
/// How many move when some do.
const SOME: usize = 10;
/// From when somebody begins to watch, or leaves, until anything is measured: all drives have been looked at then.
const SETTLE: Duration = Duration::from_millis(1500);
/// How long a round lasts.
const ROUND: Duration = Duration::from_secs(2);
const ROUNDS: usize = 3;
/// The most of a processor that one who watches a thousand drives at rest may cost.
const AIM: f64 = 0.1;
/// The unit to which every drive answers besides its own.
const ANY_UNIT: u8 = 255;

/// The argument that makes this program a server.
const SERVE: &str = "serve";

/// Who watches: a name, and the streams that are read.
struct Audience {
    name: &'static str,
    streams: &'static [&'static str],
    /// How many do the same.
    heads: usize,
}

const OVERVIEW: &[&str] = &["/v1/axes/events"];
/// The first drive closely, and its mechanism from the rig's API.
const DRIVE_PAGE: &[&str] = &["/v1/axes/events?focus=drive0", "/v1/events?drive=drive0&every=40ms"];

const AUDIENCES: [Audience; 6] = [
    Audience { name: "nobody", streams: &[], heads: 0 },
    Audience { name: "overview", streams: OVERVIEW, heads: 1 },
    Audience { name: "and one drive closely", streams: &["/v1/axes/events?focus=drive0"], heads: 1 },
    Audience { name: "the page of a drive", streams: DRIVE_PAGE, heads: 1 },
    Audience { name: "eight overviews", streams: OVERVIEW, heads: 8 },
    Audience { name: "the rig's API", streams: &["/v1/events"], heads: 1 },
];

/// What a round gave.
#[derive(Clone, Copy)]
struct Round {
    /// The part of a processor that the server used.
    processor: f64,
    /// Bytes a second to each who watches.
    bytes: f64,
}

fn main() -> io::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let [role, drives] = &arguments[..]
        && role == SERVE
    {
        return serve(drives.parse().map_err(io::Error::other)?);
    }
    if !arguments.iter().any(|argument| argument == "--bench") {
        println!("run by `cargo bench`");
        return Ok(());
    }
    let after = |name: &str| arguments.iter().skip_while(|argument| *argument != name).nth(1);
    let number = |name: &str| after(name).and_then(|number| number.parse::<usize>().ok());
    let rounds = number("--rounds").unwrap_or(ROUNDS).max(1);
    let sizes = number("--drives").map_or(DRIVES.to_vec(), |drives| vec![drives.max(1)]);
    println!("{rounds} rounds of {ROUND:?} each; medians; ratios to {AIM} of a processor");
    println!("drives  moving  watched by              processor   ratio   kB/s to each");
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    sizes.into_iter().try_for_each(|drives| runtime.block_on(measure(drives, rounds)))
}

/// A rig of this size: at rest, with some of its motors turning, with all of them.
async fn measure(drives: usize, rounds: usize) -> io::Result<()> {
    // Each drive listens, and is connected to from here.
    allow_many_files()?;
    let server = ServerProcess::spawn(this(&[SERVE, &drives.to_string()])?)?;
    let Some((api, motors)) = server.addresses().split_first() else {
        return Err(io::Error::other("the server did not say where its API is"));
    };
    let before = server.resident()?;
    // The first to watch has the models of the drives asked for.
    watch(&server, *api, &Audience { name: "the first", streams: OVERVIEW, heads: 1 }).await?;
    let [before, after] = [before, server.resident()?].map(|memory| memory as f64 / 1024.0 / 1024.0);
    println!("{drives:6}  take {before:.1} MiB of memory, {after:.1} MiB since they have been watched");
    let mut turning = Vec::new();
    for moving in [0, SOME, drives] {
        if moving > drives {
            continue;
        }
        for motor in &motors[turning.len()..moving] {
            turning.push(turn(*motor).await?);
        }
        compare(&server, *api, (drives, moving), rounds).await?;
    }
    Ok(())
}

/// Lets a motor turn. It is for whoever gets the connection to keep it.
async fn turn(motor: SocketAddr) -> io::Result<TcpStream> {
    let mut stream = TcpStream::connect(motor).await?;
    for request in [log_in(), write(Reg::TargetSpeed, 1000), command(Opcode::RunF)] {
        exchange(&mut stream, &adu(&request)).await?;
    }
    Ok(stream)
}

/// Lets each audience watch in turn, and says what came of it.
async fn compare(
    server: &ServerProcess,
    api: SocketAddr,
    (drives, moving): (usize, usize),
    rounds: usize,
) -> io::Result<()> {
    let mut given: [Vec<Round>; AUDIENCES.len()] = Default::default();
    for _ in 0..rounds {
        for (audience, given) in AUDIENCES.iter().zip(&mut given) {
            given.push(watch(server, api, audience).await?);
        }
    }
    for (audience, given) in AUDIENCES.iter().zip(&given) {
        let processor = median(given.iter().map(|round| round.processor));
        println!(
            "{drives:6}  {moving:6}  {:22} {:8.2} %  {:6.3} {:14.2}",
            audience.name,
            processor * 100.0,
            processor / AIM,
            median(given.iter().map(|round| round.bytes)) / 1000.0,
        );
    }
    Ok(())
}

/// A round of one audience. They have left when it ends.
async fn watch(server: &ServerProcess, api: SocketAddr, audience: &Audience) -> io::Result<Round> {
    let received = Arc::new(AtomicU64::new(0));
    let mut readers = JoinSet::new();
    for path in audience.streams.iter().cycle().take(audience.streams.len() * audience.heads) {
        readers.spawn(follow(api, path, Arc::clone(&received)));
    }
    sleep(SETTLE).await;
    let (began, used) = (tokio::time::Instant::now(), server.cpu_time()?);
    received.store(0, Ordering::Relaxed);
    sleep(ROUND).await;
    let used = server.cpu_time()?.saturating_sub(used).as_secs_f64();
    let (bytes, time) = (received.load(Ordering::Relaxed), began.elapsed().as_secs_f64());
    match readers.try_join_next() {
        Some(Ok(Err(error))) => Err(error),
        Some(_) => Err(io::Error::other("a stream of events has ended")),
        None => {
            Ok(Round { processor: used / time, bytes: bytes as f64 / time / audience.heads.max(1) as f64 })
        }
    }
}

/// Reads a stream of events for as long as it lasts, and counts its bytes as they come over the wire.
async fn follow(api: SocketAddr, path: &str, received: Arc<AtomicU64>) -> io::Result<()> {
    let mut stream = TcpStream::connect(api).await?;
    stream.write_all(format!("GET {path} HTTP/1.1\r\nHost: {api}\r\n\r\n").as_bytes()).await?;
    let mut bytes = vec![0; 1 << 16];
    let mut is_answered = false;
    loop {
        let count = stream.read(&mut bytes).await?;
        if !is_answered && !bytes[..count].starts_with(b"HTTP/1.1 200 ") {
            return Err(io::Error::other(format!("GET {path} was refused")));
        }
        is_answered = true;
        if count == 0 {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        received.fetch_add(count as u64, Ordering::Relaxed);
    }
}

/// This program once more, as something else.
fn this(arguments: &[&str]) -> io::Result<Command> {
    let mut command = Command::new(std::env::current_exe()?);
    command.args(arguments);
    Ok(command)
}

/// Serves a rig of so many drives with its panel until the standard input ends. Says where its API is, and its drives.
fn serve(drives: usize) -> io::Result<()> {
    let mut text = String::new();
    for number in 0..drives {
        let _ = write!(
            text,
            "[[drive]]\nname = \"drive{number}\"\nmodel = \"SMSD-4.2LAN\"\nmodbus_tcp = \"127.0.0.1:0\"\n"
        );
    }
    let mut rig = RigFile::parse(&text).map_err(io::Error::other)?;
    rig.api = Some(ApiSection { address: SocketAddr::from(([127, 0, 0, 1], 0)), token: None });
    let state = tempfile::tempdir()?;
    let notify = Arc::new(|notice| eprintln!("{notice}"));
    let options = Options { state: state.path().into(), recording: None, notify };
    let runtime = tokio::runtime::Runtime::new()?;
    let server = runtime.block_on(Server::start_with(&rig, options, |connector, drives| {
        Panel::new(drives.iter().enumerate().map(|place| axis(connector, place)).collect()).router()
    }));
    let server = server.map_err(io::Error::other)?;
    let motors = server.drives().iter().filter_map(|drive| drive.modbus_tcp);
    let places: Vec<String> = server.api().into_iter().chain(motors).map(|place| place.to_string()).collect();
    writeln!(io::stdout(), "{}", places.join(" "))?;
    io::stdin().read_to_end(&mut Vec::new())?;
    Ok(())
}

/// A drive as the panel has it: over a line within this process.
fn axis(connector: &Connector, (number, drive): (usize, &ServedDrive)) -> PanelAxis {
    let connector = connector.clone();
    let line = from_fn(&drive.name, move || std::future::ready(connector.connect(number)));
    let client = SmsdClient::new(line, SmsdOptions { unit: ANY_UNIT, ..SmsdOptions::default() });
    PanelAxis {
        name: drive.name.clone(),
        is_virtual: true,
        target: "a drive of this rig".to_owned(),
        controller: Controller::Smsd(Arc::new(DriveAxis::new(SmsdMotor::new(&drive.name, client)))),
        keeper: None,
        simulated_as: None,
    }
}
