//! Modbus as the tests of the API speak it: bytes on any stream.

use crate::bench::Bench;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::TcpStream;

/// Sends a PDU to unit 1 and waits for that of the reply.
pub(crate) async fn ask(stream: &mut (impl AsyncRead + AsyncWrite + Unpin), pdu: &[u8]) -> Vec<u8> {
    let length = u8::try_from(1 + pdu.len()).expect("short");
    stream.write_all(&[&[0, 1, 0, 0, 0, length, 1], pdu].concat()).await.expect("sent");
    let mut head = [0; 7];
    stream.read_exact(&mut head).await.expect("answered");
    let mut pdu = vec![0; usize::from(head[5]) - 1];
    stream.read_exact(&mut pdu).await.expect("whole");
    pdu
}

/// Writes holding registers, which must be accepted.
pub(crate) async fn write(stream: &mut (impl AsyncRead + AsyncWrite + Unpin), address: u16, words: &[u16]) {
    let count = u8::try_from(words.len()).expect("few");
    let [high, low] = address.to_be_bytes();
    let values = words.iter().flat_map(|word| word.to_be_bytes());
    let pdu: Vec<u8> = [16, high, low, 0, count, 2 * count].into_iter().chain(values).collect();
    let reply = ask(stream, &pdu).await;
    assert_eq!(reply[0], 16, "{reply:?}");
}

/// Logs in with the password of the factory.
pub(crate) async fn log_in(stream: &mut (impl AsyncRead + AsyncWrite + Unpin)) {
    write(stream, 0x2100, &[0xCDEF, 0x89AB, 0x4567, 0x0123, 0]).await;
}

/// A client of the first drive over TCP that has logged in.
pub(crate) async fn host(bench: &Bench) -> TcpStream {
    let address = bench.server.drives()[0].modbus_tcp.expect("it listens");
    let mut stream = TcpStream::connect(address).await.expect("connected");
    log_in(&mut stream).await;
    stream
}
