//! The lines of the SMD3 as its manual has them: the examples, the table of commands, the forms of numbers.

use stepdrive_proto::smd3::{
    Line, LineBuf, LineReader, MAX_LINE, ReplyError, decode_line, decode_reply, encode_reply, encode_request,
    split_reply,
};
use stepdrive_spec::smd3::commands::{
    Access, COMMANDS, Command, CommandInfo, Kind, Mode, Reply, Request, Value,
};
use stepdrive_spec::smd3::errors::Error;
use stepdrive_spec::smd3::flags::{ErrorFlag, Flags, StatusFlag};
use stepdrive_spec::smd3::text::Text;

const NO_FLAGS: Flags = Flags { status: 0, error: 0 };

fn read(command: Command) -> Request {
    Request { command, argument: None }
}

fn set(command: Command, value: Value) -> Request {
    Request { command, argument: Some(value) }
}

/// The lines in some bytes that come at once.
fn lines(mut bytes: &[u8]) -> Vec<Option<Vec<u8>>> {
    let mut reader = LineReader::new();
    let mut lines = Vec::new();
    while let Some(line) = reader.take(&mut bytes) {
        lines.push(text(line));
    }
    lines
}

fn text(line: Line<'_>) -> Option<Vec<u8>> {
    match line {
        Line::Text(line) => Some(line.to_vec()),
        Line::TooLong => None,
    }
}

fn reply_bytes(outcome: Result<Option<Value>, Error>) -> Vec<u8> {
    let mut out = LineBuf::new();
    encode_reply(&mut out, &Reply { flags: NO_FLAGS, outcome });
    out.to_vec()
}

/// The item behind the flags.
fn item(value: Value) -> String {
    let bytes = reply_bytes(Ok(Some(value)));
    let text = String::from_utf8(bytes).expect("ASCII");
    text["0x0000,0x0000,".len()..].trim_end_matches("\r\n").to_owned()
}

/// The examples of the manual's *Command reference*, in its order: what is sent, what that is, what is answered. Two are
/// corrected: `MODE` is answered with the number of the mode that it names, `RUNR` with the flags alone.
fn examples() -> Vec<(&'static str, Request, Option<Value>)> {
    use Command::{Autojs, Exten, Ident, Jsmode, Mode as ModeCommand, Runa, Runb, Runh, Runr, Runv, Stop};
    let on = Value::Bool(true);
    let continuous = Value::Uint(1);
    let remote = Some(Value::Mode(Mode::Remote));
    vec![
        ("IDENT,1", set(Ident, on), Some(on)),
        ("IDENT", read(Ident), Some(on)),
        ("MODE,2", set(ModeCommand, Value::Uint(2)), remote),
        ("MODE", read(ModeCommand), remote),
        ("JSMODE,1", set(Jsmode, continuous), Some(continuous)),
        ("JSMODE", read(Jsmode), Some(continuous)),
        ("AUTOJS,1", set(Autojs, on), Some(on)),
        ("AUTOJS", read(Autojs), Some(on)),
        ("EXTEN,1", set(Exten, on), Some(on)),
        ("EXTEN", read(Exten), Some(on)),
        ("RUNV,+", set(Runv, Value::Sign(true)), None),
        ("RUNV,-", set(Runv, Value::Sign(false)), None),
        ("RUNA,1000", set(Runa, Value::Int(1000)), None),
        ("RUNA,-1000", set(Runa, Value::Int(-1000)), None),
        ("RUNR,2000", set(Runr, Value::Int(2000)), None),
        ("RUNR,-2000", set(Runr, Value::Int(-2000)), None),
        ("RUNB", read(Runb), None),
        ("STOP", read(Stop), None),
        ("RUNH,+", set(Runh, Value::Sign(true)), None),
        ("RUNH,-", set(Runh, Value::Sign(false)), None),
        ("STOP", read(Stop), None),
    ]
}

/// What the manual prints behind the flags of an example.
fn printed(value: Option<Value>) -> &'static str {
    match value {
        None => "",
        Some(Value::Mode(_)) => ",2 (Remote)",
        Some(_) => ",1",
    }
}

#[test]
fn every_example_of_the_manual_reads_and_prints_on_both_ends() {
    for (sent, request, value) in examples() {
        let mut out = LineBuf::new();
        encode_request(&mut out, &request).expect("a well-formed request");
        let bytes = format!("{sent}\r\n");
        assert_eq!(out.escape_ascii().to_string(), bytes.escape_default().to_string());
        assert_eq!(lines(bytes.as_bytes()), [Some(sent.as_bytes().to_vec())]);
        assert_eq!(decode_line(sent.as_bytes()), Ok(Some(request)), "{sent}");

        let reply = Reply { flags: NO_FLAGS, outcome: Ok(value) };
        let answered = format!("0x0000,0x0000{}\r\n", printed(value));
        assert_eq!(reply_bytes(reply.outcome), answered.as_bytes(), "{sent}");
        let (line, size) = split_reply(answered.as_bytes()).expect("a whole reply");
        assert_eq!(size, answered.len());
        assert_eq!(decode_reply(line, request.command), Ok(reply), "{sent}");
    }
}

#[test]
fn a_client_takes_the_item_that_the_manual_prints_behind_the_reply_to_runr() {
    let reply = Ok(Reply { flags: NO_FLAGS, outcome: Ok(None) });
    for command in [Command::Runr, Command::Runa] {
        assert_eq!(decode_reply(b"0x0000,0x0000,1", command), reply);
    }
    assert_eq!(decode_reply(b"0x0000,0x0000,1", Command::Stop), Err(ReplyError::Unexpected));
    assert_eq!(decode_reply(b"0x0000,0x0000,+", Command::Runv), Err(ReplyError::Unexpected));
}

#[test]
fn the_arguments_that_the_manual_gives_as_examples_are_read() {
    let argument = |line: &str| decode_line(line.as_bytes()).expect("a request").expect("not empty").argument;
    for (text, value) in [("100", 100), ("-10", -10), ("+7", 7)] {
        assert_eq!(argument(&format!("RUNA,{text}")), Some(Value::Int(value)));
    }
    for (text, value) in [("99", 99), ("1000", 1000), ("0xA74F", 0xA74F), ("0xd7", 0xD7)] {
        assert_eq!(argument(&format!("BAKET,{text}")), Some(Value::Uint(value)));
    }
    for (text, value) in [("10.23", 10.23), ("100e-3", 0.1), ("100E4", 1e6), ("10", 10.0)] {
        assert_eq!(argument(&format!("VMAX,{text}")), Some(Value::Float(value)));
    }
    for (text, value) in [("0", false), ("1", true)] {
        assert_eq!(argument(&format!("L+,{text}")), Some(Value::Bool(value)));
    }
}

#[test]
fn values_print_as_the_manual_shows_them() {
    assert_eq!(item(Value::Int(100)), "100");
    assert_eq!(item(Value::Int(-10)), "-10");
    assert_eq!(item(Value::Uint(200)), "200");
    assert_eq!(item(Value::Float(12_300.0)), "1.23000E+04");
    assert_eq!(item(Value::Float(5.761_59e-10)), "5.76159E-10");
    assert_eq!(item(Value::Bool(false)), "0");
    assert_eq!(item(Value::Text(Text::new("1234 abc").expect("short"))), "1234 abc");
    assert_eq!(item(Value::Mode(Mode::TriggeredVelocity)), "1 (Step/direction triggered velocity)");
}

#[test]
fn flags_are_four_digits_in_capitals_and_errors_print_number_and_text() {
    let flags = Flags { status: 0x1234, error: 0xA4DE };
    let mut out = LineBuf::new();
    encode_reply(&mut out, &Reply { flags, outcome: Err(Error::StopMotorFirst) });
    assert_eq!(&*out, b"0x1234,0xA4DE,-1 (Stop motor first)\r\n");
    for error in Error::ALL {
        let bytes = reply_bytes(Err(error));
        let (line, _) = split_reply(&bytes).expect("a whole reply");
        for row in &COMMANDS {
            let reply = decode_reply(line, row.command).expect("a reply");
            assert_eq!(reply.outcome, Err(error), "{error} to {}", row.mnemonic);
        }
    }
}

#[test]
fn the_table_of_flags_is_one_reply_of_a_line_a_flag() {
    let flags = Flags {
        status: StatusFlag::Standby.mask() | StatusFlag::LimitNegative.mask(),
        error: ErrorFlag::Topen.mask(),
    };
    let reply = Reply { flags, outcome: Ok(Some(Value::FlagTable)) };
    let mut out = LineBuf::new();
    encode_reply(&mut out, &reply);
    let expected = "0x0042,0x0002,JSCON\t0\nLIMIT NEGATIVE\t1\nLIMIT POSITIVE\t0\nEXTEN\t0\nIDENT\t0\nSTANDBY\t1\n\
                    BAKE\t0\nATSPEED\t0\nTSHORT\t0\nTOPEN\t1\nTOVR\t0\nMOTOR SHORT\t0\nEXTERNAL DISABLE\t0\n\
                    EMERGENCY STOP\t0\nCONFIGURATION ERROR\t0\r\n";
    assert_eq!(String::from_utf8_lossy(&out), expected);
    assert!(out.len() < MAX_LINE);
    let (line, size) = split_reply(&out).expect("a whole reply");
    assert_eq!(size, out.len(), "CR LF is only at the end");
    assert_eq!(decode_reply(line, Command::Flags), Ok(reply));
}

/// For each type: arguments of that type with their values, arguments of another, and arguments of that type that cannot
/// be held.
type Samples = (Vec<(&'static str, Value)>, Vec<&'static str>, Vec<&'static str>);

fn samples(kind: Kind) -> Samples {
    match kind {
        Kind::Int => (
            vec![
                ("+0", Value::Int(0)),
                ("007", Value::Int(7)),
                ("-9223372036854775808", Value::Int(i64::MIN)),
            ],
            vec!["", "+", "1.5", "1e3", "0x10", "--1", "1 0", "one", "1\u{0}"],
            vec!["9223372036854775808", "-9223372036854775809"],
        ),
        Kind::Uint => (
            vec![
                ("0", Value::Uint(0)),
                ("0XfF", Value::Uint(255)),
                ("18446744073709551615", Value::Uint(u64::MAX)),
            ],
            vec!["", "+1", "-1", "1.5", "1e3", "0x", "0x+1", "0xG", "x1", "FF", "µ"],
            vec!["18446744073709551616", "0x10000000000000000"],
        ),
        Kind::Float => (
            vec![
                ("-.5", Value::Float(-0.5)),
                ("5.", Value::Float(5.0)),
                ("+1.5e+2", Value::Float(150.0)),
                ("1e-999", Value::Float(0.0)),
            ],
            vec![
                "",
                ".",
                "-",
                "e5",
                ".e5",
                "1e",
                "1e+",
                "1e1.5",
                "1.2.3",
                "0x10",
                "nan",
                "NAN",
                "inf",
                "-Infinity",
                "1,5",
                "1_0",
                "٣",
            ],
            vec!["1e999", "-1e309"],
        ),
        Kind::Bool => (
            vec![("0", Value::Bool(false)), ("1", Value::Bool(true))],
            vec!["", "-1", "+1", "1.0", "on", "true", "\u{7f}"],
            vec!["2", "00", "0x1", "99999999999999999999"],
        ),
        Kind::Sign => (
            vec![("+", Value::Sign(true)), ("-", Value::Sign(false))],
            vec!["", "\u{1}", "+\t+", "µ"],
            vec!["++", "1", "+1", "positive", "+ -"],
        ),
        Kind::None | Kind::Text => (vec![], vec!["", "0", "x"], vec![]),
    }
}

#[test]
fn every_command_is_read_and_set_as_its_row_says() {
    for row in &COMMANDS {
        let bare = decode_line(row.mnemonic.as_bytes());
        let expected = match row.access {
            Access::Write => Err(Error::UnableToGet),
            Access::Read | Access::ReadWrite | Access::Action => Ok(Some(read(row.command))),
        };
        assert_eq!(bare, expected, "{}", row.mnemonic);
        check_arguments(row);
    }
}

/// What a command makes of well-formed, wrong and too many arguments.
fn check_arguments(row: &CommandInfo) {
    let decode = |argument: &str| decode_line(format!("{},{argument}", row.mnemonic).as_bytes());
    let (well_formed, wrong, not_held) = samples(row.kind);
    let takes_one = matches!(row.access, Access::ReadWrite | Access::Write);
    assert!(!takes_one || !well_formed.is_empty(), "{}", row.mnemonic);
    for (argument, value) in well_formed {
        let expected = if takes_one { Ok(Some(set(row.command, value))) } else { Err(Error::ArgumentCount) };
        assert_eq!(decode(argument), expected, "{},{argument}", row.mnemonic);
        assert_eq!(decode(&format!("{argument},")), Err(Error::ArgumentCount), "{}", row.mnemonic);
        assert_eq!(decode(&format!("{argument},{argument}")), Err(Error::ArgumentCount));
    }
    let cases = [(wrong, Error::ArgumentType), (not_held, Error::ArgumentValidation)];
    for (arguments, error) in cases {
        for argument in arguments {
            let counts = takes_one && !argument.contains(',');
            let expected = if counts { error } else { Error::ArgumentCount };
            assert_eq!(decode(argument), Err(expected), "{},{argument:?}", row.mnemonic);
        }
    }
}

#[test]
fn a_client_cannot_send_what_a_server_would_not_take() {
    let mut out = LineBuf::new();
    for row in &COMMANDS {
        let mut refusal =
            |argument| encode_request(&mut out, &Request { command: row.command, argument }).err();
        match row.access {
            Access::Read | Access::Action => {
                assert_eq!(refusal(Some(Value::Uint(1))), Some(Error::ArgumentCount));
            }
            Access::Write => assert_eq!(refusal(None), Some(Error::UnableToGet)),
            Access::ReadWrite => assert_eq!(refusal(Some(Value::FlagTable)), Some(Error::ArgumentType)),
        }
    }
    assert_eq!(out, LineBuf::new());
    let infinite = set(Command::Vmax, Value::Float(f64::INFINITY));
    assert_eq!(encode_request(&mut out, &infinite), Err(Error::ArgumentValidation));
}

#[test]
fn capitals_and_white_space_do_not_matter() {
    let expected = Ok(Some(set(Command::Vmax, Value::Float(5.0))));
    for line in ["VMAX,5", "vmax,5", "VmAx,5", " \tVMAX\t ,  5 ", "VMAX,\t5.0"] {
        assert_eq!(decode_line(line.as_bytes()), expected, "{line:?}");
    }
    assert_eq!(decode_line(b"l+\t"), Ok(Some(read(Command::LPlus))));
    assert_eq!(decode_line(b"V MAX"), Err(Error::UnknownCommand));
}

#[test]
fn an_empty_line_is_no_request() {
    for line in ["", " ", "\t \t"] {
        assert_eq!(decode_line(line.as_bytes()), Ok(None), "{line:?}");
    }
}

#[test]
fn what_is_no_mnemonic_is_an_unknown_command() {
    for line in ["VMA", "VMAXX", "RUN", ",", ",1", "STOP;", "\u{0}STOP", "ST\u{8}OP", "ſTOP", "µ,1,2"] {
        assert_eq!(decode_line(line.as_bytes()), Err(Error::UnknownCommand), "{line:?}");
    }
    assert_eq!(decode_line(b"STOP\xFF"), Err(Error::UnknownCommand));
    assert_eq!(decode_line(b"VMAX,\xFF"), Err(Error::ArgumentType));
}

#[test]
fn cr_lf_lone_cr_and_lone_lf_end_a_line() {
    let some = |text: &str| Some(text.as_bytes().to_vec());
    assert_eq!(lines(b"A\r\nB\rC\nD"), [some("A"), some("B"), some("C")]);
    assert_eq!(lines(b"\r\r\n\n"), [some(""), some(""), some("")]);
    assert_eq!(lines(b"\n\rA\n"), [some(""), some(""), some("A")]);
}

#[test]
fn cr_answers_at_once_and_its_lf_may_come_later() {
    let mut reader = LineReader::new();
    assert_eq!(reader.take(&mut &b"STOP\r"[..]), Some(Line::Text(b"STOP")));
    assert_eq!(reader.take(&mut &b""[..]), None);
    assert_eq!(reader.take(&mut &b"\n"[..]), None);
    assert_eq!(reader.take(&mut &b"\n"[..]), Some(Line::Text(b"")));
    assert_eq!(format!("{reader:?}"), r#"LineReader("")"#);
}

#[test]
fn a_line_over_256_bytes_is_dropped_up_to_its_end() {
    let bytes = |len| [&vec![b'x'; len][..], b"\r\nSTOP\r\n"].concat();
    assert_eq!(lines(&bytes(256)), [Some(vec![b'x'; 256]), Some(b"STOP".to_vec())]);
    for len in [257, 258, 513, 100_000] {
        assert_eq!(lines(&bytes(len)), [None, Some(b"STOP".to_vec())], "{len}");
    }
    assert_eq!(Line::TooLong.decode(), Err(Error::ArgumentType));
    assert_eq!(Line::Text(b"STOP").decode(), Ok(Some(read(Command::Stop))));
}

#[test]
fn the_reader_is_hardly_larger_than_a_line() {
    assert!(size_of::<LineReader>() <= MAX_LINE + 2 * size_of::<usize>());
}

#[test]
fn a_client_reads_flags_with_or_without_leading_zeros() {
    let flags = Flags { status: 0x40, error: 0 };
    for line in ["0x0040,0x0000", "0x40,0x0", " 0X0040 ,\t0x00000000 "] {
        let reply = Reply { flags, outcome: Ok(None) };
        assert_eq!(decode_reply(line.as_bytes(), Command::Stop), Ok(reply), "{line}");
    }
    for line in ["", "0x0040", "64,0", "0x,0x", "0x10000,0x0", "0x-1,0x0", "ERR,0x0"] {
        assert_eq!(decode_reply(line.as_bytes(), Command::Stop), Err(ReplyError::Flags), "{line}");
    }
}

#[test]
fn a_client_tells_what_is_wrong_with_a_reply() {
    let error = |item: &str, command| {
        decode_reply(format!("0x0000,0x0000{item}").as_bytes(), command).expect_err("no reply")
    };
    let value = |expected| ReplyError::Value { expected };
    assert_eq!(error("", Command::Vmax), ReplyError::Missing { expected: Kind::Float });
    assert_eq!(error(",", Command::Vmax), value(Kind::Float));
    assert_eq!(error(",NAN", Command::Tmot), value(Kind::Float));
    assert_eq!(error(",6 (Other)", Command::Mode), value(Kind::Uint));
    assert_eq!(error(",", Command::Ser), value(Kind::Text));
    assert_eq!(error(",", Command::Flags), value(Kind::Text));
    assert_eq!(error(",-8 (New)", Command::Vmax), ReplyError::UnknownError { code: -8 });
    assert_eq!(error(",-99999 (New)", Command::Vmax), ReplyError::ErrorNumber);
    assert_eq!(error(",1", Command::Clr), ReplyError::Unexpected);
    let text = value(Kind::Bool).to_string();
    assert_eq!(text, "the value in the reply is not of type BOOL");
}

#[test]
fn a_client_takes_negative_values_and_the_optional_value_of_lp() {
    let outcome = |line: &str, command| decode_reply(line.as_bytes(), command).expect("a reply").outcome;
    assert_eq!(outcome("0x0,0x0,-1.50000E+00", Command::Vact), Ok(Some(Value::Float(-1.5))));
    assert_eq!(outcome("0x0,0x0,2", Command::Mode), Ok(Some(Value::Mode(Mode::Remote))));
    assert_eq!(outcome("0x0,0x0,1", Command::Lp), Ok(Some(Value::Bool(true))));
    assert_eq!(outcome("0x0,0x0", Command::Lp), Ok(None));
}

/// Numbers, and what C prints for them with `%.5E`: ties in binary, carries into the next power of ten, both ends of the
/// numbers that are printed the short way, subnormal numbers, the drive's own quantities.
#[rustfmt::skip]
#[allow(clippy::excessive_precision, clippy::unreadable_literal, reason = "literals are as C was given them")]
const PRINTED: &[(f64, &str)] = &[
    (0.0, "0.00000E+00"),
    (-0.0, "0.00000E+00"),
    (1.0, "1.00000E+00"),
    (-1.0, "-1.00000E+00"),
    (12300.0, "1.23000E+04"),
    (5.76159e-10, "5.76159E-10"),
    (5e-324, "4.94066E-324"),
    (-5e-324, "-4.94066E-324"),
    (2.2250738585072014e-308, "2.22507E-308"),
    (2.225073858507201e-308, "2.22507E-308"),
    (1e-310, "1.00000E-310"),
    (1.7976931348623157e308, "1.79769E+308"),
    (1e22, "1.00000E+22"),
    (1e23, "1.00000E+23"),
    (1e-300, "1.00000E-300"),
    (1e300, "1.00000E+300"),
    (1e100, "1.00000E+100"),
    (9.999995, "1.00000E+01"),
    (9.9999949999999999, "1.00000E+01"),
    (9.9999945, "9.99999E+00"),
    (99999.95, "9.99999E+04"),
    (999999.5, "1.00000E+06"),
    (999999.4999999999, "9.99999E+05"),
    (9999995.0, "1.00000E+07"),
    (9999985.0, "9.99998E+06"),
    (100000.5, "1.00000E+05"),
    (100001.5, "1.00002E+05"),
    (100002.5, "1.00002E+05"),
    (123456.5, "1.23456E+05"),
    (-123457.5, "-1.23458E+05"),
    (1000005.0, "1.00000E+06"),
    (1000015.0, "1.00002E+06"),
    (1000025.0, "1.00002E+06"),
    (10000050.0, "1.00000E+07"),
    (12345650000000.0, "1.23456E+13"),
    (999999500000000.0, "1.00000E+15"),
    (999998500000000.0, "9.99998E+14"),
    (1e15, "1.00000E+15"),
    (1000005000000000.0, "1.00000E+15"),
    (999999999999999.9, "1.00000E+15"),
    (1e14, "1.00000E+14"),
    (4503599627370496.0, "4.50360E+15"),
    (0.5, "5.00000E-01"),
    (0.25, "2.50000E-01"),
    (1.234565, "1.23456E+00"),
    (1.000005, "1.00001E+00"),
    (1.000015, "1.00002E+00"),
    (0.0009999995, "1.00000E-03"),
    (1e-5, "1.00000E-05"),
    (1.0000049999999999e-5, "1.00000E-05"),
    (1e-6, "1.00000E-06"),
    (1e-7, "1.00000E-07"),
    (9.999999999999999e-8, "1.00000E-07"),
    (1.0000000000000001e-7, "1.00000E-07"),
    (0.1, "1.00000E-01"),
    (0.3, "3.00000E-01"),
    (21.845333333333333, "2.18453E+01"),
    (109.22666666666667, "1.09227E+02"),
    (200.32051282051282, "2.00321E+02"),
    (16763.549804687500, "1.67635E+04"),
    (8388607.99609375, "8.38861E+06"),
    (-8388608.0, "-8.38861E+06"),
    (8388606.5, "8.38861E+06"),
    (100000.00390625, "1.00000E+05"),
    (0.00390625, "3.90625E-03"),
    (1.1754943508222875e-38, "1.17549E-38"),
    (3.4028234663852886e38, "3.40282E+38"),
    (0.0000152587890625, "1.52588E-05"),
    (65536.5, "6.55365E+04"),
    (1048576.5, "1.04858E+06"),
    (131072.5, "1.31072E+05"),
    (6.103515625e-05, "6.10352E-05"),
    (9.99995e-5, "9.99995E-05"),
    (3.0517578125e-05, "3.05176E-05"),
    (7.62939453125e-06, "7.62939E-06"),
];

#[test]
fn floats_print_as_in_c() {
    for (value, expected) in PRINTED {
        assert_eq!(item(Value::Float(*value)), *expected, "{value:?}");
    }
    assert_eq!(item(Value::Float(f64::NEG_INFINITY)), "-INF");
    assert_eq!(item(Value::Float(f64::NAN.abs())), "NAN");
}
