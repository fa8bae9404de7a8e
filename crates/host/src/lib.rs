//! Drivers for SMSD and SMD3 stepper motor controllers, real or virtual.
//!
//! They speak the controllers' own protocols and do not know which kind they speak to.
//!
//! | | |
//! |---|---|
//! | [`axis::Axis`] | what both families can do, in user units, with soft limits and trust in the position |
//! | [`smsd::Smsd`] | everything an SMSD has |
//! | [`smsd::SmsdClient`] | that over Modbus TCP |
//! | [`smsd::SmsdUsbClient`] | that over USB, or TCP with the standard firmware |
//! | [`settings`] | the settings of both families: what there is, what it can be, how it is changed |
//! | [`smd3::Smd3Client`] | everything an SMD3 has, over its serial port or TCP |
//! | [`uri::Target`] | where a controller is |
//! | [`blocking::Blocking`] | any of these for programs that are not asynchronous |
//!
//! # An axis
//!
//! ```no_run
//! use stepdrive_host::Direction;
//! use stepdrive_host::axis::{AxisOptions, MoveOptions, SoftLimits, open};
//! use stepdrive_host::units::{Amount, Decimal, Goal, Scale};
//! use stepdrive_host::uri::Target;
//!
//! # async fn example() -> Result<(), stepdrive_host::Error> {
//! // A screw of 5 mm on a motor of 200 steps, which may go from 0 to 100 mm.
//! let options = AxisOptions {
//!     scale: Scale::millimetres(Decimal::whole(5), 200)?,
//!     limits: SoftLimits::new(Decimal::ZERO, Decimal::whole(100))?,
//!     ..AxisOptions::default()
//! };
//! let axis = open(&Target::parse("192.168.1.2:502")?, &options);
//! axis.home(Direction::Negative, MoveOptions::default()).await?;
//! let plan = axis.plan(Goal::parse("to 12.5mm")?, MoveOptions::default()).await?;
//! println!("{} in {:?}", plan.distance, plan.duration);
//! axis.move_to(Amount::parse("12.5mm")?, MoveOptions::default()).await?;
//! # Ok(())
//! # }
//! ```

pub mod axis;
pub mod blocking;
mod connect;
mod direction;
mod error;
mod serial;
pub mod settings;
pub mod smd3;
pub mod smsd;
pub mod trust;
pub mod units;
pub mod uri;
mod wire;

pub use connect::{BoxFuture, Connect, Stream, Tcp, from_fn};
pub use direction::Direction;
pub use error::{Error, LineError};
pub use serial::{Serial, serial_ports};
pub use wire::Timeouts;
