//! Server-sent events: what is said between clients and drives.

use super::TheApi;
use super::events::{EVERY_AND_DRIVE, every};
use crate::traffic::{Overheard, Row, words};
use axum::body::Bytes;
use axum::extract::{RawQuery, State};
use axum::response::Response;
use serde::Serialize;
use std::sync::Arc;
use std::time::Duration;
use stepdrive_web::{Place, Problem, QUIET, Query, STILL_HERE, event, stream};
use tokio::time::{Instant, sleep_until, timeout};

/// The most who may watch at once.
pub(super) const MOST_LISTENERS: usize = 16;

/// The most rows in an event.
const MOST_ROWS: usize = 1000;

/// What was said since the event before.
#[derive(Serialize)]
struct Traffic {
    rows: Vec<Row>,
    /// How many exchanges were lost, since more was said than could be taken.
    lost: u64,
}

/// Somebody who watches.
struct Listener {
    api: Arc<super::Api>,
    overheard: Overheard,
    every: Duration,
    /// When the last event was sent; `None` before the first.
    sent_at: Option<Instant>,
    _place: Place,
}

pub(super) async fn traffic(State(api): TheApi, RawQuery(query): RawQuery) -> Result<Response, Problem> {
    let query = Query::parse(query.as_deref(), &EVERY_AND_DRIVE)?;
    let every = every(&query)?;
    let drive = query.get("drive").map(|name| api.find_drive(name)).transpose()?.map(|(number, _)| number);
    let place = api.listeners.take()?;
    let overheard = api.world.tap().overhear(drive);
    let listener = Listener { api, overheard, every, sent_at: None, _place: place };
    Ok(stream(listener, |mut listener| async {
        let event = listener.next().await;
        Some((event, listener))
    }))
}

impl Listener {
    /// The first event comes at once and is empty, so that the client knows that it hears.
    async fn next(&mut self) -> Bytes {
        let mut rows = Vec::new();
        if let Some(sent_at) = self.sent_at {
            let Ok(Some(first)) = timeout(QUIET, self.overheard.next()).await else {
                return Bytes::from_static(STILL_HERE);
            };
            sleep_until(sent_at + self.every).await;
            rows = words(self.api.control.rig(), &first);
            while rows.len() < MOST_ROWS
                && let Some(said) = self.overheard.waiting()
            {
                rows.extend(words(self.api.control.rig(), &said));
            }
        }
        self.sent_at = Some(Instant::now());
        event("traffic", &Traffic { rows, lost: self.overheard.lost() })
    }
}
