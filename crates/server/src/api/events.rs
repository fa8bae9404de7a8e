//! Server-sent events: the rig whenever it has changed.
//!
//! All who watch the same of it share one look, its comparison with the one before and its text. While nobody watches
//! nothing is looked at.

use super::look::View;
use super::rows::RigRow;
use super::{Api, TheApi};
use axum::body::Bytes;
use axum::extract::{RawQuery, State};
use axum::response::Response;
use std::ops::RangeInclusive;
use std::sync::{Arc, OnceLock};
use std::time::Duration;
use stepdrive_rig::duration;
use stepdrive_web::{Place, Problem, QUIET, Query, STILL_HERE, event, stream};
use tokio::sync::Mutex;
use tokio::time::Instant;

/// How often events come at most when a client does not say.
const EVERY: Duration = Duration::from_millis(100);

/// How often a client may have them at most.
const RANGE: RangeInclusive<Duration> = Duration::from_millis(20)..=Duration::from_mins(1);

/// What queries have.
pub(super) const EVERY_AND_DRIVE: [&str; 2] = ["drive", "every"];

/// What a client names that wants to see no drive, unless there is one of that name.
const NO_DRIVES: &str = "none";

/// The most who may watch at once.
pub(super) const MOST_VIEWERS: usize = 16;

/// A look at the rig is shared by those who want one within this time.
const SHARED: Duration = Duration::from_millis(10);

/// A look that takes long is shared for so many times as long: a tenth of a processor goes into looking at most.
const SHARED_TIMES: u32 = 10;

/// What those who watch saw last, for each view.
pub(super) struct Watched {
    all: Last,
    no_drives: Last,
    /// In the order of the rig file.
    drives: Vec<Last>,
}

/// What was last seen in a view.
type Last = Mutex<Option<Arc<Seen>>>;

/// A look at the rig.
struct Seen {
    /// Until when it is shared.
    good_until: Instant,
    /// Counts the looks that differed from the one before.
    version: u64,
    rig: RigRow,
    event: OnceLock<Bytes>,
}

impl Watched {
    /// Nothing was seen yet of a rig with so many drives.
    pub(super) fn new(drives: usize) -> Watched {
        let drives = (0..drives).map(|_| Last::default()).collect();
        Watched { all: Last::default(), no_drives: Last::default(), drives }
    }

    /// A look at the rig: a new one, or one that is young enough.
    async fn look(&self, api: &Api, view: View, new: bool) -> Arc<Seen> {
        let last = match view {
            View::All => &self.all,
            View::Drive(number) => self.drives.get(number).unwrap_or(&self.no_drives),
            View::NoDrives => &self.no_drives,
        };
        let mut last = last.lock().await;
        let begun = Instant::now();
        if let Some(seen) = last.as_ref().filter(|seen| !new && begun < seen.good_until) {
            return Arc::clone(seen);
        }
        let rig = api.look(view);
        let before = last.as_ref();
        let version = match before {
            Some(before) if before.rig.is_like(&rig) => before.version,
            Some(before) => before.version + 1,
            None => 0,
        };
        let good_until = Instant::now() + SHARED.max(begun.elapsed() * SHARED_TIMES);
        let seen = Arc::new(Seen { good_until, version, rig, event: OnceLock::new() });
        *last = Some(Arc::clone(&seen));
        seen
    }
}

impl Seen {
    fn event(&self) -> Bytes {
        self.event.get_or_init(|| event("state", &self.rig)).clone()
    }
}

/// Somebody who watches.
struct Viewer {
    api: Arc<Api>,
    view: View,
    every: Duration,
    /// The version that was sent last; `None` before the first.
    sent: Option<u64>,
    sent_at: Instant,
    _place: Place,
}

pub(super) async fn events(State(api): TheApi, RawQuery(query): RawQuery) -> Result<Response, Problem> {
    let query = Query::parse(query.as_deref(), &EVERY_AND_DRIVE)?;
    let (view, every) = (view(&api, &query)?, every(&query)?);
    let place = api.viewers.take()?;
    let viewer = Viewer { api, view, every, sent: None, sent_at: Instant::now(), _place: place };
    Ok(stream(viewer, |mut viewer| async {
        let event = viewer.next().await;
        Some((event, viewer))
    }))
}

impl Viewer {
    async fn next(&mut self) -> Bytes {
        let Some(sent) = self.sent else {
            let seen = self.api.watched.look(&self.api, self.view, true).await;
            return self.send(&seen);
        };
        loop {
            tokio::time::sleep(self.every).await;
            let seen = self.api.watched.look(&self.api, self.view, false).await;
            if seen.version != sent {
                return self.send(&seen);
            }
            if self.sent_at.elapsed() >= QUIET {
                self.sent_at = Instant::now();
                return Bytes::from_static(STILL_HERE);
            }
        }
    }

    fn send(&mut self, seen: &Seen) -> Bytes {
        self.sent = Some(seen.version);
        self.sent_at = Instant::now();
        seen.event()
    }
}

/// What the client wants to see.
fn view(api: &Api, query: &Query<'_>) -> Result<View, Problem> {
    match query.get("drive").map(|name| (name, api.find_drive(name))) {
        None => Ok(View::All),
        Some((_, Ok((number, _)))) => Ok(View::Drive(number)),
        Some((NO_DRIVES, Err(_))) => Ok(View::NoDrives),
        Some((_, Err(problem))) => Err(problem),
    }
}

/// How often the client wants events.
pub(super) fn every(query: &Query<'_>) -> Result<Duration, Problem> {
    let every = query.get("every").map(duration::parse).transpose().map_err(Problem::impossible)?;
    Some(every.unwrap_or(EVERY)).filter(|every| RANGE.contains(every)).ok_or_else(|| {
        let (least, most) = (duration::display(*RANGE.start()), duration::display(*RANGE.end()));
        Problem::impossible(format!("`every` is {least} to {most}"))
    })
}
