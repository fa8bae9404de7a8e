//! Properties of the packets of the SMSD's standard protocol, both ends against each other, and the framing against a
//! plain checker that looks at all bytes at once.

use proptest::array::{uniform4, uniform6, uniform17};
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::{Index, select};
use stepdrive_proto::smsd::{
    ESCAPE, Framing, MAX_PACKET, Packet, PacketBuf, PacketReader, START, STOP, checksum, decode_reply,
    decode_request, encode_packet, encode_reply, encode_request,
};
use stepdrive_spec::smsd::standard::{
    Answer, CODES, Code, Firmware, HALF_PACKET_TIMEOUT, LanParameters, MAX_DATA, Malformed, Reply, Request,
    Versions, Words,
};
use stepdrive_spec::smsd::status::Status;
use stepdrive_spec::time::Instant;

const FRAMINGS: [Framing; 2] = [Framing::Stuffed, Framing::Raw];

fn config() -> ProptestConfig {
    ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(256) }
}

/// What was taken: the identification, and the bytes or what is wrong with them.
type Found = (u8, Result<Vec<u8>, Malformed>);

/// Any byte, and more often one of those that matter to the framing.
fn any_byte() -> impl Strategy<Value = u8> {
    prop_oneof![2 => any::<u8>(), 1 => select(&[0xFA, 0xFB, 0xFE, 0x7A, 0x7B, 0x7E, 0x00][..])]
}

/// Version, type, identification and data of any packet.
fn any_packet() -> impl Strategy<Value = (u8, u8, u8, Vec<u8>)> {
    let long = (any_byte(), 0..=MAX_DATA).prop_map(|(byte, len)| vec![byte; len]);
    let data = prop_oneof![4 => vec(any_byte(), 0..40), 1 => long];
    (any::<u8>(), any::<u8>(), any_byte(), data)
}

fn any_words() -> impl Strategy<Value = Words> {
    prop_oneof![3 => vec(any::<u32>(), 0..5), 1 => vec(any::<u32>(), 0..=255)]
        .prop_map(|words| words.into_iter().collect())
}

fn any_lan(firmware: Firmware) -> impl Strategy<Value = LanParameters> {
    let octets = || uniform4(any_byte());
    let addresses = (uniform6(any_byte()), octets(), octets(), octets(), octets());
    (addresses, any::<u16>(), any::<u8>(), any::<u8>()).prop_map(move |(addresses, port, dhcp, id)| {
        let (mac, ip, subnet_mask, gateway, dns) = addresses;
        let id = (firmware == Firmware::Modbus).then_some(id);
        LanParameters { mac, ip, subnet_mask, gateway, dns, port, dhcp, id }
    })
}

fn any_firmware() -> impl Strategy<Value = Firmware> {
    select(&[Firmware::Modbus, Firmware::Standard][..])
}

fn any_request(firmware: Firmware) -> BoxedStrategy<Box<Request>> {
    prop_oneof![
        any::<u64>().prop_map(Request::Authorise),
        any::<u32>().prop_map(Request::Command),
        (0..=3_u8, any_words()).prop_map(|(area, words)| Request::WriteMemory { area, words }),
        (0..=3_u8).prop_map(|area| Request::ReadMemory { area }),
        any_lan(firmware).prop_map(Request::SetLan),
        Just(Request::GetLan),
        any::<u64>().prop_map(Request::SetPassword),
        Just(Request::GetErrors),
        Just(Request::GetVersions),
    ]
    .prop_map(Box::new)
    .boxed()
}

fn any_answer() -> impl Strategy<Value = Answer> {
    (any::<u16>(), 0..CODES.len(), any::<u32>()).prop_map(|(status, code, data)| Answer {
        status: Status::from_word(status),
        code: CODES[code].0,
        data,
    })
}

/// A reply that a controller may give to the request.
fn any_reply(request: &Request, firmware: Firmware) -> BoxedStrategy<Box<Reply>> {
    let values = match *request {
        Request::ReadMemory { area } => {
            any_words().prop_map(move |words| Reply::Memory { area, words }).boxed()
        }
        Request::GetLan => any_lan(firmware).prop_map(Reply::Lan).boxed(),
        Request::GetErrors => uniform17(any::<u32>()).prop_map(Reply::Errors).boxed(),
        Request::GetVersions => any::<([u16; 2], [u16; 2], u8)>()
            .prop_map(|(hardware, firmware, protocol)| {
                Reply::Versions(Versions { hardware, firmware, protocol })
            })
            .boxed(),
        Request::Authorise(_)
        | Request::Command(_)
        | Request::WriteMemory { .. }
        | Request::SetLan(_)
        | Request::SetPassword(_) => any_answer().prop_map(Reply::Powerstep01).boxed(),
    };
    prop_oneof![3 => values, 1 => any_answer().prop_map(Reply::Response)].prop_map(Box::new).boxed()
}

/// Boxed, as requests and replies are: they are large, and the strategies would hold many of them on the stack.
fn any_exchange() -> BoxedStrategy<Box<(Firmware, Request, Reply)>> {
    any_firmware()
        .prop_flat_map(|firmware| (Just(firmware), any_request(firmware)))
        .prop_flat_map(|(firmware, request)| {
            any_reply(&request, firmware)
                .prop_map(move |reply| Box::new((firmware, (*request).clone(), *reply)))
        })
        .boxed()
}

/// Bytes as they come on a line of this framing: packets, packets with something changed, left out or put in, and noise.
fn any_bytes(framing: Framing) -> impl Strategy<Value = Vec<u8>> {
    let packet = || any_packet().prop_map(move |packet| line(framing, &packet));
    let changed = (packet(), any::<Index>(), any_byte()).prop_map(|(mut bytes, place, byte)| {
        let place = place.index(bytes.len());
        bytes[place] = byte;
        bytes
    });
    let cut = (packet(), any::<Index>()).prop_map(|(mut bytes, place)| {
        bytes.remove(place.index(bytes.len()));
        bytes
    });
    let more = (packet(), any::<Index>(), vec(any_byte(), 1..3)).prop_map(|(mut bytes, place, more)| {
        let place = place.index(bytes.len());
        bytes.splice(place..place, more);
        bytes
    });
    let long =
        (any_byte(), 1000..1100_usize).prop_map(|(byte, len)| [&[START], &vec![byte; len][..]].concat());
    let part = prop_oneof![
        4 => packet(),
        2 => changed,
        2 => cut,
        2 => more,
        2 => vec(any_byte(), 0..20),
        1 => long,
    ];
    vec(part, 0..8).prop_map(|parts| parts.concat())
}

fn any_stream() -> impl Strategy<Value = (Framing, Vec<u8>)> {
    select(&FRAMINGS[..]).prop_flat_map(|framing| (Just(framing), any_bytes(framing)))
}

/// A packet as it goes onto a line.
fn line(framing: Framing, (version, packet_type, id, data): &(u8, u8, u8, Vec<u8>)) -> Vec<u8> {
    let packet = Packet { version: *version, packet_type: *packet_type, id: *id, data };
    let mut buf = PacketBuf::new();
    encode_packet(&mut buf, framing, &packet);
    buf.to_vec()
}

fn found(reader: &mut PacketReader, now: Instant, mut bytes: &[u8]) -> Vec<Found> {
    let mut found = Vec::new();
    while let Some(taken) = reader.take(now, &mut bytes) {
        assert!(taken.raw.len() <= MAX_PACKET);
        assert!(!matches!(taken.packet, Err(Malformed::Content(_))));
        found.push((taken.id, taken.packet.map(|_| taken.raw.to_vec())));
    }
    assert!(bytes.is_empty());
    found
}

/// What is in bytes that come in these chunks.
fn found_in_chunks(framing: Framing, bytes: &[u8], chunk: usize) -> Vec<Found> {
    let mut reader = PacketReader::new(framing);
    bytes.chunks(chunk).flat_map(|part| found(&mut reader, Instant::ZERO, part)).collect()
}

/// `bytes` with every `from` replaced.
fn replaced(bytes: &[u8], from: &[u8], to: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    let mut rest = bytes;
    while let Some((first, behind)) = rest.split_first() {
        if let Some(behind) = rest.strip_prefix(from) {
            out.extend_from_slice(to);
            rest = behind;
        } else {
            out.push(*first);
            rest = behind;
        }
    }
    out
}

/// Stuffing as the sheet, §3, has it for those who do it by replacing: FE first.
fn plainly_stuffed(bytes: &[u8]) -> Vec<u8> {
    let escaped = replaced(bytes, &[0xFE], &[0xFE, 0x7E]);
    let escaped = replaced(&escaped, &[0xFA], &[0xFE, 0x7A]);
    let escaped = replaced(&escaped, &[0xFB], &[0xFE, 0x7B]);
    [&[0xFA], &escaped[..], &[0xFB]].concat()
}

/// What stands between start and stop byte, with what it stands for: FE last.
fn plainly_unstuffed(bytes: &[u8]) -> Vec<u8> {
    let plain = replaced(bytes, &[0xFE, 0x7A], &[0xFA]);
    let plain = replaced(&plain, &[0xFE, 0x7B], &[0xFB]);
    replaced(&plain, &[0xFE, 0x7E], &[0xFE])
}

/// How many bytes these stand for, and whether every escape among them is one.
fn plainly_counted(bytes: &[u8]) -> (usize, bool) {
    let (mut count, mut sound, mut rest) = (0, true, bytes);
    while let Some((first, behind)) = rest.split_first() {
        rest = if *first == ESCAPE { behind.get(1..).unwrap_or_default() } else { behind };
        sound &= *first != ESCAPE || matches!(behind, [0x7A | 0x7B | 0x7E, ..]);
        count += usize::from(*first != ESCAPE || !behind.is_empty());
    }
    (count, sound)
}

/// What is in a stuffed stream.
fn plainly_found_stuffed(bytes: &[u8]) -> Vec<Result<Vec<u8>, Malformed>> {
    let packets = bytes.split(|byte| *byte == START).skip(1);
    let ended = packets.filter_map(|part| Some(&part[..part.iter().position(|byte| *byte == STOP)?]));
    let checked = |part: &[u8]| match plainly_counted(part) {
        (6..=MAX_PACKET, false) => Err(Malformed::Packet(Code::ErrorXor)),
        (_, false) => Err(Malformed::Packet(Code::ErrorLen)),
        (_, true) => plainly_checked(&plainly_unstuffed(part)).1,
    };
    ended.map(checked).collect()
}

/// What is in a raw stream.
fn plainly_found_raw(mut bytes: &[u8]) -> Vec<Found> {
    let mut found = Vec::new();
    while bytes.len() >= 6 {
        let length = usize::from(bytes[4]) + 256 * usize::from(bytes[5]);
        if length > MAX_DATA {
            found.push((bytes[3], Err(Malformed::Packet(Code::ErrorLen))));
            break;
        }
        if bytes.len() < 6 + length {
            break;
        }
        found.push(plainly_checked(&bytes[..6 + length]));
        bytes = &bytes[6 + length..];
    }
    found
}

/// What becomes of a packet of these bytes.
fn plainly_checked(bytes: &[u8]) -> Found {
    let id = bytes.get(3).copied().unwrap_or(0);
    let sum = bytes.iter().map(|byte| u32::from(*byte)).sum::<u32>();
    let wrong = |code| Err(Malformed::Packet(code));
    let outcome = match bytes.len() {
        0..6 | 1031.. => wrong(Code::ErrorLen),
        _ if !sum.is_multiple_of(256) => wrong(Code::ErrorXor),
        len if len != 6 + usize::from(bytes[4]) + 256 * usize::from(bytes[5]) => wrong(Code::ErrorLen),
        _ => Ok(bytes.to_vec()),
    };
    (id, outcome)
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn any_packet_comes_through_however_it_is_cut(packet in any_packet(), chunk in 1..20_usize) {
        let raw = line(Framing::Raw, &packet);
        let (version, packet_type, id, data) = &packet;
        prop_assert_eq!(&raw[1..4], &[*version, *packet_type, *id]);
        prop_assert_eq!(&raw[6..], &data[..]);
        prop_assert_eq!(checksum(&raw[1..]), raw[0]);
        for framing in FRAMINGS {
            let sent = line(framing, &packet);
            prop_assert_eq!(found_in_chunks(framing, &sent, chunk), vec![(*id, Ok(raw.clone()))]);
        }
    }

    #[test]
    fn a_packet_cut_at_any_byte_is_the_same(packet in any_packet(), place in any::<Index>()) {
        for framing in FRAMINGS {
            let sent = line(framing, &packet);
            let (first, second) = sent.split_at(place.index(sent.len()));
            let mut reader = PacketReader::new(framing);
            prop_assert_eq!(found(&mut reader, Instant::ZERO, first), vec![]);
            prop_assert_eq!(reader.is_empty(), first.is_empty());
            prop_assert_eq!(found(&mut reader, Instant::ZERO, second).len(), 1);
            prop_assert!(reader.is_empty());
        }
    }

    #[test]
    fn stuffing_in_one_pass_is_replacing_in_the_right_order(packet in any_packet()) {
        let raw = line(Framing::Raw, &packet);
        let sent = line(Framing::Stuffed, &packet);
        prop_assert_eq!(&sent, &plainly_stuffed(&raw));
        prop_assert_eq!(plainly_unstuffed(&sent[1..sent.len() - 1]), raw);
    }

    #[test]
    fn any_request_and_any_reply_mean_the_same_at_the_other_end(
        exchange in any_exchange(),
        version in any::<u8>(),
        id in any_byte(),
    ) {
        let (firmware, request, reply) = *exchange;
        let mut buf = PacketBuf::new();
        for framing in FRAMINGS {
            let mut reader = PacketReader::new(framing);
            encode_request(&mut buf, framing, version, id, &request);
            let packet = reader.take(Instant::ZERO, &mut &*buf).expect("a packet").packet.expect("a good one");
            prop_assert_eq!((packet.version, packet.packet_type, packet.id), (version, request.packet_type().code(), id));
            prop_assert_eq!(decode_request(&packet, firmware), Ok(request.clone()));

            encode_reply(&mut buf, framing, version, id, &reply);
            let packet = reader.take(Instant::ZERO, &mut &*buf).expect("a packet").packet.expect("a good one");
            prop_assert_eq!((packet.version, packet.id), (version, id));
            prop_assert_eq!(decode_reply(&packet, &request), Ok(reply.clone()));
        }
    }

    #[test]
    fn any_content_is_a_request_that_means_the_same_encoded_again_or_is_refused(
        (version, packet_type, id, data) in any_packet(),
        known in 0..17_u8,
        firmware in any_firmware(),
    ) {
        for packet_type in [packet_type, known] {
            let packet = Packet { version, packet_type, id, data: &data };
            match decode_request(&packet, firmware) {
                Ok(request) => {
                    let mut buf = PacketBuf::new();
                    encode_request(&mut buf, Framing::Raw, version, id, &request);
                    prop_assert_eq!(buf.to_vec(), line(Framing::Raw, &(version, packet_type, id, data.clone())));
                }
                Err(Malformed::Content(Code::ErrorLen | Code::ErrorNoCommand)) => {}
                Err(Malformed::Packet(Code::ErrorLen)) if packet_type == 0 => {}
                Err(other) => prop_assert!(false, "{:?}", other),
            }
        }
    }

    #[test]
    fn what_is_found_does_not_depend_on_how_the_bytes_are_cut((framing, bytes) in any_stream(), chunk in 1..50_usize) {
        let at_once = found_in_chunks(framing, &bytes, bytes.len().max(1));
        prop_assert_eq!(&found_in_chunks(framing, &bytes, 1), &at_once);
        prop_assert_eq!(&found_in_chunks(framing, &bytes, chunk), &at_once);
    }

    #[test]
    fn what_is_found_on_usb_is_what_a_plain_checker_finds(bytes in any_bytes(Framing::Stuffed)) {
        let found = found_in_chunks(Framing::Stuffed, &bytes, bytes.len().max(1));
        let found: Vec<_> = found.into_iter().map(|(_, outcome)| outcome).collect();
        prop_assert_eq!(found, plainly_found_stuffed(&bytes));
    }

    #[test]
    fn what_is_found_on_tcp_is_what_a_plain_checker_finds(bytes in any_bytes(Framing::Raw)) {
        let found = found_in_chunks(Framing::Raw, &bytes, bytes.len().max(1));
        prop_assert_eq!(found, plainly_found_raw(&bytes));
    }

    #[test]
    fn a_good_packet_behind_any_bytes_is_found_on_usb(bytes in any_bytes(Framing::Stuffed), packet in any_packet()) {
        let bytes = [bytes, line(Framing::Stuffed, &packet)].concat();
        let found = found_in_chunks(Framing::Stuffed, &bytes, bytes.len());
        prop_assert_eq!(found.last(), Some(&(packet.2, Ok(line(Framing::Raw, &packet)))));
    }

    #[test]
    fn a_good_packet_after_any_bytes_and_silence_is_found(
        (framing, bytes) in any_stream(),
        packet in any_packet(),
        asked in any::<bool>(),
    ) {
        let mut reader = PacketReader::new(framing);
        found(&mut reader, Instant::ZERO, &bytes);
        let silence = Instant::ZERO + HALF_PACKET_TIMEOUT;
        prop_assert!(reader.deadline().is_none_or(|deadline| deadline == silence));
        if asked {
            reader.expire(silence);
            prop_assert!(reader.is_empty());
        }
        let expected = vec![(packet.2, Ok(line(Framing::Raw, &packet)))];
        prop_assert_eq!(found(&mut reader, silence, &line(framing, &packet)), expected);
    }

    #[test]
    fn any_packet_read_as_a_reply_means_the_same_encoded_again_or_is_told_to_be_none(
        (version, packet_type, id, data) in any_packet(),
        request in any_firmware().prop_flat_map(any_request),
        own_type in any::<bool>(),
    ) {
        let packet_type = if own_type { request.packet_type().code() } else { packet_type };
        let packet = Packet { version, packet_type, id, data: &data };
        match decode_reply(&packet, &request) {
            Ok(reply) => {
                let mut buf = PacketBuf::new();
                encode_reply(&mut buf, Framing::Raw, version, id, &reply);
                prop_assert_eq!(&buf[1..6], &line(Framing::Raw, &(version, packet_type, id, data.clone()))[1..6]);
                let packet = Packet { version, packet_type, id, data: &buf[6..] };
                prop_assert_eq!(decode_reply(&packet, &request), Ok(reply));
            }
            Err(why) => prop_assert!(!why.to_string().is_empty()),
        }
    }
}
