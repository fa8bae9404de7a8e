//! The flags of both families by the makers' names, with what they mean and where that is written.

use crate::member::Client;
use serde::{Serialize, Serializer};
use stepdrive_spec::smd3::flags::{ERROR_FLAGS, FlagBits, FlagInfo, Flags, STATUS_FLAGS};
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::status::{MotStatus, Status};

/// Where the flags of an SMD3 are documented here.
const SMD3_STATUS: &str = "docs/smd3-commands.md#status-flags-the-first-set";
const SMD3_ERRORS: &str = "docs/smd3-commands.md#error-flags-the-second-set";
/// Where the discrete inputs, the inputs and the relay of an SMSD are.
const SMSD_STATUS: &str = "docs/registers.md#discrete-inputs";
const SMSD_INPUTS: &str = "docs/registers.md#input-registers";
const SMSD_RELAY: &str = "docs/registers.md#coils";

/// Tells whether a flag is set.
type IsSet = fn(Status) -> bool;

/// The flags of an SMSD's status, and when each is set.
const SMSD: [(Reg, IsSet); 10] = [
    (Reg::HiZ, |status| status.hi_z),
    (Reg::Stop, |status| status.motion == MotStatus::Stopped),
    (Reg::ConstSpeed, |status| status.motion == MotStatus::ConstantSpeed),
    (Reg::AccFlag, |status| status.motion == MotStatus::Accelerating),
    (Reg::DecFlag, |status| status.motion == MotStatus::Decelerating),
    (Reg::Ready, |status| status.ready),
    (Reg::SwF, |status| status.sw_f),
    (Reg::SwEvn, |status| status.sw_evn),
    (Reg::DirFlag, |status| status.forward),
    (Reg::CmdError, |status| status.cmd_error),
];

/// Names with their values, as an object in JSON that keeps its order.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Named<T>(pub(crate) Vec<(&'static str, T)>);

impl<T: Serialize> Serialize for Named<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(name, value)| (name, value)))
    }
}

/// What is to be known of a flag, an input or an output.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct FlagRow {
    name: &'static str,
    about: &'static str,
    /// Where the maker says so; empty where the table does not tell.
    source: &'static str,
    doc: Option<&'static str>,
    kind: &'static str,
}

/// The flags of an SMSD.
pub(crate) fn of_smsd(status: Status) -> Named<bool> {
    Named(SMSD.iter().map(|(reg, is_set)| (reg.info().name, is_set(status))).collect())
}

/// The flags of an SMD3.
pub(crate) fn of_smd3(flags: Flags) -> Named<bool> {
    let of = |table: &'static [FlagInfo], bits: FlagBits| {
        table.iter().map(move |flag| (flag.name, flag.is_in(bits)))
    };
    Named(of(&STATUS_FLAGS, flags.status).chain(of(&ERROR_FLAGS, flags.error)).collect())
}

/// All that an axis has.
pub(crate) fn table(client: Client<'_>) -> Vec<FlagRow> {
    match client {
        Client::Smsd(_) => smsd_table(),
        Client::Smd3(_) => {
            let rows = |table: &'static [FlagInfo], kind, doc| {
                table.iter().map(move |flag| smd3_row(flag, kind, doc))
            };
            rows(&STATUS_FLAGS, "status", SMD3_STATUS)
                .chain(rows(&ERROR_FLAGS, "error", SMD3_ERRORS))
                .collect()
        }
    }
}

fn smsd_table() -> Vec<FlagRow> {
    let flag = |(reg, _): &(Reg, IsSet)| {
        let row = reg.info();
        let kind = if *reg == Reg::CmdError { "error" } else { "status" };
        FlagRow { name: row.name, about: row.about, source: row.source, doc: Some(SMSD_STATUS), kind }
    };
    let input = |input: Input| FlagRow {
        name: input.name(),
        about: input.about(),
        source: input.source(),
        doc: Some(SMSD_INPUTS),
        kind: "input",
    };
    let relay = Reg::Relay.info();
    let relay = FlagRow {
        name: "relay",
        about: relay.about,
        source: relay.source,
        doc: Some(SMSD_RELAY),
        kind: "output",
    };
    SMSD.iter().map(flag).chain(Input::ALL.into_iter().map(input)).chain([relay]).collect()
}

fn smd3_row(flag: &'static FlagInfo, kind: &'static str, doc: &'static str) -> FlagRow {
    // Where the manual is silent is of interest to who reads its table.
    let about = flag.about.split_once(" ASSUMED").map_or(flag.about, |(about, _)| about);
    FlagRow { name: flag.name, about, source: "manual, Flags", doc: Some(doc), kind }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_flag_of_the_status_word_is_shown_and_by_no_other_value() {
        let set = |word| {
            of_smsd(Status::from_word(word))
                .0
                .into_iter()
                .filter(|(_, on)| *on)
                .map(|(name, _)| name)
                .collect::<Vec<_>>()
        };
        let names = [Reg::HiZ, Reg::Stop, Reg::Ready, Reg::DirFlag].map(|reg| reg.info().name);
        assert_eq!(set(0x13), names);
        assert_eq!(
            set(0xEC),
            [Reg::ConstSpeed, Reg::SwF, Reg::SwEvn, Reg::CmdError].map(|reg| reg.info().name)
        );
    }

    #[test]
    fn names_keep_their_order_in_json() {
        let json = serde_json::to_string(&Named(vec![("b", true), ("a", false)])).expect("JSON");
        assert_eq!(json, r#"{"b":true,"a":false}"#);
    }
}
