//! The packets of the SMSD's standard protocol.

use stepdrive_proto::smsd::{
    Framing, MAX_PACKET, Packet, PacketBuf, PacketReader, checksum, decode_reply, decode_request,
    encode_packet, encode_reply, encode_request,
};
use stepdrive_spec::smsd::standard::{
    Answer, COUNTERS, Code, Firmware, HALF_PACKET_TIMEOUT, LanParameters, MAX_DATA, Malformed, Reply,
    Request, Versions, Words,
};
use stepdrive_spec::smsd::status::Status;
use stepdrive_spec::time::Instant;

const FRAMINGS: [Framing; 2] = [Framing::Stuffed, Framing::Raw];

/// The packet behind everything: a request for the counters of errors.
const LAST: Packet<'static> = Packet { version: 2, packet_type: 14, id: 0xFE, data: &[] };

/// Bytes without start, stop and escapes, or what is wrong with them; and the identification.
type Found = (u8, Result<Vec<u8>, Malformed>);

/// What a host sends on a line of either framing: the packets do not depend on how the bytes were cut, one that is sent
/// behind them is found, on USB at once and on TCP after silence; every packet comes through on the other line, what is
/// understood means the same encoded again, and the host understands the reply. Read as what a controller sends, a reply
/// that is understood means the same encoded again.
///
/// # Panics
/// When that does not hold.
pub fn smsd_packets(data: &[u8]) {
    for framing in FRAMINGS {
        let at_once = found(framing, data, data.len().max(1));
        for chunk in [1, 7, MAX_PACKET] {
            assert_eq!(found(framing, data, chunk), at_once, "cut to {chunk} bytes");
        }
        for bytes in at_once.iter().filter_map(|(_, outcome)| outcome.as_ref().ok()) {
            let packet = packet(bytes);
            comes_through(&packet, bytes);
            means_the_same_encoded_again(&packet, bytes);
            is_read_by_a_host(&packet);
        }
    }
    let bytes = [data, &sent(Framing::Stuffed, &LAST)].concat();
    let last = found(Framing::Stuffed, &bytes, bytes.len()).pop();
    assert_eq!(last, Some((LAST.id, Ok(sent(Framing::Raw, &LAST)))));
}

/// What is in some bytes cut to chunks. Behind them, after silence, [`LAST`] is found.
fn found(framing: Framing, bytes: &[u8], chunk: usize) -> Vec<Found> {
    let mut reader = PacketReader::new(framing);
    let chunks = bytes.chunks(chunk);
    let all = chunks.flat_map(|bytes| taken(&mut reader, Instant::ZERO, bytes)).collect();
    let silence = Instant::ZERO + HALF_PACKET_TIMEOUT;
    assert!(reader.deadline().is_none_or(|deadline| deadline == silence));
    let last = taken(&mut reader, silence, &sent(framing, &LAST));
    assert_eq!(last, [(LAST.id, Ok(sent(Framing::Raw, &LAST)))]);
    all
}

fn taken(reader: &mut PacketReader, now: Instant, mut bytes: &[u8]) -> Vec<Found> {
    let mut all = Vec::new();
    while let Some(taken) = reader.take(now, &mut bytes) {
        assert!(taken.raw.len() <= MAX_PACKET && reader_is_right(&taken.packet, taken.raw));
        all.push((taken.id, taken.packet.map(|_| taken.raw.to_vec())));
    }
    assert!(bytes.is_empty());
    all
}

/// Whether a packet is one, and what is none has an error of its own.
fn reader_is_right(packet: &Result<Packet<'_>, Malformed>, raw: &[u8]) -> bool {
    match packet {
        Ok(packet) => {
            checksum(raw) == 0 && packet.data.len() <= MAX_DATA && raw.len() == 6 + packet.data.len()
        }
        Err(Malformed::Packet(code)) => matches!(code, Code::ErrorLen | Code::ErrorXor),
        Err(Malformed::Content(_)) => false,
    }
}

fn packet(bytes: &[u8]) -> Packet<'_> {
    let &[_, version, packet_type, id, _, _, ref data @ ..] = bytes else {
        panic!("no header: {bytes:02X?}")
    };
    Packet { version, packet_type, id, data }
}

fn sent(framing: Framing, packet: &Packet<'_>) -> Vec<u8> {
    let mut buf = PacketBuf::new();
    encode_packet(&mut buf, framing, packet);
    buf.to_vec()
}

fn comes_through(packet: &Packet<'_>, bytes: &[u8]) {
    for framing in FRAMINGS {
        let line = sent(framing, packet);
        let all = taken(&mut PacketReader::new(framing), Instant::ZERO, &line);
        assert_eq!(all, [(packet.id, Ok(bytes.to_vec()))]);
    }
}

fn means_the_same_encoded_again(packet: &Packet<'_>, bytes: &[u8]) {
    for firmware in [Firmware::Modbus, Firmware::Standard] {
        match decode_request(packet, firmware) {
            Ok(request) => {
                let mut buf = PacketBuf::new();
                encode_request(&mut buf, Framing::Raw, packet.version, packet.id, &request);
                assert_eq!(*buf, *bytes);
                is_answered(packet, &request);
            }
            Err(Malformed::Content(Code::ErrorLen | Code::ErrorNoCommand)) => {}
            // An attempt to log in is told its length whoever is logged in.
            Err(why) => assert_eq!((why, packet.packet_type), (Malformed::Packet(Code::ErrorLen), 0)),
        }
    }
}

/// A controller that makes up its answers: the host reads what was answered.
fn is_answered(packet: &Packet<'_>, request: &Request) {
    let reply = made_up(packet, request);
    assert_eq!(read_back(packet, &reply, request), reply);
}

/// What a controller could answer: values that follow from the request, or an error for every identification that is a
/// multiple of 16.
fn made_up(packet: &Packet<'_>, request: &Request) -> Reply {
    let answer = |code| Answer {
        status: Status::from_word(packet.version.into()),
        code,
        data: u32::from(packet.id) * 0x0101_0101,
    };
    if packet.id.is_multiple_of(16) {
        return Reply::Response(answer(Code::ErrorAccess));
    }
    match request {
        Request::ReadMemory { area } => {
            let words = (0..packet.id.into()).map(|line| line << 24 | line).collect::<Words>();
            Reply::Memory { area: *area, words }
        }
        Request::GetLan => Reply::Lan(LanParameters {
            mac: [packet.id; 6],
            ip: [0xFA; 4],
            subnet_mask: [0xFB; 4],
            gateway: [0xFE; 4],
            dns: [0; 4],
            port: 5000,
            dhcp: 1,
            id: packet.id.is_multiple_of(2).then_some(packet.id),
        }),
        Request::GetErrors => Reply::Errors([packet.id.into(); COUNTERS]),
        Request::GetVersions => {
            Reply::Versions(Versions { hardware: [6, packet.id.into()], firmware: [1, 3], protocol: 2 })
        }
        Request::Command(_) => Reply::Powerstep01(answer(Code::Ok)),
        Request::Authorise(_)
        | Request::WriteMemory { .. }
        | Request::SetLan(_)
        | Request::SetPassword(_) => Reply::Response(answer(Code::Ok)),
    }
}

/// The reply as the host reads it.
fn read_back(packet: &Packet<'_>, reply: &Reply, request: &Request) -> Reply {
    let mut buf = PacketBuf::new();
    encode_reply(&mut buf, Framing::Stuffed, packet.version, packet.id, reply);
    let mut reader = PacketReader::new(Framing::Stuffed);
    let taken = reader.take(Instant::ZERO, &mut &*buf).expect("a whole packet");
    let found = taken.packet.expect("a good packet");
    assert_eq!((found.version, found.id), (packet.version, packet.id));
    decode_reply(&found, request).expect("a reply to the request")
}

/// A host that takes the packet for the reply to every kind of request in turn.
fn is_read_by_a_host(packet: &Packet<'_>) {
    for request in [
        Request::Command(0),
        Request::ReadMemory { area: 0 },
        Request::ReadMemory { area: 3 },
        Request::GetLan,
        Request::GetErrors,
        Request::GetVersions,
    ] {
        match decode_reply(packet, &request) {
            Ok(reply) => assert_eq!(read_back(packet, &reply, &request), reply),
            Err(why) => assert!(!why.to_string().is_empty()),
        }
    }
}
