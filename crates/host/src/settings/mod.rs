//! The settings of a controller of either family: which there are, what they can be, and how they are changed.
//!
//! A setting is what a person sets once and a program relies on: [`Key`]. Which there are, their ranges, units and defaults
//! stand in the tables of `stepdrive_spec`. [`changes`] says what has to be sent so that a controller is as it is wanted, in
//! an order that it takes; [`Client`] reads settings, sends changes, and says beforehand whether it can.
//!
//! ```no_run
//! use stepdrive_host::settings::{Client, Key, changes, differences, objection};
//! use stepdrive_host::smd3::Smd3Client;
//! use stepdrive_spec::smd3::commands::Command;
//!
//! # async fn example(drive: &Smd3Client) -> Result<(), stepdrive_host::Error> {
//! let client = Client::Smd3(drive);
//! let wanted = [(Key::Smd3(Command::Vmax), 500.0), (Key::Smd3(Command::Ir), 0.8)];
//! let now = client.read_settings().await?;
//! assert_eq!(objection(&wanted, &now), None);
//! let changes = changes(&wanted, &now);
//! client.check_state("uhv", &changes).await?;
//! client.apply(&changes, |_| {}).await?;
//! assert_eq!(differences(&wanted, &client.read_settings().await?), []);
//! # Ok(())
//! # }
//! ```

mod client;
mod key;
mod plan;
mod words;

pub use client::{Client, Obstacle, Standing};
pub use key::{Family, Key, printed, resolution_of, same};
pub use plan::{Change, Difference, Setting, changes, differences, objection, resolution};
pub use words::{
    choice, inputs, microstepping, mode, motor_type, of_value, plural, stop_current, unit, work_current,
};
