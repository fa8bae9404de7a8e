//! A drive as it is served: its place in the rig, and who is told about it.

use crate::link::Outgoing;
use crate::recording::{Entry, Happened, Via, hex};
use crate::talk::{Heard, count};
use crate::traffic::{By, Client, Fate, Peer};
use crate::world::World;
use crate::{Notice, What};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use stepdrive_rig::group::Group;
use stepdrive_spec::smsd::standard::{COUNTER_ROWS, Counter};
use tokio::sync::watch;
use tokio::time::Instant;

/// How long a notice that repeats is not told again.
const NOTICE_REST: Duration = Duration::from_secs(10);

/// How many kinds of notices repeat: see [`Drive::tell`].
const REPEATING: usize = 3;

/// Who is told what happens.
pub type Notify = Arc<dyn Fn(Notice) + Send + Sync>;

/// A drive of a rig.
pub(crate) struct Drive {
    world: Arc<World>,
    /// Its number in the rig file.
    number: usize,
    name: String,
    notify: Notify,
    /// Whether clients can be connected to it, and how often that has ended.
    line: watch::Sender<Reach>,
    /// When each notice that repeats was last told.
    told: Mutex<[Option<Instant>; REPEATING]>,
}

/// Whether clients can be connected to a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Reach {
    /// Whether they can now.
    reachable: bool,
    /// How often it has ended; see [`stepdrive_rig::group::Member::outages`].
    pub(crate) outages: u32,
}

impl Drive {
    /// The drive with this number.
    pub(crate) fn new(world: Arc<World>, number: usize, notify: Notify) -> Drive {
        let name = world.rig().drives.get(number).map(|drive| drive.name.clone()).unwrap_or_default();
        Drive {
            world,
            number,
            name,
            notify,
            line: watch::Sender::new(Reach { reachable: true, outages: 0 }),
            told: Mutex::default(),
        }
    }

    /// Its name in the rig.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// The rig.
    pub(crate) fn world(&self) -> &World {
        &self.world
    }

    /// Does something with its group, alone and at the present time; see [`World::visit`].
    pub(crate) fn visit<R>(&self, act: impl FnOnce(&mut Group, usize) -> R) -> R {
        self.world.visit(self.number, act)
    }

    /// A client has connected, by what its family has or by `via`: the number of its connection.
    pub(crate) fn open(&self, via: Option<Via>, peer: Peer) -> u64 {
        let conn = self.world.new_connection();
        self.world.tap().open(Client { conn, drive: self.number, by: self.by(via), peer });
        if self.world.recorder().is_some() {
            let panel = peer == Peer::Panel;
            let open = Happened::Open { conn, drive: self.number, via, panel };
            self.visit(|group, _| self.world.write(|| Entry::new(group.now(), open)));
        }
        conn
    }

    fn by(&self, via: Option<Via>) -> By {
        let is_smsd = self.world.rig().drives.get(self.number).is_some_and(|drive| drive.smsd().is_some());
        match via {
            Some(Via::Usb) => By::Usb,
            Some(Via::Standard) => By::Lan,
            None if is_smsd => By::Modbus,
            None => By::Serial,
        }
    }

    /// A client has left.
    pub(crate) fn shut(&self, conn: u64) {
        self.world.tap().shut(conn);
        if self.world.recorder().is_some() {
            self.visit(|group, _| self.world.write(|| Entry::new(group.now(), Happened::Shut { conn })));
        }
    }

    /// Lets an SMSD count an error that has its cause outside the rig.
    pub(crate) fn count(&self, counter: Counter) {
        let name = COUNTER_ROWS.iter().find(|(other, ..)| *other == counter).map_or("", |(_, name, _)| name);
        self.visit(|group, member| {
            count(group, member, counter);
            let what = Happened::Counted { drive: self.number, counter: name.into() };
            self.world.write(|| Entry::new(group.now(), what));
        });
    }

    /// Tells whoever listens, and the recording if one is made, what a drive said before it was asked.
    pub(crate) fn record_greeting(&self, group: &Group, conn: u64, out: &Outgoing) {
        self.world.tap().say(group.now(), conn, &[], out.bytes(), Fate::Taken);
        self.world.write(|| Entry::new(group.now(), Happened::Greeted { conn, tx: hex(out.bytes()) }));
    }

    /// Tells whoever listens, and the recording if one is made, of a request and what leaves for it.
    pub(crate) fn record(&self, group: &Group, conn: u64, rx: &[u8], out: &Outgoing, heard: Heard) {
        let fate = if heard == Heard::Cut { Fate::Cut } else { Fate::Taken };
        self.world.tap().say(group.now(), conn, rx, out.bytes(), fate);
        self.world.write(|| {
            let (rx, tx, cut) = (hex(rx), hex(out.bytes()), heard == Heard::Cut);
            Entry::new(group.now(), Happened::Heard { conn, rx, tx, cut })
        });
    }

    /// Tells whoever listens, and the recording if one is made, that what the last request of a connection changed could
    /// not be stored, and what leaves instead of its reply; `rx` is that request, as far as it is at hand.
    pub(crate) fn record_not_stored(&self, group: &Group, conn: u64, rx: &[u8], out: &Outgoing) {
        self.world.tap().say(group.now(), conn, rx, out.bytes(), Fate::NotStored);
        self.world.write(|| Entry::new(group.now(), Happened::NotStored { conn, tx: hex(out.bytes()) }));
    }

    /// Sees whether clients can be connected.
    pub(crate) fn look_at_line(&self, group: &Group, member: usize) {
        let Some(member) = group.members().get(member) else { return };
        let reach = Reach { reachable: member.reachable(), outages: member.outages() };
        self.line.send_if_modified(|before| std::mem::replace(before, reach) != reach);
    }

    /// Whether clients can be connected now.
    pub(crate) fn is_reachable(&self) -> bool {
        self.visit(|group, member| self.look_at_line(group, member));
        self.line.borrow().reachable
    }

    /// Tells whenever clients cannot be connected any more, or can again.
    pub(crate) fn watch(&self) -> watch::Receiver<Reach> {
        self.line.subscribe()
    }

    /// Tells the person at the server. What comes as often as clients do is told once in a [`NOTICE_REST`].
    pub(crate) fn tell(&self, what: What) {
        let repeating = match &what {
            What::Full(_) => Some(0),
            What::CannotAccept(_) => Some(1),
            What::NotStored { .. } | What::StoreFailed(_) => Some(2),
            What::Refused(_)
            | What::Moved(_)
            | What::CannotMove { .. }
            | What::DamagedConfiguration { .. }
            | What::SerialFailed(_)
            | What::RecordingFailed(_) => None,
        };
        let mut told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(last) = repeating.and_then(|kind| told.get_mut(kind)) {
            let now = Instant::now();
            if last.is_some_and(|last| now.duration_since(last) < NOTICE_REST) {
                return;
            }
            *last = Some(now);
        }
        drop(told);
        (self.notify)(Notice { drive: self.name.clone(), what });
    }
}
