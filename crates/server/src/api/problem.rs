//! Why a request was not answered with what it asked for.

use super::Reply;
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use std::fmt::Display;

/// An error, as a client is told it.
#[derive(Debug)]
pub(super) struct Problem {
    status: StatusCode,
    told: Told,
}

#[derive(Debug, Serialize)]
struct Told {
    error: String,
    #[serde(flatten)]
    place: Option<Place>,
}

/// Where it is in what the client sent, both from 1.
#[derive(Debug, Serialize)]
struct Place {
    line: usize,
    column: usize,
}

impl Problem {
    pub(super) fn new(status: StatusCode, error: impl Into<String>) -> Problem {
        Problem { status, told: Told { error: error.into(), place: None } }
    }

    /// What was sent is not of the form that it should have.
    pub(super) fn malformed(error: impl Display) -> Problem {
        Problem::new(StatusCode::BAD_REQUEST, error.to_string())
    }

    /// What was sent has the right form, but cannot be for this rig.
    pub(super) fn impossible(error: impl Display) -> Problem {
        Problem::new(StatusCode::UNPROCESSABLE_ENTITY, error.to_string())
    }

    pub(super) fn at(mut self, line: usize, column: usize) -> Problem {
        self.told.place = Some(Place { line, column });
        self
    }
}

impl IntoResponse for Problem {
    fn into_response(self) -> Response {
        let mut response = (self.status, Reply(self.told)).into_response();
        if self.status == StatusCode::UNAUTHORIZED {
            response.headers_mut().insert(header::WWW_AUTHENTICATE, HeaderValue::from_static("Bearer"));
        }
        response
    }
}
