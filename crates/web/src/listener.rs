//! A listener for HTTP, and its connections.

use crate::Site;
use crate::guard::Arrived;
use crate::patient::Patient;
use axum::Router;
use hyper::service::{Service as _, service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use std::convert::Infallible;
use std::io;
use std::net::{IpAddr, SocketAddr};
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};
use tokio::task::JoinSet;
use tokio::time::{Instant, sleep};

/// The most connections at once.
const MOST_CONNECTIONS: usize = 64;

/// How long a connection may be without a whole head of a request.
const SLOWEST_HEAD: Duration = Duration::from_secs(10);

/// Bytes held for a connection.
const BUFFER: usize = 64 << 10;

/// How long accepting rests after it has failed, as when the process has no file descriptors left.
const ACCEPT_REST: Duration = Duration::from_millis(100);

/// How long a failure to accept is not told again.
const NOTICE_REST: Duration = Duration::from_secs(10);

/// What a client is answered when there are [`MOST_CONNECTIONS`].
const FULL: &[u8] = b"HTTP/1.1 503 Service Unavailable\r\nConnection: close\r\nContent-Type: application/json\r\n\
    Content-Length: 84\r\n\r\n{\"error\":\"64 clients are connected, and no more can be served; close one of them\"}\r\n";

/// A socket that takes connections.
#[derive(Debug)]
pub struct Listener {
    socket: TcpListener,
    address: SocketAddr,
}

impl Listener {
    /// Listens at `address`; port 0 takes a free one. Must be called in a tokio runtime with timers and I/O.
    ///
    /// # Errors
    /// The address cannot be had.
    pub async fn bind(address: SocketAddr) -> io::Result<Listener> {
        let socket = TcpListener::bind(address).await?;
        let address = socket.local_addr()?;
        Ok(Listener { socket, address })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Serves clients until it is dropped, at most 64 at a time. `tell` is told now and then why connections cannot be
    /// accepted, while they cannot.
    pub async fn serve(self, site: Site, tell: impl Fn(io::Error) + Send + Sync) -> Infallible {
        let router = site.into_router();
        let mut connections = JoinSet::new();
        let mut told: Option<Instant> = None;
        loop {
            match self.socket.accept().await {
                Ok((stream, _)) => admit(&mut connections, &router, stream),
                Err(error) => {
                    if told.is_none_or(|told| told.elapsed() >= NOTICE_REST) {
                        told = Some(Instant::now());
                        tell(error);
                    }
                    sleep(ACCEPT_REST).await;
                }
            }
        }
    }
}

/// Serves a connection, or turns it away when there are enough.
fn admit(connections: &mut JoinSet<()>, router: &Router, stream: TcpStream) {
    while connections.try_join_next().is_some() {}
    // Without this the connection still works, a little slower.
    let _ = stream.set_nodelay(true);
    let Ok(arrived) = stream.local_addr() else { return };
    if connections.len() >= MOST_CONNECTIONS {
        // A new connection has room for it; whoever is gone already need not be told.
        let _ = stream.try_write(FULL);
        return;
    }
    connections.spawn(serve(router.clone(), stream, arrived.ip()));
}

async fn serve(router: Router, stream: TcpStream, arrived: IpAddr) {
    let router = TowerToHyperService::new(router);
    let service = service_fn(move |mut request: hyper::Request<hyper::body::Incoming>| {
        request.extensions_mut().insert(Arrived(arrived));
        router.call(request)
    });
    let connection = hyper::server::conn::http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(SLOWEST_HEAD)
        .max_buf_size(BUFFER)
        .serve_connection(TokioIo::new(Patient::new(stream)), service);
    // However it ends, there is nobody left to tell.
    let _ = connection.await;
}
