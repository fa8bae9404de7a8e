//! How long a host waits for a reply at an SMSD's USB port, with the machine more than busy: the position asked for over a
//! pseudo-terminal, from the first byte of the request to the last of the reply.
//!
//! The server is a process of its own with as many worker threads as there are processors, as `stepdrive up` has. It serves
//! other drives too. What keeps the machine busy is in processes of their own: clients of those other drives, with a
//! request each in flight all the time, and as many processes that only compute as there are processors.
//!
//! Beside it, in rounds that alternate, a thread in a process of its own that answers the same bytes at another
//! pseudo-terminal and does nothing else: what it takes is what the machine takes.
//!
//! `cargo bench -p stepdrive-bench --bench smsd_usb [-- --rounds N]`: N rounds a row, 20 by default.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::net::SocketAddr;
use std::process::{Child, Command, Stdio, exit};
use std::sync::Arc;
use std::thread::{available_parallelism, spawn};
use std::time::Duration;
use stepdrive_bench::load::exchange;
use stepdrive_bench::requests::{adu, command, log_in, read, write};
use stepdrive_bench::servers::ServerProcess;
use stepdrive_bench::terminal;
use stepdrive_proto::smsd::{Framing, PacketBuf, PacketReader, STOP, encode_reply, encode_request};
use stepdrive_rig::file::RigFile;
use stepdrive_server::{Options, Server};
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::standard::{
    AUTHORISATION_REST, Answer, Code, PacketType, Reply, Request, VERSION_2,
};
use stepdrive_spec::smsd::status::Status;
use tokio::net::TcpStream;
use tokio::time::Instant;

/// Drives besides the one that is measured, and clients of each.
const OTHERS: usize = 8;
const CLIENTS: usize = 8;
/// The password as it leaves the factory.
const PASSWORD: u64 = 0x0123_4567_89AB_CDEF;
/// What the host calls its requests.
const ID: u8 = 7;
/// How long a server is asked before the other one is.
const ROUND: Duration = Duration::from_secs(1);
/// How often a host asks that does not ask at once again.
const INTERVAL: Duration = Duration::from_millis(2);
/// How long the load runs before anything is measured.
const SETTLE: Duration = Duration::from_millis(500);
/// What 99.9 % of the replies must come within, and how long the maker's software waits.
const AIM: Duration = Duration::from_millis(5);
const PATIENCE: Duration = Duration::from_millis(50);

/// The arguments that make this program something else.
const SERVE: &str = "serve";
const ECHO: &str = "echo";
const ASK: &str = "ask";
const COMPUTE: &str = "compute";

/// What keeps the machine busy.
#[derive(Clone, Copy)]
struct Load {
    name: &'static str,
    clients: bool,
    hogs: bool,
}

const LOADS: [Load; 4] = [
    Load { name: "nothing", clients: false, hogs: false },
    Load { name: "other drives' clients", clients: true, hogs: false },
    Load { name: "computing", clients: false, hogs: true },
    Load { name: "both", clients: true, hogs: true },
];

fn main() -> io::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match &arguments[..] {
        [role] if role == SERVE => return serve(),
        [role] if role == ECHO => return echo(),
        [role, places @ ..] if role == ASK => return ask(places),
        [role] if role == COMPUTE => compute(),
        _ => {}
    }
    if !arguments.iter().any(|argument| argument == "--bench") {
        println!("run by `cargo bench`");
        return Ok(());
    }
    let rounds = arguments.iter().skip_while(|argument| *argument != "--rounds").nth(1);
    measure(rounds.and_then(|number| number.parse().ok()).unwrap_or(20))
}

fn measure(rounds: usize) -> io::Result<()> {
    let (server, echo) = (ServerProcess::spawn(this(&[SERVE])?)?, Echo::start()?);
    let [terminal] = server.terminals() else { return Err(io::Error::other("one port")) };
    let mut ports = [("stepdrive", Port::open(terminal)?), ("echo", Port::open(&echo.path)?)];
    ports[0].1.start()?;
    println!("round trips in µs, {rounds} rounds of {ROUND:?}; ratios to {AIM:?} and {PATIENCE:?}");
    println!(
        "busy with               asks        server      replies    p50    p99  p99.9    max    p99.9    max"
    );
    for load in LOADS {
        let _busy = load.start(server.addresses())?;
        for (habit, interval) in [("at once", Duration::ZERO), ("every 2 ms", INTERVAL)] {
            pause(SETTLE);
            let mut times = [Vec::new(), Vec::new()];
            for _ in 0..rounds {
                for ((_, port), times) in ports.iter_mut().zip(&mut times) {
                    port.ask_for(ROUND, interval, times)?;
                }
            }
            for ((name, _), times) in ports.iter().zip(&mut times) {
                times.sort_unstable();
                report(load.name, habit, name, times);
            }
        }
    }
    Ok(())
}

/// One row; `times` are sorted.
fn report(load: &str, habit: &str, server: &str, times: &[Duration]) {
    let at = |per_mille: usize| times[(times.len() - 1) * per_mille / 1000];
    let micros = |time: Duration| time.as_secs_f64() * 1e6;
    println!(
        "{load:23} {habit:10}  {server:9} {:9} {:6.0} {:6.0} {:6.0} {:6.0} {:8.3} {:6.3}",
        times.len(),
        micros(at(500)),
        micros(at(990)),
        micros(at(999)),
        micros(at(1000)),
        at(999).as_secs_f64() / AIM.as_secs_f64(),
        at(1000).as_secs_f64() / PATIENCE.as_secs_f64(),
    );
}

/// The host's end of the drive's USB port.
struct Port {
    file: File,
    reader: PacketReader,
    request: PacketBuf,
}

impl Port {
    fn open(path: &str) -> io::Result<Port> {
        let file = File::options().read(true).write(true).open(path)?;
        Ok(Port { file, reader: PacketReader::new(Framing::Stuffed), request: PacketBuf::new() })
    }

    /// Logs in and lets the motor turn.
    fn start(&mut self) -> io::Result<()> {
        pause(AUTHORISATION_REST + SETTLE);
        self.exchange(&Request::Authorise(PASSWORD), PacketType::Response)?;
        self.exchange(&instruction(Opcode::RunF, 1000), PacketType::Powerstep01)
    }

    /// Asks for the position again and again; adds how long each reply took.
    fn ask_for(&mut self, time: Duration, interval: Duration, times: &mut Vec<Duration>) -> io::Result<()> {
        let request = instruction(Opcode::GetAbsPos, 0);
        let start = Instant::now();
        while start.elapsed() < time {
            pause(interval);
            let asked = Instant::now();
            self.exchange(&request, PacketType::Powerstep01)?;
            times.push(asked.elapsed());
        }
        Ok(())
    }

    /// Sends a request and waits for the whole reply, which must be of that type: errors come in another one.
    fn exchange(&mut self, request: &Request, expected: PacketType) -> io::Result<()> {
        encode_request(&mut self.request, Framing::Stuffed, VERSION_2, ID, request);
        self.file.write_all(&self.request)?;
        let mut bytes = [0; 64];
        loop {
            let count = self.file.read(&mut bytes)?;
            let Some(mut came) = bytes.get(..count).filter(|came| !came.is_empty()) else {
                return Err(io::ErrorKind::UnexpectedEof.into());
            };
            let Some(taken) = self.reader.take(stepdrive_spec::time::Instant::ZERO, &mut came) else {
                continue;
            };
            let good =
                taken.packet.is_ok_and(|packet| packet.packet_type == expected.code() && packet.id == ID);
            return if good { Ok(()) } else { Err(io::Error::other("not the reply that was expected")) };
        }
    }
}

fn instruction(opcode: Opcode, data: u32) -> Request {
    Request::Command(Instruction { opcode, data }.word())
}

impl Load {
    /// Starts what keeps the machine busy, until it is dropped.
    fn start(self, drives: &[SocketAddr]) -> io::Result<Vec<Busy>> {
        let mut busy = Vec::new();
        if self.clients {
            let places: Vec<String> = drives.iter().map(SocketAddr::to_string).collect();
            let arguments: Vec<&str> = [ASK].into_iter().chain(places.iter().map(String::as_str)).collect();
            busy.push(Busy::start(&arguments)?);
        }
        for _ in 0..if self.hogs { available_parallelism()?.get() } else { 0 } {
            busy.push(Busy::start(&[COMPUTE])?);
        }
        Ok(busy)
    }
}

/// The echo, in a process of its own.
struct Echo {
    path: String,
    /// It ends when this is dropped.
    _process: Busy,
}

impl Echo {
    fn start() -> io::Result<Echo> {
        let mut process = Busy(this(&[ECHO])?.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn()?);
        let mut path = String::new();
        if let Some(output) = process.0.stdout.as_mut() {
            BufReader::new(output).read_line(&mut path)?;
        }
        Ok(Echo { path: path.trim().to_owned(), _process: process })
    }
}

/// Answers every packet with the same.
fn echo() -> io::Result<()> {
    end_with_input();
    let (master, path) = terminal::open()?;
    writeln!(io::stdout(), "{path}")?;
    // While the other end is open nowhere, reading the master fails.
    let _held = File::options().read(true).write(true).open(path)?;
    let mut reply = PacketBuf::new();
    let status = Status::from_word(0x72);
    let position = Reply::Powerstep01(Answer { status, code: Code::GetAbsPos, data: 123_456 });
    encode_reply(&mut reply, Framing::Stuffed, VERSION_2, ID, &position);
    let (mut master, mut bytes) = (File::from(master), [0; 512]);
    loop {
        let count = master.read(&mut bytes)?;
        for _ in bytes[..count].iter().filter(|byte| **byte == STOP) {
            master.write_all(&reply)?;
        }
    }
}

/// A process that is busy until its input ends, so that it does not outlive this one.
struct Busy(Child);

impl Busy {
    fn start(arguments: &[&str]) -> io::Result<Busy> {
        Ok(Busy(this(arguments)?.stdin(Stdio::piped()).spawn()?))
    }
}

impl Drop for Busy {
    fn drop(&mut self) {
        drop(self.0.stdin.take());
        let _ = self.0.wait();
    }
}

#[expect(clippy::disallowed_methods, reason = "the host's thread waits as a host does, on the wall clock")]
fn pause(time: Duration) {
    if !time.is_zero() {
        std::thread::sleep(time);
    }
}

/// This program once more, as something else.
fn this(arguments: &[&str]) -> io::Result<Command> {
    let mut command = Command::new(std::env::current_exe()?);
    command.args(arguments);
    Ok(command)
}

/// Ends this process when its input does.
fn end_with_input() {
    spawn(|| {
        let _ = io::stdin().read_to_end(&mut Vec::new());
        exit(0);
    });
}

/// Serves a drive with a USB port, and the others.
fn serve() -> io::Result<()> {
    let drive = |name: String| {
        format!("[[drive]]\nname = \"{name}\"\nmodel = \"SMSD-4.2LAN\"\nmodbus_tcp = \"127.0.0.1:0\"\n")
    };
    let others: String = (0..OTHERS).map(|number| drive(format!("other{number}"))).collect();
    let text = drive("stage".to_owned()) + "usb = \"pty\"\n" + &others;
    let rig = RigFile::parse(&text).map_err(io::Error::other)?;
    let state = tempfile::tempdir()?;
    let notify = Arc::new(|notice| eprintln!("{notice}"));
    let options = Options { state: state.path().into(), recording: None, notify };
    let runtime = tokio::runtime::Runtime::new()?;
    let server = runtime.block_on(Server::start(&rig, options)).map_err(io::Error::other)?;
    let [measured, others @ ..] = server.drives() else { return Err(io::Error::other("no drive")) };
    let mut places: Vec<String> =
        others.iter().filter_map(|drive| drive.modbus_tcp).map(|place| place.to_string()).collect();
    places.extend(measured.usb.as_ref().map(|path| path.display().to_string()));
    writeln!(io::stdout(), "{}", places.join(" "))?;
    io::stdin().read_to_end(&mut Vec::new())?;
    Ok(())
}

/// Keeps clients of the drives at `places` asking, with the motors turning.
fn ask(places: &[String]) -> io::Result<()> {
    end_with_input();
    tokio::runtime::Builder::new_current_thread().enable_all().build()?.block_on(async {
        let mut clients = tokio::task::JoinSet::new();
        for place in places.iter().cycle().take(places.len() * CLIENTS) {
            clients.spawn(client(TcpStream::connect(place).await?));
        }
        while let Some(ended) = clients.join_next().await {
            ended.map_err(io::Error::other)??;
        }
        Ok(())
    })
}

async fn client(mut stream: TcpStream) -> io::Result<()> {
    stream.set_nodelay(true)?;
    for request in [log_in(), write(Reg::TargetSpeed, 1000), command(Opcode::RunF)] {
        exchange(&mut stream, &adu(&request)).await?;
    }
    let request = adu(&read(Reg::Speed, 6));
    loop {
        exchange(&mut stream, &request).await?;
    }
}

/// Uses a processor for nothing.
fn compute() -> ! {
    end_with_input();
    loop {
        std::hint::spin_loop();
    }
}
