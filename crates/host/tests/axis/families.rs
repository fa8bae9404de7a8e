//! The two families behind one set of verbs.

use crate::bench::Bench;
use crate::link;
use crate::stage::{SWITCH, Stage, smsd_with_switch};
use crate::station::{self, Station};
use std::sync::Arc;
use stepdrive_drive::smd3::Smd3;
use stepdrive_host::axis::{Smd3Motor, SmsdMotor};
use stepdrive_host::smsd::{Smsd as _, SmsdOptions};
use stepdrive_spec::smd3::commands::Command;
use stepdrive_spec::smd3::signals::Signal;
use stepdrive_spec::smsd::registers::Reg;

/// An SMD3 with `L` 1.
pub(crate) struct Smd3Stage {
    pub(crate) station: Arc<Station>,
}

impl Stage for Smd3Stage {
    type Motor = Smd3Motor;

    async fn new() -> Smd3Stage {
        let station = Station::with(vec![(Signal::LimitNegative, SWITCH)]);
        station.machine(|machine, now| {
            let line = stepdrive_proto::smd3::decode_line(b"L,1");
            assert!(machine.handle(now, line).outcome.is_ok());
        });
        Smd3Stage { station }
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

    fn slow_down(&self) {
        self.station.otherwise(station::Fault::Delay(station::MS * 10));
    }

    async fn stop_behind_its_back(&self) {
        self.station.client().stop().await.expect("stopped");
    }

    async fn move_behind_its_back(&self, full_steps: i64) {
        let client = self.station.client();
        client.runr(full_steps).await.expect("started");
        tokio::time::sleep(station::SECOND * 10).await;
        self.station.carried_out();
    }
}

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
        self.bench.acts().iter().filter(|(reg, _)| *reg == Reg::Cmd).count()
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

    fn slow_down(&self) {
        self.bench.otherwise(link::Fault::Delay(station::MS * 10));
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

/// That the units of both carriages are the same.
const _: () = assert!(Smd3::ROTOR_UNITS == 256);
