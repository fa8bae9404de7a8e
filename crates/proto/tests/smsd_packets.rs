//! The packets of the SMSD's standard protocol: every vector of the sheet of facts, and every type, both ends.

use stepdrive_proto::smsd::{
    Framing, Packet, PacketBuf, PacketReader, ReplyError, Taken, checksum, decode_reply, decode_request,
    encode_greeting, encode_packet, encode_reply, encode_request,
};
use stepdrive_spec::smsd::instructions::{Instruction, Opcode};
use stepdrive_spec::smsd::standard::{
    Answer, Code, Firmware, LanParameters, MAX_DATA, Malformed, PACKET_TYPES, PacketType, Reply, Request,
    Versions, Words,
};
use stepdrive_spec::smsd::status::Status;
use stepdrive_spec::time::Instant;

/// Hi-Z and ready.
const AT_REST: u16 = 0x03;
/// Energised, ready, forward.
const HOLDING: u16 = 0x12;

/// What the sheet has the controller's LAN parameters leave the factory with, standard firmware.
const LAN: LanParameters = LanParameters {
    mac: [0x00, 0xF8, 0xDC, 0x3F, 0x00, 0x00],
    ip: [192, 168, 1, 2],
    subnet_mask: [255, 255, 0, 0],
    gateway: [192, 168, 1, 1],
    dns: [0; 4],
    port: 5000,
    dhcp: 1,
    id: None,
};
/// The same with the Modbus firmware.
const MODBUS_LAN: LanParameters = LanParameters { port: 502, id: Some(1), ..LAN };

/// The packet of these bytes, which come raw and are one.
fn packet(bytes: &[u8]) -> Packet<'_> {
    let &[_, version, packet_type, id, _, _, ref data @ ..] = bytes else {
        panic!("no header: {bytes:02X?}")
    };
    let packet = Packet { version, packet_type, id, data };
    let mut reader = PacketReader::new(Framing::Raw);
    let taken = reader.take(Instant::ZERO, &mut &*bytes).expect("a whole packet");
    assert_eq!(taken, Taken { id, packet: Ok(packet), raw: bytes });
    packet
}

fn command(opcode: Opcode, data: i32) -> Request {
    Request::Command(Instruction::with_position(opcode, data).word())
}

fn words(words: &[u32]) -> Words {
    words.iter().copied().collect()
}

fn answer(status: u16, code: Code, data: u32) -> Answer {
    Answer { status: Status::from_word(status), code, data }
}

/// A packet and the request in it.
type RequestVector = (&'static [u8], Request);

/// The requests of the sheet, §2, §3 and §7, in its order; the last three are made after its §4.
fn request_vectors() -> Vec<RequestVector> {
    use Opcode::{GetMinSpeed, GetStatusAndClr, GoTo, GoToF, MoveF, SetMaxSpeed, SetMode, StatusInEvent};
    vec![
        // XOR_SUM VER TYPE  ID    LENGTH      DATA
        (&[0x10, 0x02, 0x10, 0xDE, 0x00, 0x00], Request::GetVersions),
        (&[0xD6, 0x02, 0x02, 0x02, 0x04, 0x00, 0x20, 0x00, 0x00, 0x00], command(StatusInEvent, 0)),
        (&[0xBC, 0x02, 0x02, 0xD9, 0x04, 0x00, 0x60, 0x03, 0x00, 0x00], command(GetMinSpeed, 0)),
        (&[0xF3, 0x02, 0x0C, 0xFF, 0x00, 0x00], Request::GetLan),
        (&[0xF1, 0x02, 0x0E, 0xFF, 0x00, 0x00], Request::GetErrors),
        (
            &[0xB8, 0x01, 0x00, 0x7F, 0x08, 0x00, 0x01, 0x23, 0x45, 0x67, 0x89, 0xAB, 0xCD, 0xEF],
            Request::Authorise(0xEFCD_AB89_6745_2301),
        ),
        (
            &[0x37, 0x02, 0x00, 0xFF, 0x08, 0x00, 0xEF, 0xCD, 0xAB, 0x89, 0x67, 0x45, 0x23, 0x01],
            Request::Authorise(0x0123_4567_89AB_CDEF),
        ),
        (&[0x06, 0x02, 0x02, 0x01, 0x04, 0x00, 0x60, 0x90, 0x01, 0x00], command(SetMaxSpeed, 100)),
        (&[0x27, 0x02, 0x02, 0x05, 0x04, 0x00, 0x30, 0xF4, 0xA8, 0x00], command(SetMode, 10813)),
        (&[0xFA, 0x02, 0x02, 0x03, 0x04, 0x00, 0x00, 0xFD, 0xFF, 0xFF], command(MoveF, -1)),
        (&[0x2A, 0x02, 0x02, 0xFE, 0x04, 0x00, 0xD0, 0x00, 0x00, 0x00], command(GetStatusAndClr, 0)),
        (&[0x90, 0x02, 0x02, 0x09, 0x04, 0x00, 0x60, 0xFC, 0x03, 0x00], command(SetMaxSpeed, 255)),
        (&[0xCF, 0x02, 0x02, 0x09, 0x04, 0x00, 0x20, 0x01, 0xFC, 0x03], command(GoToF, 0xFF00)),
        (&[0xAE, 0x02, 0x02, 0x09, 0x04, 0x00, 0xC0, 0x01, 0x00, 0x80], command(GoTo, -2_097_152)),
        (
            &[0xEC, 0x02, 0x0D, 0x0A, 0x08, 0x00, 0xFA, 0xFB, 0xFE, 0x00, 0x00, 0x00, 0x00, 0x00],
            Request::SetPassword(0xFE_FBFA),
        ),
        (&[0xF3, 0x02, 0x06, 0x05, 0x00, 0x00], Request::WriteMemory { area: 3, words: words(&[]) }),
        (
            &[0xFC, 0x02, 0x04, 0x05, 0x08, 0x00, 0x60, 0x90, 0x01, 0x00, 0x00, 0x00, 0x00, 0x00],
            Request::WriteMemory { area: 1, words: words(&[0x0001_9060, 0]) },
        ),
    ]
}

/// The LAN parameters of the sheet, §9, in a request to set them.
fn lan_vectors() -> [(&'static [u8], Firmware, LanParameters); 2] {
    [
        (
            &[
                // XOR_SUM VER TYPE ID LENGTH
                0x51, 0x02, 0x0B, 0x07, 0x19, 0x00, //
                0x00, 0xF8, 0xDC, 0x3F, 0x00, 0x00, // mac
                0xC0, 0xA8, 0x01, 0x02, 0xFF, 0xFF, 0x00, 0x00, // ip, sn
                0xC0, 0xA8, 0x01, 0x01, 0x00, 0x00, 0x00, 0x00, // gw, dns
                0x88, 0x13, 0x01, // port, dhcp
            ],
            Firmware::Standard,
            LAN,
        ),
        (
            &[
                // XOR_SUM VER TYPE ID LENGTH
                0xF3, 0x02, 0x0B, 0x07, 0x1A, 0x00, //
                0x00, 0xF8, 0xDC, 0x3F, 0x00, 0x00, // mac
                0xC0, 0xA8, 0x01, 0x02, 0xFF, 0xFF, 0x00, 0x00, // ip, sn
                0xC0, 0xA8, 0x01, 0x01, 0x00, 0x00, 0x00, 0x00, // gw, dns
                0xF6, 0x01, 0x01, 0x01, // port, dhcp, unitID
            ],
            Firmware::Modbus,
            MODBUS_LAN,
        ),
    ]
}

/// Replies, the requests they answer, and their packets. The first is of the sheet, §2; the others are made after its §4 and
/// §6.
fn reply_vectors() -> Vec<(&'static [u8], Request, Reply)> {
    use Opcode::{GetAbsPos, GetRele, MoveF};
    let versions = Versions { hardware: [6, 1], firmware: [1, 3], protocol: 2 };
    vec![
        // XOR_SUM VER TYPE  ID    LENGTH      STATUS      CODE  RETURN_DATA
        (
            &[0xF2, 0x02, 0x01, 0x00, 0x07, 0x00, 0x03, 0x00, 0x01, 0x00, 0x00, 0x00, 0x00],
            Request::Authorise(0),
            Reply::Response(answer(AT_REST, Code::OkAccess, 0)),
        ),
        (
            &[0xCE, 0x02, 0x02, 0x09, 0x07, 0x00, 0x12, 0x00, 0x10, 0xFF, 0xFF, 0xFF, 0xFF],
            command(GetAbsPos, 0),
            Reply::Powerstep01(answer(HOLDING, Code::GetAbsPos, u32::MAX)),
        ),
        (
            &[0x5A, 0x02, 0x02, 0x09, 0x07, 0x00, 0x92, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00],
            command(MoveF, 1),
            Reply::Powerstep01(answer(HOLDING | 0x80, Code::Ok, 0)),
        ),
        (
            &[0xC5, 0x02, 0x01, 0x09, 0x07, 0x00, 0x12, 0x00, 0x16, 0x00, 0x00, 0x00, 0x00],
            command(GetRele, 0),
            Reply::Response(answer(HOLDING, Code::StatusReleSet, 0)),
        ),
        (
            &[0xED, 0x02, 0x01, 0x00, 0x07, 0x00, 0x03, 0x00, 0x06, 0x00, 0x00, 0x00, 0x00],
            Request::GetErrors,
            Reply::Response(answer(AT_REST, Code::ErrorLen, 0)),
        ),
        // XOR_SUM VER TYPE  ID    LENGTH      words
        (
            &[0xF8, 0x02, 0x08, 0x05, 0x08, 0x00, 0x60, 0x90, 0x01, 0x00, 0x00, 0x00, 0x00, 0x00],
            Request::ReadMemory { area: 1 },
            Reply::Memory { area: 1, words: words(&[0x0001_9060, 0]) },
        ),
        // XOR_SUM VER TYPE  ID    LENGTH      hardware                firmware                protocol
        (
            &[0xCF, 0x02, 0x10, 0x09, 0x09, 0x00, 0x06, 0x00, 0x01, 0x00, 0x01, 0x00, 0x03, 0x00, 0x02],
            Request::GetVersions,
            Reply::Versions(versions),
        ),
    ]
}

#[test]
fn every_request_of_the_sheet_reads_and_prints_on_both_ends() {
    for (bytes, request) in request_vectors() {
        let mut buf = PacketBuf::new();
        let packet = packet(bytes);
        encode_request(&mut buf, Framing::Raw, packet.version, packet.id, &request);
        assert_eq!(format!("{:02X?}", &*buf), format!("{bytes:02X?}"));
        for firmware in [Firmware::Modbus, Firmware::Standard] {
            assert_eq!(decode_request(&packet, firmware).as_ref(), Ok(&request), "{bytes:02X?}");
        }
    }
}

#[test]
fn every_reply_reads_and_prints_on_both_ends() {
    for (bytes, request, reply) in reply_vectors() {
        let mut buf = PacketBuf::new();
        let packet = packet(bytes);
        encode_reply(&mut buf, Framing::Raw, packet.version, packet.id, &reply);
        assert_eq!(format!("{:02X?}", &*buf), format!("{bytes:02X?}"));
        assert_eq!(decode_reply(&packet, &request).as_ref(), Ok(&reply), "{bytes:02X?}");
    }
}

#[test]
fn all_bytes_of_a_packet_add_up_to_0() {
    let packets = request_vectors().into_iter().map(|(bytes, _)| bytes);
    for bytes in packets.chain(reply_vectors().into_iter().map(|(bytes, ..)| bytes)) {
        assert_eq!((checksum(&bytes[1..]), checksum(bytes)), (bytes[0], 0), "{bytes:02X?}");
    }
    assert_eq!(checksum(&[]), 0);
}

#[test]
fn lan_parameters_have_a_unit_identifier_with_the_modbus_firmware_only() {
    for (bytes, firmware, lan) in lan_vectors() {
        let packet = packet(bytes);
        let mut buf = PacketBuf::new();
        encode_request(&mut buf, Framing::Raw, 2, 7, &Request::SetLan(lan));
        assert_eq!(format!("{:02X?}", &*buf), format!("{bytes:02X?}"));
        for other in [Firmware::Modbus, Firmware::Standard] {
            let wrong = Malformed::Content(Code::ErrorLen);
            let expected = if other == firmware { Ok(Request::SetLan(lan)) } else { Err(wrong) };
            assert_eq!(decode_request(&packet, other), expected);
        }

        encode_reply(&mut buf, Framing::Raw, 2, 7, &Reply::Lan(lan));
        let reply = self::packet(&buf);
        assert_eq!((reply.packet_type, reply.data), (12, packet.data));
        assert_eq!(decode_reply(&reply, &Request::GetLan), Ok(Reply::Lan(lan)));
    }
}

#[test]
fn the_counters_stand_in_the_reply_in_their_order() {
    let counters = std::array::from_fn(|place| 0xFA00_0000 + u32::try_from(place).expect("17 counters"));
    let mut buf = PacketBuf::new();
    encode_reply(&mut buf, Framing::Raw, 2, 9, &Reply::Errors(counters));
    assert_eq!(buf[1..10], [0x02, 0x0E, 0x09, 0x44, 0x00, 0x00, 0x00, 0x00, 0xFA]);
    assert_eq!(buf[6 + 64..], [0x10, 0x00, 0x00, 0xFA]);
    assert_eq!(decode_reply(&packet(&buf), &Request::GetErrors), Ok(Reply::Errors(counters)));
}

#[test]
fn the_controller_greets_with_a_request_without_data() {
    let mut buf = PacketBuf::new();
    encode_greeting(&mut buf, 2);
    //                 XOR_SUM VER TYPE  ID    LENGTH
    assert_eq!(*buf, [0xFE, 0x02, 0x00, 0x00, 0x00, 0x00]);
    assert!(packet(&buf).is_greeting());
    for (bytes, _) in request_vectors() {
        assert!(!packet(bytes).is_greeting(), "{bytes:02X?}");
    }
}

#[test]
fn the_greeting_is_no_request_and_answers_none() {
    let greeting = Packet { version: 2, packet_type: 0, id: 0, data: &[] };
    assert_eq!(decode_request(&greeting, Firmware::Standard), Err(Malformed::Packet(Code::ErrorLen)));
    assert_eq!(decode_reply(&greeting, &Request::Authorise(0)), Err(ReplyError::Type { found: 0 }));
}

#[test]
fn a_type_that_is_not_for_hosts_is_no_command() {
    let data = [0; 8];
    for packet_type in 0..=u8::MAX {
        let outcome =
            decode_request(&Packet { version: 2, packet_type, id: 0, data: &data }, Firmware::Modbus);
        let unknown = outcome == Err(Malformed::Content(Code::ErrorNoCommand));
        assert_eq!(unknown, !matches!(packet_type, 0 | 2..=14 | 16), "type {packet_type}");
    }
}

#[test]
fn data_that_are_not_as_long_as_their_type_has_them_are_refused() {
    let data = [0; MAX_DATA];
    for info in PACKET_TYPES.iter().filter(|info| info.packet_type != PacketType::Response) {
        for firmware in [Firmware::Modbus, Firmware::Standard] {
            for len in 0..=MAX_DATA {
                let packet = Packet { version: 2, packet_type: info.code, id: 0, data: &data[..len] };
                let expected = if takes(info.packet_type, firmware, len) {
                    Ok(info.packet_type)
                } else {
                    Err(wrong_length(info.packet_type))
                };
                let found = decode_request(&packet, firmware).map(|request| request.packet_type());
                assert_eq!(found, expected, "{} {len}", info.name);
            }
        }
    }
}

/// An attempt to log in is told its length whoever is logged in (decision 25).
fn wrong_length(packet_type: PacketType) -> Malformed {
    if packet_type == PacketType::Request {
        Malformed::Packet(Code::ErrorLen)
    } else {
        Malformed::Content(Code::ErrorLen)
    }
}

/// Whether a request of this type has `len` bytes of data (sheet §4).
fn takes(packet_type: PacketType, firmware: Firmware, len: usize) -> bool {
    match packet_type {
        PacketType::Request | PacketType::PasswordSet => len == 8,
        PacketType::Powerstep01 => len == 4,
        PacketType::WriteMem0 | PacketType::WriteMem1 | PacketType::WriteMem2 | PacketType::WriteMem3 => {
            len <= 1020 && len.is_multiple_of(4)
        }
        PacketType::ConfigSet => len == firmware.lan_size(),
        PacketType::Response
        | PacketType::ReadMem0
        | PacketType::ReadMem1
        | PacketType::ReadMem2
        | PacketType::ReadMem3
        | PacketType::ConfigGet
        | PacketType::ErrorGet
        | PacketType::VersionGet => len == 0,
    }
}

#[test]
fn a_host_takes_a_status_structure_of_either_type_for_any_request() {
    let data = [HOLDING.to_le_bytes()[0], 0xAB, 0, 1, 2, 3, 4];
    let expected = answer(HOLDING, Code::Ok, 0x0403_0201);
    for (_, request) in request_vectors() {
        let reply =
            |packet_type| decode_reply(&Packet { version: 1, packet_type, id: 0, data: &data }, &request);
        assert_eq!(reply(1), Ok(Reply::Response(expected)));
        assert_eq!(reply(2), Ok(Reply::Powerstep01(expected)));
    }
}

#[test]
fn a_code_that_nobody_has_described_comes_with_its_status_and_value() {
    for code in 24..=u8::MAX {
        let packet = Packet { version: 2, packet_type: 1, id: 0, data: &[0x03, 0, code, 5, 0, 0, 0] };
        let unknown = ReplyError::UnknownCode { code, status: Status::from_word(AT_REST), data: 5 };
        assert_eq!(decode_reply(&packet, &Request::GetLan), Err(unknown));
    }
}

#[test]
fn a_packet_of_another_type_answers_nothing() {
    for packet_type in (0..=u8::MAX).filter(|packet_type| !matches!(packet_type, 1 | 2 | 7)) {
        let packet = Packet { version: 2, packet_type, id: 0, data: &[] };
        let outcome = decode_reply(&packet, &Request::ReadMemory { area: 0 });
        assert_eq!(outcome, Err(ReplyError::Type { found: packet_type }));
    }
    // The type of the request, which is answered with a status structure.
    let packet = Packet { version: 2, packet_type: 13, id: 0, data: &[0; 8] };
    assert_eq!(decode_reply(&packet, &Request::SetPassword(0)), Err(ReplyError::Type { found: 13 }));
}

#[test]
fn a_reply_of_another_length_is_told_with_its_length() {
    let data = [0; MAX_DATA];
    for (request, packet_type, sizes, expected) in [
        (Request::GetErrors, 1, vec![7], "7"),
        (Request::GetErrors, 14, vec![68], "68"),
        (Request::GetVersions, 16, vec![9], "9"),
        (Request::GetLan, 12, vec![25, 26], "25 or 26"),
        (
            Request::ReadMemory { area: 3 },
            10,
            (0..=1020).step_by(4).collect(),
            "at most 1020, a multiple of 4,",
        ),
    ] {
        for len in 0..=MAX_DATA {
            let packet = Packet { version: 2, packet_type, id: 0, data: &data[..len] };
            let wrong = Err(ReplyError::Length { expected, found: len });
            assert_eq!(decode_reply(&packet, &request) == wrong, !sizes.contains(&len), "{expected}: {len}");
        }
    }
}

#[test]
fn errors_say_what_is_wrong_with_a_reply() {
    let status = Status::from_word(0);
    for (error, text) in [
        (ReplyError::Type { found: 15 }, "the reply is a packet of unknown type, 15"),
        (
            ReplyError::Type { found: 12 },
            "the reply is a packet of type 12, CODE_CMD_CONFIG_GET, which does not answer the request",
        ),
        (
            ReplyError::Length { expected: "25 or 26", found: 24 },
            "the reply has 24 bytes of data, and 25 or 26 were expected",
        ),
        (
            ReplyError::UnknownCode { code: 24, status, data: 0 },
            "the reply has an unknown code, 24: the controller may be newer than this driver",
        ),
    ] {
        assert_eq!(error.to_string(), text);
    }
}

#[test]
fn areas_above_3_count_as_3() {
    let mut buf = PacketBuf::new();
    encode_reply(&mut buf, Framing::Raw, 2, 0, &Reply::Memory { area: 9, words: words(&[]) });
    assert_eq!(buf[2], 10);
    encode_request(&mut buf, Framing::Raw, 2, 0, &Request::ReadMemory { area: 9 });
    assert_eq!(buf[2], 10);
}

#[test]
fn data_beyond_1024_bytes_are_left_out_of_a_packet() {
    let mut buf = PacketBuf::new();
    encode_packet(&mut buf, Framing::Raw, &Packet { version: 2, packet_type: 3, id: 0, data: &[1; 1025] });
    assert_eq!((buf.len(), &buf[4..6]), (1030, &[0x00, 0x04][..]));
    assert_eq!(packet(&buf).data, [1; 1024]);
}
