//! How packets of the SMSD's standard protocol are found in a stream: start, stop, escapes, lengths and time.

use core::time::Duration;
use stepdrive_proto::smsd::{Framing, MAX_PACKET, Packet, PacketBuf, PacketReader, encode_packet};
use stepdrive_spec::smsd::standard::{Code, HALF_PACKET_TIMEOUT, Malformed};
use stepdrive_spec::time::Instant;

//                      XOR_SUM VER TYPE  ID    LENGTH
const ERROR_GET: [u8; 6] = [0xF1, 0x02, 0x0E, 0xFF, 0x00, 0x00];
const CONFIG_GET: [u8; 6] = [0xF3, 0x02, 0x0C, 0xFF, 0x00, 0x00];
//                                 XOR_SUM VER TYPE  ID    LENGTH
const STUFFED_ERROR_GET: [u8; 8] = [0xFA, 0xF1, 0x02, 0x0E, 0xFF, 0x00, 0x00, 0xFB];

const WRONG_SUM: Malformed = Malformed::Packet(Code::ErrorXor);
const WRONG_LENGTH: Malformed = Malformed::Packet(Code::ErrorLen);

/// What was taken: the identification, and the bytes or what is wrong with them.
type Found = (u8, Result<Vec<u8>, Malformed>);

fn good(bytes: &[u8]) -> Found {
    (bytes[3], Ok(bytes.to_vec()))
}

fn found(reader: &mut PacketReader, now: Instant, mut bytes: &[u8]) -> Vec<Found> {
    let mut found = Vec::new();
    while let Some(taken) = reader.take(now, &mut bytes) {
        found.push((taken.id, taken.packet.map(|_| taken.raw.to_vec())));
    }
    assert!(bytes.is_empty());
    found
}

/// What is in bytes that come at once, and the same one by one.
fn all(framing: Framing, bytes: &[u8]) -> Vec<Found> {
    let mut reader = PacketReader::new(framing);
    let one_by_one: Vec<Found> =
        bytes.iter().flat_map(|byte| found(&mut reader, Instant::ZERO, &[*byte])).collect();
    let at_once = found(&mut PacketReader::new(framing), Instant::ZERO, bytes);
    assert_eq!(at_once, one_by_one);
    at_once
}

fn stuffed(bytes: &[u8]) -> Vec<Found> {
    all(Framing::Stuffed, bytes)
}

fn raw(bytes: &[u8]) -> Vec<Found> {
    all(Framing::Raw, bytes)
}

/// A packet as it goes onto a line.
fn line(framing: Framing, id: u8, data: &[u8]) -> Vec<u8> {
    let mut buf = PacketBuf::new();
    encode_packet(&mut buf, framing, &Packet { version: 2, packet_type: 2, id, data });
    buf.to_vec()
}

fn ms(millis: u64) -> Instant {
    Instant::ZERO + Duration::from_millis(millis)
}

#[test]
fn the_stuffed_vector_of_the_sheet_goes_both_ways() {
    let sent = line(Framing::Stuffed, 0xFE, &[0xD0, 0x00, 0x00, 0x00]);
    //                       start XOR   VER   TYPE  ID          LENGTH      DATA                    stop
    let expected: [u8; 13] = [0xFA, 0x2A, 0x02, 0x02, 0xFE, 0x7E, 0x04, 0x00, 0xD0, 0x00, 0x00, 0x00, 0xFB];
    assert_eq!(sent, expected);
    assert_eq!(stuffed(&sent), [good(&[0x2A, 0x02, 0x02, 0xFE, 0x04, 0x00, 0xD0, 0x00, 0x00, 0x00])]);
}

#[test]
fn a_checksum_that_is_one_of_the_three_bytes_is_stuffed_too() {
    for (data, sum) in [([0x00, 0xFD, 0xFF, 0xFF], 0xFA), ([0, 0, 0, 0xFA], 0xFB), ([0, 0, 0, 0xF7], 0xFE)] {
        let sent = line(Framing::Stuffed, 3, &data);
        assert_eq!(sent[..3], [0xFA, 0xFE, sum ^ 0x80]);
        let plain = line(Framing::Raw, 3, &data);
        assert_eq!(plain[0], sum);
        assert_eq!(stuffed(&sent), [good(&plain)]);
    }
}

#[test]
fn the_three_bytes_in_the_data_are_stuffed_and_come_back() {
    let data = [0xFA, 0xFB, 0xFE, 0x7A, 0x7B, 0x7E];
    let sent = line(Framing::Stuffed, 0, &data);
    assert_eq!(sent[7..], [0xFE, 0x7A, 0xFE, 0x7B, 0xFE, 0x7E, 0x7A, 0x7B, 0x7E, 0xFB]);
    assert_eq!(stuffed(&sent), [good(&line(Framing::Raw, 0, &data))]);
}

#[test]
fn a_host_that_escapes_in_the_wrong_order_sends_wrong_checksums() {
    // FA replaced before FE: FE 7E 7A, which are the two bytes FE and 7A.
    let sent = line(Framing::Stuffed, 0, &[0xFA, 0x00, 0x00, 0x00]);
    let place = sent.windows(2).position(|pair| pair == [0xFE, 0x7A]).expect("an escape");
    let wrong = [&sent[..=place], &[0x7E, 0x7A], &sent[place + 2..]].concat();
    assert_eq!(stuffed(&wrong), [(0, Err(WRONG_SUM))]);
}

#[test]
fn bytes_outside_a_packet_are_skipped() {
    let bytes = [&b"\0\xFB\xFE\x7Anoise"[..], &STUFFED_ERROR_GET, b"\xFB\xFE", &STUFFED_ERROR_GET, b"more"];
    assert_eq!(stuffed(&bytes.concat()), [good(&ERROR_GET), good(&ERROR_GET)]);
}

#[test]
fn an_empty_packet_has_a_wrong_length() {
    assert_eq!(stuffed(&[0xFA, 0xFB]), [(0, Err(WRONG_LENGTH))]);
}

#[test]
fn a_packet_shorter_than_its_header_has_a_wrong_length_and_the_identification_it_got_to() {
    for cut in 1..6 {
        let bytes = [&[0xFA], &ERROR_GET[..cut], &[0xFB]].concat();
        assert_eq!(stuffed(&bytes), [(if cut > 3 { 0xFF } else { 0 }, Err(WRONG_LENGTH))], "{cut}");
    }
}

#[test]
fn a_packet_in_which_another_starts_is_dropped_unanswered() {
    for cut in 1..STUFFED_ERROR_GET.len() {
        let bytes = [&STUFFED_ERROR_GET[..cut], &STUFFED_ERROR_GET].concat();
        assert_eq!(stuffed(&bytes), [good(&ERROR_GET)], "cut to {cut}");
    }
}

#[test]
fn a_start_behind_an_escape_starts_a_packet() {
    let bytes = [&[0xFA, 0x01, 0xFE], &STUFFED_ERROR_GET[..]].concat();
    assert_eq!(stuffed(&bytes), [good(&ERROR_GET)]);
}

#[test]
fn an_escape_before_the_stop_byte_is_a_wrong_checksum() {
    let bytes = [&STUFFED_ERROR_GET[..7], &[0xFE, 0xFB], &STUFFED_ERROR_GET].concat();
    assert_eq!(stuffed(&bytes), [(0xFF, Err(WRONG_SUM)), good(&ERROR_GET)]);
}

#[test]
fn an_escape_before_any_other_byte_is_a_wrong_checksum() {
    for escaped in (0..=u8::MAX).filter(|byte| !matches!(byte, 0x7A | 0x7B | 0x7E | 0xFA | 0xFB)) {
        let mut bytes = line(Framing::Stuffed, 5, &[0, escaped, 0, 0]);
        let place = bytes.len() - 4 - usize::from(escaped == 0xFE);
        if escaped == 0xFE {
            bytes[place + 1] = 0xFE;
        } else {
            bytes.insert(place, 0xFE);
        }
        let next = [bytes, STUFFED_ERROR_GET.to_vec()].concat();
        assert_eq!(stuffed(&next), [(5, Err(WRONG_SUM)), good(&ERROR_GET)], "{escaped:02X}");
    }
}

#[test]
fn a_good_packet_follows_one_with_a_broken_escape() {
    let bytes = [&[0xFA, 0xFE, 0x00, 0xFB], &STUFFED_ERROR_GET[..]].concat();
    assert_eq!(stuffed(&bytes), [(0, Err(WRONG_LENGTH)), good(&ERROR_GET)]);
}

#[test]
fn a_wrong_checksum_is_told_before_a_wrong_length() {
    // Both wrong, then the length alone: the header says 0 bytes, and there is one.
    for (sum, expected) in [(0xF1, WRONG_SUM), (0xF0, WRONG_LENGTH)] {
        let bytes = [0xFA, sum, 0x02, 0x0E, 0xFF, 0x00, 0x00, 0x01, 0xFB];
        assert_eq!(stuffed(&bytes), [(0xFF, Err(expected))]);
    }
    // The header says one byte, and there is none.
    assert_eq!(stuffed(&[0xFA, 0xF0, 0x02, 0x0E, 0xFF, 0x01, 0x00, 0xFB]), [(0xFF, Err(WRONG_LENGTH))]);
}

#[test]
fn the_longest_packet_passes_and_one_byte_more_is_a_wrong_length_at_its_end() {
    for filler in [0x55, 0xFA] {
        let mut longest = line(Framing::Stuffed, 9, &[filler; 1024]);
        assert_eq!(stuffed(&longest), [good(&line(Framing::Raw, 9, &[filler; 1024]))]);
        longest.insert(longest.len() - 1, 0x00);
        let more = [longest, STUFFED_ERROR_GET.to_vec()].concat();
        assert_eq!(stuffed(&more), [(9, Err(WRONG_LENGTH)), good(&ERROR_GET)]);
    }
}

#[test]
fn a_packet_that_is_too_long_is_swallowed_to_its_end_however_far_that_is() {
    let bytes = [&[0xFA, 1, 2, 3, 4], &vec![0; 100_000][..], &[0xFB], &STUFFED_ERROR_GET].concat();
    let mut reader = PacketReader::new(Framing::Stuffed);
    let mut rest = &bytes[..];
    let taken = reader.take(Instant::ZERO, &mut rest).expect("the end of the long packet");
    assert_eq!((taken.id, taken.packet, taken.raw.len()), (4, Err(WRONG_LENGTH), MAX_PACKET));
    assert_eq!(taken.raw[..6], [1, 2, 3, 4, 0, 0]);
    assert_eq!(found(&mut reader, Instant::ZERO, rest), [good(&ERROR_GET)]);
}

#[test]
fn raw_packets_follow_one_another_by_their_lengths() {
    let longest = line(Framing::Raw, 9, &[0xFA; 1024]);
    let bytes = [&ERROR_GET, &longest[..], &CONFIG_GET].concat();
    assert_eq!(raw(&bytes), [good(&ERROR_GET), good(&longest), good(&CONFIG_GET)]);
}

#[test]
fn a_raw_packet_with_a_wrong_checksum_is_followed_by_the_next() {
    let bytes = [&[0xF2, 0x02, 0x0E, 0x21, 0x02, 0x00, 0xAA, 0xBB], &CONFIG_GET[..]].concat();
    assert_eq!(raw(&bytes), [(0x21, Err(WRONG_SUM)), good(&CONFIG_GET)]);
}

#[test]
fn a_raw_length_that_cannot_be_true_is_told_once_and_all_is_skipped_until_silence() {
    for [low, high] in [1025_u16, 0xFFFF].map(u16::to_le_bytes) {
        let mut reader = PacketReader::new(Framing::Raw);
        let bytes = [&[0, 2, 2, 0x21, low, high], &ERROR_GET[..]].concat();
        assert_eq!(found(&mut reader, ms(0), &bytes), [(0x21, Err(WRONG_LENGTH))]);
        assert!(!reader.is_empty());
        assert_eq!(found(&mut reader, ms(399), &ERROR_GET), []);
        assert_eq!(reader.deadline(), Some(ms(799)));
        assert!(!reader.expire(ms(799)), "it was no half packet");
        assert!(reader.is_empty());
        assert_eq!(found(&mut reader, ms(799), &ERROR_GET), [good(&ERROR_GET)]);
    }
}

#[test]
fn half_a_packet_is_dropped_400_ms_after_its_last_byte() {
    for (framing, bytes, cuts) in
        [(Framing::Stuffed, &STUFFED_ERROR_GET[..], 1..8), (Framing::Raw, &ERROR_GET[..], 1..6)]
    {
        for cut in cuts {
            let mut reader = PacketReader::new(framing);
            assert_eq!((reader.deadline(), reader.is_empty()), (None, true));
            assert_eq!(found(&mut reader, ms(0), &bytes[..1]), []);
            assert_eq!(found(&mut reader, ms(300), &bytes[1..cut]), []);
            let last = if cut == 1 { 0 } else { 300 };
            assert_eq!((reader.deadline(), reader.is_empty()), (Some(ms(last + 400)), false));
            assert!(!reader.expire(Instant::from_nanos(ms(last + 400).as_nanos() - 1)));
            assert!(reader.expire(ms(last + 400)));
            assert_eq!((reader.deadline(), reader.is_empty()), (None, true));
            assert!(!reader.expire(ms(last + 400)), "once");
            assert_eq!(found(&mut reader, ms(last + 400), bytes), [good(&ERROR_GET)], "cut at {cut}");
        }
    }
}

#[test]
fn bytes_that_come_after_half_a_packets_time_belong_to_the_next_though_nobody_dropped_it() {
    for (framing, bytes) in [(Framing::Stuffed, &STUFFED_ERROR_GET[..]), (Framing::Raw, &ERROR_GET[..])] {
        let mut reader = PacketReader::new(framing);
        assert_eq!(found(&mut reader, ms(0), &bytes[..4]), []);
        assert_eq!(found(&mut reader, ms(400), &[]), []);
        assert!(!reader.is_empty(), "no bytes drop nothing");
        assert_eq!(found(&mut reader, ms(400), bytes), [good(&ERROR_GET)]);
    }
}

#[test]
fn the_rest_of_a_stuffed_packet_that_comes_too_late_is_skipped() {
    let mut reader = PacketReader::new(Framing::Stuffed);
    assert_eq!(found(&mut reader, ms(0), &STUFFED_ERROR_GET[..4]), []);
    assert_eq!(found(&mut reader, ms(400), &STUFFED_ERROR_GET[4..]), []);
    assert!(reader.is_empty());
}

#[test]
fn a_packet_may_take_any_time_when_its_pauses_are_short_enough() {
    for (framing, bytes) in [(Framing::Stuffed, &STUFFED_ERROR_GET[..]), (Framing::Raw, &ERROR_GET[..])] {
        let mut reader = PacketReader::new(framing);
        let mut taken = Vec::new();
        for (place, byte) in (0..).zip(bytes) {
            let now = ms(place * 399);
            assert!(!reader.expire(now));
            taken.extend(found(&mut reader, now, &[*byte]));
        }
        assert_eq!(taken, [good(&ERROR_GET)]);
    }
}

#[test]
fn bytes_outside_a_stuffed_packet_begin_nothing() {
    let mut reader = PacketReader::new(Framing::Stuffed);
    assert_eq!(found(&mut reader, ms(0), b"noise\xFB\xFE"), []);
    assert_eq!((reader.is_empty(), reader.deadline(), reader.expire(ms(1000))), (true, None, false));
}

#[test]
fn half_a_packet_that_is_too_long_is_dropped_unanswered_in_its_time() {
    let mut reader = PacketReader::new(Framing::Stuffed);
    assert_eq!(found(&mut reader, ms(0), &[&[0xFA], &[0; 2000][..]].concat()), []);
    assert!(reader.expire(Instant::ZERO + HALF_PACKET_TIMEOUT));
    assert_eq!(found(&mut reader, ms(400), &[&[0xFB], &STUFFED_ERROR_GET[..]].concat()), [good(&ERROR_GET)]);
}

#[test]
fn a_reader_shows_what_it_holds() {
    let mut reader = PacketReader::new(Framing::Stuffed);
    assert_eq!(found(&mut reader, ms(0), &[0xFA, 0x01, 0xFE, 0x7A, 0xFE]), []);
    assert_eq!(format!("{reader:?}"), "PacketReader(Stuffed, Escaped, [01, FA])");
}
