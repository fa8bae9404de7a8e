//! The ways to reach a controller, on real sockets and terminals.

use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use std::ffi::OsString;
use std::os::fd::OwnedFd;
use std::os::unix::ffi::OsStringExt;
use stepdrive_host::{Connect, Serial, Stream, Tcp};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpListener;

/// Every byte there is, so that any which a line changes or swallows is missed.
fn all_bytes() -> Vec<u8> {
    (0..=u8::MAX).collect()
}

/// Sends every byte, and expects every byte back.
async fn is_transparent(mut stream: Box<dyn Stream>) {
    let sent = all_bytes();
    stream.write_all(&sent).await.expect("an open line");
    let mut found = vec![0; sent.len()];
    stream.read_exact(&mut found).await.expect("an echo");
    assert_eq!(found, sent);
}

#[tokio::test]
async fn bytes_pass_over_tcp_as_they_are() {
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a free port");
    let port = listener.local_addr().expect("bound").port();
    tokio::spawn(async move {
        let (mut stream, _) = listener.accept().await.expect("a client");
        let (mut reader, mut writer) = stream.split();
        tokio::io::copy(&mut reader, &mut writer).await.expect("an echo");
    });
    is_transparent(Tcp::new("127.0.0.1", port).connect().await.expect("somebody listens")).await;
}

#[tokio::test]
async fn a_port_that_nobody_listens_at_is_refused() {
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a free port");
    let port = listener.local_addr().expect("bound").port();
    drop(listener);
    let error = Tcp::new("127.0.0.1", port).connect().await.err().expect("nobody listens");
    assert_eq!(error.kind(), std::io::ErrorKind::ConnectionRefused);
}

/// The far end of a terminal, and the path of its near end.
fn terminal() -> (OwnedFd, OsString) {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).expect("a terminal");
    grantpt(&master).expect("ours");
    unlockpt(&master).expect("ours");
    let path = ptsname(&master, Vec::new()).expect("it has a name").into_bytes();
    (master, OsString::from_vec(path))
}

#[tokio::test]
async fn bytes_pass_over_a_serial_port_as_they_are() {
    let (master, path) = terminal();
    let serial = Serial::new(&path);
    assert_eq!(serial.name(), path.to_string_lossy());
    // Only an open port passes bytes as they are, so the echo begins behind that.
    let stream = serial.connect().await.expect("a terminal");
    let echo = tokio::task::spawn_blocking(move || {
        let mut left = all_bytes().len();
        while left > 0 {
            let mut bytes = [0; 64];
            let count = rustix::io::read(&master, &mut bytes).expect("the port is open");
            rustix::io::write(&master, &bytes[..count]).expect("the port is open");
            left -= count;
        }
        master
    });
    is_transparent(stream).await;
    drop(echo.await.expect("an echo"));
}

#[tokio::test]
async fn a_serial_port_that_is_not_there_is_an_error() {
    let error = Serial::new("/dev/stepdrive-no-such-port").connect().await.err().expect("not there");
    assert_eq!(error.kind(), std::io::ErrorKind::NotFound);
}

#[tokio::test(start_paused = true)]
async fn a_serial_port_is_one_programs_until_it_closes_it() {
    let (_master, path) = terminal();
    let serial = Serial::new(&path);
    let first = serial.connect().await.expect("a terminal");
    let error = serial.connect().await.err().expect("the first has it");
    assert_eq!(error.kind(), std::io::ErrorKind::ResourceBusy);
    assert!(error.to_string().starts_with("another program has it open"), "{error}");
    let waiting = serial.connect();
    let leaving = async {
        tokio::time::sleep(std::time::Duration::from_millis(300)).await;
        drop(first);
    };
    tokio::join!(waiting, leaving).0.expect("the first has gone");
}
