//! What the control API tells about a rig. What is not shown here is not read.

use serde::de::{Deserializer, MapAccess, Visitor};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::marker::PhantomData;
use std::time::Duration;
use stepdrive_rig::duration;

/// A rig at a time.
#[derive(Debug, Deserialize)]
pub(super) struct RigState {
    /// Rig time, nanoseconds.
    pub(super) now_ns: u64,
    /// How it passes.
    pub(super) clock: Clock,
    /// The drives, in the order of the rig file.
    pub(super) drives: Vec<DriveState>,
    /// The wires, in the order of the rig file.
    #[serde(default)]
    pub(super) wires: Vec<Wire>,
    /// The scenario that is being played.
    #[serde(default)]
    pub(super) playing: Option<String>,
}

/// How rig time passes.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub(super) struct Clock {
    /// `real`, `x100`, `paused`.
    pub(super) mode: String,
    /// How much of the speed that was asked for is reached: 1 is all of it.
    #[serde(default)]
    pub(super) speed_reached: Option<f64>,
}

/// A drive.
#[derive(Debug, Deserialize)]
pub(crate) struct DriveState {
    /// Its name.
    pub(crate) name: String,
    /// Its model.
    pub(crate) model: String,
    /// Whether it has its supply.
    pub(super) powered: bool,
    /// What it does, in a word or a few.
    pub(super) state: String,
    /// Its position, in the controller's unit.
    pub(super) position: f64,
    /// Its speed, in the controller's unit.
    pub(super) speed: f64,
    /// Where the carriage is on its travel, full steps.
    #[serde(default)]
    pub(super) carriage: f64,
    /// Whether the rotor is held or driven against an end.
    #[serde(default)]
    pub(super) stalled: bool,
    /// Its inputs.
    #[serde(default)]
    pub(super) inputs: Ordered<Input>,
    /// Its outputs, and whether they are on.
    #[serde(default)]
    pub(super) outputs: Ordered<bool>,
    /// The faults that are on, and their settings.
    #[serde(default)]
    pub(super) faults: Ordered<String>,
    /// Where it listens for Modbus TCP.
    #[serde(default)]
    pub(crate) modbus_tcp: Option<String>,
    /// Where it listens for the standard protocol, with the standard firmware.
    #[serde(default)]
    pub(crate) standard_tcp: Option<String>,
    /// The virtual COM port that stands for its USB.
    #[serde(default)]
    pub(crate) usb: Option<String>,
    /// Where it takes over TCP what comes over USB.
    #[serde(default)]
    pub(crate) usb_tcp: Option<String>,
    /// Its virtual COM port.
    #[serde(default)]
    pub(crate) serial: Option<String>,
    /// Where it takes lines over TCP.
    #[serde(default)]
    pub(crate) serial_tcp: Option<String>,
}

/// A drive with all that has a value.
#[derive(Debug, Deserialize)]
pub(super) struct DriveDetail {
    /// What is told of each drive.
    #[serde(flatten)]
    pub(super) state: DriveState,
    /// Everything else about it that has a value.
    pub(super) quantities: Ordered<serde_json::Value>,
}

/// An input.
#[derive(Debug, Deserialize)]
pub(super) struct Input {
    /// Whether it is high.
    pub(super) level: bool,
    /// The level that it is forced to.
    #[serde(default)]
    pub(super) forced: Option<bool>,
}

/// A wire.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Wire {
    /// The output at which it begins.
    pub(super) from: String,
    /// The input at which it ends.
    pub(super) to: String,
    /// How much later a change arrives.
    #[serde(default)]
    pub(super) delay_ns: u64,
    /// Whether it arrives the other way round.
    #[serde(default)]
    pub(super) invert: bool,
    /// Whether it is whole.
    pub(super) connected: bool,
    /// The level that arrives.
    #[serde(default)]
    pub(super) level: bool,
}

/// A fault that a drive can have.
#[derive(Debug, Deserialize)]
pub(super) struct Fault {
    /// The drive.
    pub(super) drive: String,
    /// Its name.
    pub(super) name: String,
    /// The settings that it has.
    pub(super) settings: String,
    /// What it is, in a line.
    #[serde(default)]
    pub(super) about: String,
    /// The setting it has now.
    pub(super) setting: String,
}

/// The time at which something was done.
#[derive(Debug, Deserialize)]
pub(super) struct Done {
    /// Rig time, nanoseconds.
    pub(super) now_ns: u64,
}

/// The clock when it was set.
#[derive(Debug, Deserialize)]
pub(super) struct ClockSet {
    /// How rig time passes from now on.
    pub(super) mode: String,
    /// Rig time, nanoseconds.
    pub(super) now_ns: u64,
}

/// Where moving rig time has led.
#[derive(Debug, Deserialize)]
pub(super) struct Arrived {
    /// Whether what it was moved to was reached.
    pub(super) reached: bool,
    /// Rig time, nanoseconds.
    pub(super) now_ns: u64,
}

/// Rig time as a person reads it.
pub(super) fn time(nanoseconds: u64) -> String {
    duration::display(Duration::from_nanos(nanoseconds)).to_string()
}

/// An object of JSON, in the order in which it was written.
#[derive(Debug)]
pub(super) struct Ordered<T>(pub(super) Vec<(String, T)>);

impl<T> Default for Ordered<T> {
    fn default() -> Ordered<T> {
        Ordered(Vec::new())
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Ordered<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Ordered<T>, D::Error> {
        deserializer.deserialize_map(Entries(PhantomData))
    }
}

struct Entries<T>(PhantomData<T>);

impl<'de, T: Deserialize<'de>> Visitor<'de> for Entries<T> {
    type Value = Ordered<T>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Ordered<T>, A::Error> {
        let mut entries = Vec::new();
        while let Some(entry) = map.next_entry()? {
            entries.push(entry);
        }
        Ok(Ordered(entries))
    }
}
