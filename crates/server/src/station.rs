//! One machine in step with the clock, shared by its clients.

use crate::clock::Clock;
use crate::store::{Saver, Store, StoreError};
use crate::{Notice, What};
use std::net::SocketAddr;
use std::sync::atomic::{AtomicU8, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use stepdrive_drive::smsd::{Event, Session};
use stepdrive_proto::modbus::{Adu, Frame, decode_request, encode_refusal, encode_reply};
use stepdrive_rig::file::DriveSection;
use stepdrive_rig::machine::Machine;
use stepdrive_spec::modbus::{Exception, Reply, Request};

/// Who is told what happens.
pub(crate) type Notify = Arc<dyn Fn(Notice) + Send + Sync>;

/// A machine, the clock it runs by, and where its memory is kept.
pub(crate) struct Station {
    name: String,
    /// The address that the rig gives. LAN parameters may change the port.
    rig_address: SocketAddr,
    clock: Clock,
    machine: Mutex<Machine>,
    /// Rung when the machine wants to be woken at another time than before.
    wake_changed: tokio::sync::Notify,
    /// Rung when LAN parameters have been applied and the reply has been sent.
    reconfigured: tokio::sync::Notify,
    /// The unit identifier in effect, so that frames for others need no lock.
    unit: AtomicU8,
    /// The generation of the machine's memory that is safely stored.
    stored: AtomicU64,
    saver: Saver,
    notify: Notify,
}

/// What has to be done before and after a reply is sent.
#[derive(Debug, Default)]
pub(crate) struct Duties {
    /// The generation of memory that has to be stored before the reply is sent.
    pub(crate) store: Option<u64>,
    /// LAN parameters were applied: call [`Station::reconfigure`] once the reply is sent.
    pub(crate) reconfigure: bool,
}

impl Station {
    /// Switches on the machine of a drive with what the store remembers of it.
    pub(crate) fn power_up(
        section: &DriveSection,
        clock: Clock,
        store: &Store,
        notify: Notify,
    ) -> Result<Station, StoreError> {
        let name = section.name.get_ref().clone();
        let saver = store.saver(&name, section.model);
        let machine = section.power_up(store.load(&name, section.model)?);
        Ok(Station {
            rig_address: *section.modbus_tcp.get_ref(),
            unit: AtomicU8::new(machine.drive().unit()),
            stored: AtomicU64::new(machine.drive().memory_generation()),
            machine: Mutex::new(machine),
            wake_changed: tokio::sync::Notify::new(),
            reconfigured: tokio::sync::Notify::new(),
            name,
            clock,
            saver,
            notify,
        })
    }

    /// The unit identifier in effect.
    pub(crate) fn unit(&self) -> u8 {
        self.unit.load(Ordering::Relaxed)
    }

    /// Where the drive wants to be reached: at the rig's address, on the port of its LAN parameters if they name one.
    pub(crate) fn address(&self) -> SocketAddr {
        let port = self.lock().drive().memory().lan.port;
        SocketAddr::new(self.rig_address.ip(), port.unwrap_or(self.rig_address.port()))
    }

    /// Tells the drive which port a rig that left it open has got.
    pub(crate) fn set_port(&self, port: u16) {
        self.lock().drive_mut().set_port(port);
    }

    /// Answers a frame into `out`. `None` when it is meant for another unit and gets no answer.
    pub(crate) fn answer(&self, session: &mut Session, frame: &Frame<'_>, out: &mut Adu) -> Option<Duties> {
        let Frame { transaction, unit, pdu } = *frame;
        if unit != 0 && unit != 255 && unit != self.unit() {
            return None;
        }
        match decode_request(pdu) {
            Ok(request) => {
                let (outcome, duties) = self.handle(session, &request);
                encode_reply(out, transaction, unit, &request, &outcome);
                Some(duties)
            }
            Err(refusal) => {
                encode_refusal(out, transaction, unit, refusal);
                Some(Duties::default())
            }
        }
    }

    fn handle(&self, session: &mut Session, request: &Request) -> (Result<Reply, Exception>, Duties) {
        let mut machine = self.lock();
        let now = self.clock.now();
        let wake = machine.next_wake();
        let outcome = machine.handle(now, session, request);
        let duties = self.duties(&mut machine);
        if machine.next_wake() != wake {
            self.wake_changed.notify_one();
        }
        (outcome, duties)
    }

    /// Drains what the drive tells, and says what is left to do.
    fn duties(&self, machine: &mut Machine) -> Duties {
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
        duties.store = (generation > self.stored.load(Ordering::Acquire)).then_some(generation);
        duties
    }

    /// Makes sure that the memory of `generation` is stored: what a client sees has survived power-off already.
    pub(crate) async fn store(&self, generation: u64) -> Result<(), Exception> {
        let records = {
            let mut machine = self.lock();
            let mut records = Vec::new();
            while let Some(record) = machine.drive_mut().take_unsaved() {
                records.push((record, machine.drive().memory().encode(record).to_vec()));
            }
            records
        };
        match self.saver.save(records).await {
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

    /// Waits until [`Station::reconfigure`] is called.
    pub(crate) async fn reconfigured(&self) {
        self.reconfigured.notified().await;
    }

    /// Wakes the machine when it wants to be woken, for as long as it is served.
    pub(crate) async fn keep_time(self: Arc<Self>) {
        loop {
            let wake = self.lock().next_wake();
            tokio::select! {
                () = self.wake_changed.notified() => continue,
                () = self.clock.sleep_until(wake) => {}
            }
            let duties = {
                let mut machine = self.lock();
                machine.advance(self.clock.now());
                self.duties(&mut machine)
            };
            if let Some(generation) = duties.store {
                // A failure has been told; the next client to be answered is refused for it, and it is tried again.
                let _ = self.store(generation).await;
            }
        }
    }

    pub(crate) fn tell(&self, what: What) {
        (self.notify)(Notice { drive: self.name.clone(), what });
    }

    fn lock(&self) -> MutexGuard<'_, Machine> {
        // A panic while the lock was held is our bug; the machine itself is whole, since every step of it is.
        self.machine.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
