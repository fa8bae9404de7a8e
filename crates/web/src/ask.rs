//! What clients send: bodies, and the names in paths.

use crate::{JSON, Problem};
use axum::body::Body;
use axum::extract::{FromRequest, FromRequestParts, Path, Request};
use axum::http::request::Parts;
use axum::http::{HeaderMap, StatusCode, header};
use futures_util::StreamExt as _;
use serde::de::DeserializeOwned;
use std::time::Duration;
use tokio::time::timeout;

/// The most bytes that a body may have.
const LONGEST_BODY: usize = 1 << 20;

/// Of a body that is longer so much is read and thrown away, so that the client comes to read why it is refused.
const MOST_DISCARDED: usize = 16 * LONGEST_BODY;

/// How long a body may take to arrive.
const SLOWEST_BODY: Duration = Duration::from_secs(10);

/// A body in JSON: an object of at most 1 MiB.
#[derive(Clone, Copy, Debug)]
pub struct Asked<T>(pub T);

impl<T: DeserializeOwned, S: Send + Sync> FromRequest<S> for Asked<T> {
    type Rejection = Problem;

    async fn from_request(request: Request, _: &S) -> Result<Asked<T>, Problem> {
        if !is_json(request.headers()) {
            let message = "a body in JSON is wanted here; send the header Content-Type: application/json";
            return Err(Problem::new(StatusCode::UNSUPPORTED_MEDIA_TYPE, message));
        }
        let body = timeout(SLOWEST_BODY, read(request.into_body()));
        let body = body.await.unwrap_or_else(|_| {
            Err(Problem::new(StatusCode::REQUEST_TIMEOUT, "the body did not arrive within 10 seconds"))
        });
        parse(&body?).map(Asked)
    }
}

/// The names in a path.
#[derive(Clone, Copy, Debug)]
pub struct Named<T>(pub T);

impl<T: DeserializeOwned + Send, S: Send + Sync> FromRequestParts<S> for Named<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Named<T>, Problem> {
        let names = Path::<T>::from_request_parts(parts, state).await;
        names.map(|Path(names)| Named(names)).map_err(|_| Problem::malformed("the path is not UTF-8"))
    }
}

fn is_json(headers: &HeaderMap) -> bool {
    let kind = headers.get(header::CONTENT_TYPE).and_then(|kind| kind.to_str().ok());
    let kind = kind.and_then(|kind| kind.split(';').next());
    kind.is_some_and(|kind| kind.trim().eq_ignore_ascii_case(JSON))
}

async fn read(body: Body) -> Result<Vec<u8>, Problem> {
    let (mut bytes, mut length, mut parts) = (Vec::new(), 0, body.into_data_stream());
    while let Some(part) = parts.next().await {
        let part = part.map_err(|error| Problem::malformed(format!("the body cannot be read: {error}")))?;
        length += part.len();
        if length <= LONGEST_BODY {
            bytes.extend_from_slice(&part);
        } else if length > MOST_DISCARDED {
            break;
        }
    }
    if length > LONGEST_BODY {
        return Err(Problem::new(
            StatusCode::PAYLOAD_TOO_LARGE,
            "the body is longer than 1 MiB; send less at a time",
        ));
    }
    Ok(bytes)
}

fn parse<T: DeserializeOwned>(body: &[u8]) -> Result<T, Problem> {
    // Serde would also take the fields of an object in a row, without their names.
    if body.trim_ascii_start().first().is_some_and(|byte| *byte == b'[') {
        return Err(Problem::malformed("the body is a JSON array; an object is wanted here").at(1, 1));
    }
    serde_json::from_slice(body).map_err(|error| {
        let problem = Problem::malformed(format!("the body is not what is wanted here: {error}"));
        if error.line() == 0 { problem } else { problem.at(error.line(), error.column().max(1)) }
    })
}
