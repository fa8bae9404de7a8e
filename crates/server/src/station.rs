//! One machine in step with the clock, shared by its clients.

use crate::clock::Clock;
use crate::{Notice, What};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use stepdrive_drive::controller::Controller;
use stepdrive_rig::machine::Machine;
use stepdrive_spec::time::Instant;

/// How long a notice that repeats is not told again.
const NOTICE_REST: Duration = Duration::from_secs(10);

/// How many kinds of notices repeat: see [`Station::tell`].
const REPEATING: usize = 3;

/// Who is told what happens.
pub(crate) type Notify = Arc<dyn Fn(Notice) + Send + Sync>;

/// A machine of either family and the clock it runs by.
pub(crate) struct Station<C: Controller> {
    name: String,
    clock: Clock,
    /// Boxed, so that moving a station does not move the machine's memory with it.
    machine: Mutex<Box<Machine<C>>>,
    /// Rung when the machine wants to be woken at another time than before.
    wake_changed: tokio::sync::Notify,
    notify: Notify,
    /// When each notice that repeats was last told.
    told: Mutex<[Option<Instant>; REPEATING]>,
}

impl<C: Controller> Station<C> {
    /// A machine that has just been switched on.
    pub(crate) fn new(name: String, clock: Clock, notify: Notify, machine: Machine<C>) -> Station<C> {
        Station {
            name,
            clock,
            machine: Mutex::new(Box::new(machine)),
            wake_changed: tokio::sync::Notify::new(),
            notify,
            told: Mutex::default(),
        }
    }

    /// The drive's name in the rig.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// Does something with the machine, alone and at the present time.
    pub(crate) fn visit<R>(&self, act: impl FnOnce(&mut Machine<C>, Instant) -> R) -> R {
        let mut machine = self.lock();
        let wake = machine.next_wake();
        let outcome = act(&mut machine, self.clock.now());
        if machine.next_wake() != wake {
            self.wake_changed.notify_one();
        }
        outcome
    }

    /// Waits until the machine wants to be woken, and wakes it.
    pub(crate) async fn wake(&self) {
        loop {
            let wake = self.lock().next_wake();
            tokio::select! {
                () = self.wake_changed.notified() => {}
                () = self.clock.sleep_until(wake) => break,
            }
        }
        let mut machine = self.lock();
        machine.advance(self.clock.now());
    }

    /// Tells the person at the server. What comes as often as clients do is told once in a [`NOTICE_REST`].
    pub(crate) fn tell(&self, what: What) {
        let repeating = match &what {
            What::Full(_) => Some(0),
            What::CannotAccept(_) => Some(1),
            What::NotStored(_) | What::StoreFailed(_) => Some(2),
            What::Refused(_)
            | What::Moved(_)
            | What::CannotMove { .. }
            | What::DamagedConfiguration { .. }
            | What::SerialFailed(_) => None,
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

    fn lock(&self) -> MutexGuard<'_, Box<Machine<C>>> {
        // A panic while the lock was held is our bug; the machine itself is whole, since every step of it is.
        self.machine.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
