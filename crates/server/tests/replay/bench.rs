//! A rig that records, and clients that send bytes and wait for no particular reply.

use std::fs;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;
use stepdrive_proto::modbus::{Adu, encode_request};
use stepdrive_rig::file::RigFile;
use stepdrive_server::replay::{ReplayError, Replayed, replay};
use stepdrive_server::{Options, Recording, Server};
use stepdrive_spec::modbus::Request;
use stepdrive_spec::smsd::registers::Reg;
use tempfile::TempDir;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

/// How long a client waits for a reply that a fault may have swallowed.
const PATIENCE: Duration = Duration::from_millis(30);

/// The password from the factory, as words, and the register that takes it over.
const LOG_IN: [u16; 5] = [0xCDEF, 0x89AB, 0x4567, 0x0123, 0];

/// A rig that is served and recorded.
pub(crate) struct Bench {
    pub(crate) server: Server,
    file: PathBuf,
    folder: TempDir,
}

impl Bench {
    pub(crate) async fn start(rig: &str) -> Bench {
        Bench::start_in(TempDir::new().expect("a temporary folder"), rig, "recording").await
    }

    /// A rig on what another one has left, recorded to a file of this name.
    pub(crate) async fn start_in(folder: TempDir, rig: &str, file: &str) -> Bench {
        let file = folder.path().join(file);
        let recording = Some(Recording { file: file.clone(), rig: rig.to_owned() });
        let options = Options { state: folder.path().join("state"), recording, notify: Arc::new(|_| {}) };
        let server =
            Server::start(&RigFile::parse(rig).expect("a rig"), options).await.expect("the rig starts");
        Bench { server, file, folder }
    }

    /// A place in the state folder.
    pub(crate) fn state(&self, name: &str) -> PathBuf {
        self.folder.path().join("state").join(name)
    }

    pub(crate) fn act(&self, action: &str) {
        self.server.control().act(action).expect("an action");
    }

    /// Switches the rig off, and gives back what was recorded.
    pub(crate) async fn stop(self) -> String {
        self.stop_and_keep().await.0
    }

    /// Switches the rig off, and gives back what was recorded, and what the drives remember.
    pub(crate) async fn stop_and_keep(self) -> (String, TempDir) {
        self.server.stop().await;
        (fs::read_to_string(self.file).expect("a recording"), self.folder)
    }

    /// A client of an SMSD that is reached at this port now.
    pub(crate) async fn smsd_at(&self, port: u16) -> Client {
        let address = SocketAddr::from(([127, 0, 0, 1], port));
        loop {
            match TcpStream::connect(address).await {
                Ok(stream) => return Client { stream, transaction: 0 },
                Err(_) => tokio::time::sleep(Duration::from_millis(1)).await,
            }
        }
    }

    pub(crate) async fn smsd(&self, drive: usize) -> Client {
        Client::connect(self.server.drives()[drive].modbus_tcp.expect("an SMSD")).await
    }

    pub(crate) async fn smd3(&self, drive: usize) -> Client {
        Client::connect(self.server.drives()[drive].serial_tcp.expect("an SMD3")).await
    }
}

pub(crate) struct Client {
    stream: TcpStream,
    transaction: u16,
}

impl Client {
    async fn connect(address: SocketAddr) -> Client {
        let stream = TcpStream::connect(address).await.expect("the drive can be reached");
        stream.set_nodelay(true).expect("set");
        Client { stream, transaction: 0 }
    }

    /// Sends bytes, if the connection is open still.
    pub(crate) async fn send(&mut self, bytes: &[u8]) {
        let _ = self.stream.write_all(bytes).await;
    }

    /// Sends bytes, and gives back what comes in a little time.
    pub(crate) async fn tell(&mut self, bytes: &[u8]) -> Vec<u8> {
        self.send(bytes).await;
        let mut reply = vec![0; 4096];
        match tokio::time::timeout(PATIENCE, self.stream.read(&mut reply)).await {
            Ok(Ok(count)) => reply[..count].to_vec(),
            Ok(Err(_)) | Err(_) => Vec::new(),
        }
    }

    /// Whether the server closes the connection.
    pub(crate) async fn is_closed(&mut self) -> bool {
        let mut rest = Vec::new();
        // What ends it is the end or a reset.
        tokio::time::timeout(Duration::from_secs(10), self.stream.read_to_end(&mut rest)).await.is_ok()
    }

    pub(crate) fn frame(&mut self, unit: u8, request: &Request) -> Vec<u8> {
        self.transaction += 1;
        let mut adu = Adu::new();
        encode_request(&mut adu, self.transaction, unit, request).expect("a well-formed request");
        adu.to_vec()
    }

    pub(crate) async fn log_in(&mut self) {
        let frame = self.frame(1, &write(Reg::PasswordLow32, &LOG_IN));
        self.tell(&frame).await;
    }
}

/// A read of registers from one on.
pub(crate) fn read(reg: Reg, count: u16) -> Request {
    let row = reg.info();
    Request::ReadWords { table: row.table, address: row.address, count }
}

/// A write to registers from one on.
pub(crate) fn write(reg: Reg, values: &[u16]) -> Request {
    Request::WriteRegisters { address: reg.info().address, values: values.iter().copied().collect() }
}

/// A write of TRUE to a coil.
pub(crate) fn trigger(reg: Reg) -> Request {
    Request::WriteCoil { address: reg.info().address, value: true }
}

pub(crate) fn replayed(recording: impl AsRef<[u8]>) -> Result<Replayed, ReplayError> {
    replay(recording.as_ref())
}

/// Replays what must be a recording.
pub(crate) fn replay_it(recording: impl AsRef<[u8]>) -> Replayed {
    replayed(recording).unwrap_or_else(|error| panic!("{error}"))
}
