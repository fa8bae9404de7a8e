//! An SMSD-4.2LAN at 1/16 at its USB port.

use crate::bench::{Act, Bench};
use crate::link::Fault;
use crate::programs::{Controller, ENDS};
use crate::stage::{MS, SECOND, Stage, smsd_with_switch};
use std::time::Duration;
use stepdrive_host::axis::SmsdMotor;
use stepdrive_host::smsd::{Smsd as _, SmsdOptions, SmsdUsbClient};
use stepdrive_spec::smsd::instructions::Opcode;
use stepdrive_spec::smsd::standard::AUTHORISATION_REST;

pub(crate) struct UsbStage {
    bench: Bench,
    /// Another program's, logged in already.
    other: SmsdUsbClient,
}

impl Stage for UsbStage {
    type Motor = SmsdMotor;

    async fn new() -> UsbStage {
        let bench = Bench::new();
        bench.machine(|machine, _| *machine = smsd_with_switch());
        let other = bench.another(SmsdOptions::default());
        other.log_in().await.expect("the factory's password");
        // Nobody can log in earlier after that.
        tokio::time::sleep(AUTHORISATION_REST + MS).await;
        UsbStage { bench, other }
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
        self.bench.faults(std::iter::repeat_n(Fault::None, number).chain([Fault::LoseReply]));
    }

    fn lose_request(&self) {
        self.bench.faults([Fault::LoseRequest]);
    }

    fn slow_down(&self, by: Duration) {
        self.bench.otherwise(Fault::Delay(by));
    }

    async fn stop_behind_its_back(&self) {
        self.other.soft_stop().await.expect("stopped");
    }

    async fn move_behind_its_back(&self, full_steps: i64) {
        self.other.move_by(full_steps * 16).await.expect("started");
        tokio::time::sleep(10 * SECOND).await;
        self.bench.acts();
    }
}

impl Controller for UsbStage {
    fn acts(&self) -> Vec<Opcode> {
        let opcode = |act| match act {
            Act::Instruction(opcode) => Some(opcode).filter(|opcode| opcode.info().in_cmd),
            Act::Password => None,
        };
        self.bench.acts().into_iter().filter_map(opcode).collect()
    }

    fn requests(&self) -> u64 {
        self.bench.requests()
    }

    fn lose_line_behind(&self, requests: usize) {
        self.bench.fault_behind(requests, Fault::Close);
        self.bench.refuse_connections(100);
    }
}
