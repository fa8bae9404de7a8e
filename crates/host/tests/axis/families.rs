//! The two families behind one set of verbs: a stage with a home switch at the negative side, closed from -110 to -100 full
//! steps.

use crate::bench::Bench;
use crate::link;
use crate::station::{self, Station};
use std::sync::Arc;
use stepdrive_drive::smd3::Smd3;
use stepdrive_drive::smsd::{Config, Memory, Smsd, WordOrder};
use stepdrive_host::axis::{DriveAxis, Motor, Smd3Motor, SmsdMotor};
use stepdrive_host::smsd::SmsdOptions;
use stepdrive_rig::machine::Machine;
use stepdrive_rig::mechanics::{Mechanics, Switch};
use stepdrive_spec::smd3::commands::Command;
use stepdrive_spec::smd3::signals::Signal;
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::time::Instant;

const SWITCH: [f64; 2] = [-110.0, -100.0];

/// A controller on the bench.
pub(crate) trait Stage: Sized {
    type Motor: Motor + 'static;

    fn new() -> Self;

    /// Another program's motor of the same controller.
    fn motor(&self) -> Self::Motor;

    /// An axis in full steps.
    fn axis(&self) -> DriveAxis<Self::Motor> {
        DriveAxis::new(self.motor())
    }

    /// Where the carriage is, in full steps from where it began.
    fn carriage(&self) -> f64;

    /// How fast it goes.
    fn speed(&self) -> f64;

    /// How many commands have started motion since this was last asked.
    fn starts(&self) -> usize;

    /// Ends all connections.
    fn cut(&self);

    /// Switches the controller off and on, which ends all connections.
    fn restart(&self);

    /// Lets the reply to the `number`th request from now get lost, the first being 0.
    fn lose_reply(&self, number: usize);

    /// Loses the next request.
    fn lose_request(&self);

    /// Makes every reply come 10 ms late.
    fn slow_down(&self);

    /// Stops the motor by another program.
    async fn stop_behind_its_back(&self);

    /// Moves the motor behind the back of the axis, and waits until it stands.
    async fn move_behind_its_back(&self, full_steps: i64);
}

/// An SMD3 with `L` 1.
pub(crate) struct Smd3Stage {
    pub(crate) station: Arc<Station>,
}

impl Stage for Smd3Stage {
    type Motor = Smd3Motor;

    fn new() -> Smd3Stage {
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

    fn new() -> SmsdStage {
        let bench = Bench::new();
        bench.machine(|machine, _| *machine = with_switch());
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

fn with_switch() -> Machine<Smsd> {
    let config =
        Config { model: Model::Smsd42, word_order: WordOrder::LowFirst, port: 502, autonomous: false };
    let switch = Switch::new(Input::SetZero, SWITCH).expect("wide enough");
    Machine::power_up(Mechanics::new(None, 0.0), vec![switch], |levels| {
        Smsd::power_up(Instant::ZERO, config, Memory::factory(), levels.to_le_bytes()[0])
    })
}

/// That the units of both carriages are the same.
const _: () = assert!(Smd3::ROTOR_UNITS == 256);
