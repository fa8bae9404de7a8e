//! What the tests are written with: a served rig whose time stands unless it is moved, and a client that knows bytes.

use rustix::fs::{Mode, OFlags};
use std::fs::File;
use std::io;
use std::net::SocketAddr;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use stepdrive_rig::file::RigFile;
use stepdrive_server::{Options, ServedDrive, Server, Until};
use tempfile::TempDir;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::net::unix::pipe;

/// A drive that is reached in every way that the Modbus firmware has.
pub(crate) const USB: &str = r#"
    [rig]
    clock = "paused"
    [[drive]]
    name = "stage"
    model = "SMSD-4.2LAN"
    modbus_tcp = "127.0.0.1:0"
    usb = "pty"
    usb_tcp = "127.0.0.1:0"
"#;

/// One with the standard firmware.
pub(crate) const STANDARD: &str = r#"
    [rig]
    clock = "paused"
    [[drive]]
    name = "stage"
    model = "SMSD-4.2LAN"
    lan = "standard"
    standard_tcp = "127.0.0.1:0"
    usb_tcp = "127.0.0.1:0"
"#;

/// The password from the factory, as it goes over the wire.
pub(crate) const PASSWORD: [u8; 8] = [0xEF, 0xCD, 0xAB, 0x89, 0x67, 0x45, 0x23, 0x01];

/// A little more than has to pass before the first attempt to log in and between two.
pub(crate) const REST: Duration = Duration::from_millis(1001);

/// Longer than half a packet waits for its other half, with a margin for a busy computer.
pub(crate) const SILENCE: Duration = Duration::from_millis(600);

/// Longer than anything takes here; a reply that has not come by then will not come.
const LIMIT: Duration = Duration::from_secs(30);

/// So long is waited for a reply that is not to come.
const PATIENCE: Duration = Duration::from_millis(150);

/// Codes of replies.
pub(crate) mod code {
    pub(crate) const OK: u8 = 0;
    pub(crate) const OK_ACCESS: u8 = 1;
    pub(crate) const ERROR_ACCESS: u8 = 2;
    pub(crate) const ERROR_ACCESS_TIMEOUT: u8 = 3;
    pub(crate) const ERROR_XOR: u8 = 4;
    pub(crate) const ERROR_NO_COMMAND: u8 = 5;
    pub(crate) const ERROR_LEN: u8 = 6;
    pub(crate) const ERROR_RANGE: u8 = 7;
    pub(crate) const END_PROGRAMS: u8 = 13;
    pub(crate) const GET_ABS_POS: u8 = 16;
    pub(crate) const GET_MAX_SPEED: u8 = 20;
}

/// A rig that is served, and its state folder.
pub(crate) struct Bench {
    pub(crate) server: Server,
    rig: String,
    pub(crate) folder: TempDir,
    notices: Arc<Mutex<Vec<String>>>,
}

impl Bench {
    /// A rig that has just been switched on.
    pub(crate) async fn start(rig: &str) -> Bench {
        Bench::start_in(TempDir::new().expect("a temporary folder"), rig).await
    }

    async fn start_in(folder: TempDir, rig: &str) -> Bench {
        let notices = Arc::<Mutex<Vec<String>>>::default();
        let told = Arc::clone(&notices);
        let notify =
            move |notice: stepdrive_server::Notice| told.lock().expect("whole").push(notice.to_string());
        let options = Options { state: folder.path().into(), recording: None, notify: Arc::new(notify) };
        let parsed = RigFile::parse(rig).expect("a rig");
        let server = Server::start(&parsed, options).await.expect("the rig starts");
        Bench { server, rig: rig.to_owned(), folder, notices }
    }

    /// A rig in which the second after power-up is over.
    pub(crate) async fn awake(rig: &str) -> Bench {
        let bench = Bench::start(rig).await;
        bench.pass(REST).await;
        bench
    }

    /// Switches the rig off and on again, and lets the second after power-up pass.
    pub(crate) async fn restart(self) -> Bench {
        self.server.stop().await;
        let bench = Bench::start_in(self.folder, &self.rig).await;
        bench.pass(REST).await;
        bench
    }

    /// Lets rig time pass.
    pub(crate) async fn pass(&self, time: Duration) {
        assert!(self.server.control().run(&Until::Time, time).await.is_some());
    }

    pub(crate) fn act(&self, action: &str) {
        self.server.control().act(action).expect("an action");
    }

    pub(crate) fn drive(&self) -> &ServedDrive {
        &self.server.drives()[0]
    }

    /// A client that opens the serial port.
    pub(crate) fn serial(&self) -> Client {
        Client::open(self.drive().usb.as_deref().expect("it has USB"))
    }

    /// A client of USB over TCP.
    pub(crate) async fn usb_tcp(&self) -> Client {
        Client::connect(self.drive().usb_tcp.expect("it has USB over TCP"), true).await
    }

    /// A client over the LAN of the standard firmware, which has been greeted.
    pub(crate) async fn standard(&self) -> Client {
        let mut client =
            Client::connect(self.drive().standard_tcp.expect("it has the standard firmware"), false).await;
        client.reply().await;
        client
    }

    /// A client at the serial port that has logged in. The rest between two attempts is kept.
    pub(crate) async fn logged_in(&self) -> Client {
        self.log_in(self.serial()).await
    }

    pub(crate) async fn log_in(&self, mut client: Client) -> Client {
        self.pass(REST).await;
        assert_eq!(client.ask(0, &PASSWORD).await.code(), code::OK_ACCESS);
        client
    }

    /// What the server has told that contains `part`.
    pub(crate) fn notices(&self, part: &str) -> Vec<String> {
        self.notices.lock().expect("whole").iter().filter(|notice| notice.contains(part)).cloned().collect()
    }
}

/// Lets the drive see that a client has closed its port: opening it again at once may be sooner.
pub(crate) async fn noticed() {
    tokio::time::sleep(Duration::from_millis(20)).await;
}

/// A packet that came back, without start, stop and escapes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Reply(pub(crate) Vec<u8>);

impl Reply {
    pub(crate) fn packet_type(&self) -> u8 {
        self.0[2]
    }

    pub(crate) fn id(&self) -> u8 {
        self.0[3]
    }

    pub(crate) fn data(&self) -> &[u8] {
        &self.0[6..]
    }

    /// Of a status structure, the status word.
    pub(crate) fn status(&self) -> u16 {
        u16::from_le_bytes(self.data()[..2].try_into().expect("two"))
    }

    /// Of a status structure, the code.
    pub(crate) fn code(&self) -> u8 {
        assert_eq!(self.data().len(), 7, "a status structure: {:02X?}", self.0);
        self.data()[2]
    }

    /// Of a status structure, the value.
    pub(crate) fn value(&self) -> i32 {
        i32::from_le_bytes(self.data()[3..].try_into().expect("four"))
    }
}

/// The bytes of a packet before stuffing.
pub(crate) fn packet(packet_type: u8, id: u8, data: &[u8]) -> Vec<u8> {
    let [low, high] = u16::try_from(data.len()).expect("not so long").to_le_bytes();
    let mut bytes = [&[0, 2, packet_type, id, low, high], data].concat();
    bytes[0] = bytes.iter().fold(0_u8, |sum, byte| sum.wrapping_sub(*byte));
    bytes
}

/// Bytes with start, stop and escapes.
pub(crate) fn stuffed(bytes: &[u8]) -> Vec<u8> {
    let escaped = bytes.iter().flat_map(|byte| match byte {
        0xFA | 0xFB | 0xFE => vec![0xFE, byte ^ 0x80],
        _ => vec![*byte],
    });
    [0xFA].into_iter().chain(escaped).chain([0xFB]).collect()
}

fn unstuffed(bytes: &[u8]) -> Vec<u8> {
    let mut escaped = false;
    let plain = bytes.iter().filter_map(|byte| match byte {
        0xFE => {
            escaped = true;
            None
        }
        _ => Some(byte ^ if std::mem::take(&mut escaped) { 0x80 } else { 0 }),
    });
    plain.collect()
}

/// An instruction.
pub(crate) fn instruction(opcode: u8, data: i32) -> [u8; 4] {
    (data.cast_unsigned() << 10 | u32::from(opcode) << 4).to_le_bytes()
}

/// A client, polite or not. Dropping it closes the port or the connection.
pub(crate) struct Client {
    input: Box<dyn AsyncRead + Send + Unpin>,
    output: Box<dyn AsyncWrite + Send + Unpin>,
    stuffed: bool,
    id: u8,
    /// What has come and was not looked at yet.
    unread: Vec<u8>,
}

impl Client {
    /// Opens a serial port as any program would.
    pub(crate) fn open(path: &Path) -> Client {
        let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
        let port = File::from(rustix::fs::open(path, flags, Mode::empty()).expect("the port can be opened"));
        let output = port.try_clone().expect("a second handle");
        Client {
            input: Box::new(pipe::Receiver::from_file_unchecked(port).expect("non-blocking")),
            output: Box::new(pipe::Sender::from_file_unchecked(output).expect("non-blocking")),
            stuffed: true,
            id: 0,
            unread: Vec::new(),
        }
    }

    pub(crate) async fn connect(address: SocketAddr, stuffed: bool) -> Client {
        let stream = TcpStream::connect(address).await.expect("the drive can be reached");
        stream.set_nodelay(true).expect("set");
        let (input, output) = stream.into_split();
        Client { input: Box::new(input), output: Box::new(output), stuffed, id: 0, unread: Vec::new() }
    }

    /// Sends bytes as they are.
    pub(crate) async fn send(&mut self, bytes: &[u8]) {
        self.output.write_all(bytes).await.expect("the port is open");
    }

    /// A packet as it goes over this line.
    pub(crate) fn framed(&self, packet: &[u8]) -> Vec<u8> {
        if self.stuffed { stuffed(packet) } else { packet.to_vec() }
    }

    /// Sends a packet with the next identification.
    pub(crate) async fn say(&mut self, packet_type: u8, data: &[u8]) {
        self.id = self.id.wrapping_add(1);
        let bytes = self.framed(&packet(packet_type, self.id, data));
        self.send(&bytes).await;
    }

    /// Sends a packet, and gives back the reply, which has its identification.
    pub(crate) async fn ask(&mut self, packet_type: u8, data: &[u8]) -> Reply {
        self.say(packet_type, data).await;
        let reply = self.reply().await;
        assert_eq!(reply.id(), self.id, "the identification of the request");
        reply
    }

    /// Sends an instruction.
    pub(crate) async fn command(&mut self, opcode: u8, data: i32) -> Reply {
        self.ask(2, &instruction(opcode, data)).await
    }

    /// A counter of errors, by its place.
    pub(crate) async fn counter(&mut self, place: usize) -> u32 {
        let reply = self.ask(14, &[]).await;
        assert_eq!((reply.packet_type(), reply.data().len()), (14, 68));
        u32::from_le_bytes(reply.data()[4 * place..4 * place + 4].try_into().expect("four"))
    }

    /// The next packet, whose checksum is right.
    pub(crate) async fn reply(&mut self) -> Reply {
        let reply = tokio::time::timeout(LIMIT, self.try_reply()).await.expect("in time").expect("a reply");
        assert_eq!(reply.0.iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte)), 0, "{reply:02X?}");
        assert_eq!(usize::from(u16::from_le_bytes([reply.0[4], reply.0[5]])), reply.data().len());
        reply
    }

    async fn try_reply(&mut self) -> io::Result<Reply> {
        loop {
            if let Some(reply) = self.take_reply() {
                return Ok(Reply(reply));
            }
            if self.input.read_buf(&mut self.unread).await? == 0 {
                return Err(io::ErrorKind::UnexpectedEof.into());
            }
        }
    }

    fn take_reply(&mut self) -> Option<Vec<u8>> {
        if self.stuffed {
            let end = self.unread.iter().position(|byte| *byte == 0xFB)?;
            let frame: Vec<u8> = self.unread.drain(..=end).collect();
            assert_eq!(frame[0], 0xFA, "nothing stands between packets");
            return Some(unstuffed(&frame[1..end]));
        }
        let &[_, _, _, _, low, high, ..] = self.unread.as_slice() else { return None };
        let size = 6 + usize::from(u16::from_le_bytes([low, high]));
        (self.unread.len() >= size).then(|| self.unread.drain(..size).collect())
    }

    /// The bytes that come in a little time, as they are.
    pub(crate) async fn bytes(&mut self) -> Vec<u8> {
        let all = async { while !matches!(self.input.read_buf(&mut self.unread).await, Ok(0) | Err(_)) {} };
        // It ends when nothing more has come for a while.
        let _ = tokio::time::timeout(PATIENCE, all).await;
        std::mem::take(&mut self.unread)
    }

    /// Waits until the server closes the connection, and says what it sent before.
    pub(crate) async fn closed(&mut self) -> Vec<u8> {
        let all = async { while !matches!(self.input.read_buf(&mut self.unread).await, Ok(0) | Err(_)) {} };
        tokio::time::timeout(LIMIT, all).await.expect("it is closed");
        std::mem::take(&mut self.unread)
    }
}
