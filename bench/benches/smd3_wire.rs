//! What an SMD3's line costs on the wire, over a pseudo-terminal and over TCP: stepdrive beside a bare tokio echo of the
//! same sizes on the same transport, in rounds that alternate.
//!
//! Each server is a process of its own with one worker thread. One client has one line in flight, in turn a position and
//! a setting.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::os::fd::OwnedFd;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::time::Duration;
use stepdrive_bench::{median, process, terminal};
use stepdrive_rig::file::RigFile;
use stepdrive_server::{Options, Server};
use tokio::io::unix::AsyncFd;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpListener;
use tokio::time::Instant;

/// Rounds of each server on each transport.
const ROUNDS: usize = 31;
/// How long a round lasts.
const ROUND: Duration = Duration::from_millis(250);
/// What the client sends in turn.
const LINES: [&[u8]; 2] = [b"PACT\r\n", b"VMAX\r\n"];
/// A reply to either.
const REPLY: &[u8] = b"0x0040,0x0000,1.00000E+03\r\n";

/// A server in a process of its own, and the client's end.
struct Contender {
    server: Child,
    port: Box<dyn Port>,
}

trait Port: Read + Write {}
impl<T: Read + Write> Port for T {}

/// What a round gave.
#[derive(Clone, Copy)]
struct Round {
    /// Lines in a second.
    rate: f64,
    /// Processor time of the server for a line, in microseconds.
    cost: f64,
}

fn main() -> io::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let [serve, kind, transport] = &arguments[..]
        && serve == "serve"
    {
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build()?;
        return runtime.block_on(serve_until_told(kind, transport));
    }
    if !arguments.iter().any(|argument| argument == "--bench") {
        println!("run by `cargo bench`");
        return Ok(());
    }
    println!("transport  server        lines/s   ratio   server µs/line   ratio");
    for transport in ["tcp", "pty"] {
        compare(transport)?;
    }
    Ok(())
}

fn compare(transport: &str) -> io::Result<()> {
    let names = ["stepdrive", "echo"];
    let mut contenders = [Contender::start(names[0], transport)?, Contender::start(names[1], transport)?];
    let mut rounds: [Vec<Round>; 2] = [Vec::new(), Vec::new()];
    for number in 0..=ROUNDS {
        // Every other time the other way round, so that neither always comes first.
        for place in if number % 2 == 0 { [0, 1] } else { [1, 0] } {
            let round = contenders[place].round()?;
            // The first is to warm up.
            if number > 0 {
                rounds[place].push(round);
            }
        }
    }
    for (place, name) in names.iter().enumerate() {
        let figure = |of: fn(&Round) -> f64| median(rounds[place].iter().map(of));
        let ratio = |of: fn(&Round) -> f64| {
            median(rounds[place].iter().zip(&rounds[1]).map(|(this, echo)| of(this) / of(echo)))
        };
        println!(
            "{transport:9}  {name:10} {:10.0} {:7.3} {:16.2} {:7.3}",
            figure(|round| round.rate),
            ratio(|round| round.rate),
            figure(|round| round.cost),
            ratio(|round| round.cost)
        );
    }
    Ok(())
}

impl Contender {
    fn start(kind: &str, transport: &str) -> io::Result<Contender> {
        let mut server = Command::new(std::env::current_exe()?)
            .args(["serve", kind, transport])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()?;
        let mut place = String::new();
        if let Some(output) = server.stdout.as_mut() {
            BufReader::new(output).read_line(&mut place)?;
        }
        let port: Box<dyn Port> = if transport == "tcp" {
            let stream = TcpStream::connect(place.trim())?;
            stream.set_nodelay(true)?;
            Box::new(stream)
        } else {
            Box::new(File::options().read(true).write(true).open(place.trim())?)
        };
        Ok(Contender { server, port })
    }

    /// Sends lines for a round.
    fn round(&mut self) -> io::Result<Round> {
        let (start, used) = (Instant::now(), process::cpu_time(self.server.id())?);
        let mut lines = 0.0;
        for line in LINES.iter().cycle() {
            self.exchange(line)?;
            lines += 1.0;
            if start.elapsed() > ROUND {
                break;
            }
        }
        let (time, used) = (start.elapsed(), process::cpu_time(self.server.id())?.saturating_sub(used));
        Ok(Round { rate: lines / time.as_secs_f64(), cost: used.as_secs_f64() * 1e6 / lines })
    }

    /// Sends a line and waits for the whole reply.
    fn exchange(&mut self, line: &[u8]) -> io::Result<()> {
        self.port.write_all(line)?;
        let (mut reply, mut filled) = ([0; 64], 0);
        while !reply[..filled].ends_with(b"\r\n") {
            let count = self.port.read(&mut reply[filled..])?;
            if count == 0 {
                return Err(io::ErrorKind::UnexpectedEof.into());
            }
            filled += count;
        }
        if filled == REPLY.len() { Ok(()) } else { Err(io::Error::other("not the reply that was expected")) }
    }
}

impl Drop for Contender {
    fn drop(&mut self) {
        // It ends with its input; when it has ended already that is as good.
        drop(self.server.stdin.take());
        let _ = self.server.wait();
    }
}

/// Serves until the standard input ends.
async fn serve_until_told(kind: &str, transport: &str) -> io::Result<()> {
    let folder = tempfile::tempdir()?;
    let _server = match (kind, transport) {
        ("stepdrive", _) => Some(stepdrive(transport, folder.path()).await?),
        (_, "tcp") => {
            let listener = TcpListener::bind("127.0.0.1:0").await?;
            announce(&listener.local_addr()?.to_string())?;
            tokio::spawn(echo_tcp(listener));
            None
        }
        _ => {
            let (master, path) = terminal()?;
            announce(&path)?;
            tokio::spawn(echo_terminal(master));
            None
        }
    };
    tokio::task::spawn_blocking(|| io::stdin().read_to_end(&mut Vec::new()))
        .await
        .map_err(io::Error::other)??;
    Ok(())
}

fn announce(place: &str) -> io::Result<()> {
    writeln!(io::stdout(), "{place}")
}

async fn stepdrive(transport: &str, folder: &Path) -> io::Result<Server> {
    let port = if transport == "tcp" { "serial_tcp = \"127.0.0.1:0\"" } else { "serial = \"pty\"" };
    let rig = RigFile::parse(&format!("[[drive]]\nname = \"uhv\"\nmodel = \"SMD3\"\n{port}\n"));
    let options =
        Options { state: folder.into(), recording: None, notify: Arc::new(|notice| eprintln!("{notice}")) };
    let server = Server::start(&rig.map_err(io::Error::other)?, options).await.map_err(io::Error::other)?;
    let [drive] = server.drives() else { return Err(io::Error::other("one drive")) };
    let tcp = drive.serial_tcp.map(|address| address.to_string());
    let pty = drive.serial.as_ref().map(|path| path.display().to_string());
    announce(&tcp.or(pty).unwrap_or_default())?;
    Ok(server)
}

async fn echo_tcp(listener: TcpListener) -> io::Result<()> {
    let (mut stream, _) = listener.accept().await?;
    stream.set_nodelay(true)?;
    let mut line = [0; 512];
    while stream.read(&mut line).await? > 0 {
        stream.write_all(REPLY).await?;
    }
    Ok(())
}

/// The master of a pseudo-terminal, and the path of its other end.
fn terminal() -> io::Result<(AsyncFd<OwnedFd>, String)> {
    let (master, path) = terminal::open()?;
    rustix::io::ioctl_fionbio(&master, true)?;
    #[allow(deprecated, reason = "its unsafe successor wants a promise that an `OwnedFd` keeps")]
    Ok((AsyncFd::new(master)?, path))
}

async fn echo_terminal(master: AsyncFd<OwnedFd>) -> io::Result<()> {
    let mut line = [0; 512];
    loop {
        let mut ready = master.readable().await?;
        match ready.try_io(|master| Ok(rustix::io::read(master.get_ref(), &mut line)?)) {
            Ok(read) => read?,
            Err(_would_block) => continue,
        };
        rustix::io::write(master.get_ref(), REPLY)?;
    }
}
