//! What can be seen of a rig, as clients get it.

use super::mechanism::MechanismRow;
use serde::{Serialize, Serializer};

/// The rig.
#[derive(Serialize)]
pub(super) struct RigRow {
    pub(super) now_ns: u64,
    pub(super) clock: ClockRow,
    pub(super) drives: Vec<DriveRow>,
    pub(super) wires: Vec<WireRow>,
    /// The name of the scenario that is being played.
    pub(super) playing: Option<String>,
}

impl RigRow {
    /// Whether nothing differs but the time and the speed that is reached.
    pub(super) fn is_like(&self, other: &RigRow) -> bool {
        self.clock.mode == other.clock.mode
            && self.drives == other.drives
            && self.wires == other.wires
            && self.playing == other.playing
    }
}

/// The clock.
#[derive(Serialize)]
pub(super) struct ClockRow {
    pub(super) mode: String,
    pub(super) speed_reached: f64,
}

/// A wire.
#[derive(PartialEq, Serialize)]
pub(super) struct WireRow {
    pub(super) from: String,
    pub(super) to: String,
    pub(super) delay_ns: u64,
    pub(super) invert: bool,
    pub(super) connected: bool,
    pub(super) level: bool,
}

/// A drive.
#[derive(PartialEq, Serialize)]
pub(super) struct DriveRow {
    pub(super) name: String,
    pub(super) model: &'static str,
    pub(super) powered: bool,
    pub(super) state: String,
    pub(super) position: f64,
    pub(super) speed: f64,
    pub(super) carriage: f64,
    pub(super) stalled: bool,
    pub(super) inputs: Named<&'static str, InputRow>,
    pub(super) outputs: Named<&'static str, bool>,
    pub(super) faults: Named<String, String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) modbus_tcp: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) standard_tcp: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) usb: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) usb_tcp: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) serial: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) serial_tcp: Option<String>,
    /// Where one drive is looked at by itself.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) mechanism: Option<MechanismRow>,
}

/// An input.
#[derive(PartialEq, Serialize)]
pub(super) struct InputRow {
    pub(super) level: bool,
    /// What it is forced to.
    pub(super) forced: Option<bool>,
}

/// A drive with all that it can be asked for.
#[derive(Serialize)]
pub(super) struct DriveDetail {
    #[serde(flatten)]
    pub(super) drive: DriveRow,
    pub(super) quantities: Named<String, f64>,
}

/// A fault that a drive can have.
#[derive(Serialize)]
pub(super) struct FaultRow {
    pub(super) drive: String,
    pub(super) name: String,
    pub(super) settings: String,
    pub(super) about: &'static str,
    pub(super) setting: String,
}

/// Values by name, in the makers' order: a JSON object.
#[derive(PartialEq)]
pub(super) struct Named<K, V>(Vec<(K, V)>);

impl<K, V> FromIterator<(K, V)> for Named<K, V> {
    fn from_iter<I: IntoIterator<Item = (K, V)>>(pairs: I) -> Named<K, V> {
        Named(pairs.into_iter().collect())
    }
}

impl<K: Serialize, V: Serialize> Serialize for Named<K, V> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(name, value)| (name, value)))
    }
}
