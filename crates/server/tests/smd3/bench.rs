//! What the tests are written with: a served rig in a temporary folder, and a client of either transport.

use rustix::fs::{Mode, OFlags};
use std::fs::File;
use std::io;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use stepdrive_rig::file::RigFile;
use stepdrive_server::{Options, Server, StartError};
use tempfile::TempDir;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::net::unix::pipe;

/// A rig of one drive, reached both ways.
pub(crate) const ONE: &str = r#"
    [[drive]]
    name = "uhv"
    model = "SMD3"
    serial = "pty"
    serial_tcp = "127.0.0.1:0"
"#;

/// The flags at standstill with nothing wrong.
pub(crate) const IDLE: &str = "0x0040,0x0000";

/// Longer than anything takes here; a reply that has not come by then will not come.
const LIMIT: Duration = Duration::from_secs(30);

/// A rig that is served, and its state folder.
pub(crate) struct Bench {
    pub(crate) server: Server,
    rig: RigFile,
    folder: TempDir,
    notices: Arc<Mutex<Vec<String>>>,
}

impl Bench {
    /// One drive.
    pub(crate) async fn start() -> Bench {
        Bench::with(ONE).await
    }

    pub(crate) async fn with(rig: &str) -> Bench {
        Bench::start_in(folder(), rig).await.expect("the rig starts")
    }

    /// A rig on what is in `folder`.
    pub(crate) async fn start_in(folder: TempDir, rig: &str) -> Result<Bench, StartError> {
        let rig = RigFile::parse(rig).expect("a rig");
        let notices = Arc::<Mutex<Vec<String>>>::default();
        let told = Arc::clone(&notices);
        let notify =
            move |notice: stepdrive_server::Notice| told.lock().expect("whole").push(notice.to_string());
        let options = Options { state: folder.path().into(), recording: None, notify: Arc::new(notify) };
        Ok(Bench { server: Server::start(&rig, options).await?, rig, folder, notices })
    }

    /// Switches the rig off; what it remembers is left.
    pub(crate) async fn stop(self) -> TempDir {
        self.server.stop().await;
        self.folder
    }

    /// Switches the rig off and on again.
    pub(crate) async fn restart(self) -> Bench {
        let Bench { server, rig, folder, notices } = self;
        server.stop().await;
        let options = Options { state: folder.path().into(), recording: None, notify: Arc::new(|_| {}) };
        let server = Server::start(&rig, options).await.expect("the rig starts again");
        Bench { server, rig, folder, notices }
    }

    /// A place in the state folder.
    pub(crate) fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The name of the first drive's serial port.
    pub(crate) fn port(&self) -> PathBuf {
        self.server.drives()[0].serial.clone().expect("it has a serial port")
    }

    /// Where the first drive takes lines over TCP.
    pub(crate) fn address(&self) -> SocketAddr {
        self.server.drives()[0].serial_tcp.expect("it takes TCP")
    }

    /// A client that opens the serial port.
    pub(crate) fn serial(&self) -> Client {
        Client::open(&self.port())
    }

    /// A client that connects over TCP.
    pub(crate) async fn tcp(&self) -> Client {
        Client::connect(self.address()).await
    }

    /// One client of each transport.
    pub(crate) async fn both(&self) -> [Client; 2] {
        [self.serial(), self.tcp().await]
    }

    /// What the server has told that contains `part`.
    pub(crate) fn notices(&self, part: &str) -> Vec<String> {
        self.notices.lock().expect("whole").iter().filter(|notice| notice.contains(part)).cloned().collect()
    }
}

/// A state folder.
pub(crate) fn folder() -> TempDir {
    TempDir::new().expect("a temporary folder")
}

/// Lets the drive see that a client has closed its port: opening it again at once may be sooner.
pub(crate) async fn noticed() {
    tokio::time::sleep(Duration::from_millis(20)).await;
}

/// A client, polite or not. Dropping it closes the port or the connection.
pub(crate) struct Client {
    input: Box<dyn AsyncRead + Send + Unpin>,
    output: Box<dyn AsyncWrite + Send + Unpin>,
    /// What has come and was not looked at yet.
    unread: Vec<u8>,
}

impl Client {
    /// Opens a serial port as it is: nothing is set, nothing is flushed.
    pub(crate) fn open(path: &Path) -> Client {
        let port = open_port(path);
        let output = port.try_clone().expect("a second handle");
        Client {
            input: Box::new(pipe::Receiver::from_file_unchecked(port).expect("non-blocking")),
            output: Box::new(pipe::Sender::from_file_unchecked(output).expect("non-blocking")),
            unread: Vec::new(),
        }
    }

    pub(crate) async fn connect(address: SocketAddr) -> Client {
        let stream = TcpStream::connect(address).await.expect("the drive can be reached");
        stream.set_nodelay(true).expect("set");
        let (input, output) = stream.into_split();
        Client { input: Box::new(input), output: Box::new(output), unread: Vec::new() }
    }

    /// Sends bytes as they are.
    pub(crate) async fn send(&mut self, bytes: impl AsRef<[u8]>) {
        self.output.write_all(bytes.as_ref()).await.expect("the port is open");
    }

    /// Sends the last bytes and closes this half of the connection.
    pub(crate) async fn send_last(&mut self, bytes: &str) {
        // What is left when the server has closed the connection is lost, as it should be.
        let _ = self.output.write_all(bytes.as_bytes()).await;
        let _ = self.output.shutdown().await;
    }

    /// Sends a line and gives back the reply.
    pub(crate) async fn ask(&mut self, line: &str) -> String {
        self.send(format!("{line}\r\n")).await;
        self.reply().await
    }

    /// Sends a line, and gives back what comes behind the flags of the reply.
    pub(crate) async fn data(&mut self, line: &str) -> String {
        self.ask(line).await.splitn(3, ',').nth(2).unwrap_or_default().to_owned()
    }

    /// The position.
    pub(crate) async fn position(&mut self) -> f64 {
        self.data("PACT").await.parse().expect("a number")
    }

    /// The next reply, without its terminator.
    pub(crate) async fn reply(&mut self) -> String {
        tokio::time::timeout(LIMIT, self.try_reply()).await.expect("in time").expect("a reply")
    }

    async fn try_reply(&mut self) -> io::Result<String> {
        loop {
            if let Some(end) = self.unread.windows(2).position(|pair| pair == b"\r\n") {
                let line = self.unread.drain(..end + 2).take(end).collect();
                return Ok(String::from_utf8(line).expect("ASCII"));
            }
            if self.input.read_buf(&mut self.unread).await? == 0 {
                return Err(io::ErrorKind::UnexpectedEof.into());
            }
        }
    }

    /// Sends everything without waiting for anything, and gives back so many replies.
    pub(crate) async fn flood(self, lines: String, replies: usize) -> Vec<String> {
        let Client { input, mut output, unread } = self;
        let mut reader = Client { input, output: Box::new(tokio::io::sink()), unread };
        let writer = tokio::spawn(async move { output.write_all(lines.as_bytes()).await.map(|()| output) });
        let mut got = Vec::new();
        while got.len() < replies {
            got.push(reader.reply().await);
        }
        writer.await.expect("no panic").expect("the port is open");
        got
    }

    /// Sends and never reads, until no more is taken.
    pub(crate) async fn stuff(&mut self, bytes: &[u8]) {
        while tokio::time::timeout(Duration::from_millis(200), self.output.write_all(bytes)).await.is_ok() {}
    }

    /// Sends and never reads, until the server closes the connection. Returns how many bytes it took.
    pub(crate) async fn send_until_closed(&mut self, bytes: &[u8]) -> usize {
        let mut taken = 0;
        while self.output.write_all(bytes).await.is_ok() {
            taken += bytes.len();
        }
        taken
    }

    /// Waits until the server closes the port or the connection, and says what it sent before.
    pub(crate) async fn closed(&mut self) -> Vec<u8> {
        while !matches!(self.input.read_buf(&mut self.unread).await, Ok(0) | Err(_)) {}
        std::mem::take(&mut self.unread)
    }
}

/// Opens a serial port as any program would.
pub(crate) fn open_port(path: &Path) -> File {
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
    File::from(rustix::fs::open(path, flags, Mode::empty()).expect("the port can be opened"))
}
