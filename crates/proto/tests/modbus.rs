//! Properties of the Modbus TCP codec, both ends against each other.

use proptest::collection::vec;
use proptest::prelude::*;
use stepdrive_proto::modbus::{
    Adu, Frame, MAX_ADU, ReplyError, Split, decode_reply, decode_request, encode_refusal, encode_reply,
    encode_request, split,
};
use stepdrive_spec::modbus::{Bits, Exception, Reply, Request, Table};

fn config() -> ProptestConfig {
    ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(256) }
}

/// An address and a quantity of 1 to `most` that ends within the addresses.
fn range(most: u16) -> impl Strategy<Value = (u16, u16)> {
    (1..=most).prop_flat_map(|count| (0..=u16::MAX - (count - 1), Just(count)))
}

fn any_request() -> impl Strategy<Value = Request> {
    let bits = prop_oneof![Just(Table::Coils), Just(Table::DiscreteInputs)];
    let words = prop_oneof![Just(Table::InputRegisters), Just(Table::HoldingRegisters)];
    prop_oneof![
        (bits, range(2000)).prop_map(|(table, (address, count))| Request::ReadBits { table, address, count }),
        (words, range(125)).prop_map(|(table, (address, count))| Request::ReadWords {
            table,
            address,
            count
        }),
        any::<(u16, bool)>().prop_map(|(address, value)| Request::WriteCoil { address, value }),
        any::<(u16, u16)>().prop_map(|(address, value)| Request::WriteRegister { address, value }),
        range(1968).prop_flat_map(|(address, count)| {
            any_bits(count).prop_map(move |values| Request::WriteCoils { address, values })
        }),
        range(123).prop_flat_map(|(address, count)| {
            vec(any::<u16>(), usize::from(count)).prop_map(move |values| Request::WriteRegisters {
                address,
                values: values.into_iter().collect(),
            })
        }),
    ]
}

fn any_bits(count: u16) -> impl Strategy<Value = Bits> {
    vec(any::<u8>(), usize::from(count).div_ceil(8))
        .prop_map(move |bytes| Bits::from_packed(&bytes, count).expect("as many bytes as the bits take"))
}

fn any_reply(request: &Request) -> BoxedStrategy<Reply> {
    match request {
        Request::ReadBits { count, .. } => any_bits(*count).prop_map(Reply::Bits).boxed(),
        Request::ReadWords { count, .. } => vec(any::<u16>(), usize::from(*count))
            .prop_map(|words| Reply::Words(words.into_iter().collect()))
            .boxed(),
        Request::WriteCoil { .. }
        | Request::WriteRegister { .. }
        | Request::WriteCoils { .. }
        | Request::WriteRegisters { .. } => Just(Reply::Written).boxed(),
    }
}

fn any_exchange() -> impl Strategy<Value = (Request, Result<Reply, Exception>)> {
    any_request().prop_flat_map(|request| {
        let reply = any_reply(&request);
        let exception = any::<u8>().prop_map(Exception::from_code);
        (Just(request), prop_oneof![3 => reply.prop_map(Ok), 1 => exception.prop_map(Err)])
    })
}

/// Bytes that are often a request's PDU, or nearly one.
fn any_pdu() -> impl Strategy<Value = Vec<u8>> {
    let request = any_request().prop_map(|request| encoded(&request)[7..].to_vec());
    prop_oneof![vec(any::<u8>(), 0..300), spoilt(request)]
}

/// A request and bytes that are often the PDU of a reply to it, or nearly one.
fn any_answer() -> impl Strategy<Value = (Request, Vec<u8>)> {
    any_exchange().prop_flat_map(|(request, outcome)| {
        let mut out = Adu::new();
        encode_reply(&mut out, 1, 1, &request, &outcome);
        (Just(request), prop_oneof![vec(any::<u8>(), 0..300), spoilt(Just(out[7..].to_vec()))])
    })
}

/// Bytes that are often a frame, or nearly one.
fn any_stream() -> impl Strategy<Value = Vec<u8>> {
    let framed = (any::<u16>(), 0..=2_u16, 0..=300_u16, vec(any::<u8>(), 0..300)).prop_map(
        |(transaction, protocol, length, rest)| {
            let header = [transaction, protocol, length].map(u16::to_be_bytes).concat();
            [header, rest].concat()
        },
    );
    prop_oneof![vec(any::<u8>(), 0..300), framed]
}

/// The bytes with one changed and up to two cut off.
fn spoilt(bytes: impl Strategy<Value = Vec<u8>>) -> impl Strategy<Value = Vec<u8>> {
    (bytes, any::<prop::sample::Index>(), any::<u8>(), 0..3_usize).prop_map(
        |(mut bytes, place, byte, cut)| {
            *place.get_mut(&mut bytes) = byte;
            bytes.truncate(bytes.len() - cut);
            bytes
        },
    )
}

fn encoded(request: &Request) -> Adu {
    let mut out = Adu::new();
    encode_request(&mut out, 0x1234, 7, request).expect("the strategy makes well-formed requests only");
    out
}

/// The only frame in `bytes`, which it must fill.
fn whole(bytes: &[u8]) -> Frame<'_> {
    let Split::Frame { frame, size } = split(bytes) else { panic!("not one frame: {bytes:02X?}") };
    assert_eq!(size, bytes.len());
    frame
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn requests_arrive_as_they_were_sent(request in any_request(), transaction: u16, unit: u8) {
        let mut out = Adu::new();
        encode_request(&mut out, transaction, unit, &request).expect("a well-formed request");
        let frame = whole(&out);
        prop_assert_eq!((frame.transaction, frame.unit), (transaction, unit));
        prop_assert_eq!(decode_request(frame.pdu), Ok(request));
    }

    #[test]
    fn replies_arrive_as_they_were_sent((request, outcome) in any_exchange(), transaction: u16, unit: u8) {
        let mut out = Adu::new();
        encode_reply(&mut out, transaction, unit, &request, &outcome);
        let frame = whole(&out);
        prop_assert_eq!((frame.transaction, frame.unit), (transaction, unit));
        prop_assert_eq!(decode_reply(frame.pdu, &request), outcome.map_err(ReplyError::Exception));
    }

    #[test]
    fn a_frame_cut_anywhere_needs_more_and_then_is_whole(request in any_request()) {
        let out = encoded(&request);
        for cut in 0..out.len() {
            let needed = if cut < 6 { 6 } else { out.len() };
            prop_assert_eq!(split(&out[..cut]), Split::Incomplete { needed });
        }
        prop_assert_eq!(decode_request(whole(&out).pdu), Ok(request));
    }

    #[test]
    fn frames_in_one_buffer_come_out_in_order(requests in vec(any_request(), 1..6), foreign in 1..=u16::MAX) {
        let mut bytes = Vec::new();
        for request in &requests {
            let [high, low] = foreign.to_be_bytes();
            bytes.extend([0, 0, high, low, 0, 3, 1, 2, 3]);
            bytes.extend_from_slice(&encoded(request));
        }
        let mut rest = &bytes[..];
        let mut found = Vec::new();
        while !rest.is_empty() {
            let size = match split(rest) {
                Split::Frame { frame, size } => {
                    found.push(decode_request(frame.pdu).expect("a well-formed request"));
                    size
                }
                Split::Foreign { protocol, size } => {
                    prop_assert_eq!(protocol, foreign);
                    size
                }
                Split::Incomplete { .. } | Split::Broken { .. } => panic!("whole frames only: {rest:02X?}"),
            };
            rest = &rest[size..];
        }
        prop_assert_eq!(found, requests);
    }

    #[test]
    fn splitting_arbitrary_bytes_always_gets_on(bytes in any_stream()) {
        match split(&bytes) {
            Split::Incomplete { needed } => prop_assert!(bytes.len() < needed && needed <= MAX_ADU),
            Split::Frame { frame, size } => {
                prop_assert_eq!(size, frame.pdu.len() + 7);
                prop_assert!(size <= bytes.len() && !frame.pdu.is_empty());
            }
            Split::Foreign { size, .. } => prop_assert!((8..=bytes.len()).contains(&size)),
            Split::Broken { length } => prop_assert!(!(2..=254).contains(&length)),
        }
    }

    #[test]
    fn what_is_decoded_from_arbitrary_bytes_is_encoded_the_same(pdu in any_pdu()) {
        let mut out = Adu::new();
        match decode_request(&pdu) {
            Ok(request) => {
                let out = encoded(&request);
                prop_assert_eq!(out.len(), pdu.len() + 7);
                prop_assert_eq!(decode_request(whole(&out).pdu), Ok(request));
            }
            Err(refusal) => {
                encode_refusal(&mut out, 1, 1, refusal);
                prop_assert_eq!(whole(&out).pdu, [refusal.function | 0x80, refusal.exception.code()]);
            }
        }
    }

    #[test]
    fn arbitrary_replies_are_values_or_errors((request, pdu) in any_answer()) {
        let read = decode_reply(&pdu, &request);
        let outcome = match read.clone() {
            Ok(reply) => Ok(reply),
            Err(ReplyError::Exception(exception)) => Err(exception),
            Err(_) => return Ok(()),
        };
        let mut out = Adu::new();
        encode_reply(&mut out, 1, 1, &request, &outcome);
        prop_assert_eq!(out.len(), pdu.len() + 7);
        prop_assert_eq!(decode_reply(whole(&out).pdu, &request), read);
    }
}
