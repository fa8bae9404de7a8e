//! An axis: what a controller of either family can do with one, in user units.
//!
//! [`Axis`] is what programs and the command line see. [`DriveAxis`] is one over a [`Motor`], which is what a family has
//! to do for it: [`Smd3Motor`] and [`SmsdMotor`]. Units, soft limits, trust, plans, stops and waiting are the same for both
//! and stand in `driven`, `checks`, `plan`, `stops` and `wait`.

mod checks;
mod driven;
mod limits;
mod motor;
mod open;
mod plan;
mod smd3;
mod smsd;
mod speed;
mod stops;
mod wait;

pub use driven::DriveAxis;
pub use limits::SoftLimits;
pub use motor::{Fault, Look, Motion, Motor, Order, Profile, Setup};
pub use open::{AxisOptions, open};
pub use plan::Plan;
pub use smd3::Smd3Motor;
pub use smsd::SmsdMotor;
pub use stops::Leave;

use crate::connect::BoxFuture;
use crate::direction::Direction;
use crate::error::Error;
use crate::trust::{Doubt, Trust, TrustState};
use crate::units::{Amount, Goal, Scale, Speed};
use std::fmt;
use std::time::Duration;

/// How a motor is stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Stop {
    /// It brakes and holds. SMSD: `SOFT_STOP`; SMD3: `STOP`.
    Soft,
    /// It stands at once. SMSD: `HARD_STOP`, and it holds; SMD3: `ESTOP`, and it is disabled until the fault is cleared, as
    /// nothing else stops it at once.
    Hard,
    /// It brakes, and is then de-energised. SMSD: `SOFT_HI_Z`; SMD3: `STOP`, and `ESTOP` once it stands.
    Free,
}

/// What may be said about a move.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MoveOptions {
    /// Speed of the move; the one that the controller has otherwise. It is set in the controller (`MAX_SPEED`, `VMAX`)
    /// and stays.
    pub speed: Option<Speed>,
    /// Return as soon as it has begun.
    pub no_wait: bool,
    /// Go to a position that is not trusted.
    pub override_trust: bool,
    /// How long to wait at most; for as long as it takes otherwise.
    pub timeout: Option<Duration>,
}

/// An axis as it is at one moment.
#[derive(Clone, Debug, PartialEq)]
#[allow(clippy::struct_excessive_bools, reason = "each is a thing of its own to see")]
pub struct AxisState {
    /// Where it is, to the millionth.
    pub position: Amount,
    /// The same in full steps as the controller counts them.
    pub full_steps: f64,
    /// Speed in the axis' unit a second, negative towards lower positions.
    pub speed: f64,
    /// Whether it moves, or is about to.
    pub moving: bool,
    /// Whether the motor is energised, as far as the controller tells.
    pub energised: bool,
    /// Faults that are latched.
    pub faults: Vec<Fault>,
    /// Whether the limit switch towards lower positions is active, used or not.
    pub limit_negative: bool,
    /// The same towards higher positions.
    pub limit_positive: bool,
    /// Whether it is within the soft limits, or there are none.
    pub within_soft_limits: bool,
    /// Whether the position can be believed.
    pub trust: Trust,
    /// Why not.
    pub doubt: Option<Doubt>,
}

/// An axis, of whichever family, in user units.
///
/// Nothing here moves the motor but [`Axis::go`], [`Axis::run`] and [`Axis::home`] with what is built on them. Every call may
/// be dropped at any point: a motion that has begun goes on then, and [`Axis::stop`] ends it.
///
/// A stop ends every motion that was asked for before it: also one that another task still prepares, and homing at any
/// moment. What counts is when [`Axis::stop`], [`Axis::go`], [`Axis::run`] and [`Axis::home`] are called, not when their
/// futures are first polled. So a caller may make the future of a motion, do something else that takes time, and await it
/// then: a stop that came meanwhile is not lost.
pub trait Axis: Send + Sync + fmt::Debug {
    /// What errors call it.
    fn name(&self) -> &str;

    /// How it is measured.
    fn scale(&self) -> &Scale;

    /// The soft limits.
    fn soft_limits(&self) -> SoftLimits;

    /// The trust in its position, as of the last call that looked at it. To be kept when the program ends, and given to
    /// [`DriveAxis::with_trust`] when it starts again.
    fn trust(&self) -> TrustState;

    /// Says that something has spoilt the position, as a stall that somebody saw.
    fn distrust(&self, doubt: Doubt);

    /// Takes over the trust that another program has noted, as after it has homed the axis. Whether it still holds is found
    /// out at the next look.
    fn believe(&self, trust: TrustState);

    /// The axis as it is now.
    fn state(&self) -> BoxFuture<'_, Result<AxisState, Error>>;

    /// What [`Axis::go`] would do, checked in the same way. Reads, and changes nothing.
    ///
    /// # Errors
    /// Those of [`Axis::go`] that come before anything is sent.
    fn plan(&self, goal: Goal, options: MoveOptions) -> BoxFuture<'_, Result<Plan, Error>>;

    /// Moves, and waits until the axis is there unless told not to. Answers what was done.
    ///
    /// # Errors
    /// Before anything is sent: [`Error::Usage`] when the unit does not fit, or the move or its speed is out of the
    /// controller's range;
    /// [`Error::Refused`] when the goal is beyond a soft limit, the position is not trusted, or the axis moves already;
    /// [`Error::Fault`] when a fault is latched.
    /// Afterwards: [`Error::Refused`] when a limit or somebody stopped it before it was there, [`Error::Fault`] when a fault
    /// did, [`Error::Uncertain`] when the reply to the command was lost, [`Error::Device`] after the timeout.
    fn go(&self, goal: Goal, options: MoveOptions) -> BoxFuture<'_, Result<Plan, Error>>;

    /// Turns in a direction until it is stopped; with soft limits, until it comes to the one that lies there.
    ///
    /// # Errors
    /// Those of [`Axis::go`].
    fn run(&self, direction: Direction, options: MoveOptions) -> BoxFuture<'_, Result<(), Error>>;

    /// Stops. A stop is never refused for what the axis is or was told. It goes out at once; once it is answered, nothing that
    /// was asked for before it starts the motor any more. What was under way then fails with [`Error::Refused`].
    ///
    /// It also ends a user program that runs in an SMSD, which would move the motor again: the motor is stopped first, then
    /// the program, and then the motor once more, as the program may have moved it in between. Where the line tells whether
    /// one runs, that costs two readings behind the stop if there is none; over USB it is always done, two packets.
    ///
    /// # Errors
    /// [`Error::Line`] when the controller cannot be reached, and [`Error::Uncertain`] when no reply came however often it
    /// was sent. [`Error::Partly`] when the motor was stopped, but a user program may still run and move it again.
    fn stop(&self, how: Stop) -> BoxFuture<'_, Result<(), Error>>;

    /// Looks for the home switch in a direction, waits, and takes its place as zero. Soft limits do not count: they have a
    /// meaning only afterwards.
    ///
    /// # Errors
    /// [`Error::Usage`] when the controller does not take the speed. [`Error::Refused`] when the switch is not in use or was
    /// not found, or when it was told to stop meanwhile, [`Error::Fault`] when a fault is latched, [`Error::Device`] after the
    /// timeout; the motor is then stopped. However it fails once the motor may have been told to move, or when it is dropped,
    /// the position is unknown.
    fn home(&self, direction: Direction, options: MoveOptions) -> BoxFuture<'_, Result<(), Error>>;

    /// Takes the place where the axis stands as zero.
    ///
    /// # Errors
    /// [`Error::Refused`] when it moves or its motor is de-energised, [`Error::Fault`] when a fault is latched.
    fn zero(&self) -> BoxFuture<'_, Result<(), Error>>;

    /// Waits until the axis stands, looking every 5 ms at first and every 100 ms in the end.
    ///
    /// # Errors
    /// [`Error::Device`] after the timeout, and [`Error::Fault`] when a fault is latched.
    fn wait_done(&self, timeout: Option<Duration>) -> BoxFuture<'_, Result<AxisState, Error>>;

    /// Clears latched faults whose cause is gone. Answers those that are left.
    ///
    /// # Errors
    /// [`Error::Line`] when the controller cannot be reached.
    fn clear_faults(&self) -> BoxFuture<'_, Result<Vec<Fault>, Error>>;

    /// Goes to a position.
    ///
    /// # Errors
    /// Those of [`Axis::go`].
    fn move_to(&self, position: Amount, options: MoveOptions) -> BoxFuture<'_, Result<Plan, Error>> {
        self.go(Goal::To(position), options)
    }

    /// Goes so far.
    ///
    /// # Errors
    /// Those of [`Axis::go`].
    fn move_by(&self, distance: Amount, options: MoveOptions) -> BoxFuture<'_, Result<Plan, Error>> {
        self.go(Goal::By(distance), options)
    }

    /// Where it is.
    ///
    /// # Errors
    /// [`Error::Line`] when the controller cannot be reached.
    fn position(&self) -> BoxFuture<'_, Result<Amount, Error>> {
        Box::pin(async { Ok(self.state().await?.position) })
    }

    /// Its speed in its unit a second.
    ///
    /// # Errors
    /// [`Error::Line`] when the controller cannot be reached.
    fn speed(&self) -> BoxFuture<'_, Result<f64, Error>> {
        Box::pin(async { Ok(self.state().await?.speed) })
    }

    /// The faults that are latched.
    ///
    /// # Errors
    /// [`Error::Line`] when the controller cannot be reached.
    fn faults(&self) -> BoxFuture<'_, Result<Vec<Fault>, Error>> {
        Box::pin(async { Ok(self.state().await?.faults) })
    }
}
