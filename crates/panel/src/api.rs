//! The API: what there is, and who answers it. `api/openapi.json` describes it for clients, and a test holds the one to
//! the other.

use crate::flags::FlagRow;
use crate::look::{Focus, Looker};
use crate::member::{AxisInfo, Member};
use crate::{Shared, bake, events, flags, jog, motion, programs, settings, stopping};
use axum::Router;
use axum::extract::State;
use axum::http::{Method, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::on;
use serde::Serialize;
use std::sync::Arc;
use std::time::Duration;
use stepdrive_host::Error;
use stepdrive_web::{JSON, Named, Problem, Reply, Route, route};
use tokio::time::{Instant, timeout};

/// The document that describes the API.
const DOCUMENT: &str = include_str!("api/openapi.json");

/// How long a look at an axis may take.
const PATIENCE: Duration = Duration::from_millis(700);

/// What answers requests, as handlers are given it.
pub(crate) type ThePanel = State<Arc<Shared>>;

/// A reply that says no more than that it is done.
#[derive(Debug, Serialize)]
pub(crate) struct Nothing {}

const ROUTES: [Route<Arc<Shared>>; 28] = [
    route(Method::GET, "/v1/axes/openapi.json", |method| on(method, document)),
    route(Method::GET, "/v1/axes", |method| on(method, axes)),
    route(Method::GET, "/v1/axes/events", |method| on(method, events::events)),
    route(Method::POST, "/v1/axes/stop", |method| on(method, stopping::stop_all)),
    route(Method::GET, "/v1/axes/{axis}", |method| on(method, axis)),
    route(Method::POST, "/v1/axes/{axis}/jog", |method| on(method, jog::jog)),
    route(Method::POST, "/v1/axes/{axis}/jog/end", |method| on(method, jog::end)),
    route(Method::POST, "/v1/axes/{axis}/move", |method| on(method, motion::r#move)),
    route(Method::POST, "/v1/axes/{axis}/run", |method| on(method, motion::run)),
    route(Method::POST, "/v1/axes/{axis}/home", |method| on(method, motion::home)),
    route(Method::POST, "/v1/axes/{axis}/zero", |method| on(method, motion::zero)),
    route(Method::POST, "/v1/axes/{axis}/clear", |method| on(method, motion::clear)),
    route(Method::POST, "/v1/axes/{axis}/stop", |method| on(method, stopping::stop)),
    route(Method::GET, "/v1/axes/{axis}/programs", |method| on(method, programs::fetch)),
    route(Method::PUT, "/v1/axes/{axis}/programs", |method| on(method, programs::store)),
    route(Method::POST, "/v1/axes/{axis}/programs/{mem}/start", |method| on(method, programs::start)),
    route(Method::POST, "/v1/axes/{axis}/programs/stop", |method| on(method, programs::stop)),
    route(Method::POST, "/v1/axes/{axis}/bake", |method| on(method, bake::begin)),
    route(Method::DELETE, "/v1/axes/{axis}/bake", |method| on(method, bake::end)),
    route(Method::GET, "/v1/axes/{axis}/settings", |method| on(method, settings::get)),
    route(Method::PUT, "/v1/axes/{axis}/settings", |method| on(method, settings::put)),
    route(Method::POST, "/v1/axes/{axis}/settings/store", |method| on(method, settings::store)),
    route(Method::POST, "/v1/axes/{axis}/settings/load", |method| on(method, settings::load)),
    route(Method::POST, "/v1/axes/{axis}/settings/apply-lan", |method| on(method, settings::apply_lan)),
    route(Method::GET, "/v1/language", |method| on(method, programs::language)),
    route(Method::POST, "/v1/programs/check", |method| on(method, programs::check)),
    route(Method::POST, "/v1/programs/format", |method| on(method, programs::format)),
    route(Method::POST, "/v1/programs/simulate", |method| on(method, programs::simulate)),
];

pub(crate) fn router(panel: &Arc<Shared>) -> Router {
    stepdrive_web::router(ROUTES).with_state(Arc::clone(panel))
}

/// The axis of a name.
pub(crate) fn find(panel: &Shared, name: &str) -> Result<Arc<Member>, Problem> {
    panel.find(name).cloned().ok_or_else(|| {
        let name: String = name.chars().take(60).flat_map(char::escape_debug).collect();
        Problem::impossible(format!("there is no axis `{name}`; GET /v1/axes says which there are"))
    })
}

/// An error of a driver, as a client is told it.
#[allow(clippy::needless_pass_by_value, reason = "it is for map_err")]
pub(crate) fn problem(error: Error) -> Problem {
    Problem::new(status(&error), error.to_string())
}

fn status(error: &Error) -> StatusCode {
    match error {
        Error::Usage(_) => StatusCode::UNPROCESSABLE_ENTITY,
        Error::Refused(_) | Error::Fault(_) => StatusCode::CONFLICT,
        Error::Line(_)
        | Error::NotAuthorised(_)
        | Error::Device(_)
        | Error::Uncertain { .. }
        | Error::Differs(_) => StatusCode::BAD_GATEWAY,
        Error::Partly { cause, .. } => status(cause),
    }
}

#[derive(Serialize)]
struct Axes {
    axes: Vec<AxisInfo>,
}

/// An axis with all there is to know of it.
#[derive(Serialize)]
struct Detail {
    #[serde(flatten)]
    info: AxisInfo,
    #[serde(flatten)]
    now: Focus,
    flags_table: Vec<FlagRow>,
}

async fn document() -> Response {
    ([(header::CONTENT_TYPE, JSON)], DOCUMENT).into_response()
}

async fn axes(State(panel): ThePanel) -> Reply<Axes> {
    Reply(Axes { axes: panel.members.iter().map(|member| member.info()).collect() })
}

async fn axis(State(panel): ThePanel, Named(name): Named<String>) -> Result<Reply<Detail>, Problem> {
    let member = find(&panel, &name)?;
    let mut looker = Looker::new(Arc::clone(&member));
    let outcome = timeout(
        PATIENCE,
        member.work(async {
            if member.model().is_none() {
                member.find_model().await?;
            }
            looker.look(true).await
        }),
    );
    let now = match outcome.await {
        Ok(Ok((_, Some(focus)))) => focus,
        Ok(Ok((_, None))) => Focus::default(),
        Ok(Err(error)) => panel.hub.lost(&member, error.to_string()),
        Err(_) => panel.hub.lost(&member, format!("{} did not answer within {PATIENCE:?}", member.name())),
    };
    let now = Focus { t: panel.millis(Instant::now()), name: String::new(), ..now };
    Ok(Reply(Detail { info: member.info(), now, flags_table: flags::table(member.client()) }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn the_document_describes_every_route_and_no_other() {
        let there: BTreeSet<(String, String)> =
            ROUTES.into_iter().map(|route| (route.method.to_string(), route.path.to_owned())).collect();
        assert_eq!(stepdrive_web::described(DOCUMENT), there);
    }
}
