//! One axis of the panel, and what is under way on it.

use crate::jog::{Jog, LastJog};
use crate::look::Focus;
use crate::notices::{Level, Notices};
use crate::{Controller, Keeper, Kept, PanelAxis};
use serde::Serialize;
use std::fmt;
use std::sync::atomic::{AtomicU32, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::Duration;
use stepdrive_host::axis::{Axis, Stop};
pub(crate) use stepdrive_host::settings::Client;
use stepdrive_host::smd3::Smd3Client;
use stepdrive_host::smsd::Smsd;
use stepdrive_host::{Direction, Error};
use stepdrive_rig::file::DriveSection;
use stepdrive_spec::smsd::models::Model;
use tokio::sync::{Notify, watch};
use tokio::time::{Instant, sleep, timeout};

/// How long a stop waits for its turn on the line before whatever else is under way there is given up.
const PATIENCE: Duration = Duration::from_millis(100);

/// How often a stop that did not get through is sent again.
const AGAIN: Duration = Duration::from_millis(250);

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
    /// Counts stops, so that what ends by one can be told from what ends otherwise.
    stops: AtomicU32,
}

/// What was started from here.
#[derive(Default)]
pub(crate) struct Doing {
    pub(crate) jog: Option<Arc<Jog>>,
    pub(crate) last_jog: Option<LastJog>,
    pub(crate) homing: bool,
    pub(crate) aim: Option<Aim>,
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
            steps_per_unit: 1.0 / scale.from_steps(1.0).abs(),
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

    // ---- what is under way

    pub(crate) fn doing(&self) -> MutexGuard<'_, Doing> {
        // It holds plain values, so whoever panicked left nothing half done.
        self.doing.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Fails while it homes or is jogged: what is asked for then would wait, and come as a surprise.
    pub(crate) fn check_idle(&self) -> Result<(), Error> {
        let doing = self.doing();
        let what = match (&doing.jog, doing.homing) {
            (_, true) => "is looking for its home switch",
            (Some(_), false) => "is being jogged",
            (None, false) => return Ok(()),
        };
        Err(Error::Refused(format!("{} {what}; stop it first; nothing was sent", self.name())))
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

    /// Stops it. Whatever is under way on its line goes on if it lets the stop through at once, and is given up otherwise.
    pub(crate) async fn stop(&self, how: Stop) -> Result<(), Error> {
        self.stops.fetch_add(1, Ordering::SeqCst);
        self.doing().aim = None;
        let mut stopped = self.axis().stop(how);
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

    /// Stops it however often that has to be tried.
    pub(crate) async fn stop_at_last(&self, how: Stop) {
        let mut told = false;
        while let Err(error) = self.stop(how).await {
            if !std::mem::replace(&mut told, true) {
                let name = self.name();
                self.tell(
                    Level::Error,
                    format!("{name} could not be told to stop, and is told again and again: {error}"),
                );
            }
            sleep(AGAIN).await;
        }
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
