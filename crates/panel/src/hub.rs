//! Looks at the axes in turns, while somebody watches, and keeps what was seen last.
//!
//! One task an axis looks, so that one that does not answer holds no other up. All of them end when the last who watches
//! has gone: then nothing is asked of any controller.

use crate::look::{Focus, Looker, Reading, bit};
use crate::member::{Member, Seen};
use std::pin::pin;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use stepdrive_host::Error;
use tokio::task::JoinSet;
use tokio::time::{Instant, sleep_until, timeout};

/// How often an axis is looked at that somebody looks at closely.
const CLOSELY: Duration = Duration::from_millis(40);
/// How often the others are.
const OTHERS: Duration = Duration::from_millis(100);
/// How often one is looked at that is lost.
const LOST: Duration = Duration::from_millis(500);
/// The most looks a second, at all of them together.
const MOST_LOOKS: u32 = 2000;
/// How often one is looked at that does not let us in: each attempt with a wrong password locks it for others for a second.
const NOT_LET_IN: Duration = Duration::from_secs(10);
/// How long a look may take.
const PATIENCE: Duration = Duration::from_millis(700);
/// How much longer one is waited for that is shown as lost meanwhile.
const LONGEST_LOOK: Duration = Duration::from_secs(5);
/// Within this time from the last reading on an axis that does not answer is shown as lost.
const NOTICED: Duration = Duration::from_millis(900);
/// A look is given at least so long, however many axes there are.
const LEAST_PATIENCE: Duration = Duration::from_millis(200);
/// The least time between two looks, however often somebody asks for one out of turn.
const LEAST_REST: Duration = Duration::from_millis(10);

/// What was seen of an axis, and when.
#[derive(Clone, Debug, Default)]
pub(crate) struct Row {
    /// That of all rows when it last changed.
    version: u64,
    pub(crate) reading: Reading,
    /// When the last reading was begun; `None` before the first.
    pub(crate) read_at: Option<Instant>,
    /// Nobody has looked since the last who watched has gone.
    is_of_before: bool,
    /// Why it cannot be read.
    pub(crate) lost: Option<String>,
    focus: Option<Arc<Focus>>,
}

impl Row {
    /// See [`bit`].
    pub(crate) fn bits(&self) -> u16 {
        let lost = if self.lost.is_some() { bit::LOST } else { 0 };
        let unread = if self.is_unread() { bit::UNREAD } else { 0 };
        self.reading.bits | lost | unread
    }

    /// Whether it was never read, or not since looking at it was begun again and without its being known as lost.
    fn is_unread(&self) -> bool {
        self.read_at.is_none() || (self.is_of_before && self.lost.is_none())
    }

    /// How old the last reading is, in milliseconds, when it is not of now.
    pub(crate) fn age(&self) -> Option<u64> {
        if self.lost.is_none() && !self.is_of_before {
            return None;
        }
        let age = self.read_at?.elapsed().as_millis();
        Some(u64::try_from(age).unwrap_or(u64::MAX))
    }

    /// What was seen last.
    fn last(&self, member: &Member) -> Focus {
        Focus {
            name: member.name().to_owned(),
            p: self.reading.position,
            v: self.reading.speed,
            e: self.reading.faults.clone(),
            b: self.bits(),
            rev: member.revision(),
            a: self.age(),
            w: self.lost.clone(),
            ..self.focus.as_deref().cloned().unwrap_or_default()
        }
    }
}

#[derive(Debug, Default)]
struct Sights {
    version: u64,
    rows: Vec<Row>,
}

#[derive(Default)]
struct Watching {
    count: usize,
    tasks: JoinSet<()>,
}

/// Who looks at the axes.
pub(crate) struct Hub {
    began: Instant,
    members: Vec<Arc<Member>>,
    seen: Mutex<Sights>,
    /// Counts what was found out about axes beyond their state.
    found: tokio::sync::watch::Sender<u64>,
    watching: Mutex<Watching>,
}

/// Somebody who watches. While there is one the axes are looked at.
pub(crate) struct Watcher {
    hub: Arc<Hub>,
    closely: Option<Arc<Member>>,
}

impl Hub {
    pub(crate) fn new(began: Instant, members: Vec<Arc<Member>>) -> Hub {
        let rows = members.iter().map(|_| Row::default()).collect();
        Hub {
            began,
            members,
            seen: Mutex::new(Sights { version: 1, rows }),
            found: tokio::sync::watch::Sender::new(0),
            watching: Mutex::default(),
        }
    }

    fn seen(&self) -> MutexGuard<'_, Sights> {
        // They are plain values, so whoever panicked left nothing half done.
        self.seen.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn watching(&self) -> MutexGuard<'_, Watching> {
        self.watching.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Begins to watch; one axis closely.
    pub(crate) fn watch(self: &Arc<Hub>, closely: Option<Arc<Member>>) -> Watcher {
        if let Some(member) = &closely {
            member.close_watchers.fetch_add(1, Ordering::SeqCst);
            member.nudge.notify_one();
        }
        let mut watching = self.watching();
        watching.count += 1;
        if watching.count == 1 {
            self.begin(&mut watching.tasks);
        }
        Watcher { hub: Arc::clone(self), closely }
    }

    /// Begins to look. What was seen before is of another time; it is kept as that.
    fn begin(self: &Arc<Hub>, tasks: &mut JoinSet<()>) {
        let mut seen = self.seen();
        seen.version += 1;
        let version = seen.version;
        for row in &mut seen.rows {
            row.version = version;
            row.is_of_before = true;
        }
        drop(seen);
        for member in &self.members {
            member.focus.send_replace(None);
            tasks.spawn(look_in_turns(Arc::clone(self), Arc::clone(member)));
        }
    }

    /// What has changed since a version, with its place among the axes; and the version now.
    pub(crate) fn since(&self, version: u64) -> (u64, Vec<(usize, Row)>) {
        let seen = self.seen();
        let rows = seen.rows.iter().enumerate().filter(|(_, row)| row.version > version);
        (seen.version, rows.map(|(place, row)| (place, row.clone())).collect())
    }

    /// Why an axis cannot be read, if it cannot.
    pub(crate) fn why_lost(&self, member: &Member) -> Option<String> {
        self.seen().rows.get(member.index())?.lost.clone()
    }

    /// Changes when something was found out about axes beyond their state.
    pub(crate) fn found(&self) -> tokio::sync::watch::Receiver<u64> {
        self.found.subscribe()
    }

    /// How often all are looked at that nobody looks at closely.
    fn rest(&self) -> Duration {
        let count = u32::try_from(self.members.len()).unwrap_or(u32::MAX);
        OTHERS.max(Duration::from_secs(1).saturating_mul(count) / MOST_LOOKS)
    }

    /// Takes down what was seen.
    fn note(&self, member: &Member, begun: Instant, reading: Reading, focus: Option<Focus>) {
        member.doing().seen = Some(Seen { at: begun, bits: reading.bits });
        let mut seen = self.seen();
        let next = seen.version + 1;
        let Some(row) = seen.rows.get_mut(member.index()) else { return };
        let is_news = row.lost.is_some() || row.is_unread() || row.reading != reading;
        row.lost = None;
        row.is_of_before = false;
        row.reading = reading;
        row.read_at = Some(begun);
        if is_news {
            row.version = next;
        }
        if let Some(focus) = focus {
            let focus = Arc::new(Focus { t: self.millis(begun), ..focus });
            row.focus = Some(Arc::clone(&focus));
            member.focus.send_replace(Some(focus));
        }
        if is_news {
            seen.version = next;
        }
    }

    /// Takes down that an axis could not be read.
    fn lose(&self, member: &Member, why: &str) {
        member.doing().seen = None;
        let mut seen = self.seen();
        let next = seen.version + 1;
        let Some(row) = seen.rows.get_mut(member.index()) else { return };
        let is_news = row.lost.as_deref() != Some(why);
        row.lost = Some(why.to_owned());
        let focus = Focus { t: self.millis(Instant::now()), ..row.last(member) };
        member.focus.send_replace(Some(Arc::new(focus)));
        if is_news {
            row.version = next;
            seen.version = next;
        }
    }

    /// An axis that cannot be read, as it was last seen.
    pub(crate) fn lost(&self, member: &Member, why: String) -> Focus {
        let row = self.seen().rows.get(member.index()).cloned().unwrap_or_default();
        Row { lost: Some(why), ..row }.last(member)
    }

    fn millis(&self, at: Instant) -> u64 {
        u64::try_from(at.saturating_duration_since(self.began).as_millis()).unwrap_or(u64::MAX)
    }
}

impl Drop for Watcher {
    fn drop(&mut self) {
        if let Some(member) = &self.closely {
            member.close_watchers.fetch_sub(1, Ordering::SeqCst);
        }
        let mut watching = self.hub.watching();
        watching.count = watching.count.saturating_sub(1);
        if watching.count == 0 {
            // To end the tasks is to drop them.
            watching.tasks = JoinSet::new();
        }
    }
}

/// Looks at an axis again and again.
async fn look_in_turns(hub: Arc<Hub>, member: Arc<Member>) {
    let rest = hub.rest();
    let mut looker = Looker::new(Arc::clone(&member));
    // Not all of them at once.
    let place = u32::try_from(member.index()).unwrap_or(0);
    let count = u32::try_from(hub.members.len()).unwrap_or(u32::MAX).max(1);
    let mut next = Instant::now() + rest * place / count;
    loop {
        tokio::select! {
            () = sleep_until(next) => {}
            () = member.nudge.notified() => {}
        }
        let closely = member.close_watchers.load(Ordering::SeqCst) > 0;
        let rest = if closely { CLOSELY } else { rest };
        let begun = Instant::now();
        let patience = PATIENCE.min(NOTICED.saturating_sub(rest)).max(LEAST_PATIENCE);
        let stops = member.stops();
        let outcome = patiently(&hub, &member, patience, looker.look(closely)).await;
        next = begun + rest;
        match outcome {
            Some(Ok((reading, focus))) => {
                // What came late is of the time when it came.
                let at = if begun.elapsed() <= patience { begun } else { Instant::now() };
                hub.note(&member, at, reading, focus);
                if member.model().is_none()
                    && matches!(timeout(patience, member.work(member.find_model())).await, Ok(Ok(true)))
                {
                    hub.found.send_modify(|count| *count += 1);
                }
            }
            // It gave way to a stop.
            Some(Err(_)) | None if member.stops() != stops => {}
            Some(Err(error)) => {
                hub.lose(&member, &error.to_string());
                let is_let_in = !matches!(error, Error::NotAuthorised(_));
                next = Instant::now() + if is_let_in { LOST.max(rest) } else { NOT_LET_IN };
            }
            None => {}
        }
        sleep_until(begun + LEAST_REST).await;
    }
}

/// Looks, and shows the axis as lost when that takes too long. Then it is waited for some more: a login takes seconds, and
/// would never come to an end if it were given up each time.
async fn patiently<T>(
    hub: &Hub,
    member: &Member,
    patience: Duration,
    look: impl Future<Output = Result<T, Error>>,
) -> Option<Result<T, Error>> {
    let mut look = pin!(member.work(look));
    if let Ok(done) = timeout(patience, &mut look).await {
        return Some(done);
    }
    let silent = format!("{} did not answer within {patience:?}", member.name());
    hub.lose(member, &silent);
    timeout(LONGEST_LOOK, look).await.ok()
}
