//! What the tests are written with: a served rig in a temporary folder, and a client that can also misbehave.

use std::io;
use std::net::{SocketAddr, TcpListener as StdListener};
use std::path::PathBuf;
use std::sync::atomic::{AtomicU16, Ordering};
use std::sync::{Arc, Mutex};
use stepdrive_proto::modbus::{Adu, ReplyError, Split, decode_reply, encode_request, split};
use stepdrive_rig::file::RigFile;
use stepdrive_server::{Options, Server, StartError};
use stepdrive_spec::modbus::{Bits, Exception, Reply, Request, Table};
use stepdrive_spec::smsd::registers::Reg;
use tempfile::TempDir;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

/// The password from the factory.
pub(crate) const PASSWORD: u64 = 0x0123_4567_89AB_CDEF;

/// A rig of one drive on a free port.
pub(crate) const ONE: &str = r#"
    [[drive]]
    name = "stage"
    model = "SMSD-4.2LAN"
    modbus_tcp = "127.0.0.1:0"
"#;

/// Two drives on free ports.
pub(crate) const TWO: &str = r#"
    [[drive]]
    name = "left"
    model = "SMSD-4.2LAN"
    modbus_tcp = "127.0.0.1:0"
    [[drive]]
    name = "right"
    model = "SMSD-8.0LAN"
    modbus_tcp = "127.0.0.1:0"
"#;

/// A rig that is served, and its state folder.
pub(crate) struct Bench {
    pub(crate) server: Server,
    rig: RigFile,
    folder: TempDir,
    notices: Notices,
}

/// What the server has told so far.
type Notices = Arc<Mutex<Vec<String>>>;

impl Bench {
    /// One drive.
    pub(crate) async fn start() -> Bench {
        Bench::with(ONE).await
    }

    pub(crate) async fn with(rig: &str) -> Bench {
        let folder = TempDir::new().expect("a temporary folder");
        Bench::start_in(folder, rig).await.expect("the rig starts")
    }

    /// A rig on the memory that is in `folder`.
    pub(crate) async fn start_in(folder: TempDir, rig: &str) -> Result<Bench, StartError> {
        let rig = RigFile::parse(rig).expect("a rig");
        let notices = Notices::default();
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

    /// Where the first drive listened at the start.
    pub(crate) fn address(&self) -> SocketAddr {
        self.address_of(0)
    }

    pub(crate) fn address_of(&self, drive: usize) -> SocketAddr {
        self.server.drives()[drive].modbus_tcp.expect("an SMSD")
    }

    /// The file of the non-volatile memory.
    pub(crate) fn file(&self) -> PathBuf {
        self.folder.path().join("memory.redb")
    }

    /// A client of the first drive, not logged in.
    pub(crate) async fn stranger(&self) -> Client {
        Client::connect(self.address()).await
    }

    /// A client of the first drive, logged in.
    pub(crate) async fn client(&self) -> Client {
        self.client_of(0).await
    }

    pub(crate) async fn client_of(&self, drive: usize) -> Client {
        let mut client = Client::connect(self.address_of(drive)).await;
        client.log_in(PASSWORD).await;
        client
    }

    /// What the server has told that contains `part`.
    pub(crate) fn notices(&self, part: &str) -> Vec<String> {
        self.notices.lock().expect("whole").iter().filter(|notice| notice.contains(part)).cloned().collect()
    }
}

/// A client, polite or not.
pub(crate) struct Client {
    stream: TcpStream,
    input: Vec<u8>,
    transaction: u16,
    pub(crate) unit: u8,
}

impl Client {
    pub(crate) async fn connect(address: SocketAddr) -> Client {
        Client::try_connect(address).await.expect("the drive can be reached")
    }

    pub(crate) async fn try_connect(address: SocketAddr) -> io::Result<Client> {
        Client::of(TcpStream::connect(address).await?)
    }

    /// Connects without giving the server a chance to do anything meanwhile.
    pub(crate) fn connect_at_once(address: SocketAddr) -> Client {
        let stream = std::net::TcpStream::connect(address).expect("the drive can be reached");
        stream.set_nonblocking(true).expect("set");
        Client::of(TcpStream::from_std(stream).expect("in a runtime")).expect("set")
    }

    fn of(stream: TcpStream) -> io::Result<Client> {
        stream.set_nodelay(true)?;
        Ok(Client { stream, input: Vec::new(), transaction: 0, unit: 1 })
    }

    /// Asks, and waits for the reply.
    pub(crate) async fn ask(&mut self, request: &Request) -> Result<Reply, Exception> {
        self.try_ask(request).await.expect("the connection is open")
    }

    /// Asks on a connection that may be closed.
    pub(crate) async fn try_ask(&mut self, request: &Request) -> io::Result<Result<Reply, Exception>> {
        let frame = self.frame(request);
        self.stream.write_all(&frame).await?;
        let reply = self.try_reply().await?;
        assert_eq!(reply[..2], frame[..2], "the transaction of the request");
        assert_eq!(reply[6], frame[6], "the unit of the request");
        match decode_reply(&reply[7..], request) {
            Ok(reply) => Ok(Ok(reply)),
            Err(ReplyError::Exception(exception)) => Ok(Err(exception)),
            Err(error) => panic!("no reply to the request: {error}"),
        }
    }

    /// The bytes of a request with the next transaction number.
    pub(crate) fn frame(&mut self, request: &Request) -> Vec<u8> {
        self.transaction += 1;
        let mut adu = Adu::new();
        encode_request(&mut adu, self.transaction, self.unit, request).expect("a well-formed request");
        adu.to_vec()
    }

    /// Sends bytes as they are.
    pub(crate) async fn send(&mut self, bytes: &[u8]) {
        self.stream.write_all(bytes).await.expect("the connection is open");
    }

    /// Sends the last bytes, as far as the server takes them, and closes this half of the connection.
    pub(crate) async fn send_last(&mut self, bytes: &[u8]) {
        // What is left when the server has closed the connection is lost, as it should be.
        let _ = self.stream.write_all(bytes).await;
        let _ = self.stream.shutdown().await;
    }

    /// The bytes of the next reply.
    pub(crate) async fn reply(&mut self) -> Vec<u8> {
        self.try_reply().await.expect("a reply")
    }

    async fn try_reply(&mut self) -> io::Result<Vec<u8>> {
        loop {
            if let Split::Frame { size, .. } = split(&self.input) {
                return Ok(self.input.drain(..size).collect());
            }
            if self.stream.read_buf(&mut self.input).await? == 0 {
                return Err(io::ErrorKind::UnexpectedEof.into());
            }
        }
    }

    /// Waits until the server closes the connection, and says what it sent before.
    pub(crate) async fn closed(&mut self) -> Vec<u8> {
        while !matches!(self.stream.read_buf(&mut self.input).await, Ok(0) | Err(_)) {}
        std::mem::take(&mut self.input)
    }

    /// Sends requests and never reads a reply, until the server has enough of it. Returns how many bytes it took.
    pub(crate) async fn send_until_closed(&mut self, bytes: &[u8]) -> usize {
        let mut taken = 0;
        while self.stream.write_all(bytes).await.is_ok() {
            taken += bytes.len();
        }
        taken
    }

    /// Logs in, and says whether that was accepted.
    pub(crate) async fn log_in(&mut self, password: u64) -> bool {
        let mut words = words_of(password).to_vec();
        words.push(0);
        self.write(Reg::PasswordLow32, &words).await.expect("written");
        self.get(Reg::AccessFlag).await == Ok(1)
    }

    /// Reads a register, or the first word of it.
    pub(crate) async fn get(&mut self, reg: Reg) -> Result<u16, Exception> {
        let row = reg.info();
        if !row.table.is_bits() {
            return self.words(reg, 1).await.map(|words| words[0]);
        }
        let request = Request::ReadBits { table: row.table, address: row.address, count: 1 };
        let Reply::Bits(bits) = self.ask(&request).await? else { panic!("no bits") };
        Ok(bits.get(0).expect("one bit").into())
    }

    /// Reads words from a register on.
    pub(crate) async fn words(&mut self, reg: Reg, count: u16) -> Result<Vec<u16>, Exception> {
        let row = reg.info();
        let request = Request::ReadWords { table: row.table, address: row.address, count };
        let Reply::Words(words) = self.ask(&request).await? else { panic!("no words") };
        Ok(words.to_vec())
    }

    /// Writes holding registers from one on.
    pub(crate) async fn write(&mut self, reg: Reg, values: &[u16]) -> Result<(), Exception> {
        assert_eq!(reg.info().table, Table::HoldingRegisters);
        let values = values.iter().copied().collect();
        self.ask(&Request::WriteRegisters { address: reg.info().address, values }).await.map(drop)
    }

    /// Sets a coil to TRUE.
    pub(crate) async fn trigger(&mut self, reg: Reg) -> Result<(), Exception> {
        self.ask(&Request::WriteCoil { address: reg.info().address, value: true }).await.map(drop)
    }

    /// Commands a motion to or by `position` at `speed`.
    pub(crate) async fn command(&mut self, code: u16, speed: u16, position: i32) {
        let [low, high, ..] = words_of(u64::from(position.cast_unsigned()));
        self.write(Reg::TargetSpeed, &[speed, low, high, 0, code]).await.expect("accepted");
    }

    pub(crate) async fn position(&mut self) -> i32 {
        let words = self.words(Reg::AbsPos, 2).await.expect("readable");
        (u32::from(words[1]) << 16 | u32::from(words[0])).cast_signed()
    }

    /// Runs a procedure of `MEM_CMD` and waits until it has ended.
    pub(crate) async fn procedure(&mut self, registers: [u16; 5]) {
        let address = Reg::BComplete.info().address;
        let values: Bits = [false].into_iter().collect();
        self.ask(&Request::WriteCoils { address, values }).await.expect("cleared");
        self.write(Reg::NProg, &registers).await.expect("accepted");
        while self.get(Reg::BComplete).await != Ok(1) {}
    }

    /// Stores instructions in an area, from its first line on, and its size.
    pub(crate) async fn store_program(&mut self, area: u16, words: &[u32]) {
        let halves: Vec<u16> =
            words.iter().flat_map(|word| words_of(u64::from(*word))[..2].to_vec()).collect();
        self.write(Reg::CmdBuffer, &halves).await.expect("accepted");
        let count = u16::try_from(words.len()).expect("few");
        self.procedure([area, 0, count, 0, 1]).await;
        self.procedure([area, 0, 1, count, 4]).await;
    }

    /// Reads back what [`Client::store_program`] stored.
    pub(crate) async fn read_program(&mut self, area: u16) -> Vec<u32> {
        self.procedure([area, 0, 1, 0, 3]).await;
        let count = self.get(Reg::ProgSize).await.expect("readable");
        if count == 0 {
            return Vec::new();
        }
        self.procedure([area, 0, count, 0, 0]).await;
        let halves = self.words(Reg::CmdBuffer, count * 2).await.expect("readable");
        halves.chunks(2).map(|pair| u32::from(pair[1]) << 16 | u32::from(pair[0])).collect()
    }
}

/// A number as four words, the lowest first.
fn words_of(number: u64) -> [u16; 4] {
    [0, 16, 32, 48].map(|shift| u16::try_from(number >> shift & 0xFFFF).expect("masked"))
}

/// A request that every client may make at any time.
pub(crate) fn who_are_you() -> Request {
    let row = Reg::HwMajor.info();
    Request::ReadWords { table: row.table, address: row.address, count: 1 }
}

/// A port that nothing listens on, out of the range from which systems give out free ones.
pub(crate) fn free_port() -> u16 {
    static NEXT: AtomicU16 = AtomicU16::new(0);
    let first = 20_000 + u16::try_from(std::process::id() % 10_000).expect("small");
    let mut candidates = (0..2000).map(|_| first + NEXT.fetch_add(1, Ordering::Relaxed));
    candidates.find(|port| StdListener::bind(("127.0.0.1", *port)).is_ok()).expect("a free port")
}
