//! One axis of the panel, and what is under way on it.

use crate::jog::{EndedJogs, Jog};
use crate::look::{Focus, bit};
use crate::notices::{Level, Notices};
use crate::stopping::Stopping;
use crate::{Controller, Keeper, Kept, PanelAxis};
use serde::Serialize;
use std::fmt;
use std::pin::pin;
use std::sync::atomic::{AtomicU32, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::Duration;
use stepdrive_host::axis::{Axis, Stop};
pub(crate) use stepdrive_host::settings::Client;
use stepdrive_host::settings::Setting;
use stepdrive_host::smd3::Smd3Client;
use stepdrive_host::smsd::Smsd;
use stepdrive_host::{Direction, Error};
use stepdrive_rig::file::DriveSection;
use stepdrive_spec::smsd::models::Model;
use tokio::sync::{Notify, watch};
use tokio::time::{Instant, timeout};

/// How long a stop waits for its turn on the line before whatever else is under way there is given up.
const PATIENCE: Duration = Duration::from_millis(100);

/// An axis of the panel.
pub(crate) struct Member {
    index: usize,
    axis: PanelAxis,
    notices: Notices,
    model: OnceLock<String>,
    doing: Mutex<Doing>,
    /// Counts the times that everything under way on the line had to be given up.
    urgent: watch::Sender<u32>,
    /// How many watch it closely, and what they see.
    pub(crate) close_watchers: AtomicUsize,
    pub(crate) focus: watch::Sender<Option<Arc<Focus>>>,
    /// Wakes whoever looks at it in turns.
    pub(crate) nudge: Notify,
    /// Counts what was done from here that changes settings.
    revision: AtomicU64,
    stored: Mutex<Option<Vec<Setting>>>,
    /// Counts stops, so that what ends by one can be told from what ends otherwise.
    stops: AtomicU32,
}

/// What was started from here.
#[derive(Default)]
pub(crate) struct Doing {
    pub(crate) jog: Option<Arc<Jog>>,
    pub(crate) ended_jogs: EndedJogs,
    pub(crate) homing: bool,
    pub(crate) aim: Option<Aim>,
    pub(crate) stopping: Option<Stopping>,
    /// How many motions are being begun.
    departing: u32,
    /// When the last was.
    departed: Option<Instant>,
    /// How it was told to stop last, and which of the stops that was.
    last_stop: Option<(u32, Stop)>,
    /// What was seen of it last; `None` while it is lost.
    pub(crate) seen: Option<Seen>,
}

/// A look at an axis, as far as stops ask for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Seen {
    pub(crate) at: Instant,
    /// See [`bit`].
    pub(crate) bits: u16,
}

impl Seen {
    pub(crate) fn is_moving(self) -> bool {
        self.bits & bit::MOVING != 0
    }

    /// Whether it stood without current, and no program was seen to run.
    pub(crate) fn is_at_rest(self) -> bool {
        self.bits & (bit::MOVING | bit::ENERGISED | bit::PROGRAM) == 0
    }
}

impl Doing {
    /// See [`Member::check_idle`].
    pub(crate) fn check_idle(&self, name: &str) -> Result<(), Error> {
        self.check_stopped(name)?;
        let what = match (&self.jog, self.homing) {
            (_, true) => "is looking for its home switch",
            (Some(_), false) => "is being jogged",
            (None, false) => return Ok(()),
        };
        Err(Error::Refused(format!("{name} {what}; stop it first; nothing was sent")))
    }

    /// Fails while a stop does not get through: whatever is asked for then would wait behind it, and be given up for it.
    pub(crate) fn check_stopped(&self, name: &str) -> Result<(), Error> {
        match self.stopping.as_ref().and_then(Stopping::trouble) {
            None => Ok(()),
            Some(why) => Err(Error::Refused(format!(
                "{name} is still being told to stop: {why}; try again; nothing was sent"
            ))),
        }
    }

    /// How it was told to stop last, if that was since it was told to so many times.
    pub(crate) fn stopped_since(&self, stops: u32) -> Option<Stop> {
        self.last_stop.filter(|(stop, _)| *stop > stops).map(|(_, how)| how)
    }

    /// Whether a motion is being begun from here, or goes on that ends from here.
    pub(crate) fn is_under_way(&self) -> bool {
        self.departing > 0 || self.jog.is_some() || self.homing
    }

    /// Whether no motion was begun from here since a time, and none is being.
    pub(crate) fn has_not_departed_since(&self, time: Instant) -> bool {
        !self.is_under_way() && self.departed.is_none_or(|departed| departed < time)
    }
}

/// Where a move that was started from here goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Aim {
    /// In the axis' unit.
    pub(crate) to: f64,
    /// How far off it may stand in the end.
    pub(crate) within: f64,
    pub(crate) since: Instant,
    /// [`Member::stops`] when it began.
    pub(crate) stops: u32,
}

/// What is known of an axis beforehand.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct AxisInfo {
    name: String,
    family: &'static str,
    model: Option<String>,
    r#virtual: bool,
    target: String,
    unit: &'static str,
    /// Full steps as the controller counts them, which it does the other way for a reversed axis.
    steps_per_unit: f64,
    limits: Option<[f64; 2]>,
}

impl Member {
    pub(crate) fn new(index: usize, axis: PanelAxis, notices: Notices) -> Member {
        Member {
            index,
            axis,
            notices,
            model: OnceLock::new(),
            doing: Mutex::default(),
            urgent: watch::Sender::new(0),
            close_watchers: AtomicUsize::new(0),
            focus: watch::Sender::new(None),
            nudge: Notify::new(),
            revision: AtomicU64::new(0),
            stored: Mutex::default(),
            stops: AtomicU32::new(0),
        }
    }

    // ---- what it is

    /// Its place among the axes.
    pub(crate) fn index(&self) -> usize {
        self.index
    }

    pub(crate) fn name(&self) -> &str {
        &self.axis.name
    }

    pub(crate) fn controller(&self) -> &Controller {
        &self.axis.controller
    }

    pub(crate) fn axis(&self) -> &dyn Axis {
        self.axis.controller.axis()
    }

    pub(crate) fn client(&self) -> Client<'_> {
        match &self.axis.controller {
            Controller::Smsd(axis) => Client::Smsd(axis.motor().client()),
            Controller::Smd3(axis) => Client::Smd3(axis.motor().client()),
        }
    }

    /// Its controller, if it is an SMSD.
    pub(crate) fn smsd(&self) -> Result<&dyn Smsd, Error> {
        match self.client() {
            Client::Smsd(client) => Ok(client),
            Client::Smd3(_) => {
                Err(Error::Usage(format!("{} is an SMD3; only an SMSD has this", self.name())))
            }
        }
    }

    /// Its controller, if it is an SMD3.
    pub(crate) fn smd3(&self) -> Result<&Smd3Client, Error> {
        match self.client() {
            Client::Smd3(client) => Ok(client),
            Client::Smsd(_) => {
                Err(Error::Usage(format!("{} is an SMSD; only an SMD3 has this", self.name())))
            }
        }
    }

    /// How a program is tried out for it.
    pub(crate) fn simulated_as(&self) -> Option<&DriveSection> {
        self.axis.simulated_as.as_ref()
    }

    pub(crate) fn info(&self) -> AxisInfo {
        let scale = self.axis().scale();
        let range = self.axis().soft_limits().range();
        let is_smsd = matches!(self.client(), Client::Smsd(_));
        AxisInfo {
            name: self.axis.name.clone(),
            family: if is_smsd { "smsd" } else { "smd3" },
            model: self.model.get().cloned(),
            r#virtual: self.axis.is_virtual,
            target: self.axis.target.clone(),
            unit: scale.unit().name(),
            steps_per_unit: 1.0 / scale.from_steps(1.0),
            limits: range.map(|(low, high)| [low.as_f64(), high.as_f64()]),
        }
    }

    /// The name of its model, once it is known.
    pub(crate) fn model(&self) -> Option<&str> {
        self.model.get().map(String::as_str)
    }

    /// Finds out its model. `true` when that is news.
    pub(crate) async fn find_model(&self) -> Result<bool, Error> {
        let model = match self.client() {
            Client::Smsd(client) => client.model().await?.map_or("SMSD", Model::name),
            Client::Smd3(_) => "SMD3",
        };
        Ok(self.model.set(model.to_owned()).is_ok())
    }

    /// Tells all who watch.
    pub(crate) fn tell(&self, level: Level, text: String) {
        self.notices.tell(self.name(), level, text);
    }

    // ---- trust

    /// Takes over what other programs have noted of the trust in its position.
    pub(crate) fn hear_news(&self) {
        if let Some(trust) = self.keeper().and_then(Keeper::news) {
            self.axis().believe(trust);
        }
    }

    /// Has the trust in its position remembered.
    pub(crate) fn keep_trust(&self, why: Kept) {
        if let Some(keeper) = self.keeper() {
            keeper.keep(self.axis().trust(), why);
        }
    }

    /// Has remembered that it is about to be moved from here: from now on it may be anywhere.
    pub(crate) fn note_departure(&self) {
        if let Some(keeper) = self.keeper() {
            let mut trust = self.axis().trust();
            trust.saw(None);
            keeper.keep(trust, Kept::Acted);
        }
    }

    fn keeper(&self) -> Option<&dyn Keeper> {
        self.axis.keeper.as_deref()
    }

    // ---- settings

    /// Something was done that changes its settings.
    pub(crate) fn revise(&self) {
        self.revision.fetch_add(1, Ordering::SeqCst);
        self.nudge.notify_one();
    }

    /// Grows with each [`Member::revise`].
    pub(crate) fn revision(&self) -> u64 {
        self.revision.load(Ordering::SeqCst)
    }

    /// What it keeps without power, as far as that is known: what was stored or loaded from here last.
    pub(crate) fn stored(&self) -> Option<Vec<Setting>> {
        self.lock_stored().clone()
    }

    /// This is what it keeps from now on, or nobody knows.
    pub(crate) fn note_stored(&self, stored: Option<Vec<Setting>>) {
        *self.lock_stored() = stored;
    }

    fn lock_stored(&self) -> MutexGuard<'_, Option<Vec<Setting>>> {
        // They are plain values, so whoever panicked left nothing half done.
        self.stored.lock().unwrap_or_else(PoisonError::into_inner)
    }

    // ---- what is under way

    pub(crate) fn doing(&self) -> MutexGuard<'_, Doing> {
        // It holds plain values, so whoever panicked left nothing half done.
        self.doing.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Fails while it homes or is jogged: what is asked for then would wait, and come as a surprise.
    pub(crate) fn check_idle(&self) -> Result<(), Error> {
        self.doing().check_idle(self.name())
    }

    /// How often it was told to stop.
    pub(crate) fn stops(&self) -> u32 {
        self.stops.load(Ordering::SeqCst)
    }

    /// Does something on its line, unless a stop needs that line.
    pub(crate) async fn work<T>(&self, work: impl Future<Output = Result<T, Error>>) -> Result<T, Error> {
        let mut urgent = self.urgent.subscribe();
        tokio::select! {
            biased;
            done = work => done,
            // The sender lives as long as this.
            _ = urgent.changed() => Err(Error::Refused(format!(
                "{} was told to stop, and what else was under way on its line was given up",
                self.name()
            ))),
        }
    }

    /// Somebody wants it to stop: what is about to be begun is not.
    pub(crate) fn note_stop(&self, doing: &mut Doing, how: Stop) {
        let stop = self.stops.fetch_add(1, Ordering::SeqCst).wrapping_add(1);
        doing.aim = None;
        doing.last_stop = Some((stop, how));
    }

    /// Tells it once to stop, as `chosen` says of what was asked for. Whatever is under way on its line goes on if it lets
    /// this through at once, and is given up otherwise.
    pub(crate) async fn stop(
        &self,
        asked: Stop,
        chosen: impl Future<Output = Result<Stop, Error>>,
    ) -> Result<(), Error> {
        self.note_stop(&mut self.doing(), asked);
        let mut stopped = pin!(async { self.axis().stop(chosen.await?).await });
        let done = if let Ok(done) = timeout(PATIENCE, &mut stopped).await {
            done
        } else {
            self.urgent.send_modify(|count| *count = count.wrapping_add(1));
            stopped.await
        };
        self.keep_trust(Kept::Acted);
        self.nudge.notify_one();
        done
    }

    // ---- being begun

    /// Begins a motion, unless it was told to stop since it was told to do so `stops` times.
    ///
    /// What is begun has to be called, and not only awaited, before this: from then on it sees by itself that a stop has come.
    pub(crate) async fn depart<T>(
        &self,
        stops: u32,
        motion: impl Future<Output = Result<T, Error>>,
    ) -> Result<T, Error> {
        let _departing = Departing::new(self);
        self.note_departure();
        if self.stops() != stops {
            return Err(Error::Refused(format!("{} was told to stop; nothing was sent", self.name())));
        }
        let begun = motion.await?;
        self.was_reached(stops);
        Ok(begun)
    }

    /// What was asked of it was done: a stop from before need not be told again.
    fn was_reached(&self, stops: u32) {
        let doing = self.doing();
        if let Some(stopping) = doing.stopping.as_ref().filter(|_| self.stops() == stops) {
            stopping.end();
        }
    }
}

/// A motion that is being begun.
struct Departing<'a>(&'a Member);

impl Departing<'_> {
    fn new(member: &Member) -> Departing<'_> {
        member.doing().departing += 1;
        Departing(member)
    }
}

impl Drop for Departing<'_> {
    fn drop(&mut self) {
        let mut doing = self.0.doing();
        doing.departing -= 1;
        doing.departed = Some(Instant::now());
    }
}

/// A direction as it is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize)]
pub(crate) enum Way {
    #[serde(rename = "+")]
    Positive,
    #[serde(rename = "-")]
    Negative,
}

impl From<Way> for Direction {
    fn from(way: Way) -> Direction {
        match way {
            Way::Positive => Direction::Positive,
            Way::Negative => Direction::Negative,
        }
    }
}

impl fmt::Debug for Member {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Member").field("name", &self.name()).finish_non_exhaustive()
    }
}
