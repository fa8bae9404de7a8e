//! The listener of the control API.

use super::{Api, routes};
use crate::world::World;
use crate::{Control, Notice, Notify, ServedDrive, What};
use axum::Router;
use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use stepdrive_rig::file::ApiSection;
use stepdrive_web::{Guard, Site};

/// What a client has to show where the rig file asks for it.
const TOKEN: &str = "the api_token of the rig file";

/// A socket that takes connections to the control API.
pub(crate) struct Listener {
    socket: stepdrive_web::Listener,
    guard: Guard,
}

impl Listener {
    /// Listens where the rig file says; port 0 takes a free one.
    pub(crate) async fn bind(section: &ApiSection) -> io::Result<Listener> {
        let socket = stepdrive_web::Listener::bind(section.address).await?;
        let guard = match &section.token {
            Some(token) => Guard::with_token(token, TOKEN),
            None => Guard::open(),
        };
        Ok(Listener { socket, guard })
    }

    /// Where it listens.
    pub(crate) fn address(&self) -> SocketAddr {
        self.socket.address()
    }

    /// Serves clients until it is dropped, `more` beside the API. `drives` are in the order of the rig file.
    pub(crate) async fn serve(
        self,
        world: Arc<World>,
        control: Control,
        drives: Vec<ServedDrive>,
        notify: Notify,
        more: Router,
    ) {
        let api = Arc::new(Api::new(world, control, drives));
        let site = Site::new(routes(api), self.guard, "GET /openapi.json").with(more);
        let tell = move |error| {
            notify(Notice { drive: "the control API".to_owned(), what: What::CannotAccept(error) });
        };
        match self.socket.serve(site, tell).await {}
    }
}
