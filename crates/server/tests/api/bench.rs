//! What the tests are written with: a served rig with its control API, and an HTTP client that says what it is told to.

use serde_json::Value;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;
use stepdrive_rig::file::RigFile;
use stepdrive_server::{Options, Server};
use tempfile::TempDir;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

/// Two SMSDs joined by wires, and an SMD3. Time stands.
pub(crate) const THREE: &str = r#"
    [rig]
    clock = "paused"
    api = "127.0.0.1:0"
    [[drive]]
    name = "a"
    model = "SMSD-4.2LAN"
    modbus_tcp = "127.0.0.1:0"
    [[drive.switch]]
    input = "IN1"
    closed = [-10.0, 10.0]
    [[drive]]
    name = "b"
    model = "SMSD-8.0LAN"
    modbus_tcp = "127.0.0.1:0"
    [[drive]]
    name = "uhv"
    model = "SMD3"
    serial_tcp = "127.0.0.1:0"
    [[wire]]
    from = "a.relay"
    to = "b.CONTINUE"
    [[wire]]
    from = "b.relay"
    to = "a.IN0"
    delay = "5ms"
    invert = true
"#;

/// Longer than anything takes here; what has not come by then will not come.
const LIMIT: Duration = Duration::from_secs(30);

/// A rig that is served.
pub(crate) struct Bench {
    pub(crate) server: Server,
    _folder: TempDir,
}

/// A reply.
#[derive(Debug)]
pub(crate) struct Reply {
    pub(crate) status: u16,
    head: String,
    pub(crate) body: String,
}

impl Bench {
    pub(crate) async fn start() -> Bench {
        Bench::with(THREE).await
    }

    pub(crate) async fn with(rig: &str) -> Bench {
        let folder = TempDir::new().expect("a temporary folder");
        let rig = RigFile::parse(rig).expect("a rig");
        let options = Options { state: folder.path().into(), recording: None, notify: Arc::new(|_| {}) };
        let server = Server::start(&rig, options).await.expect("the rig starts");
        Bench { server, _folder: folder }
    }

    /// A rig that is served already, and its state folder.
    pub(crate) fn of(server: Server, folder: TempDir) -> Bench {
        Bench { server, _folder: folder }
    }

    /// Where the API listens.
    pub(crate) fn address(&self) -> SocketAddr {
        self.server.api().expect("the rig has an API")
    }

    pub(crate) async fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(self.address()).await.expect("the API can be reached");
        stream.set_nodelay(true).expect("set");
        stream
    }

    /// Sends bytes as they are, and reads until the server closes the connection.
    pub(crate) async fn raw(&self, request: impl AsRef<[u8]>) -> Reply {
        let mut stream = self.connect().await;
        // A server that refuses may close before it has read everything.
        let _ = stream.write_all(request.as_ref()).await;
        let mut bytes = Vec::new();
        let read = tokio::time::timeout(LIMIT, stream.read_to_end(&mut bytes));
        read.await.expect("in time").expect("a whole reply");
        Reply::parse(&String::from_utf8(bytes).expect("UTF-8"))
    }

    /// Sends a request with these lines in its head, and this body.
    pub(crate) async fn send(&self, first_line: &str, head: &str, body: &str) -> Reply {
        let length = body.len();
        let fixed = format!("Connection: close\r\nContent-Length: {length}\r\n");
        self.raw(format!("{first_line} HTTP/1.1\r\n{fixed}{head}\r\n{body}")).await
    }

    pub(crate) async fn get(&self, path: &str) -> Reply {
        self.send(&format!("GET {path}"), "Host: localhost\r\n", "").await
    }

    /// Sends a body in JSON.
    pub(crate) async fn ask(&self, method_and_path: &str, body: &str) -> Reply {
        self.send(method_and_path, "Host: localhost\r\nContent-Type: application/json\r\n", body).await
    }

    /// Sends a body in JSON that must be accepted.
    pub(crate) async fn done(&self, method_and_path: &str, body: &str) -> Value {
        let reply = self.ask(method_and_path, body).await;
        assert_eq!(reply.status, 200, "{method_and_path} {body}: {}", reply.body);
        reply.json()
    }

    /// Sends a body in JSON that must be refused so.
    pub(crate) async fn refused(&self, method_and_path: &str, body: &str, status: u16, error: &str) {
        let reply = self.ask(method_and_path, body).await;
        let told = reply.error();
        assert!(told.contains(error), "{method_and_path} {body}: {told}");
        assert_eq!(reply.status, status, "{method_and_path} {body}: {told}");
    }

    /// What is to be seen at a place in the rig, as in `/drives/0/state`.
    pub(crate) async fn see(&self, place: &str) -> Value {
        let rig = self.get("/v1/rig").await.json();
        rig.pointer(place).unwrap_or_else(|| panic!("{place} in {rig}")).clone()
    }
}

impl Reply {
    fn parse(text: &str) -> Reply {
        let (head, body) = text.split_once("\r\n\r\n").unwrap_or_else(|| panic!("no reply, but {text:?}"));
        let status = head.split(' ').nth(1).and_then(|status| status.parse().ok());
        Reply { status: status.expect("a status"), head: head.to_owned(), body: body.to_owned() }
    }

    /// A line of the head.
    pub(crate) fn header(&self, name: &str) -> Option<&str> {
        let mut lines = self.head.lines().filter_map(|line| line.split_once(": "));
        lines.find(|(other, _)| other.eq_ignore_ascii_case(name)).map(|(_, value)| value)
    }

    pub(crate) fn json(&self) -> Value {
        assert_eq!(self.header("content-type"), Some("application/json"), "{}", self.body);
        serde_json::from_str(&self.body).unwrap_or_else(|error| panic!("{error} in {}", self.body))
    }

    /// The sentence that says what is wrong.
    pub(crate) fn error(&self) -> String {
        let json = self.json();
        json["error"].as_str().unwrap_or_else(|| panic!("no error, but {json}")).to_owned()
    }
}

/// Somebody who watches.
pub(crate) struct Viewer {
    stream: TcpStream,
    unread: String,
}

impl Viewer {
    /// Asks for events; with what path of the API, as in `/v1/events`.
    pub(crate) async fn open(bench: &Bench, path: &str) -> Viewer {
        Viewer::ask(bench, &format!("GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n")).await
    }

    /// Sends a request that is answered with events.
    pub(crate) async fn ask(bench: &Bench, request: &str) -> Viewer {
        let mut viewer = Viewer { stream: bench.connect().await, unread: String::new() };
        viewer.stream.write_all(request.as_bytes()).await.expect("sent");
        viewer
    }

    /// The next event, as its name and data; `None` when the connection is closed.
    pub(crate) async fn next(&mut self) -> Option<(String, Value)> {
        let event = self.read_to("\n\n").await?;
        let line = |name: &str| event.lines().find_map(|line| line.strip_prefix(name));
        let data = serde_json::from_str(line("data: ").expect("data")).expect("JSON");
        Some((line("event: ").expect("a name").to_owned(), data))
    }

    /// The status of the reply.
    pub(crate) async fn status(&mut self) -> u16 {
        let head = self.read_to("\r\n\r\n").await.expect("a head");
        Reply::parse(&head).status
    }

    /// Whether nothing comes for a while.
    pub(crate) async fn is_quiet(&mut self) -> bool {
        tokio::time::timeout(Duration::from_millis(100), self.next()).await.is_err()
    }

    async fn read_to(&mut self, end: &str) -> Option<String> {
        loop {
            if let Some(place) = self.unread.find(end) {
                return Some(self.unread.drain(..place + end.len()).collect());
            }
            let mut bytes = [0; 4096];
            let read = tokio::time::timeout(LIMIT, self.stream.read(&mut bytes)).await.expect("in time");
            let count = read.ok().filter(|count| *count > 0)?;
            self.unread.push_str(str::from_utf8(&bytes[..count]).expect("ASCII"));
        }
    }
}
