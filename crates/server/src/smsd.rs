//! An SMSD as it is served: its requests, its memory, its place in the network.

use crate::What;
use crate::clock::Clock;
use crate::station::{Notify, Station};
use crate::store::{Saver, Store, StoreError};
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, AtomicU64, Ordering};
use stepdrive_drive::smsd::{Event, Session, Smsd};
use stepdrive_proto::modbus::{Adu, Frame, decode_request, encode_refusal, encode_reply};
use stepdrive_rig::file::{DriveSection, SmsdSection};
use stepdrive_rig::machine::Machine;
use stepdrive_spec::modbus::Exception;

/// An SMSD and where its memory is kept.
pub(crate) struct SmsdStation {
    station: Station<Smsd>,
    /// The address that the rig gives, with the real port once it is known. LAN parameters may name another port.
    rig_address: SocketAddr,
    /// Rung when LAN parameters have been applied and the reply has been sent.
    reconfigured: tokio::sync::Notify,
    /// The unit identifier in effect, so that frames for others need no lock.
    unit: AtomicU8,
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
    /// Switches on the machine of a drive with what the store remembers of it.
    pub(crate) fn power_up(
        drive: &DriveSection,
        section: &SmsdSection,
        clock: Clock,
        store: &mut Store,
        notify: Notify,
    ) -> Result<SmsdStation, StoreError> {
        let saver = store.saver(&drive.name, section.model);
        let machine = section.power_up(drive, store.load(&drive.name, section.model)?);
        Ok(SmsdStation {
            rig_address: section.modbus_tcp,
            unit: AtomicU8::new(machine.drive().unit()),
            stored: AtomicU64::new(machine.drive().memory_generation()),
            station: Station::new(drive.name.clone(), clock, notify, machine),
            reconfigured: tokio::sync::Notify::new(),
            saver,
        })
    }

    /// The drive's name in the rig.
    pub(crate) fn name(&self) -> &str {
        self.station.name()
    }

    /// Tells the person at the server.
    pub(crate) fn tell(&self, what: What) {
        self.station.tell(what);
    }

    /// The unit identifier in effect.
    pub(crate) fn unit(&self) -> u8 {
        self.unit.load(Ordering::Relaxed)
    }

    /// Where the drive wants to be reached: at the rig's address, on the port of its LAN parameters if they name one.
    pub(crate) fn address(&self) -> SocketAddr {
        SocketAddr::new(self.rig_address.ip(), self.lan_port().unwrap_or(self.rig_address.port()))
    }

    /// The port that the LAN parameters name; `None` while the rig's counts.
    pub(crate) fn lan_port(&self) -> Option<u16> {
        self.station.visit(|machine, _| machine.drive().memory().lan.port)
    }

    /// Tells the drive which port it has got from a rig that left it open.
    pub(crate) fn set_rig_port(&mut self, port: u16) {
        self.rig_address.set_port(port);
        self.station.visit(|machine, _| machine.drive_mut().set_port(port));
    }

    /// Answers a frame into `out`. `None` when it is meant for another unit and gets no answer.
    pub(crate) fn answer(&self, session: &mut Session, frame: &Frame<'_>, out: &mut Adu) -> Option<Duties> {
        let Frame { transaction, unit, pdu } = *frame;
        if unit != 0 && unit != 255 && unit != self.unit() {
            return None;
        }
        // By reference, since a request or a reply has room for the most that Modbus allows, and moving it copies all.
        match &decode_request(pdu) {
            Ok(request) => Some(self.station.visit(|machine, now| {
                encode_reply(out, transaction, unit, request, &machine.handle(now, session, request));
                self.duties(machine)
            })),
            Err(refusal) => {
                encode_refusal(out, transaction, unit, *refusal);
                Some(Duties::default())
            }
        }
    }

    /// Drains what the drive tells, and says what is left to do.
    fn duties(&self, machine: &mut Machine<Smsd>) -> Duties {
        let mut duties = Duties::default();
        while let Some(event) = machine.drive_mut().poll_event() {
            match event {
                Event::NetworkConfigured => {
                    self.unit.store(machine.drive().unit(), Ordering::Relaxed);
                    duties.reconfigure = true;
                }
                Event::Refused(refusal) => self.tell(What::Refused(refusal)),
            }
        }
        let generation = machine.drive().memory_generation();
        duties.store = generation > self.stored.load(Ordering::Acquire);
        duties
    }

    /// Makes sure that the memory as it is now is stored: what a client sees has survived power-off already.
    pub(crate) async fn store(&self) -> Result<(), Exception> {
        let (generation, saved) = self.station.visit(|machine, _| {
            let mut records = Vec::new();
            while let Some(record) = machine.drive_mut().take_unsaved() {
                records.push((record, machine.drive().memory().encode(record).to_vec()));
            }
            // Handed in while the machine is locked, so that an older state never follows a newer one.
            (machine.drive().memory_generation(), self.saver.save(records))
        });
        match saved.await {
            Ok(()) => {
                self.stored.fetch_max(generation, Ordering::Release);
                Ok(())
            }
            Err(error) => {
                self.tell(What::NotStored(error));
                Err(Exception::ServerDeviceFailure)
            }
        }
    }

    /// Asks for the drive to be reached where its LAN parameters say.
    pub(crate) fn reconfigure(&self) {
        self.reconfigured.notify_one();
    }

    /// Waits until [`SmsdStation::reconfigure`] is called.
    pub(crate) async fn reconfigured(&self) {
        self.reconfigured.notified().await;
    }

    /// Wakes the machine when it wants to be woken, for as long as it is served.
    pub(crate) async fn keep_time(self: Arc<Self>) {
        loop {
            self.station.wake().await;
            if self.station.visit(|machine, _| self.duties(machine)).store {
                // A failure has been told; the next client to be answered is refused for it, and it is tried again.
                let _ = self.store().await;
            }
        }
    }
}
