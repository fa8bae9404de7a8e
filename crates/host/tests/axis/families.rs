//! The two families behind one set of verbs.

use crate::bench::Bench;
use crate::link;
use crate::programs::{Controller, ENDS};
use crate::stage::{SWITCH, Stage, smsd_with_switch};
use crate::station::{self, Station};
use std::sync::Arc;
use std::time::Duration;
use stepdrive_drive::smd3::Smd3;
use stepdrive_host::axis::{Smd3Motor, SmsdMotor};
use stepdrive_host::smsd::{Smsd as _, SmsdOptions};
use stepdrive_proto::smd3::decode_line;
use stepdrive_spec::smd3::commands::Command;
use stepdrive_spec::smd3::signals::Signal;
use stepdrive_spec::smsd::instructions::Opcode;
use stepdrive_spec::smsd::registers::Reg;

/// An SMD3 with `L` 1.
pub(crate) struct Smd3Stage {
    pub(crate) station: Arc<Station>,
}

impl Smd3Stage {
    /// Says something to the drive, on a line of its own.
    fn say(&self, line: &[u8]) {
        self.station.machine(|machine, now| {
            assert!(machine.handle(now, decode_line(line)).outcome.is_ok());
        });
    }
}

impl Stage for Smd3Stage {
    type Motor = Smd3Motor;

    async fn new() -> Smd3Stage {
        let station = Station::with(vec![(Signal::LimitNegative, SWITCH)]);
        let stage = Smd3Stage { station };
        stage.say(b"L,1");
        stage
    }

    fn motor(&self) -> Smd3Motor {
        Smd3Motor::new(self.station.client())
    }

    fn carriage(&self) -> f64 {
        self.station.machine(|machine, now| machine.carriage(now))
    }

    fn speed(&self) -> f64 {
        self.station.machine(|machine, now| machine.drive().speed(now))
    }

    fn starts(&self) -> usize {
        let starts = |command: &Command| command.info().starts;
        self.station.carried_out().iter().filter(|command| starts(command)).count()
    }

    fn cut(&self) {
        self.station.cut();
    }

    fn restart(&self) {
        self.station.restart();
        self.station.cut();
    }

    fn lose_reply(&self, number: usize) {
        let before = std::iter::repeat_n(station::Fault::None, number);
        self.station.faults(before.chain([station::Fault::LoseReply]));
    }

    fn lose_request(&self) {
        self.station.faults([station::Fault::LoseLine]);
    }

    fn slow_down(&self, by: Duration) {
        self.station.otherwise(station::Fault::Delay(by));
    }

    async fn stop_behind_its_back(&self) {
        self.say(b"STOP");
    }

    async fn move_behind_its_back(&self, full_steps: i64) {
        self.say(format!("RUNR,{full_steps}").as_bytes());
        tokio::time::sleep(station::SECOND * 10).await;
    }
}

/// Coils that stop, and what they do.
const COILS: [(Reg, Opcode); 3] =
    [(Reg::SoftStop, Opcode::SoftStop), (Reg::HardStop, Opcode::HardStop), (Reg::SoftHiZ, Opcode::SoftHiZ)];

/// An SMSD-4.2LAN at 1/16.
pub(crate) struct SmsdStage {
    pub(crate) bench: Bench,
}

impl Stage for SmsdStage {
    type Motor = SmsdMotor;

    async fn new() -> SmsdStage {
        let bench = Bench::new();
        bench.machine(|machine, _| *machine = smsd_with_switch());
        SmsdStage { bench }
    }

    fn motor(&self) -> SmsdMotor {
        SmsdMotor::new("stage", self.bench.another(SmsdOptions::default()))
    }

    fn carriage(&self) -> f64 {
        self.bench.machine(|machine, now| {
            machine.advance(now);
            machine.carriage(now)
        })
    }

    fn speed(&self) -> f64 {
        self.bench.machine(|machine, now| {
            machine.advance(now);
            machine.drive().speed(now)
        })
    }

    fn starts(&self) -> usize {
        self.acts().iter().filter(|opcode| !ENDS.contains(opcode)).count()
    }

    fn cut(&self) {
        self.bench.cut();
    }

    fn restart(&self) {
        self.bench.machine(|machine, now| {
            machine.switch_off(now);
            machine.switch_on(now);
        });
        self.bench.cut();
    }

    fn lose_reply(&self, number: usize) {
        let before = std::iter::repeat_n(link::Fault::None, number);
        self.bench.faults(before.chain([link::Fault::LoseReply]));
    }

    fn lose_request(&self) {
        self.bench.faults([link::Fault::LoseRequest]);
    }

    fn slow_down(&self, by: Duration) {
        self.bench.otherwise(link::Fault::Delay(by));
    }

    async fn stop_behind_its_back(&self) {
        self.bench.another(SmsdOptions::default()).soft_stop().await.expect("stopped");
    }

    async fn move_behind_its_back(&self, full_steps: i64) {
        let client = self.bench.another(SmsdOptions::default());
        client.move_by(full_steps * 16).await.expect("started");
        tokio::time::sleep(station::SECOND * 10).await;
        self.bench.acts();
    }
}

impl Controller for SmsdStage {
    fn acts(&self) -> Vec<Opcode> {
        let opcode = |(reg, value): (Reg, u16)| {
            let coil = COILS.iter().find(|(coil, _)| *coil == reg).map(|(_, opcode)| *opcode);
            coil.or_else(|| Opcode::from_cmd(value).filter(|_| reg == Reg::Cmd))
        };
        self.bench.acts().into_iter().filter_map(opcode).collect()
    }

    fn requests(&self) -> u64 {
        self.bench.requests()
    }

    fn lose_line_behind(&self, requests: usize) {
        self.bench.fault_behind(requests, link::Fault::Close);
        self.bench.refuse_connections(100);
    }
}

/// That the units of both carriages are the same.
const _: () = assert!(Smd3::ROTOR_UNITS == 256);
