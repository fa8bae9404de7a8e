//! Why a request was not answered with what it asked for.

use crate::Reply;
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use serde_json::{Map, Value};
use std::fmt::Display;

/// An error, as a client is told it: `{"error": "one sentence"}`, and what else there is to say.
#[derive(Debug)]
pub struct Problem {
    status: StatusCode,
    told: Box<Told>,
}

#[derive(Debug, Serialize)]
struct Told {
    error: String,
    #[serde(flatten)]
    more: Map<String, Value>,
}

impl Problem {
    /// With this status, and this sentence: what happened, to what, what to do.
    pub fn new(status: StatusCode, error: impl Into<String>) -> Problem {
        Problem { status, told: Box::new(Told { error: error.into(), more: Map::new() }) }
    }

    /// What was sent is not of the form that it should have.
    pub fn malformed(error: impl Display) -> Problem {
        Problem::new(StatusCode::BAD_REQUEST, error.to_string())
    }

    /// What was sent has the right form, but cannot be here.
    pub fn impossible(error: impl Display) -> Problem {
        Problem::new(StatusCode::UNPROCESSABLE_ENTITY, error.to_string())
    }

    /// It could be, but not as things are now.
    pub fn refused(error: impl Display) -> Problem {
        Problem::new(StatusCode::CONFLICT, error.to_string())
    }

    /// Where it is in what the client sent, both from 1.
    #[must_use]
    pub fn at(self, line: usize, column: usize) -> Problem {
        self.with("line", line).with("column", column)
    }

    /// Says more, under a name beside `error`. What has no form in JSON is left out.
    #[must_use]
    pub fn with(mut self, name: &str, value: impl Serialize) -> Problem {
        if let Ok(value) = serde_json::to_value(value) {
            self.told.more.insert(name.to_owned(), value);
        }
        self
    }

    /// The status of the reply.
    pub fn status(&self) -> StatusCode {
        self.status
    }

    /// The sentence.
    pub fn error(&self) -> &str {
        &self.told.error
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

#[cfg(test)]
mod tests {
    use super::*;

    fn text(problem: &Problem) -> String {
        serde_json::to_string(&problem.told).expect("JSON")
    }

    #[test]
    fn a_sentence_comes_first_and_more_beside_it() {
        assert_eq!(text(&Problem::malformed("no")), r#"{"error":"no"}"#);
        let problem = Problem::impossible("no").with("fields", [("ACC", "15 to 59000")]);
        assert_eq!(text(&problem), r#"{"error":"no","fields":[["ACC","15 to 59000"]]}"#);
        let place = Problem::malformed("no").at(3, 7);
        assert_eq!(serde_json::to_value(&place.told).expect("JSON")["column"], 7);
        assert_eq!(serde_json::to_value(&place.told).expect("JSON")["line"], 3);
    }
}
