//! An SMD3 as it is served: its lines and its flash.

use crate::What;
use crate::drive::Drive;
use crate::flash::Flash;
use crate::link::Outgoing;
use crate::recording::RecordedDrive;
use crate::store::StoreError;
use crate::talk::{Heard, LineTalk};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use stepdrive_drive::smd3::{Smd3, Stored};
use stepdrive_proto::smd3::Line;
use stepdrive_rig::group::Group;
use stepdrive_rig::machine::Machine;

/// An SMD3 and its flash.
pub(crate) struct Smd3Station {
    drive: Arc<Drive>,
    flash: Flash,
    /// The generation of the machine's memory that somebody sees to storing.
    stored: AtomicU64,
}

impl Smd3Station {
    /// An SMD3 that has just been switched on.
    pub(crate) fn new(drive: Drive, flash: Flash) -> Smd3Station {
        Smd3Station { drive: Arc::new(drive), flash, stored: AtomicU64::new(0) }
    }

    /// The drive.
    pub(crate) fn drive(&self) -> &Drive {
        &self.drive
    }

    /// What a recording says of it that begins now.
    pub(crate) fn recorded(&self) -> RecordedDrive {
        self.drive.visit(|group, member| {
            let recorded = |machine: &mut Machine<Smd3>| {
                RecordedDrive::smd3(self.drive.name(), machine.drive().stored())
            };
            smd3(group, member).map(recorded).unwrap_or_default()
        })
    }

    /// The drive's flash.
    pub(crate) fn flash(&self) -> &Flash {
        &self.flash
    }

    /// Answers a line into `out`; `bytes` are the line as it came. What `STORE` keeps is safely in the flash by then; when
    /// that fails, the drive still has what it had.
    pub(crate) async fn hear(
        &self,
        conn: u64,
        talk: &mut LineTalk,
        bytes: &[u8],
        line: Line<'_>,
        out: &mut Outgoing,
    ) -> Heard {
        let (heard, before) = self.drive.visit(|group, member| {
            let (heard, before) = talk.hear(group, member, line, out);
            self.drive.record(group, conn, bytes, out, heard);
            self.drive.look_at_line(group, member);
            // This one sees to it.
            self.has_stored(group, member);
            (heard, before)
        });
        if let Some(before) = before
            && let Err(error) = self.store().await
        {
            self.drive.tell(What::StoreFailed(error));
            self.drive.visit(|group, member| {
                talk.undo_store(group, member, &before, out);
                self.drive.record_not_stored(group, conn, bytes, out);
            });
        }
        heard
    }

    /// Sees to what has happened in the drive without a client, such as a `STORE` by a scenario.
    pub(crate) async fn look_after(&self) {
        let stored = self.drive.visit(|group, member| {
            self.drive.look_at_line(group, member);
            self.has_stored(group, member)
        });
        if stored && let Err(error) = self.store().await {
            self.drive.tell(What::StoreFailed(error));
        }
    }

    /// Whether there was a `STORE` since this was last asked.
    fn has_stored(&self, group: &mut Group, member: usize) -> bool {
        let generation = smd3(group, member).map_or(0, |machine| machine.drive().memory_generation());
        self.stored.swap(generation, Ordering::Relaxed) != generation
    }

    async fn store(&self) -> Result<(), StoreError> {
        let drive = Arc::clone(&self.drive);
        let latest = move || {
            drive.visit(|group, member| match smd3(group, member)?.drive().stored() {
                Stored::Intact(settings) => Some(settings.encode().to_vec()),
                Stored::Nothing | Stored::Damaged => None,
            })
        };
        self.flash.save(latest).await.map_err(|error| self.flash.not_written(&error))
    }
}

fn smd3(group: &mut Group, member: usize) -> Option<&mut Machine<Smd3>> {
    group.machine_mut(member)?.smd3_mut()
}
