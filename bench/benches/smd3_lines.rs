//! What the lines of the SMD3 cost a server: per line the time from its bytes to those of the reply, but for the drive's
//! own work.

use criterion::{Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use stepdrive_proto::smd3::{LineBuf, LineReader, decode_reply, encode_reply, encode_request, split_reply};
use stepdrive_spec::smd3::commands::{Command, Mode, Reply, Request, Value};
use stepdrive_spec::smd3::errors::Error;
use stepdrive_spec::smd3::flags::Flags;

fn reply(outcome: Result<Option<Value>, Error>) -> Reply {
    Reply { flags: Flags { status: 0x0140, error: 0 }, outcome }
}

/// What comes, and what is answered.
fn transactions() -> [(&'static str, &'static [u8], Reply); 9] {
    let float = |value| reply(Ok(Some(Value::Float(value))));
    [
        ("STOP", b"STOP\r\n", reply(Ok(None))),
        ("PACT", b"PACT\r\n", float(-123_456.5)),
        ("VACT", b"VACT\r\n", float(999.998_12)),
        ("TMOT above 10 million", b"TMOT\r\n", float(1.234_5e7)),
        ("VMAX set", b"VMAX,1234.56\r\n", float(1_234.560_6)),
        ("RUNA set", b"RUNA,-1000000\r\n", reply(Ok(None))),
        ("BAKET, last of the table", b"BAKET\r\n", reply(Ok(Some(Value::Uint(150))))),
        ("MODE refused", b"MODE,2\r\n", reply(Err(Error::StopMotorFirst))),
        ("FLAGS", b"FLAGS\r\n", reply(Ok(Some(Value::FlagTable)))),
    ]
}

fn server(c: &mut Criterion) {
    let mut group = c.benchmark_group("smd3_lines/server");
    for (name, bytes, reply) in transactions() {
        let mut reader = LineReader::new();
        let mut out = LineBuf::new();
        group.bench_function(name, |b| {
            b.iter(|| {
                let mut rest = black_box(bytes);
                let line = reader.take(&mut rest).expect("a whole line");
                black_box(line.decode().expect("a request"));
                encode_reply(&mut out, black_box(&reply));
                black_box(&out);
            });
        });
    }
    group.finish();
}

/// Replies with a number; the last is printed by way of the standard library, the others the short way.
fn floats(c: &mut Criterion) {
    let mut group = c.benchmark_group("smd3_lines/float");
    for value in [0.0, 21.845_333_3, 100_000.5, 8_388_606.5, 1e-9] {
        let reply = reply(Ok(Some(Value::Float(value))));
        let mut out = LineBuf::new();
        group.bench_function(format!("{value:e}"), |b| {
            b.iter(|| {
                encode_reply(&mut out, black_box(&reply));
                black_box(&out);
            });
        });
    }
    group.finish();
}

fn client(c: &mut Criterion) {
    let mut group = c.benchmark_group("smd3_lines/client");
    let answers = [
        ("PACT", Command::Pact, reply(Ok(Some(Value::Float(-123_456.5))))),
        ("MODE", Command::Mode, reply(Ok(Some(Value::Mode(Mode::Remote))))),
        ("refusal", Command::Res, reply(Err(Error::StopMotorFirst))),
    ];
    for (name, command, reply) in answers {
        let request = Request { command, argument: None };
        let mut answer = LineBuf::new();
        encode_reply(&mut answer, &reply);
        let mut out = LineBuf::new();
        group.bench_function(name, |b| {
            b.iter(|| {
                encode_request(&mut out, black_box(&request)).expect("a well-formed request");
                black_box(&out);
                let (line, _) = split_reply(black_box(&answer)).expect("a whole reply");
                decode_reply(line, command).expect("a reply to this request")
            });
        });
    }
    group.finish();
}

/// 100 lines in one buffer, and in buffers shorter than a line.
fn framing(c: &mut Criterion) {
    let bytes = b"VMAX,500\r\n".repeat(100);
    let mut group = c.benchmark_group("smd3_lines/framing of 100");
    for (name, chunk) in [("at once", bytes.len()), ("cut every 7 bytes", 7)] {
        let mut reader = LineReader::new();
        group.bench_function(name, |b| {
            b.iter(|| {
                let mut lines = 0;
                for mut rest in black_box(&bytes).chunks(chunk) {
                    while let Some(line) = reader.take(&mut rest) {
                        black_box(line);
                        lines += 1;
                    }
                }
                assert_eq!(lines, 100);
            });
        });
    }
    group.finish();
}

criterion_group!(smd3_lines, server, floats, client, framing);
criterion_main!(smd3_lines);
