//! A power cut at any instant: what was acknowledged is there, and nothing is torn.

use crate::bench::{Client, Place, Up};
use std::fs;
use std::io;
use std::sync::mpsc;
use std::thread;
use std::time::Duration;
use stepdrive_spec::smsd::registers::Reg;

/// How often the power is cut.
const CUTS: u64 = 25;

/// What one client has written: numbers that count up, from which everything it writes is made.
#[derive(Clone, Copy, Debug, Default)]
struct Written {
    /// The number last acknowledged.
    acknowledged: u32,
    /// The number last sent.
    sent: u32,
}

impl Written {
    /// Whether a drive may remember `number` after a cut.
    fn allows(self, number: u32) -> bool {
        (self.acknowledged..=self.sent).contains(&number)
    }
}

/// What the client has written into the motor configuration and the four program areas.
#[derive(Clone, Copy, Debug, Default)]
struct Ledger {
    motor: Written,
    areas: [Written; 4],
}

/// A motor configuration made of a number; 0 gives the one from the factory.
fn motor(number: u32) -> Vec<u16> {
    if number == 0 {
        return vec![1, 0, 4, 10, 1];
    }
    let part = |modulus: u32| u16::try_from(number % modulus).expect("small");
    vec![part(2), part(46), part(8), part(42) + 1, part(4)]
}

/// A block of 32 instructions made of a number, as registers.
fn block(number: u32) -> Vec<u16> {
    let words = (0..32).map(|line| (number * 32 + line) << 10 | 0x10 << 4);
    words
        .flat_map(|word: u32| [word & 0xFFFF, word >> 16].map(|half| u16::try_from(half).expect("half")))
        .collect()
}

/// Writes until the connection is lost, and reports every acknowledgement.
fn write_on(client: &mut Client, ledger: &mut Ledger, report: &mpsc::Sender<()>) -> io::Result<()> {
    loop {
        let number = ledger.motor.sent + 1;
        ledger.motor.sent = number;
        client.write(Reg::CurrentOrVoltage, &motor(number))?.expect("accepted");
        ledger.motor.acknowledged = number;
        // At the end nobody listens any more.
        let _ = report.send(());

        let area = number % 4;
        let written = &mut ledger.areas[area as usize];
        written.sent = number;
        client.write(Reg::CmdBuffer, &block(number))?.expect("accepted");
        client.procedure([u16::try_from(area).expect("small"), 0, 32, 0, 1])?;
        written.acknowledged = number;
        let _ = report.send(());
    }
}

/// Checks what the drive remembers against what was written, and takes it as written from now on.
fn check(client: &mut Client, ledger: &mut Ledger) {
    let found = client.read(Reg::CurrentOrVoltage, 5).expect("answered").expect("readable");
    let number = (ledger.motor.acknowledged..=ledger.motor.sent).find(|number| motor(*number) == found);
    let number = number.unwrap_or_else(|| panic!("{found:?} was not written: {ledger:?}"));
    ledger.motor = Written { acknowledged: number, sent: number };
    for (area, written) in (0..).zip(&mut ledger.areas) {
        client.procedure([area, 0, 32, 0, 0]).expect("answered");
        let found = client.read(Reg::CmdBuffer, 64).expect("answered").expect("readable");
        let number = (u32::from(found[1]) << 16 | u32::from(found[0])) / (32 << 10);
        assert!(written.allows(number), "area {area} holds {number}: {written:?}");
        assert!(number == 0 || found == block(number), "area {area} is torn");
        *written = Written { acknowledged: number, sent: number };
    }
}

/// Writes in another thread until the program is killed, which is some acknowledgements and some time later.
fn write_and_kill(up: Up, mut client: Client, mut ledger: Ledger, cut: u64) -> Ledger {
    let (report, acknowledged) = mpsc::channel();
    let writer = thread::spawn(move || {
        write_on(&mut client, &mut ledger, &report).expect_err("the connection is lost");
        ledger
    });
    for _ in 0..=cut % 4 {
        acknowledged.recv().expect("it writes on");
    }
    pass(Duration::from_micros(cut * 7919 % 15_000));
    up.kill();
    writer.join().expect("whole")
}

/// Lets a while of the real world pass, in which the program is killed.
fn pass(time: Duration) {
    let (_hold, never) = mpsc::channel::<()>();
    never.recv_timeout(time).expect_err("nothing is sent");
}

#[test]
fn what_was_acknowledged_survives_kills_at_any_instant() {
    let place = Place::new();
    let mut ledger = Ledger::default();
    for cut in 0..CUTS {
        let up = place.up();
        let mut client = up.client();
        check(&mut client, &mut ledger);
        ledger = write_and_kill(up, client, ledger, cut);
    }
    let up = place.up();
    check(&mut up.client(), &mut ledger);
    up.end("TERM");
}

#[test]
fn a_first_start_may_be_killed_at_any_instant() {
    let place = Place::new();
    for cut in 0..CUTS {
        let mut child =
            place.command().args(["up", "rig.toml", "--state", "state"]).spawn().expect("started");
        pass(Duration::from_micros(1000 * cut));
        child.kill().expect("killed");
        child.wait().expect("ended");
        // The next start is a first start again; this one may have been killed before there was a file.
        let _ = fs::remove_file(place.memory());
    }
    place.up().end("TERM");
}
