//! Server-sent events.

use crate::Problem;
use axum::body::{Body, Bytes};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse as _, Response};
use futures_util::stream::unfold;
use serde::Serialize;
use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

/// After so long a client that got no event is sent [`STILL_HERE`], to see whether it is still there.
pub const QUIET: Duration = Duration::from_secs(15);

/// A comment, which clients skip.
pub const STILL_HERE: &[u8] = b":\n\n";

/// An event of this name, as it is sent.
pub fn event(name: &str, data: &impl Serialize) -> Bytes {
    let data = serde_json::to_string(data).unwrap_or_default();
    format!("event: {name}\ndata: {data}\n\n").into()
}

/// Replies with a stream of events: what `next` gives from a state, until it gives none or the client hangs up, which
/// drops the state.
pub fn stream<S, F>(state: S, mut next: impl FnMut(S) -> F + Send + 'static) -> Response
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

/// The places for those who watch.
#[derive(Debug)]
pub struct Places {
    free: Arc<Semaphore>,
    most: usize,
}

/// The place of somebody who watches, until it is dropped.
#[derive(Debug)]
pub struct Place(#[allow(dead_code, reason = "it is held, not looked at")] OwnedSemaphorePermit);

impl Places {
    /// For so many at once.
    pub fn new(most: usize) -> Places {
        Places { free: Arc::new(Semaphore::new(most)), most }
    }

    /// Takes one.
    ///
    /// # Errors
    /// All are taken.
    pub fn take(&self) -> Result<Place, Problem> {
        Arc::clone(&self.free).try_acquire_owned().map(Place).map_err(|_| {
            let most = self.most;
            let message = format!("{most} clients watch already, and no more can; close one of them");
            Problem::new(StatusCode::SERVICE_UNAVAILABLE, message)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_is_free_again_when_it_is_dropped() {
        let places = Places::new(2);
        let first = places.take().expect("free");
        let _second = places.take().expect("free");
        let problem = places.take().expect_err("taken");
        assert_eq!(problem.error(), "2 clients watch already, and no more can; close one of them");
        drop(first);
        places.take().expect("free");
    }

    #[test]
    fn an_event_is_one_line_of_json_whatever_its_text() {
        let bytes = event("notice", &"two\nlines");
        assert_eq!(&bytes[..], b"event: notice\ndata: \"two\\nlines\"\n\n");
    }
}
