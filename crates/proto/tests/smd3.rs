//! Properties of the lines of the SMD3, both ends against each other.

use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::{Index, select};
use stepdrive_proto::smd3::{
    Line, LineBuf, LineReader, MAX_LINE, decode_line, decode_reply, encode_reply, encode_request, split_reply,
};
use stepdrive_spec::smd3::commands::{
    Access, COMMANDS, Command, CommandInfo, Kind, Mode, Reply, Request, Value,
};
use stepdrive_spec::smd3::errors::Error;
use stepdrive_spec::smd3::flags::Flags;
use stepdrive_spec::smd3::text::Text;

fn config() -> ProptestConfig {
    ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(256) }
}

fn any_command() -> impl Strategy<Value = &'static CommandInfo> {
    (0..COMMANDS.len()).prop_map(|index| &COMMANDS[index])
}

/// Any finite number, and more often one that a drive would have.
fn any_float() -> impl Strategy<Value = f64> {
    let bits = any::<u64>().prop_map(f64::from_bits).prop_filter("finite", |value| value.is_finite());
    let position = any::<i32>().prop_map(|parts| f64::from(parts) / 256.0);
    prop_oneof![bits, position, -1e6..1e6, -1e-6..1e-6]
}

/// An argument or value of a type.
fn any_value(kind: Kind) -> BoxedStrategy<Value> {
    match kind {
        Kind::Int => any::<i64>().prop_map(Value::Int).boxed(),
        Kind::Uint => any::<u64>().prop_map(Value::Uint).boxed(),
        Kind::Float => any_float().prop_map(Value::Float).boxed(),
        Kind::Bool => any::<bool>().prop_map(Value::Bool).boxed(),
        Kind::Sign => any::<bool>().prop_map(Value::Sign).boxed(),
        Kind::Text => {
            "[!-+\\--~]([ -+\\--~]{0,30}[!-+\\--~])?".prop_map(|text| Value::Text(text_of(&text))).boxed()
        }
        Kind::None => unreachable!("no value is of this type"),
    }
}

fn text_of(text: &str) -> Text {
    Text::new(text).expect("one item")
}

fn any_request() -> impl Strategy<Value = Request> {
    any_command().prop_flat_map(|row| {
        let bare = || Just(None).boxed();
        let with_argument = || any_value(row.kind).prop_map(Some).boxed();
        let argument = match row.access {
            Access::Read | Access::Action => bare(),
            Access::Write => with_argument(),
            Access::ReadWrite => prop_oneof![bare(), with_argument()].boxed(),
        };
        argument.prop_map(|argument| Request { command: row.command, argument })
    })
}

/// What a drive may answer to a command.
fn any_outcome(row: &'static CommandInfo) -> BoxedStrategy<Result<Option<Value>, Error>> {
    let value = match (row.command, row.access) {
        (_, Access::Write | Access::Action) => Just(None).boxed(),
        (Command::Mode, _) => select(&Mode::ALL[..]).prop_map(|mode| Some(Value::Mode(mode))).boxed(),
        (Command::Flags, _) => Just(Some(Value::FlagTable)).boxed(),
        (_, Access::Read | Access::ReadWrite) => any_value(row.kind).prop_map(Some).boxed(),
    };
    prop_oneof![4 => value.prop_map(Ok), 1 => select(&Error::ALL[..]).prop_map(Err)].boxed()
}

fn any_exchange() -> impl Strategy<Value = (Command, Reply)> {
    (any_command(), any::<(u16, u16)>()).prop_flat_map(|(row, (status, error))| {
        let flags = Flags { status, error };
        any_outcome(row).prop_map(move |outcome| (row.command, Reply { flags, outcome }))
    })
}

/// Bytes that often make lines, and some of them requests or nearly so.
fn any_bytes() -> impl Strategy<Value = Vec<u8>> {
    let part = prop_oneof![
        4 => any_request().prop_map(|request| encoded(&request).to_vec()),
        2 => vec(select(&b"\r\n,+-.0xeE \tSTOPL"[..]), 0..12),
        1 => vec(any::<u8>(), 0..40),
        1 => (250..260_usize).prop_map(|len| vec![b'x'; len]),
    ];
    vec(part, 0..12).prop_map(|parts| parts.concat())
}

fn encoded(request: &Request) -> LineBuf {
    let mut out = LineBuf::new();
    encode_request(&mut out, request).expect("a well-formed request");
    out
}

fn encoded_reply(reply: &Reply) -> LineBuf {
    let mut out = LineBuf::new();
    encode_reply(&mut out, reply);
    out
}

/// The lines in bytes that come in these parts; `None` is a line that is too long.
fn lines<'a>(parts: impl IntoIterator<Item = &'a [u8]>) -> Vec<Option<Vec<u8>>> {
    let mut reader = LineReader::new();
    let mut lines = Vec::new();
    for mut bytes in parts {
        while let Some(line) = reader.take(&mut bytes) {
            lines.push(match line {
                Line::Text(line) => Some(line.to_vec()),
                Line::TooLong => None,
            });
        }
        assert!(bytes.is_empty());
        assert!(reader.held() <= MAX_LINE);
    }
    lines
}

/// The same, read slowly: a CR LF is as good as a CR, a CR as good as a LF.
fn lines_by_the_book(bytes: &[u8]) -> Vec<Option<Vec<u8>>> {
    let text: String = bytes.iter().map(|byte| char::from(*byte)).collect();
    let text = text.replace("\r\n", "\n").replace('\r', "\n");
    let mut lines: Vec<&str> = text.split('\n').collect();
    lines.pop();
    let line =
        |line: &&str| line.chars().map(|char| u8::try_from(char).expect("a byte")).collect::<Vec<u8>>();
    lines.iter().map(line).map(|line| (line.len() <= MAX_LINE).then_some(line)).collect()
}

/// What C prints with `%.5E`, by way of the standard library, which rounds alike and writes the exponent bare.
fn printed(value: f64) -> String {
    // Adding 0 takes the sign off a negative zero.
    let bare = format!("{:.5E}", value + 0.0);
    let (mantissa, exponent) = bare.split_once('E').expect("an exponent");
    let exponent: i32 = exponent.parse().expect("a number");
    format!("{mantissa}E{exponent:+03}")
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn lines_do_not_depend_on_how_the_bytes_are_cut(
        bytes in any_bytes(),
        cuts in vec(any::<Index>(), 0..20),
    ) {
        let expected = lines_by_the_book(&bytes);
        prop_assert_eq!(&lines([&bytes[..]]), &expected);
        prop_assert_eq!(&lines(bytes.chunks(1)), &expected);
        let mut at: Vec<usize> = cuts.iter().map(|cut| cut.index(bytes.len() + 1)).collect();
        at.extend([0, bytes.len()]);
        at.sort_unstable();
        prop_assert_eq!(&lines(at.windows(2).map(|ends| &bytes[ends[0]..ends[1]])), &expected);
    }

    #[test]
    fn the_line_behind_any_garbage_is_understood(garbage in any_bytes(), request in any_request()) {
        let bytes = [&garbage[..], b"\r\n", &encoded(&request)].concat();
        let all = lines(bytes.chunks(7));
        let last = all.last().expect("a line").as_deref().expect("not too long");
        prop_assert_eq!(decode_line(last), Ok(Some(request)));
    }

    #[test]
    fn memory_is_bounded_however_long_a_line_is(len in 0..5000_usize, chunk in 1..600_usize) {
        let mut reader = LineReader::new();
        for mut bytes in vec![b'x'; len].chunks(chunk) {
            prop_assert_eq!(reader.take(&mut bytes), None);
            prop_assert!(reader.held() <= MAX_LINE);
        }
        let line = if len > MAX_LINE { Line::TooLong } else { Line::Text(&[b'x'; MAX_LINE][..len]) };
        prop_assert_eq!(reader.take(&mut &b"\n"[..]), Some(line));
        prop_assert_eq!(reader.held(), 0);
    }

    #[test]
    fn a_request_comes_back_from_its_line(request in any_request()) {
        let bytes = encoded(&request);
        let [Some(line)] = &lines([&bytes[..]])[..] else { panic!("not one line: {bytes:?}") };
        prop_assert_eq!(decode_line(line), Ok(Some(request)));
        prop_assert_eq!(decode_line(&line.to_ascii_lowercase()), Ok(Some(request)));
    }

    #[test]
    fn what_is_understood_means_the_same_encoded_again(line in vec(any::<u8>(), 0..300), request in any_request()) {
        let nearly = encoded(&request);
        for line in [&line[..], &nearly[..nearly.len().min(line.len())]] {
            if let Ok(Some(request)) = decode_line(line) {
                let again = encoded(&request);
                prop_assert_eq!(decode_line(&again[..again.len() - 2]), Ok(Some(request)));
            }
        }
    }

    #[test]
    fn a_reply_comes_back_from_its_line((command, reply) in any_exchange()) {
        let bytes = encoded_reply(&reply);
        let (line, size) = split_reply(&bytes).expect("a whole reply");
        prop_assert_eq!(size, bytes.len());
        prop_assert!(line.len() <= MAX_LINE);
        let read = decode_reply(line, command).expect("a reply to the command");
        if let (Ok(Some(Value::Float(value))), Ok(Some(Value::Float(read)))) = (reply.outcome, read.outcome) {
            // Half of the last digit, and of the step between two subnormal numbers.
            let most = value.abs() * 5.000_001e-6 + f64::from_bits(1);
            prop_assert!((value - read).abs() <= most, "{value} is read as {read}");
        } else {
            prop_assert_eq!(read, reply);
        }
    }

    #[test]
    fn a_cut_reply_is_not_split_off((_, reply) in any_exchange(), cut in any::<Index>()) {
        let bytes = encoded_reply(&reply);
        prop_assert_eq!(split_reply(&bytes[..cut.index(bytes.len())]), None);
    }

    #[test]
    fn no_bytes_upset_a_client(
        line in vec(any::<u8>(), 0..60),
        (command, reply) in any_exchange(),
        index in any::<Index>(),
    ) {
        let mut spoilt = encoded_reply(&reply).to_vec();
        let at = index.index(spoilt.len());
        spoilt[at] = line.first().copied().unwrap_or(b',');
        for line in [&line[..], &spoilt] {
            if let Err(error) = decode_reply(line, command) {
                prop_assert!(!error.to_string().is_empty());
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4096, ..config() })]

    #[test]
    fn floats_print_as_in_c(value in any_float(), digits in 0..20_000_000_u32, power in -18..18_i32) {
        // Numbers of eight digits are often half-way between two of six.
        let short = f64::from(digits) * 10_f64.powi(power);
        for value in [value, short, f64::from(digits) / 2.0] {
            let reply = Reply { flags: Flags::default(), outcome: Ok(Some(Value::Float(value))) };
            let expected = format!("0x0000,0x0000,{}\r\n", printed(value));
            let bytes = encoded_reply(&reply);
            prop_assert_eq!(String::from_utf8_lossy(&bytes), expected);
        }
    }
}
