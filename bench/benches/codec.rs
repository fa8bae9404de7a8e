//! What the Modbus TCP codec costs a server: per request the time from the bytes of the request to those of the reply.

use criterion::{Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use stepdrive_proto::modbus::{
    Adu, Split, decode_reply, decode_request, encode_refusal, encode_reply, encode_request, split,
};
use stepdrive_spec::modbus::{Exception, Reply, Request, Table};

fn read(count: u16) -> Request {
    Request::ReadWords { table: Table::HoldingRegisters, address: 0x1100, count }
}

fn words(count: u16) -> Reply {
    Reply::Words((0..count).collect())
}

fn encoded(request: &Request) -> Adu {
    let mut out = Adu::new();
    encode_request(&mut out, 1, 1, request).expect("a well-formed request");
    out
}

/// What a server does with the bytes of one request, but for the controller's own work.
fn serve(bytes: &[u8], out: &mut Adu, outcome: &Result<Reply, Exception>) {
    let Split::Frame { frame, .. } = split(bytes) else { panic!("one whole frame") };
    match decode_request(frame.pdu) {
        Ok(request) => encode_reply(out, frame.transaction, frame.unit, &request, outcome),
        Err(refusal) => encode_refusal(out, frame.transaction, frame.unit, refusal),
    }
}

fn server(c: &mut Criterion) {
    let mut group = c.benchmark_group("codec/server");
    let values = (0..64).collect();
    let requests = [
        ("FC03 of 1", read(1), words(1)),
        ("FC03 of 125", read(125), words(125)),
        ("FC10 of 64", Request::WriteRegisters { address: 0x1100, values }, Reply::Written),
    ];
    for (name, request, reply) in requests {
        let bytes = encoded(&request);
        let outcome = Ok(reply);
        let mut out = Adu::new();
        group.bench_function(name, |b| {
            b.iter(|| {
                serve(black_box(&bytes), &mut out, black_box(&outcome));
                black_box(&out);
            });
        });
    }
    group.finish();
}

fn client(c: &mut Criterion) {
    let mut group = c.benchmark_group("codec/client");
    for count in [1, 125] {
        let request = read(count);
        let mut reply = Adu::new();
        encode_reply(&mut reply, 1, 1, &request, &Ok(words(count)));
        let mut out = Adu::new();
        group.bench_function(format!("FC03 of {count}"), |b| {
            b.iter(|| {
                encode_request(&mut out, 1, 1, black_box(&request)).expect("a well-formed request");
                black_box(&out);
                let Split::Frame { frame, .. } = split(black_box(&reply)) else { panic!("one whole frame") };
                decode_reply(frame.pdu, &request).expect("a reply to this request")
            });
        });
    }
    group.finish();
}

/// 100 pipelined requests in one buffer.
fn framing(c: &mut Criterion) {
    let bytes = encoded(&read(2)).repeat(100);
    c.bench_function("codec/framing of 100", |b| {
        b.iter(|| {
            let mut rest = black_box(&bytes[..]);
            let mut frames = 0;
            while let Split::Frame { frame, size } = split(rest) {
                black_box(frame);
                rest = &rest[size..];
                frames += 1;
            }
            assert_eq!(frames, 100);
        });
    });
}

criterion_group!(codec, server, client, framing);
criterion_main!(codec);
