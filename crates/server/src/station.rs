//! One machine in step with the clock, shared by its clients.

use crate::clock::Clock;
use crate::store::{Saver, Store, StoreError};
use crate::{Notice, What};
use std::net::SocketAddr;
use std::sync::atomic::{AtomicU8, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use stepdrive_drive::smsd::{Event, Session, Smsd};
use stepdrive_proto::modbus::{Adu, Frame, decode_request, encode_refusal, encode_reply};
use stepdrive_rig::file::{DriveSection, SmsdSection};
use stepdrive_rig::machine::Machine;
use stepdrive_spec::modbus::Exception;
use stepdrive_spec::time::Instant;

/// How long a notice that repeats is not told again.
const NOTICE_REST: Duration = Duration::from_secs(10);

/// How many kinds of notices repeat: see [`Station::tell`].
const REPEATING: usize = 3;

/// Who is told what happens.
pub(crate) type Notify = Arc<dyn Fn(Notice) + Send + Sync>;

/// A machine, the clock it runs by, and where its memory is kept.
pub(crate) struct Station {
    name: String,
    /// The address that the rig gives, with the real port once it is known. LAN parameters may name another port.
    rig_address: SocketAddr,
    clock: Clock,
    /// Boxed, so that moving a station does not move the machine's memory with it.
    machine: Mutex<Box<Machine<Smsd>>>,
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
    /// When each notice that repeats was last told.
    told: Mutex<[Option<Instant>; REPEATING]>,
}

/// What has to be done before and after a reply is sent.
#[derive(Debug, Default)]
pub(crate) struct Duties {
    /// Memory has changed: call [`Station::store`] before the reply is sent.
    pub(crate) store: bool,
    /// LAN parameters were applied: call [`Station::reconfigure`] once the reply is sent.
    pub(crate) reconfigure: bool,
}

impl Station {
    /// Switches on the machine of a drive with what the store remembers of it.
    pub(crate) fn power_up(
        drive: &DriveSection,
        section: &SmsdSection,
        clock: Clock,
        store: &mut Store,
        notify: Notify,
    ) -> Result<Station, StoreError> {
        let name = drive.name.clone();
        let saver = store.saver(&name, section.model);
        let machine = section.power_up(drive, store.load(&name, section.model)?);
        Ok(Station {
            rig_address: section.modbus_tcp,
            unit: AtomicU8::new(machine.drive().unit()),
            stored: AtomicU64::new(machine.drive().memory_generation()),
            machine: Mutex::new(Box::new(machine)),
            wake_changed: tokio::sync::Notify::new(),
            reconfigured: tokio::sync::Notify::new(),
            name,
            clock,
            saver,
            notify,
            told: Mutex::default(),
        })
    }

    /// The drive's name in the rig.
    pub(crate) fn name(&self) -> &str {
        &self.name
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
        self.lock().drive().memory().lan.port
    }

    /// Tells the drive which port it has got from a rig that left it open.
    pub(crate) fn set_rig_port(&mut self, port: u16) {
        self.rig_address.set_port(port);
        self.lock().drive_mut().set_port(port);
    }

    /// Answers a frame into `out`. `None` when it is meant for another unit and gets no answer.
    pub(crate) fn answer(&self, session: &mut Session, frame: &Frame<'_>, out: &mut Adu) -> Option<Duties> {
        let Frame { transaction, unit, pdu } = *frame;
        if unit != 0 && unit != 255 && unit != self.unit() {
            return None;
        }
        // By reference, since a request or a reply has room for the most that Modbus allows, and moving it copies all.
        match &decode_request(pdu) {
            Ok(request) => {
                let mut machine = self.lock();
                let wake = machine.next_wake();
                let outcome = machine.handle(self.clock.now(), session, request);
                let duties = self.duties(&mut machine);
                if machine.next_wake() != wake {
                    self.wake_changed.notify_one();
                }
                drop(machine);
                encode_reply(out, transaction, unit, request, &outcome);
                Some(duties)
            }
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
        let (generation, saved) = {
            let mut machine = self.lock();
            let mut records = Vec::new();
            while let Some(record) = machine.drive_mut().take_unsaved() {
                records.push((record, machine.drive().memory().encode(record).to_vec()));
            }
            // Handed in while the machine is locked, so that an older state never follows a newer one.
            (machine.drive().memory_generation(), self.saver.save(records))
        };
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
            if duties.store {
                // A failure has been told; the next client to be answered is refused for it, and it is tried again.
                let _ = self.store().await;
            }
        }
    }

    /// Tells the person at the server. What comes as often as clients do is told once in a [`NOTICE_REST`].
    pub(crate) fn tell(&self, what: What) {
        let repeating = match &what {
            What::Full(_) => Some(0),
            What::CannotAccept(_) => Some(1),
            What::NotStored(_) => Some(2),
            What::Refused(_) | What::Moved(_) | What::CannotMove { .. } => None,
        };
        let mut told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(last) = repeating.and_then(|kind| told.get_mut(kind)) {
            let now = self.clock.now();
            if last.is_some_and(|last| now.since(last) < NOTICE_REST) {
                return;
            }
            *last = Some(now);
        }
        drop(told);
        (self.notify)(Notice { drive: self.name.clone(), what });
    }

    fn lock(&self) -> MutexGuard<'_, Box<Machine<Smsd>>> {
        // A panic while the lock was held is our bug; the machine itself is whole, since every step of it is.
        self.machine.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
