//! Scenarios: played while the client listens.

use super::TheApi;
use crate::scenario::{PlayError, Played, Playing};
use axum::body::Bytes;
use axum::extract::State;
use axum::response::Response;
use serde::Deserialize;
use stepdrive_web::{Asked, Problem, QUIET, STILL_HERE, event, stream};
use tokio::time::timeout;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Play {
    scenario: String,
}

pub(super) async fn play(
    State(api): TheApi,
    Asked(Play { scenario }): Asked<Play>,
) -> Result<Response, Problem> {
    let playing = api.control.play(&scenario).map_err(|error| match error {
        PlayError::Mistake(mistake) => {
            let problem = Problem::impossible(mistake.message);
            match mistake.line.zip(mistake.column) {
                Some((line, column)) => problem.at(line, column),
                None => problem,
            }
        }
        PlayError::Busy(_) => Problem::refused(error),
    })?;
    Ok(stream(playing, next))
}

/// What is sent next. When the client hangs up this is dropped, and the scenario with it.
async fn next(mut playing: Playing) -> Option<(Bytes, Playing)> {
    let bytes = match timeout(QUIET, playing.next()).await {
        Ok(Some(Played::Step(step))) => event("step", &step),
        Ok(Some(Played::Over(report))) => event("report", &report),
        Ok(None) => return None,
        Err(_) => Bytes::from_static(STILL_HERE),
    };
    Some((bytes, playing))
}
