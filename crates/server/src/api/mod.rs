//! The control API: HTTP and JSON, with server-sent events for what changes.
//!
//! [`ROUTES`] is what there is; `openapi.json` describes it for clients, and a test holds the one to the other. Who may
//! ask at all is seen to by `guard`, before anything is looked at. No lock is held while a client is written to.

mod ask;
mod change;
mod connection;
mod events;
mod guard;
mod look;
mod play;
mod problem;
mod rows;

pub(crate) use connection::Listener;

use crate::world::World;
use crate::{Control, ServedDrive};
use axum::Router;
use axum::extract::State;
use axum::http::{Method, StatusCode, header};
use axum::middleware::from_fn_with_state;
use axum::response::{IntoResponse, Response};
use axum::routing::{MethodFilter, MethodRouter, on};
use events::{Viewers, Watched};
use guard::Token;
use problem::Problem;
use serde::Serialize;
use std::sync::Arc;

/// The document that describes the API.
const DOCUMENT: &str = include_str!("openapi.json");

/// What answers requests.
struct Api {
    control: Control,
    world: Arc<World>,
    /// In the order of the rig file.
    drives: Vec<ServedDrive>,
    /// What a client has to show; `None` when nothing.
    token: Option<Token>,
    watched: Watched,
    viewers: Viewers,
}

/// A row of the table of routes.
struct Route {
    method: Method,
    path: &'static str,
    /// Lets the handler answer this method.
    handler: fn(MethodFilter) -> MethodRouter<Arc<Api>>,
}

const fn route(
    method: Method,
    path: &'static str,
    handler: fn(MethodFilter) -> MethodRouter<Arc<Api>>,
) -> Route {
    Route { method, path, handler }
}

/// All there is.
const ROUTES: [Route; 15] = [
    route(Method::GET, "/openapi.json", |method| on(method, document)),
    route(Method::GET, "/v1/rig", |method| on(method, look::rig)),
    route(Method::GET, "/v1/drives/{drive}", |method| on(method, look::drive)),
    route(Method::GET, "/v1/faults", |method| on(method, look::faults)),
    route(Method::GET, "/v1/events", |method| on(method, events::events)),
    route(Method::PUT, "/v1/clock", |method| on(method, change::clock)),
    route(Method::POST, "/v1/clock/step", |method| on(method, change::step)),
    route(Method::POST, "/v1/clock/run-until", |method| on(method, change::run_until)),
    route(Method::POST, "/v1/actions", |method| on(method, change::actions)),
    route(Method::PUT, "/v1/drives/{drive}/inputs/{input}", |method| on(method, change::input)),
    route(Method::PUT, "/v1/drives/{drive}/faults/{fault}", |method| on(method, change::fault)),
    route(Method::PUT, "/v1/drives/{drive}/power", |method| on(method, change::power)),
    route(Method::PUT, "/v1/drives/{drive}/panel", |method| on(method, change::panel)),
    route(Method::PUT, "/v1/wires", |method| on(method, change::wire)),
    route(Method::POST, "/v1/play", |method| on(method, play::play)),
];

impl Api {
    fn new(world: Arc<World>, control: Control, drives: Vec<ServedDrive>, token: Option<&str>) -> Api {
        Api {
            control,
            world,
            drives,
            token: token.map(Token::new),
            watched: Watched::default(),
            viewers: Viewers::default(),
        }
    }
}

fn router(api: Arc<Api>) -> Router {
    let routes = ROUTES.into_iter().filter_map(|route| {
        let method = MethodFilter::try_from(route.method).ok()?;
        Some((route.path, (route.handler)(method)))
    });
    routes
        .fold(Router::new(), |router, (path, method)| router.route(path, method))
        .fallback(nothing_here)
        .method_not_allowed_fallback(wrong_method)
        .layer(from_fn_with_state(Arc::clone(&api), guard::guard))
        .with_state(api)
}

async fn document() -> Response {
    ([(header::CONTENT_TYPE, JSON)], DOCUMENT).into_response()
}

async fn nothing_here() -> Problem {
    Problem::new(StatusCode::NOT_FOUND, "there is nothing here; GET /openapi.json says what there is")
}

async fn wrong_method() -> Problem {
    let message = "this cannot be done here; the Allow header says what can, and GET /openapi.json how";
    Problem::new(StatusCode::METHOD_NOT_ALLOWED, message)
}

const JSON: &str = "application/json";

/// A reply in JSON.
struct Reply<T>(T);

impl<T: Serialize> IntoResponse for Reply<T> {
    fn into_response(self) -> Response {
        match serde_json::to_vec(&self.0) {
            Ok(text) => ([(header::CONTENT_TYPE, JSON)], text).into_response(),
            Err(error) => Problem::new(StatusCode::INTERNAL_SERVER_ERROR, error.to_string()).into_response(),
        }
    }
}

/// What answers requests, as handlers are given it.
type TheApi = State<Arc<Api>>;

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;
    use std::collections::BTreeSet;

    #[test]
    fn the_document_describes_every_route_and_no_other() {
        let document: Value = serde_json::from_str(DOCUMENT).expect("JSON");
        let described: BTreeSet<(String, String)> = document["paths"]
            .as_object()
            .expect("paths")
            .iter()
            .flat_map(|(path, item)| {
                let methods = item.as_object().expect("a path item").keys();
                let methods = methods.filter(|key| *key != "parameters");
                methods.map(|method| (method.to_ascii_uppercase(), path.clone()))
            })
            .collect();
        let there =
            ROUTES.into_iter().map(|route| (route.method.to_string(), route.path.to_owned())).collect();
        assert_eq!(described, there);
    }
}
