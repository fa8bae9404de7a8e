//! What a family has to do so that its motor can be an axis. All of it is in the motor's own direction and in full steps;
//! user units and what is safe are not its business.

use super::Stop;
use super::stops::Leave;
use crate::connect::BoxFuture;
use crate::direction::Direction;
use crate::error::Error;
use crate::trust::Continuity;
use std::fmt;
use std::time::Duration;

/// A fault that is latched in a controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fault {
    /// The maker's name.
    pub name: &'static str,
    /// What it says.
    pub about: &'static str,
    /// Whether it disables the motor.
    pub disables: bool,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name)
    }
}

/// A motor as it is at one moment.
#[derive(Clone, Debug, PartialEq)]
#[allow(clippy::struct_excessive_bools, reason = "each is a thing of its own to see")]
pub struct Look {
    /// Full steps.
    pub position: f64,
    /// Full steps a second, negative in the negative direction.
    pub speed: f64,
    /// It turns, or is about to.
    pub moving: bool,
    /// It is energised.
    pub energised: bool,
    /// Latched faults.
    pub faults: Vec<Fault>,
    /// The limit switch of the negative direction is active.
    pub limit_negative: bool,
    /// The limit switch of the positive direction is active.
    pub limit_positive: bool,
    /// How far off the position may be shown, in full steps.
    pub within: f64,
}

/// What shapes a motion: full steps a second, and a second squared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile {
    /// Speed at which a ramp begins.
    pub start: f64,
    /// Speed at which it ends.
    pub stop: f64,
    /// Highest speed.
    pub max: f64,
    /// Acceleration.
    pub acceleration: f64,
    /// Deceleration.
    pub deceleration: f64,
}

/// How a controller is set up for motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Setup {
    /// The profile in force.
    pub profile: Profile,
    /// Parts of a full step that targets are counted in.
    pub parts: u16,
    /// The lowest and the highest target, in such parts.
    pub range: (i64, i64),
    /// The farthest that one motion goes, in such parts.
    pub reach: i64,
    /// What of the profile is not known but supposed, in words.
    pub supposed: Option<String>,
}

/// A motion, in parts of a full step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    /// To a position, in the direction in which it lies without passing the end of the counter.
    To {
        /// Where to.
        target: i64,
        /// In which direction.
        direction: Direction,
    },
    /// So far.
    By(i64),
    /// Endless.
    Run(Direction),
}

/// A motion and its speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Order {
    /// The motion.
    pub motion: Motion,
    /// Full steps a second; `None` leaves it as it is.
    pub speed: Option<f64>,
}

/// A motor that can be an axis.
pub trait Motor: Send + Sync + fmt::Debug {
    /// What errors call it.
    fn name(&self) -> &str;

    /// How often its line had to be put in order. Another number: something may have happened to it meanwhile.
    fn upsets(&self) -> BoxFuture<'_, u64>;

    /// The motor as it is now.
    fn look(&self) -> BoxFuture<'_, Result<Look, Error>>;

    /// How it is set up.
    fn setup(&self) -> BoxFuture<'_, Result<Setup, Error>>;

    /// Fails for a speed of an order, in full steps a second, that the controller does not take. Nothing is sent.
    ///
    /// # Errors
    /// [`Error::Usage`], which says what it takes.
    fn check_speed(&self, speed: f64) -> Result<(), Error>;

    /// The same for the speed at which home is looked for.
    ///
    /// # Errors
    /// [`Error::Usage`], which says what it takes.
    fn check_home_speed(&self, speed: f64) -> Result<(), Error> {
        self.check_speed(speed)
    }

    /// What would be sent for an order, for people.
    fn sent_for(&self, order: Order) -> BoxFuture<'_, Result<Vec<String>, Error>>;

    /// Prepares an order: mode, speed. Nothing moves yet.
    fn prepare(&self, order: Order) -> BoxFuture<'_, Result<(), Error>>;

    /// Starts an order that was prepared.
    fn start(&self, order: Order) -> BoxFuture<'_, Result<(), Error>>;

    /// Stops, and ends whatever in the controller would move the motor again by itself. The motor comes first.
    fn stop(&self, how: Stop) -> BoxFuture<'_, Result<(), Error>>;

    /// Looks for the home switch at a speed, takes it as zero, and waits until that is done. It gives up where its leave ends,
    /// and does nothing to the motor behind that.
    fn home<'a>(
        &'a self,
        direction: Direction,
        speed: Option<f64>,
        timeout: Option<Duration>,
        leave: Leave<'a>,
    ) -> BoxFuture<'a, Result<(), Error>>;

    /// Takes the present position as zero.
    fn zero(&self) -> BoxFuture<'_, Result<(), Error>>;

    /// Leaves a mark in the controller, where it has a place for one, by which [`Motor::continuity`] knows that it has
    /// counted since zero was set.
    fn mark(&self) -> BoxFuture<'_, Result<(), Error>>;

    /// What the controller shows about the time since it was seen standing at `place`.
    fn continuity<'a>(
        &'a self,
        place: Option<f64>,
        look: &'a Look,
    ) -> BoxFuture<'a, Result<Continuity, Error>>;

    /// Clears latched faults whose cause is gone.
    fn clear_faults(&self) -> BoxFuture<'_, Result<(), Error>>;
}
