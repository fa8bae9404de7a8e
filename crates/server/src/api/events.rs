//! Server-sent events: the rig whenever it has changed.
//!
//! All who watch share one look at the rig, its comparison with the one before and its text. While nobody watches
//! nothing is looked at.

use super::problem::Problem;
use super::rows::RigRow;
use super::{Api, TheApi};
use axum::body::{Body, Bytes};
use axum::extract::{RawQuery, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse as _, Response};
use futures_util::stream::unfold;
use serde::Serialize;
use std::convert::Infallible;
use std::ops::RangeInclusive;
use std::sync::{Arc, OnceLock};
use std::time::Duration;
use stepdrive_rig::duration;
use tokio::sync::{Mutex, OwnedSemaphorePermit, Semaphore};
use tokio::time::Instant;

/// How often events come at most when a client does not say.
const EVERY: Duration = Duration::from_millis(100);

/// How often a client may have them at most.
const RANGE: RangeInclusive<Duration> = Duration::from_millis(20)..=Duration::from_mins(1);

/// The most who may watch at once.
const MOST_VIEWERS: usize = 16;

/// A look at the rig is shared by those who want one within this time.
const SHARED: Duration = Duration::from_millis(10);

/// A look that takes long is shared for so many times as long: a tenth of a processor goes into looking at most.
const SHARED_TIMES: u32 = 10;

/// After so long a client that got no event is sent something, to see whether it is still there.
pub(super) const QUIET: Duration = Duration::from_secs(15);

/// What is sent then: a comment, which clients skip.
pub(super) const STILL_HERE: &[u8] = b":\n\n";

/// The places for those who watch.
pub(super) struct Viewers(Arc<Semaphore>);

impl Default for Viewers {
    fn default() -> Viewers {
        Viewers(Arc::new(Semaphore::new(MOST_VIEWERS)))
    }
}

/// What those who watch saw last.
#[derive(Default)]
pub(super) struct Watched(Mutex<Option<Arc<Seen>>>);

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
    /// A look at the rig: a new one, or one that is young enough.
    async fn look(&self, api: &Api, new: bool) -> Arc<Seen> {
        let mut last = self.0.lock().await;
        let begun = Instant::now();
        if let Some(seen) = last.as_ref().filter(|seen| !new && begun < seen.good_until) {
            return Arc::clone(seen);
        }
        let rig = api.look();
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

/// An event of this name.
pub(super) fn event(name: &str, data: &impl Serialize) -> Bytes {
    let data = serde_json::to_string(data).unwrap_or_default();
    format!("event: {name}\ndata: {data}\n\n").into()
}

/// Replies with a stream of events: what `next` gives from a state, until it gives none or the client hangs up.
pub(super) fn stream<S, F>(state: S, mut next: impl FnMut(S) -> F + Send + 'static) -> Response
where
    S: Send + 'static,
    F: Future<Output = Option<(Bytes, S)>> + Send + 'static,
{
    let parts = unfold(state, move |state| {
        let next = next(state);
        async { next.await.map(|(bytes, state)| (Ok::<Bytes, Infallible>(bytes), state)) }
    });
    ([(header::CONTENT_TYPE, "text/event-stream")], Body::from_stream(parts)).into_response()
}

/// Somebody who watches.
struct Viewer {
    api: Arc<Api>,
    every: Duration,
    /// The version that was sent last; `None` before the first.
    sent: Option<u64>,
    sent_at: Instant,
    _place: OwnedSemaphorePermit,
}

pub(super) async fn events(State(api): TheApi, RawQuery(query): RawQuery) -> Result<Response, Problem> {
    let every = every(query.as_deref().unwrap_or_default())?;
    let place = Arc::clone(&api.viewers.0).try_acquire_owned().map_err(|_| {
        let message = format!("{MOST_VIEWERS} clients watch already, and no more can; close one of them");
        Problem::new(StatusCode::SERVICE_UNAVAILABLE, message)
    })?;
    let viewer = Viewer { api, every, sent: None, sent_at: Instant::now(), _place: place };
    Ok(stream(viewer, |mut viewer| async {
        let event = viewer.next().await;
        Some((event, viewer))
    }))
}

impl Viewer {
    async fn next(&mut self) -> Bytes {
        let Some(sent) = self.sent else {
            let seen = self.api.watched.look(&self.api, true).await;
            return self.send(&seen);
        };
        loop {
            tokio::time::sleep(self.every).await;
            let seen = self.api.watched.look(&self.api, false).await;
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

/// How often the client wants events.
fn every(query: &str) -> Result<Duration, Problem> {
    let mut every = None;
    for (name, value) in form_urlencoded::parse(query.as_bytes()) {
        if name != "every" || every.is_some() {
            return Err(Problem::malformed(
                "the query takes `every` once, and nothing else; as in ?every=100ms",
            ));
        }
        every = Some(duration::parse(&value).map_err(Problem::impossible)?);
    }
    Some(every.unwrap_or(EVERY)).filter(|every| RANGE.contains(every)).ok_or_else(|| {
        let (least, most) = (duration::display(*RANGE.start()), duration::display(*RANGE.end()));
        Problem::impossible(format!("`every` is {least} to {most}"))
    })
}
