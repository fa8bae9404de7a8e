//! Fuzz targets: plain functions that take any bytes and panic when an invariant does not hold.
//!
//! cargo-fuzz calls them with bytes it makes up (`fuzz_targets/`), and `tests/replay.rs` with those kept in `corpus/`.

mod packets;
mod program;
mod recording;
mod smd3;
mod smsd;

pub use packets::smsd_packets;
pub use program::program_text;
pub use recording::recording;
pub use smd3::smd3_lines;
pub use smsd::smsd_drive;

use stepdrive_proto::modbus::{
    Adu, Frame, MAX_ADU, ReplyError, Split, decode_reply, decode_request, encode_refusal, encode_reply,
    encode_request, split,
};
use stepdrive_spec::modbus::{Exception, Reply, Request};
use stepdrive_spec::smsd::instructions::Instruction;

/// A function that takes any bytes.
pub type Target = fn(&[u8]);

/// Every target under its name, which is also that of its folder in `corpus/` and of its file in `fuzz_targets/`.
pub const TARGETS: &[(&str, Target)] = &[
    ("instruction_word", instruction_word),
    ("modbus_client_bytes", modbus_client_bytes),
    ("modbus_server_bytes", modbus_server_bytes),
    ("program_text", program_text),
    ("recording", recording),
    ("smd3_lines", smd3_lines),
    ("smsd_drive", smsd_drive),
    ("smsd_packets", smsd_packets),
];

/// Words of user programs, 4 bytes each, low byte first: a word that is an instruction is that instruction's word.
///
/// # Panics
/// When that does not hold.
pub fn instruction_word(data: &[u8]) {
    for bytes in data.as_chunks().0 {
        let word = u32::from_le_bytes(*bytes);
        match Instruction::from_word(word) {
            Ok(instruction) => {
                assert_eq!(instruction.word(), word);
                let same = Instruction::with_position(instruction.opcode, instruction.position());
                assert_eq!(same, instruction);
            }
            Err(why) => assert!(!why.to_string().is_empty()),
        }
    }
}

/// The PDU of a request, the count of its bytes before it, and the PDU of a reply to it: a reply that is understood
/// means the same when it is encoded again.
///
/// # Panics
/// When that does not hold.
pub fn modbus_client_bytes(data: &[u8]) {
    let Some((&len, rest)) = data.split_first() else { return };
    let Some((request, pdu)) = rest.split_at_checked(len.into()) else { return };
    let Ok(request) = decode_request(request) else { return };
    let read = decode_reply(pdu, &request);
    let outcome = match read.clone() {
        Ok(reply) => Ok(reply),
        Err(ReplyError::Exception(exception)) => Err(exception),
        Err(malformed) => return assert!(!malformed.to_string().is_empty()),
    };
    let mut out = Adu::new();
    encode_reply(&mut out, 1, 1, &request, &outcome);
    let frame = whole(&out);
    assert_eq!(frame.pdu.len(), pdu.len());
    assert_eq!(decode_reply(frame.pdu, &request), read);
}

/// What a client sends on one connection: the replies do not depend on how the bytes were cut, every frame of Modbus
/// gets exactly one, and it is one that the client understands.
///
/// # Panics
/// When that does not hold.
pub fn modbus_server_bytes(data: &[u8]) {
    let at_once = Connection::run(data, data.len().max(1));
    for chunk in [1, 7, MAX_ADU] {
        assert_eq!(Connection::run(data, chunk), at_once, "cut to {chunk} bytes");
    }
}

/// A server's end of a connection, with a controller that makes up its answers.
#[derive(Debug, Default, PartialEq, Eq)]
struct Connection {
    waiting: Vec<u8>,
    replies: Vec<u8>,
    closed: bool,
}

impl Connection {
    fn run(data: &[u8], chunk: usize) -> Connection {
        let mut connection = Connection::default();
        for bytes in data.chunks(chunk) {
            if connection.closed {
                break;
            }
            connection.waiting.extend_from_slice(bytes);
            connection.take_frames();
        }
        connection
    }

    /// Answers all whole frames.
    fn take_frames(&mut self) {
        loop {
            let size = match split(&self.waiting) {
                Split::Incomplete { needed } => {
                    assert!(self.waiting.len() < needed && needed <= MAX_ADU);
                    return;
                }
                Split::Frame { frame, size } => {
                    assert_eq!(size, frame.pdu.len() + 7);
                    self.replies.extend_from_slice(&answer(&frame));
                    size
                }
                Split::Foreign { protocol, size } => {
                    assert_ne!(protocol, 0);
                    size
                }
                Split::Broken { length } => {
                    assert!(!(2..=254).contains(&length));
                    self.closed = true;
                    self.waiting.clear();
                    return;
                }
            };
            self.waiting.drain(..size);
        }
    }
}

/// The reply to one frame, read back as its client would.
fn answer(frame: &Frame<'_>) -> Adu {
    let mut out = Adu::new();
    match decode_request(frame.pdu) {
        Ok(request) => {
            means_the_same_encoded_again(frame, &request);
            let outcome = made_up(&request);
            encode_reply(&mut out, frame.transaction, frame.unit, &request, &outcome);
            let read = decode_reply(whole(&out).pdu, &request);
            assert_eq!(read, outcome.map_err(ReplyError::Exception));
        }
        Err(refusal) => {
            encode_refusal(&mut out, frame.transaction, frame.unit, refusal);
            assert_eq!(whole(&out).pdu, [refusal.function | 0x80, refusal.exception.code()]);
        }
    }
    let reply = whole(&out);
    assert_eq!((reply.transaction, reply.unit), (frame.transaction, frame.unit));
    out
}

fn means_the_same_encoded_again(frame: &Frame<'_>, request: &Request) {
    let mut out = Adu::new();
    let encoded = encode_request(&mut out, frame.transaction, frame.unit, request);
    assert_eq!(encoded, Ok(()));
    assert_eq!(whole(&out).pdu.len(), frame.pdu.len());
    assert_eq!(decode_request(whole(&out).pdu).as_ref(), Ok(request));
}

/// What a controller could answer: values that follow from the address, or an exception for every address that is a
/// multiple of 16.
fn made_up(request: &Request) -> Result<Reply, Exception> {
    match request {
        Request::ReadBits { address, .. }
        | Request::ReadWords { address, .. }
        | Request::WriteCoil { address, .. }
        | Request::WriteRegister { address, .. }
        | Request::WriteCoils { address, .. }
        | Request::WriteRegisters { address, .. }
            if address.is_multiple_of(16) =>
        {
            let [_, low] = address.to_be_bytes();
            Err(Exception::from_code(low))
        }
        Request::ReadBits { address, count, .. } => {
            Ok(Reply::Bits((0..*count).map(|index| (address ^ index).is_multiple_of(3)).collect()))
        }
        Request::ReadWords { address, count, .. } => {
            Ok(Reply::Words((0..*count).map(|index| address ^ index).collect()))
        }
        Request::WriteCoil { .. }
        | Request::WriteRegister { .. }
        | Request::WriteCoils { .. }
        | Request::WriteRegisters { .. } => Ok(Reply::Written),
    }
}

/// The only frame in `bytes`, which it must fill.
fn whole(bytes: &[u8]) -> Frame<'_> {
    let Split::Frame { frame, size } = split(bytes) else { panic!("not one frame: {bytes:02X?}") };
    assert_eq!(size, bytes.len());
    frame
}
