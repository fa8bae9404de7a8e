//! The settings of a controller over its line.

use super::kind::ControllerKind;
use crate::Failure;
use crate::axis::map::table_name;
use crate::axis::{Client, Opened};
use stepdrive_host::Error;
use stepdrive_host::settings::{Change, Key};
use stepdrive_host::smsd::LanParameters;
use stepdrive_host::uri::Target;

/// What kind of controller it is.
pub(super) async fn identity(opened: &Opened) -> Result<ControllerKind, Failure> {
    Ok(match opened.client() {
        Client::Smsd(client) => ControllerKind::Smsd(client.model().await?),
        Client::Smd3(_) => ControllerKind::Smd3,
    })
}

/// The names of settings that the controller's line does not tell, if there are any among these.
pub(super) fn untold(opened: &Opened, keys: impl IntoIterator<Item = Key>) -> Option<String> {
    let names = keys.into_iter().filter(|key| !opened.client().tells(*key)).map(Key::name);
    let names = names.collect::<Vec<&str>>().join(", ");
    (!names.is_empty()).then_some(names)
}

/// The LAN parameters of an SMSD.
pub(super) async fn lan_of(opened: &Opened) -> Result<Option<LanParameters>, Failure> {
    match opened.client() {
        Client::Smsd(client) => Ok(Some(client.lan_parameters().await?)),
        Client::Smd3(_) => Ok(None),
    }
}

/// What is sent for a change, for people.
pub(super) async fn sent_for(opened: &Opened, change: &Change) -> Result<String, Error> {
    match (&opened.found.target, change.key) {
        (Target::Smsd { .. }, Key::Smsd(reg)) => {
            let row = reg.info();
            Ok(format!("{} {:#06X} = {}", table_name(row.table), row.address, change.to))
        }
        _ => opened.client().sent_for(change).await,
    }
}
