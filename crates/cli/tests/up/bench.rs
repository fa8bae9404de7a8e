//! What the tests are written with: the program in a folder of its own, and a client for its drives.

use std::fs;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, Output, Stdio};
use stepdrive_proto::modbus::{Adu, ReplyError, Split, decode_reply, encode_request, split};
use stepdrive_spec::modbus::{Exception, Reply, Request};
use stepdrive_spec::smsd::registers::Reg;
use tempfile::TempDir;

/// A rig of one drive on a free port.
pub(crate) const ONE: &str = "\
[[drive]]
name = \"stage\"
model = \"SMSD-4.2LAN\"
modbus_tcp = \"127.0.0.1:0\"
";

/// The words that bring it up.
const UP: [&str; 5] = ["up", "rig.toml", "--json", "--state", "state"];

/// A folder with a rig file, in which the program also finds its home.
pub(crate) struct Place(TempDir);

impl Place {
    /// With a rig of one drive.
    pub(crate) fn new() -> Place {
        Place::with(ONE)
    }

    pub(crate) fn with(rig: &str) -> Place {
        let place = Place(TempDir::new().expect("a temporary folder"));
        fs::write(place.path("rig.toml"), rig).expect("written");
        place
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// The file of the non-volatile memory that [`Place::up`] uses.
    pub(crate) fn memory(&self) -> PathBuf {
        self.path("state/memory.redb")
    }

    /// The program, at home in this folder.
    pub(crate) fn command(&self) -> Command {
        self.at_home(Command::new(env!("CARGO_BIN_EXE_stepdrive")))
    }

    /// The program, started by a shell that does something first.
    fn command_after(&self, script: &str) -> Command {
        let mut command = Command::new("sh");
        command.args(["-c", &format!("{script}\nexec \"$0\" \"$@\""), env!("CARGO_BIN_EXE_stepdrive")]);
        self.at_home(command)
    }

    fn at_home(&self, mut command: Command) -> Command {
        command
            .current_dir(self.0.path())
            .env("HOME", self.0.path())
            .env("XDG_STATE_HOME", self.path("xdg"))
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        command
    }

    /// Runs the program with these words to its end.
    pub(crate) fn run(&self, words: &str) -> Output {
        self.command().args(words.split_whitespace()).output().expect("started")
    }

    /// Brings the rig up on the state folder `state`.
    pub(crate) fn up(&self) -> Up {
        Up::start(self.command().args(UP))
    }

    /// Brings it up after a shell has done something.
    pub(crate) fn up_after(&self, script: &str) -> Up {
        Up::start(self.command_after(script).args(UP))
    }
}

/// The program bringing up a rig. It is killed when a test gives up.
pub(crate) struct Up {
    /// `None` once it has been seen to its end.
    child: Option<Child>,
    stdout: BufReader<ChildStdout>,
    /// The line on stdout that says that it is ready.
    pub(crate) ready: String,
}

impl Up {
    /// Starts it and waits until it is ready.
    pub(crate) fn start(command: &mut Command) -> Up {
        let mut child = command.spawn().expect("started");
        let mut stdout = BufReader::new(child.stdout.take().expect("piped"));
        let mut ready = String::new();
        stdout.read_line(&mut ready).expect("readable");
        if ready.is_empty() {
            let output = child.wait_with_output().expect("ended");
            panic!("it did not come up: {}", text(&output.stderr));
        }
        Up { child: Some(child), stdout, ready }
    }

    /// Where its first drive is reached.
    pub(crate) fn address(&self) -> SocketAddr {
        let ready: serde_json::Value = serde_json::from_str(&self.ready).expect("JSON");
        let address = ready["drives"][0]["modbus_tcp"].as_str().expect("an address");
        address.parse().expect("an address")
    }

    /// A client of its first drive, logged in.
    pub(crate) fn client(&self) -> Client {
        let mut client = Client::connect(self.address()).expect("reachable");
        client.log_in().expect("logged in");
        client
    }

    pub(crate) fn id(&self) -> u32 {
        self.child.as_ref().expect("it runs").id()
    }

    /// Reads on until a line that ends the welcome.
    pub(crate) fn welcome(&mut self) -> String {
        let mut text = self.ready.clone();
        while !text.ends_with("Ctrl-C ends it.\n") {
            assert_ne!(self.stdout.read_line(&mut text).expect("readable"), 0, "{text}");
        }
        text
    }

    /// Sends it a signal and waits until it has ended. Returns the rest of its output.
    pub(crate) fn end(mut self, signal: &str) -> Output {
        let sent = Command::new("kill").args([format!("-{signal}"), self.id().to_string()]).status();
        assert!(sent.expect("there is a `kill`").success());
        let mut stdout = Vec::new();
        self.stdout.read_to_end(&mut stdout).expect("readable");
        let child = self.child.take().expect("it runs");
        Output { stdout, ..child.wait_with_output().expect("ended") }
    }

    /// Kills it as a power cut would.
    pub(crate) fn kill(mut self) {
        let mut child = self.child.take().expect("it runs");
        child.kill().expect("killed");
        child.wait().expect("ended");
    }
}

impl Drop for Up {
    fn drop(&mut self) {
        if let Some(child) = &mut self.child {
            // It may have ended already; then there is nothing left to do.
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// What a failed run said: nothing on stdout, one line on stderr.
#[track_caller]
pub(crate) fn one_line(output: &Output, code: i32) -> String {
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{said}");
    assert_eq!(text(&output.stdout), "");
    assert!(said.starts_with("stepdrive: ") && said.ends_with('\n') && said.lines().count() == 1, "{said}");
    said.trim_end().to_owned()
}

pub(crate) fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("text")
}

/// The path as the program shows it.
pub(crate) fn shown(path: &Path) -> String {
    path.display().to_string()
}

/// A client of a drive. Its calls fail when the connection is lost.
pub(crate) struct Client {
    stream: TcpStream,
    input: Vec<u8>,
}

/// What becomes of a request: the connection may be lost, or the drive may refuse.
pub(crate) type Answer<T> = io::Result<Result<T, Exception>>;

impl Client {
    pub(crate) fn connect(address: SocketAddr) -> io::Result<Client> {
        let stream = TcpStream::connect(address)?;
        stream.set_nodelay(true)?;
        Ok(Client { stream, input: Vec::new() })
    }

    /// Logs in with the factory password.
    pub(crate) fn log_in(&mut self) -> io::Result<()> {
        self.write(Reg::PasswordLow32, &[0xCDEF, 0x89AB, 0x4567, 0x0123, 0])?.map_err(io::Error::other)
    }

    /// Writes holding registers from one on.
    pub(crate) fn write(&mut self, reg: Reg, values: &[u16]) -> Answer<()> {
        let values = values.iter().copied().collect();
        let reply = self.ask(&Request::WriteRegisters { address: reg.info().address, values })?;
        Ok(reply.map(drop))
    }

    /// Writes a coil.
    pub(crate) fn set(&mut self, reg: Reg, value: bool) -> Answer<()> {
        Ok(self.ask(&Request::WriteCoil { address: reg.info().address, value })?.map(drop))
    }

    /// Reads registers from one on.
    pub(crate) fn read(&mut self, reg: Reg, count: u16) -> Answer<Vec<u16>> {
        let row = reg.info();
        let request = if row.table.is_bits() {
            Request::ReadBits { table: row.table, address: row.address, count }
        } else {
            Request::ReadWords { table: row.table, address: row.address, count }
        };
        Ok(self.ask(&request)?.map(|reply| match reply {
            Reply::Words(words) => words.to_vec(),
            Reply::Bits(bits) => bits.iter().map(u16::from).collect(),
            Reply::Written => panic!("a read was answered as a write"),
        }))
    }

    /// Runs a procedure of `MEM_CMD` and waits until the drive says that it has ended.
    pub(crate) fn procedure(&mut self, registers: [u16; 5]) -> io::Result<()> {
        self.set(Reg::BComplete, false)?.expect("cleared");
        self.write(Reg::NProg, &registers)?.expect("accepted");
        while self.read(Reg::BComplete, 1)?.expect("readable") != [1] {}
        Ok(())
    }

    fn ask(&mut self, request: &Request) -> Answer<Reply> {
        let mut adu = Adu::new();
        encode_request(&mut adu, 1, 1, request).expect("a well-formed request");
        self.stream.write_all(&adu)?;
        loop {
            if let Split::Frame { frame, size } = split(&self.input) {
                let reply = match decode_reply(frame.pdu, request) {
                    Ok(reply) => Ok(reply),
                    Err(ReplyError::Exception(exception)) => Err(exception),
                    Err(error) => panic!("no reply to the request: {error}"),
                };
                self.input.drain(..size);
                return Ok(reply);
            }
            let mut bytes = [0; 512];
            match self.stream.read(&mut bytes)? {
                0 => return Err(io::ErrorKind::UnexpectedEof.into()),
                count => self.input.extend_from_slice(&bytes[..count]),
            }
        }
    }
}
