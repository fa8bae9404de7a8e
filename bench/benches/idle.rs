//! What drives cost that have nothing to do: a thousand in one process, first with nobody connected, then each with a
//! client that has logged in, then each turning at constant speed.
//!
//! Memory is the difference to a process with one drive, so that the program itself does not count.

use std::io;
use std::time::Duration;
use stepdrive_bench::requests::{adu, command, log_in};
use stepdrive_bench::servers::{self, Kind, ServerProcess};
use stepdrive_spec::modbus::Request;
use stepdrive_spec::smsd::instructions::Opcode;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

/// How many drives.
const DRIVES: usize = 1000;
/// How long the process is left alone before anything is measured: to start, or to bring the motors to speed.
const SETTLE: Duration = Duration::from_secs(2);
/// How long it is watched.
const WATCH: Duration = Duration::from_secs(5);
/// Worker threads: what a machine with two processors gives.
const WORKERS: usize = 2;

/// A process with drives, and a client for each when they are connected.
struct Rig {
    server: ServerProcess,
    clients: Vec<TcpStream>,
}

fn main() -> io::Result<()> {
    if servers::serve()? {
        return Ok(());
    }
    if !std::env::args().any(|argument| argument == "--bench") {
        println!("run by `cargo bench`");
        return Ok(());
    }
    tokio::runtime::Builder::new_current_thread().enable_all().build()?.block_on(watch())
}

async fn watch() -> io::Result<()> {
    println!("{DRIVES} drives                processor time in {WATCH:?}   memory of a drive");
    let (mut one, mut all) = (Rig::start(1)?, Rig::start(DRIVES)?);
    report("nobody connected", &one, &all).await?;
    for rig in [&mut one, &mut all] {
        rig.connect().await?;
        rig.each(&log_in()).await?;
    }
    report("a client each", &one, &all).await?;
    for rig in [&mut one, &mut all] {
        rig.each(&command(Opcode::RunF)).await?;
    }
    report("motors turning", &one, &all).await
}

async fn report(state: &str, one: &Rig, all: &Rig) -> io::Result<()> {
    tokio::time::sleep(SETTLE).await;
    let before = all.server.cpu_time()?;
    tokio::time::sleep(WATCH).await;
    let used = all.server.cpu_time()?.saturating_sub(before);
    let memory = all.server.resident()?.saturating_sub(one.server.resident()?);
    let each = memory as f64 / 1024.0 / (all.server.addresses().len() - 1) as f64;
    println!("{state:24} {:21.2} ms {each:17.1} KiB", used.as_secs_f64() * 1e3);
    Ok(())
}

impl Rig {
    fn start(drives: usize) -> io::Result<Rig> {
        Ok(Rig { server: ServerProcess::start(Kind::Stepdrive, drives, WORKERS)?, clients: Vec::new() })
    }

    /// Connects a client to each drive.
    async fn connect(&mut self) -> io::Result<()> {
        for address in self.server.addresses() {
            self.clients.push(TcpStream::connect(address).await?);
        }
        Ok(())
    }

    /// Lets each client send a request and wait for the reply, which repeats its function code.
    async fn each(&mut self, request: &Request) -> io::Result<()> {
        let bytes = adu(request);
        for client in &mut self.clients {
            client.write_all(&bytes).await?;
            let mut reply = [0; 260];
            let count = client.read(&mut reply).await?;
            if count < 8 || reply[7] != request.function() {
                return Err(io::Error::other("a request was refused"));
            }
        }
        Ok(())
    }
}
