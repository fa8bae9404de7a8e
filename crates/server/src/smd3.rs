//! An SMD3 as it is served: its lines and its flash.

use crate::What;
use crate::clock::Clock;
use crate::flash::Flash;
use crate::station::{Notify, Station};
use crate::store::StoreError;
use std::path::Path;
use std::sync::Arc;
use stepdrive_drive::smd3::{Smd3, Stored};
use stepdrive_proto::smd3::{Line, LineBuf, encode_reply};
use stepdrive_rig::file::{DriveSection, Smd3Section};
use stepdrive_spec::smd3::commands::{Command, Request};
use stepdrive_spec::smd3::errors::Error;

/// An SMD3 and its flash.
pub(crate) struct Smd3Station {
    station: Arc<Station<Smd3>>,
    flash: Flash,
}

impl Smd3Station {
    /// Switches on the machine of a drive with what its flash holds.
    pub(crate) fn power_up(
        drive: &DriveSection,
        section: &Smd3Section,
        clock: Clock,
        state: &Path,
        notify: Notify,
    ) -> Result<Smd3Station, StoreError> {
        let flash = Flash::new(state, &drive.name);
        let (stored, damaged) = flash.load()?;
        let machine = section.power_up(drive, stored);
        let station = Arc::new(Station::new(drive.name.clone(), clock, notify, machine));
        if let Some(copy) = damaged {
            station.tell(What::DamagedConfiguration { copy });
        }
        Ok(Smd3Station { station, flash })
    }

    /// The drive's name in the rig.
    pub(crate) fn name(&self) -> &str {
        self.station.name()
    }

    /// The drive's flash.
    pub(crate) fn flash(&self) -> &Flash {
        &self.flash
    }

    /// Tells the person at the server.
    pub(crate) fn tell(&self, what: What) {
        self.station.tell(what);
    }

    /// Answers a line into `out`. What `STORE` keeps is safely in the flash by then; when that fails, the drive still has
    /// what it had.
    pub(crate) async fn answer(&self, line: Line<'_>, out: &mut LineBuf) {
        let line = line.decode();
        let (mut reply, before) = self.station.visit(|machine, now| {
            let generation = machine.drive().memory_generation();
            let may_store = matches!(line, Ok(Some(Request { command: Command::Store, .. })));
            let before = may_store.then(|| *machine.drive().stored());
            let reply = machine.handle(now, line);
            (reply, before.filter(|_| machine.drive().memory_generation() != generation))
        });
        if let Some(before) = before
            && let Err(error) = self.store().await
        {
            self.station.visit(|machine, _| machine.drive_mut().undo_store(before));
            self.tell(What::StoreFailed(error));
            reply.outcome = Err(Error::ActionFailed);
        }
        encode_reply(out, &reply);
    }

    async fn store(&self) -> Result<(), StoreError> {
        let station = Arc::clone(&self.station);
        let latest = move || {
            station.visit(|machine, _| match machine.drive().stored() {
                Stored::Intact(settings) => Some(settings.encode().to_vec()),
                Stored::Nothing | Stored::Damaged => None,
            })
        };
        self.flash.save(latest).await.map_err(|error| self.flash.not_written(&error))
    }

    /// Wakes the machine when it wants to be woken, for as long as it is served.
    pub(crate) async fn keep_time(self: Arc<Self>) {
        loop {
            self.station.wake().await;
        }
    }
}
