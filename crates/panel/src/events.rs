//! The stream of events: the axes, their states as they change, one axis closely, and notices.

use crate::hub::{Row, Watcher};
use crate::look::Focus;
use crate::member::{AxisInfo, Member};
use crate::notices::Notice;
use crate::{Shared, api};
use axum::body::Bytes;
use axum::extract::{RawQuery, State};
use axum::response::Response;
use serde::Serialize;
use std::ops::RangeInclusive;
use std::sync::Arc;
use std::time::Duration;
use stepdrive_rig::duration;
use stepdrive_web::{Place, Places, Problem, Query, STILL_HERE, event, stream};
use tokio::sync::{broadcast, watch};
use tokio::time::{Instant, sleep_until};

/// How often states come at most when a client does not say.
const EVERY: Duration = Duration::from_millis(100);
/// How often a client may have them at most.
const RANGE: RangeInclusive<Duration> = Duration::from_millis(20)..=Duration::from_mins(1);
/// The most who may watch at once.
const MOST_VIEWERS: usize = 32;
/// After so long something is sent whatever happens, so that a page knows a dead connection from a quiet one.
const QUIET: Duration = Duration::from_millis(250);
/// The list of axes is sent again after so long at the soonest.
const SELDOM: Duration = Duration::from_millis(500);
/// A look at one axis that shows nothing new is told after so long.
const UNCHANGED: Duration = Duration::from_millis(500);

/// The places for those who watch.
pub(crate) struct Viewers(Places);

impl Default for Viewers {
    fn default() -> Viewers {
        Viewers(Places::new(MOST_VIEWERS))
    }
}

#[derive(Serialize)]
struct AxesEvent {
    axes: Vec<AxisInfo>,
}

#[derive(Serialize)]
struct StatesEvent<'a> {
    /// Milliseconds since the panel began.
    t: u64,
    s: Vec<StateRow<'a>>,
}

#[derive(Serialize)]
struct StateRow<'a> {
    i: usize,
    p: f64,
    v: f64,
    b: u16,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    e: &'a [&'static str],
    #[serde(skip_serializing_if = "Option::is_none")]
    a: Option<u64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    w: Option<&'a str>,
}

impl<'a> StateRow<'a> {
    fn of(place: usize, row: &'a Row) -> StateRow<'a> {
        let reading = &row.reading;
        StateRow {
            i: place,
            p: reading.position,
            v: reading.speed,
            b: row.bits(),
            e: &reading.faults,
            a: row.age(),
            w: row.lost.as_deref(),
        }
    }
}

/// Somebody who watches.
struct Viewer {
    panel: Arc<Shared>,
    every: Duration,
    /// The version of the states that was sent last; `None` before the first.
    sent: Option<u64>,
    sent_at: Instant,
    next_states: Instant,
    axes_sent_at: Instant,
    closely: Option<Closely>,
    found: watch::Receiver<u64>,
    notices: broadcast::Receiver<Notice>,
    _watcher: Watcher,
    _place: Place,
}

/// One axis, closely.
struct Closely {
    look: watch::Receiver<Option<Arc<Focus>>>,
    sent: Option<Arc<Focus>>,
    /// One that was like the one sent, and so was not.
    held: Option<Arc<Focus>>,
}

pub(crate) async fn events(
    State(panel): api::ThePanel,
    RawQuery(query): RawQuery,
) -> Result<Response, Problem> {
    let query = Query::parse(query.as_deref(), &["focus", "every"])?;
    let every = every(&query)?;
    let member = query.get("focus").map(|name| api::find(&panel, name)).transpose()?;
    let place = panel.viewers.0.take()?;
    let now = Instant::now();
    let viewer = Viewer {
        every,
        sent: None,
        sent_at: now,
        next_states: now,
        axes_sent_at: now,
        closely: member.as_deref().map(Closely::new),
        found: panel.hub.found(),
        notices: panel.notices.listen(),
        _watcher: panel.hub.watch(member),
        _place: place,
        panel,
    };
    Ok(stream(viewer, |mut viewer| async {
        let bytes = viewer.next().await;
        Some((bytes, viewer))
    }))
}

/// How often the client wants states.
fn every(query: &Query<'_>) -> Result<Duration, Problem> {
    let every = query.get("every").map(duration::parse).transpose().map_err(Problem::impossible)?;
    Some(every.unwrap_or(EVERY)).filter(|every| RANGE.contains(every)).ok_or_else(|| {
        let (least, most) = (duration::display(*RANGE.start()), duration::display(*RANGE.end()));
        Problem::impossible(format!("`every` is {least} to {most}"))
    })
}

impl Viewer {
    async fn next(&mut self) -> Bytes {
        let bytes = if self.sent.is_none() { self.first() } else { self.wait().await };
        self.sent_at = Instant::now();
        bytes
    }

    /// All axes, and all their states.
    fn first(&mut self) -> Bytes {
        self.axes_sent_at = Instant::now();
        let mut bytes = self.axes().to_vec();
        bytes.extend_from_slice(&self.states(0).unwrap_or_default());
        bytes.into()
    }

    /// Whether more is known of the axes than was told. A page begins anew with every list of axes, so not too often.
    fn has_found(&mut self) -> bool {
        let has = self.axes_sent_at.elapsed() >= SELDOM && self.found.has_changed().unwrap_or(false);
        if has {
            self.found.mark_unchanged();
        }
        has
    }

    fn axes(&self) -> Bytes {
        let axes = self.panel.members.iter().map(|member| member.info()).collect();
        event("axes", &AxesEvent { axes })
    }

    /// What has changed since a version; `None` when nothing has.
    fn states(&mut self, version: u64) -> Option<Bytes> {
        let (version, rows) = self.panel.hub.since(version);
        self.sent = Some(version);
        if rows.is_empty() {
            return None;
        }
        let s = rows.iter().map(|(place, row)| StateRow::of(*place, row)).collect();
        Some(event("states", &StatesEvent { t: self.panel.millis(Instant::now()), s }))
    }

    /// Waits for something to tell.
    async fn wait(&mut self) -> Bytes {
        loop {
            tokio::select! {
                biased;
                // Who reads too slowly misses some.
                notice = self.notices.recv() => if let Ok(notice) = notice {
                    return event("notice", &notice);
                },
                bytes = closer(self.closely.as_mut()) => return bytes,
                () = sleep_until(self.next_states) => {
                    self.next_states = Instant::now() + self.every;
                    if self.has_found() {
                        return self.first();
                    }
                    if let Some(bytes) = self.states(self.sent.unwrap_or(0)) {
                        return bytes;
                    }
                }
                () = sleep_until(self.sent_at + QUIET) => return Bytes::from_static(STILL_HERE),
            }
        }
    }
}

/// Waits for a look at one axis.
async fn closer(closely: Option<&mut Closely>) -> Bytes {
    match closely {
        Some(closely) => closely.next().await,
        None => std::future::pending().await,
    }
}

impl Closely {
    fn new(member: &Member) -> Closely {
        let mut look = member.focus.subscribe();
        // What is there already is told too.
        look.mark_changed();
        Closely { look, sent: None, held: None }
    }

    /// The next look that is worth telling: one that differs from the one before it, and one now and then.
    async fn next(&mut self) -> Bytes {
        loop {
            if self.look.changed().await.is_err() {
                return std::future::pending().await;
            }
            let Some(focus) = self.look.borrow_and_update().clone() else { continue };
            let is_news = self.sent.as_ref().is_none_or(|sent| focus.differs(sent));
            let quiet = u64::try_from(UNCHANGED.as_millis()).unwrap_or(u64::MAX);
            let is_due = self.sent.as_ref().is_none_or(|sent| focus.t >= sent.t + quiet);
            if !is_news && !is_due {
                self.held = Some(focus);
                continue;
            }
            // A curve has to turn where the change came, not where the last look was told.
            let held = self.held.take().filter(|_| is_news).map(|held| event("focus", &*held));
            let mut bytes = held.unwrap_or_default().to_vec();
            bytes.extend_from_slice(&event("focus", &*focus));
            self.sent = Some(focus);
            return bytes.into();
        }
    }
}
