//! The control API: HTTP and JSON, with server-sent events for what changes.
//!
//! [`ROUTES`] is what there is; `openapi.json` describes it for clients, and a test holds the one to the other. Who may
//! ask at all is seen to by [`stepdrive_web::Guard`], before anything is looked at. No lock is held while a client is written to.

mod change;
mod connection;
mod events;
mod look;
mod mechanism;
mod play;
mod rows;
mod traffic;

pub(crate) use connection::Listener;

use crate::world::World;
use crate::{Control, ServedDrive};
use axum::Router;
use axum::extract::State;
use axum::http::{Method, header};
use axum::response::{IntoResponse, Response};
use axum::routing::on;
use events::Watched;
use std::sync::Arc;
use stepdrive_web::{JSON, Places, Route, route, router};

/// The document that describes the API.
const DOCUMENT: &str = include_str!("openapi.json");

/// What answers requests.
struct Api {
    control: Control,
    world: Arc<World>,
    /// In the order of the rig file.
    drives: Vec<ServedDrive>,
    /// Whether there are wires in each group.
    wired: Vec<bool>,
    watched: Watched,
    viewers: Places,
    listeners: Places,
}

/// All there is.
const ROUTES: [Route<Arc<Api>>; 16] = [
    route(Method::GET, "/openapi.json", |method| on(method, document)),
    route(Method::GET, "/v1/rig", |method| on(method, look::rig)),
    route(Method::GET, "/v1/drives/{drive}", |method| on(method, look::drive)),
    route(Method::GET, "/v1/faults", |method| on(method, look::faults)),
    route(Method::GET, "/v1/events", |method| on(method, events::events)),
    route(Method::GET, "/v1/traffic", |method| on(method, traffic::traffic)),
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
    fn new(world: Arc<World>, control: Control, drives: Vec<ServedDrive>) -> Api {
        let mut wired = vec![false; world.groups()];
        for wire in &world.rig().wires {
            if let Some(wired) = wired.get_mut(world.group_of(wire.from)) {
                *wired = true;
            }
        }
        let watched = Watched::new(drives.len());
        let (viewers, listeners) = (Places::new(events::MOST_VIEWERS), Places::new(traffic::MOST_LISTENERS));
        Api { control, world, drives, wired, watched, viewers, listeners }
    }
}

fn routes(api: Arc<Api>) -> Router {
    router(ROUTES).with_state(api)
}

async fn document() -> Response {
    ([(header::CONTENT_TYPE, JSON)], DOCUMENT).into_response()
}

/// What answers requests, as handlers are given it.
type TheApi = State<Arc<Api>>;

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;
    use stepdrive_web::described;

    #[test]
    fn the_document_describes_every_route_and_no_other() {
        let there: BTreeSet<(String, String)> =
            ROUTES.into_iter().map(|route| (route.method.to_string(), route.path.to_owned())).collect();
        assert_eq!(described(DOCUMENT), there);
    }
}
