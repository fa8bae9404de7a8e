//! What the tests of an axis want of a controller: a stage with a home switch at the negative side, closed from -110 to -100
//! full steps.

use std::time::Duration;
use stepdrive_drive::smsd::{Config, Memory, Smsd, WordOrder};
use stepdrive_host::axis::{DriveAxis, Motor};
use stepdrive_rig::machine::Machine;
use stepdrive_rig::mechanics::{Mechanics, Switch};
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::standard::{Firmware, VERSION_2};
use stepdrive_spec::time::Instant;

pub(crate) const MS: Duration = Duration::from_millis(1);
pub(crate) const SECOND: Duration = Duration::from_secs(1);

pub(crate) const SWITCH: [f64; 2] = [-110.0, -100.0];

/// A controller on the bench.
pub(crate) trait Stage: Sized {
    type Motor: Motor + 'static;

    async fn new() -> Self;

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

    /// Makes every reply come late.
    fn slow_down(&self, by: Duration);

    /// Stops the motor by another program.
    async fn stop_behind_its_back(&self);

    /// Moves the motor behind the back of the axis, and waits until it stands.
    async fn move_behind_its_back(&self, full_steps: i64);
}

/// A macro that holds a stage to all of these tests of a module, in a module of its own.
macro_rules! suite {
    ($dollar:tt $hold:ident of $module:ident: $($test:ident)+) => {
        macro_rules! $hold {
            ($dollar family:ident to $dollar stage:ty) => {
                mod $dollar family { $(
                    #[tokio::test(start_paused = true)]
                    async fn $test() { crate::$module::$test::<$dollar stage>().await; }
                )+ }
            };
        }
        pub(crate) use $hold;
    };
}
pub(crate) use suite;

/// An SMSD-4.2LAN at 1/16, with the switch at `SET_ZERO`.
pub(crate) fn smsd_with_switch() -> Machine<Smsd> {
    let config = Config {
        model: Model::Smsd42,
        word_order: WordOrder::LowFirst,
        port: 502,
        autonomous: false,
        firmware: Firmware::Modbus,
        protocol_version: VERSION_2,
    };
    let switch = Switch::new(Input::SetZero, SWITCH).expect("wide enough");
    Machine::power_up(Mechanics::new(None, 0.0), vec![switch], |levels| {
        Smsd::power_up(Instant::ZERO, config, Memory::factory(), levels.to_le_bytes()[0])
    })
}
