//! What a request costs a controller, from its bytes to those of the reply: decoding, the controller's own work with
//! the motor and the mechanics that hang on it, encoding.
#![allow(missing_docs, reason = "criterion's macros generate items without documentation")]

use core::time::Duration;
use criterion::{Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use stepdrive_bench::requests::{adu, command, log_in, read, write, write_many};
use stepdrive_drive::smsd::{Memory, Session, Smsd};
use stepdrive_proto::modbus::{Adu, Split, decode_request, encode_refusal, encode_reply, split};
use stepdrive_rig::file::{DEMO, RigFile};
use stepdrive_rig::machine::Machine;
use stepdrive_spec::modbus::{Request, Table};
use stepdrive_spec::smsd::instructions::Opcode;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::time::Instant;

/// The demo rig's drive, with a client that has logged in.
struct Bench {
    machine: Machine<Smsd>,
    session: Session,
    now: Instant,
    out: Adu,
}

impl Bench {
    fn at_rest() -> Bench {
        let rig = RigFile::parse(DEMO).expect("the demo rig is right");
        let [drive, ..] = &rig.drives[..] else { panic!("the demo rig has a drive") };
        let section = drive.smsd().expect("and it is an SMSD");
        let machine = section.power_up(drive, Memory::factory());
        let mut bench =
            Bench { machine, session: Session::new(), now: Instant::from_nanos(1_000), out: Adu::new() };
        bench.succeed(&log_in());
        bench
    }

    /// Half a second into a ramp of one.
    fn moving() -> Bench {
        let mut bench = Bench::at_rest();
        bench.succeed(&write(Reg::TargetSpeed, 1000));
        bench.succeed(&command(Opcode::RunF));
        bench.now = bench.now + Duration::from_millis(500);
        bench
    }

    /// What a server does with the bytes of a request, but for the socket's.
    fn serve(&mut self, bytes: &[u8]) -> &[u8] {
        let Split::Frame { frame, .. } = split(bytes) else { panic!("one whole frame") };
        match decode_request(frame.pdu) {
            Ok(request) => {
                let outcome = self.machine.handle(self.now, &mut self.session, &request);
                encode_reply(&mut self.out, frame.transaction, frame.unit, &request, &outcome);
            }
            Err(refusal) => encode_refusal(&mut self.out, frame.transaction, frame.unit, refusal),
        }
        &self.out
    }

    fn succeed(&mut self, request: &Request) {
        let function = self.serve(&adu(request)).get(7).copied();
        assert_eq!(function, Some(request.function()), "{request:?} was refused");
    }
}

/// Times requests that are sent in turn; the figure is their mean.
fn time<const N: usize>(c: &mut Criterion, name: &str, mut bench: Bench, requests: [Request; N]) {
    let requests = requests.map(|request| adu(&request));
    let mut turns = requests.iter().cycle();
    c.bench_function(&format!("core/{name}"), |b| {
        b.iter(|| {
            if let Some(request) = turns.next() {
                black_box(bench.serve(black_box(request)));
            }
        });
    });
}

fn reads(c: &mut Criterion) {
    time(c, "FC03 of 1", Bench::at_rest(), [read(Reg::MaxSpeed, 1)]);
    time(c, "FC03 of 17, all drive parameters", Bench::at_rest(), [read(Reg::MinSpeed, 17)]);
    time(c, "FC03 of 64, the instruction buffer", Bench::at_rest(), [read(Reg::CmdBuffer, 64)]);
    let beyond = Request::ReadWords { table: Table::HoldingRegisters, address: 0x3100, count: 125 };
    time(c, "FC03 of 125, exception 02", Bench::at_rest(), [beyond]);
    time(c, "FC04 of 6, at rest", Bench::at_rest(), [read(Reg::Speed, 6)]);
    time(c, "FC04 of 6, moving", Bench::moving(), [read(Reg::Speed, 6)]);
    time(c, "FC02 of 10, at rest", Bench::at_rest(), [read(Reg::HiZ, 10)]);
    time(c, "FC02 of 10, moving", Bench::moving(), [read(Reg::HiZ, 10)]);
}

/// Writes alternate between two values, so that each changes something.
fn writes(c: &mut Criterion) {
    let max_speed = [write(Reg::MaxSpeed, 900), write(Reg::MaxSpeed, 1000)];
    time(c, "FC06 of MAX_SPEED, at rest", Bench::at_rest(), max_speed.clone());
    time(c, "FC06 of MAX_SPEED, moving", Bench::moving(), max_speed);
    // MIN_SPEED, MAX_SPEED, ACC, DEC, FS_SPEED, TARGET_SPEED, both halves of TARGET_POS, TARGET_INPUT, CMD.
    let stop = Opcode::HardStop.code().into();
    let parameters = [
        write_many(Reg::MinSpeed, [10, 900, 2000, 2000, 15_000, 800, 1600, 0, 1, stop]),
        write_many(Reg::MinSpeed, [0, 1000, 1000, 1000, 15_600, 1000, 3200, 0, 0, stop]),
    ];
    time(c, "FC10 of 10, drive parameters and CMD", Bench::at_rest(), parameters);
    time(
        c,
        "FC06 of CMD, RUN and HARD_STOP",
        Bench::at_rest(),
        [command(Opcode::RunF), command(Opcode::HardStop)],
    );
    time(
        c,
        "FC06 of CMD, RUN forward and back in motion",
        Bench::moving(),
        [command(Opcode::RunR), command(Opcode::RunF)],
    );
    time(c, "FC06 of CMD, refused", Bench::moving(), [command(Opcode::MoveF)]);
}

criterion_group!(core, reads, writes);
criterion_main!(core);
