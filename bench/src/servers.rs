//! Servers in processes of their own.
//!
//! A benchmark starts itself again as a server: [`ServerProcess::start`] in the one that measures, [`serve`] in the one
//! that is measured. The server says where it listens on its standard output, and ends when its standard input does,
//! so that it never outlives the benchmark.

use crate::process;
use std::fmt::Write as _;
use std::io::{self, BufRead, BufReader, Read, Write as _};
use std::net::SocketAddr;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::time::Duration;
use stepdrive_rig::file::RigFile;
use stepdrive_server::{Options, Server};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};
use tokio::runtime::{Builder, Runtime};

/// How many SMD3s [`Kind::BothFamilies`] has on TCP, and how many at pseudo-terminals.
pub const SMD3S: usize = 2;

/// The argument that makes a benchmark a server.
const SERVE: &str = "serve";

/// What serves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// stepdrive.
    Stepdrive,
    /// stepdrive with SMD3s behind the others: [`SMD3S`] on TCP, and as many at pseudo-terminals.
    BothFamilies,
    /// Reads a request and writes a reply of the right size, and nothing more: the least that a server on tokio can do.
    Echo,
}

impl Kind {
    /// The name, also as an argument.
    pub const fn name(self) -> &'static str {
        match self {
            Kind::Stepdrive => "stepdrive",
            Kind::BothFamilies => "both-families",
            Kind::Echo => "echo",
        }
    }
}

/// A server that runs in another process. Dropping it ends it.
#[derive(Debug)]
pub struct ServerProcess {
    child: Child,
    addresses: Vec<SocketAddr>,
    terminals: Vec<String>,
}

impl ServerProcess {
    /// Starts this program again as a server with so many listeners and worker threads.
    ///
    /// # Errors
    /// When that fails.
    pub fn start(kind: Kind, listeners: usize, workers: usize) -> io::Result<ServerProcess> {
        // A thousand listeners are more files than most systems allow a process at first.
        process::allow_many_files()?;
        let mut command = Command::new(std::env::current_exe()?);
        command.args([SERVE, kind.name(), &listeners.to_string(), &workers.to_string()]);
        ServerProcess::spawn(command)
    }

    /// Starts any server that says where it listens on the first line of its standard output.
    ///
    /// # Errors
    /// When that fails, or what it says are no addresses.
    pub fn spawn(mut command: Command) -> io::Result<ServerProcess> {
        let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn()?;
        let mut line = String::new();
        if let Some(output) = child.stdout.as_mut() {
            BufReader::new(output).read_line(&mut line)?;
        }
        let (terminals, addresses): (Vec<&str>, Vec<&str>) =
            line.split_whitespace().partition(|place| place.starts_with('/'));
        let terminals = terminals.into_iter().map(str::to_owned).collect();
        let addresses: Result<Vec<SocketAddr>, _> = addresses.into_iter().map(str::parse).collect();
        match addresses {
            Ok(addresses) if !addresses.is_empty() => Ok(ServerProcess { child, addresses, terminals }),
            Ok(_) | Err(_) => Err(io::Error::other("the server did not say where it listens")),
        }
    }

    /// Where it listens.
    pub fn addresses(&self) -> &[SocketAddr] {
        &self.addresses
    }

    /// The pseudo-terminals that it serves.
    pub fn terminals(&self) -> &[String] {
        &self.terminals
    }

    /// The processor time it has used.
    ///
    /// # Errors
    /// When it has ended.
    pub fn cpu_time(&self) -> io::Result<Duration> {
        process::cpu_time(self.child.id())
    }

    /// The memory it has in RAM, in bytes.
    ///
    /// # Errors
    /// When it has ended.
    pub fn resident(&self) -> io::Result<u64> {
        process::resident(self.child.id())
    }
}

impl Drop for ServerProcess {
    fn drop(&mut self) {
        // It ends with its input; when it has ended already that is as good.
        drop(self.child.stdin.take());
        let _ = self.child.wait();
    }
}

/// When this process was started as a server: serves until its standard input ends, and gives `true` then.
///
/// # Errors
/// When the server cannot be started.
pub fn serve() -> io::Result<bool> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [serve, kind, listeners, workers] = &arguments[..] else { return Ok(false) };
    if serve != SERVE {
        return Ok(false);
    }
    let number = |text: &String| text.parse::<usize>().map_err(io::Error::other);
    let (listeners, workers) = (number(listeners)?, number(workers)?);
    let runtime = Builder::new_multi_thread().worker_threads(workers).enable_all().build()?;
    if kind == Kind::Echo.name() {
        let addresses = runtime.block_on(echo(listeners))?;
        announce_and_wait(addresses.iter().map(SocketAddr::to_string))?;
    } else {
        let state = tempfile::tempdir()?;
        let both = kind == Kind::BothFamilies.name();
        let server = stepdrive(&runtime, listeners, both, state.path())?;
        let addresses = server.drives().iter().filter_map(|drive| drive.modbus_tcp.or(drive.serial_tcp));
        let terminals = server.drives().iter().filter_map(|drive| drive.serial.as_ref());
        let terminals = terminals.map(|path| path.display().to_string());
        announce_and_wait(addresses.map(|address| address.to_string()).chain(terminals))?;
    }
    Ok(true)
}

fn announce_and_wait(places: impl Iterator<Item = String>) -> io::Result<()> {
    let places: Vec<String> = places.collect();
    writeln!(io::stdout(), "{}", places.join(" "))?;
    io::stdin().read_to_end(&mut Vec::new())?;
    Ok(())
}

/// How many drives share an address of the loopback network: finding a free port takes the kernel long when thousands are
/// taken.
const PER_ADDRESS: usize = 1000;

/// Drives without mechanics, each on a free port; with SMD3s where `both` families are wanted.
fn stepdrive(runtime: &Runtime, drives: usize, both: bool, state: &Path) -> io::Result<Server> {
    let mut text = String::new();
    for number in 0..drives {
        let host = 1 + number / PER_ADDRESS;
        let _ = write!(
            text,
            "[[drive]]\nname = \"drive{number}\"\nmodel = \"SMSD-4.2LAN\"\nmodbus_tcp = \"127.0.0.{host}:0\"\n"
        );
    }
    for number in 0..if both { SMD3S } else { 0 } {
        for (name, port) in [("line", "serial_tcp = \"127.0.0.1:0\""), ("usb", "serial = \"pty\"")] {
            let _ = write!(text, "[[drive]]\nname = \"{name}{number}\"\nmodel = \"SMD3\"\n{port}\n");
        }
    }
    let rig = RigFile::parse(&text).map_err(io::Error::other)?;
    let notify = Arc::new(|notice| eprintln!("{notice}"));
    let options = Options { state: state.into(), recording: None, notify };
    runtime.block_on(Server::start(&rig, options)).map_err(io::Error::other)
}

async fn echo(listeners: usize) -> io::Result<Vec<SocketAddr>> {
    let mut addresses = Vec::new();
    for _ in 0..listeners {
        let listener = TcpListener::bind("127.0.0.1:0").await?;
        addresses.push(listener.local_addr()?);
        tokio::spawn(async move {
            while let Ok((stream, _)) = listener.accept().await {
                tokio::spawn(reply(stream));
            }
        });
    }
    Ok(addresses)
}

/// Answers each read with as many bytes as the reply to FC03 or FC04 has: 9 and two for each register. They are zeros
/// but for the length.
async fn reply(mut stream: TcpStream) -> io::Result<()> {
    stream.set_nodelay(true)?;
    let (mut request, mut reply) = ([0; 260], [0; 260]);
    loop {
        if stream.read(&mut request).await? == 0 {
            return Ok(());
        }
        let values = 2 * request[11];
        reply[5] = 3 + values;
        stream.write_all(&reply[..9 + usize::from(values)]).await?;
    }
}
