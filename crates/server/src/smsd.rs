//! An SMSD as it is served: its requests, its memory, its place in the network.

use crate::What;
use crate::drive::Drive;
use crate::link::Outgoing;
use crate::recording::RecordedDrive;
use crate::store::Saver;
use crate::talk::{Heard, ModbusTalk, PacketTalk};
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use stepdrive_drive::smsd::{Event, Smsd};
use stepdrive_proto::modbus::Frame;
use stepdrive_proto::smsd::Taken;
use stepdrive_rig::file::SmsdSection;
use stepdrive_rig::group::Group;
use stepdrive_rig::machine::Machine;
use stepdrive_spec::smsd::standard::{Counter, Firmware};

/// An SMSD and where its memory is kept.
pub(crate) struct SmsdStation {
    drive: Drive,
    model: &'static str,
    firmware: Firmware,
    /// The address that the rig gives, with the real port once it is known. LAN parameters may name another port.
    rig_address: SocketAddr,
    /// Rung when LAN parameters have been applied and the reply has been sent.
    reconfigured: tokio::sync::Notify,
    /// The generation of the machine's memory that is safely stored.
    stored: AtomicU64,
    saver: Saver,
}

/// What has to be done before and after a reply is sent.
#[derive(Debug, Default)]
pub(crate) struct Duties {
    /// Memory has changed: call [`SmsdStation::store`] before the reply is sent.
    pub(crate) store: bool,
    /// LAN parameters were applied: call [`SmsdStation::reconfigure`] once the reply is sent.
    pub(crate) reconfigure: bool,
}

impl SmsdStation {
    /// An SMSD that has just been switched on.
    pub(crate) fn new(drive: Drive, section: &SmsdSection, saver: Saver) -> SmsdStation {
        let mut station = SmsdStation {
            drive,
            model: section.model.name(),
            firmware: section.lan.firmware,
            rig_address: section.lan.address,
            reconfigured: tokio::sync::Notify::new(),
            stored: AtomicU64::new(0),
            saver,
        };
        station.stored =
            AtomicU64::new(station.look(|machine| machine.drive().memory_generation()).unwrap_or(0));
        station
    }

    /// The drive.
    pub(crate) fn drive(&self) -> &Drive {
        &self.drive
    }

    /// The model's name.
    pub(crate) fn model(&self) -> &'static str {
        self.model
    }

    /// What it runs.
    pub(crate) fn firmware(&self) -> Firmware {
        self.firmware
    }

    /// What a recording says of it that begins now.
    pub(crate) fn recorded(&self) -> RecordedDrive {
        let recorded = self.look(|machine| RecordedDrive::smsd(self.drive.name(), machine.drive().memory()));
        RecordedDrive { port: Some(self.rig_address.port()), ..recorded.unwrap_or_default() }
    }

    /// The unit identifier in effect.
    pub(crate) fn unit(&self) -> u8 {
        self.look(|machine| machine.drive().unit()).unwrap_or(0)
    }

    /// Where the drive wants to be reached: at the rig's address, on the port of its LAN parameters if they name one.
    pub(crate) fn address(&self) -> SocketAddr {
        SocketAddr::new(self.rig_address.ip(), self.lan_port().unwrap_or(self.rig_address.port()))
    }

    /// The port that the LAN parameters name; `None` while the rig's counts.
    pub(crate) fn lan_port(&self) -> Option<u16> {
        self.look(|machine| machine.drive().memory().lan.port).flatten()
    }

    /// Tells the drive which port it has got from a rig that left it open.
    pub(crate) fn set_rig_port(&mut self, port: u16) {
        self.rig_address.set_port(port);
        self.look(|machine| machine.drive_mut().set_port(port));
    }

    /// Answers a frame of Modbus into `out`.
    pub(crate) fn hear(
        &self,
        conn: u64,
        talk: &mut ModbusTalk,
        frame: &[u8],
        parsed: &Frame<'_>,
        out: &mut Outgoing,
    ) -> (Heard, Duties) {
        self.drive.visit(|group, member| {
            let heard = talk.hear(group, member, parsed, out);
            self.drive.record(group, conn, frame, out, heard);
            (heard, self.settle(group, member))
        })
    }

    /// Refuses the last frame with exception 04: [`SmsdStation::store`] has failed.
    pub(crate) fn refuse(
        &self,
        conn: u64,
        talk: &mut ModbusTalk,
        frame: &[u8],
        parsed: &Frame<'_>,
        out: &mut Outgoing,
    ) {
        self.drive.visit(|group, _| {
            talk.not_stored(parsed, out);
            self.drive.record_not_stored(group, conn, frame, out);
        });
    }

    /// Says into `out` what the drive says before it is asked.
    pub(crate) fn greet(&self, conn: u64, talk: &mut PacketTalk, out: &mut Outgoing) {
        self.drive.visit(|group, member| {
            talk.greet(group, member, out);
            self.drive.record_greeting(group, conn, out);
        });
    }

    /// Answers a packet of the standard protocol into `out`; `raw` is the packet as it came.
    pub(crate) fn hear_packet(
        &self,
        conn: u64,
        talk: &mut PacketTalk,
        raw: &[u8],
        packet: &Taken<'_>,
        out: &mut Outgoing,
    ) -> (Heard, Duties) {
        self.drive.visit(|group, member| {
            let heard = talk.hear(group, member, packet, out);
            self.drive.record(group, conn, raw, out, heard);
            (heard, self.settle(group, member))
        })
    }

    /// Refuses the last packet with `ERROR_WRITE`: [`SmsdStation::store`] has failed.
    pub(crate) fn refuse_packet(&self, conn: u64, talk: &mut PacketTalk, out: &mut Outgoing) {
        self.drive.visit(|group, member| {
            talk.not_stored(group, member, out);
            self.drive.record_not_stored(group, conn, &[], out);
        });
    }

    /// Drains what the drive tells, and says what is left to do.
    fn settle(&self, group: &mut Group, member: usize) -> Duties {
        self.drive.look_at_line(group, member);
        let mut duties = Duties::default();
        let duties_of = |machine: &mut Machine<Smsd>| {
            while let Some(event) = machine.drive_mut().poll_event() {
                match event {
                    Event::NetworkConfigured => duties.reconfigure = true,
                    Event::Refused(refusal) => self.drive.tell(What::Refused(refusal)),
                }
            }
            duties.store = machine.drive().memory_generation() > self.stored.load(Ordering::Acquire);
        };
        smsd(group, member).map(duties_of);
        duties
    }

    /// Makes sure that the memory as it is now is stored: what a client sees has survived power-off already. `false` when
    /// that fails: then a client is to be answered with `refusal`, which is told.
    pub(crate) async fn store(&self, refusal: Option<&'static str>) -> bool {
        let saved = self.look(|machine| {
            let mut records = Vec::new();
            while let Some(record) = machine.drive_mut().take_unsaved() {
                records.push((record, machine.drive().memory().encode(record).to_vec()));
            }
            // Handed in while the machine is locked, so that an older state never follows a newer one.
            (machine.drive().memory_generation(), self.saver.save(records))
        });
        let Some((generation, saved)) = saved else { return true };
        match saved.await {
            Ok(()) => {
                self.stored.fetch_max(generation, Ordering::Release);
                true
            }
            Err(error) => {
                self.drive.count(Counter::Fram);
                self.drive.tell(What::NotStored { error, answered: refusal });
                false
            }
        }
    }

    /// Asks for the drive to be reached where its LAN parameters say.
    pub(crate) fn reconfigure(&self) {
        self.reconfigured.notify_one();
    }

    /// Waits until [`SmsdStation::reconfigure`] is called, and says where the drive wants to be reached then.
    pub(crate) async fn moved(&self) -> SocketAddr {
        self.reconfigured.notified().await;
        self.address()
    }

    /// Sees to what has happened in the drive without a client.
    pub(crate) async fn look_after(self: &Arc<Self>) {
        let duties = self.drive.visit(|group, member| self.settle(group, member));
        if duties.store {
            // A failure has been told; the next client to be answered is refused for it, and it is tried again.
            self.store(None).await;
        }
        if duties.reconfigure {
            self.reconfigure();
        }
    }

    fn look<R>(&self, act: impl FnOnce(&mut Machine<Smsd>) -> R) -> Option<R> {
        self.drive.visit(|group, member| smsd(group, member).map(act))
    }
}

fn smsd(group: &mut Group, member: usize) -> Option<&mut Machine<Smsd>> {
    group.machine_mut(member)?.smsd_mut()
}
