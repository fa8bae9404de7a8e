//! The settings of a controller over its line.

use super::key::{Family, Key};
use super::kind::ControllerKind;
use super::plan::Change;
use super::profile::Setting;
use crate::Failure;
use crate::axis::map::table_name;
use crate::axis::{Client, Opened};
use stepdrive_host::Error;
use stepdrive_host::smd3::Smd3Client;
use stepdrive_host::smsd::LanParameters;
use stepdrive_spec::smd3::commands::{Command, Kind, Request, Value};
use stepdrive_spec::smsd::registers::{Reg, Writable};

/// What kind of controller it is.
pub(super) async fn identity(opened: &Opened) -> Result<ControllerKind, Failure> {
    Ok(match opened.client() {
        Client::Smsd(client) => ControllerKind::Smsd(client.model().await?),
        Client::Smd3(_) => ControllerKind::Smd3,
    })
}

/// All settings as they are now.
pub(super) async fn read(opened: &Opened) -> Result<Vec<Setting>, Failure> {
    match opened.client() {
        Client::Smsd(client) => {
            let keys = Key::all(Family::Smsd);
            let regs: Vec<Reg> = keys.iter().filter_map(|key| reg(*key)).collect();
            let values = client.read_many(&regs).await?;
            Ok(keys.into_iter().zip(values).map(|(key, value)| (key, value as f64)).collect())
        }
        Client::Smd3(client) => {
            let mut settings = Vec::new();
            for key in Key::all(Family::Smd3) {
                if let Key::Smd3(command) = key {
                    settings.push((key, client.get_number(command).await?));
                }
            }
            Ok(settings)
        }
    }
}

/// The LAN parameters of an SMSD.
pub(super) async fn lan_of(opened: &Opened) -> Result<Option<LanParameters>, Failure> {
    match opened.client() {
        Client::Smsd(client) => Ok(Some(client.lan_parameters().await?)),
        Client::Smd3(_) => Ok(None),
    }
}

/// Whether the controller takes these changes as it stands now.
///
/// # Errors
/// [`Error::Refused`] when it does not: nothing is changed then.
pub(super) async fn check_state(opened: &Opened, changes: &[Change]) -> Result<(), Failure> {
    match opened.client() {
        Client::Smsd(client) => {
            let needs = |state: Writable| {
                let of = changes.iter().filter_map(|change| reg(change.key));
                of.filter(|reg| reg.info().writable == state).map(|reg| reg.info().name).collect::<Vec<_>>()
            };
            let (hi_z, stopped) = (needs(Writable::HiZ), needs(Writable::Stopped));
            let snapshot = client.snapshot().await?;
            if snapshot.is_moving() && !(hi_z.is_empty() && stopped.is_empty()) {
                let names = [hi_z, stopped].concat().join(", ");
                return Err(refused(
                    opened,
                    &format!("its motor turns, and {names} can be set only while it stands; stop it"),
                ));
            }
            if !snapshot.status.hi_z && !hi_z.is_empty() {
                let names = hi_z.join(", ");
                return Err(refused(
                    opened,
                    &format!(
                        "its motor is energised, and {names} can be set only while it is not; de-energise it (`stepdrive stop --free`)"
                    ),
                ));
            }
        }
        Client::Smd3(client) => {
            let in_standby =
                |change: &&Change| matches!(change.key, Key::Smd3(command) if command.info().standby);
            let names: Vec<&str> =
                changes.iter().filter(in_standby).map(|change| change.key.name()).collect();
            if !names.is_empty() && !client.status().await?.standby() {
                let names = names.join(", ");
                return Err(refused(
                    opened,
                    &format!("its motor is not in standby, which {names} can be set in only; stop it"),
                ));
            }
        }
    }
    Ok(())
}

fn refused(opened: &Opened, why: &str) -> Failure {
    Error::Refused(format!("{} was left as it is: {why} first; nothing was changed", opened.name())).into()
}

/// Sends a change.
pub(super) async fn send(opened: &Opened, change: &Change) -> Result<(), Error> {
    match (opened.client(), change.key) {
        (Client::Smsd(client), Key::Smsd(reg)) => client.write(reg, whole(change.to)).await,
        (Client::Smd3(client), Key::Smd3(command)) => {
            client.set(command, value(command, change.to)).await.map(drop)
        }
        (Client::Smsd(_) | Client::Smd3(_), _) => {
            Err(Error::Usage(format!("it has no {}", change.key.name())))
        }
    }
}

/// What is sent for a change, for people.
pub(super) fn sent_for(change: &Change) -> String {
    match change.key {
        Key::Smsd(reg) => {
            let row = reg.info();
            format!("{} {:#06X} = {}", table_name(row.table), row.address, change.to)
        }
        Key::Smd3(command) => {
            let request = Request { command, argument: Some(value(command, change.to)) };
            Smd3Client::line_of(&request).unwrap_or_else(|error| error.to_string())
        }
    }
}

fn reg(key: Key) -> Option<Reg> {
    match key {
        Key::Smsd(reg) => Some(reg),
        Key::Smd3(_) => None,
    }
}

/// A number as the value that a setting takes.
fn value(command: Command, number: f64) -> Value {
    match command.info().kind {
        Kind::Float => Value::Float(number),
        Kind::Bool => Value::Bool(whole(number) != 0),
        Kind::None | Kind::Int | Kind::Uint | Kind::Sign | Kind::Text => {
            Value::Uint(whole(number).unsigned_abs())
        }
    }
}

/// A value that was checked to be whole.
#[allow(clippy::cast_possible_truncation, reason = "whole, and within the range of its row")]
fn whole(number: f64) -> i64 {
    number as i64
}
