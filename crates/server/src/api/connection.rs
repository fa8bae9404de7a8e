//! The listener of the control API, and its connections.

use super::guard::Arrived;
use super::{Api, router};
use crate::world::World;
use crate::{Control, Notice, Notify, ServedDrive, What};
use axum::Router;
use hyper::service::{Service as _, service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use std::io::{self, IoSlice};
use std::net::{IpAddr, SocketAddr};
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll, ready};
use std::time::Duration;
use stepdrive_rig::file::ApiSection;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::task::JoinSet;
use tokio::time::{Instant, Sleep, sleep};

/// The most connections at once.
const MOST_CONNECTIONS: usize = 64;

/// How long a connection may be without a whole head of a request.
const SLOWEST_HEAD: Duration = Duration::from_secs(10);

/// How long a client may leave what it is sent unread.
const UNREAD: Duration = Duration::from_secs(10);

/// Bytes held for a connection.
const BUFFER: usize = 64 << 10;

/// How long accepting rests after it has failed, as when the process has no file descriptors left.
const ACCEPT_REST: Duration = Duration::from_millis(100);

/// How long a failure to accept is not told again.
const NOTICE_REST: Duration = Duration::from_secs(10);

/// What a client is answered when there are [`MOST_CONNECTIONS`].
const FULL: &[u8] = b"HTTP/1.1 503 Service Unavailable\r\nConnection: close\r\nContent-Type: application/json\r\n\
    Content-Length: 84\r\n\r\n{\"error\":\"64 clients are connected, and no more can be served; close one of them\"}\r\n";

/// A socket that takes connections to the control API.
pub(crate) struct Listener {
    socket: TcpListener,
    address: SocketAddr,
    token: Option<String>,
}

impl Listener {
    /// Listens where the rig file says; port 0 takes a free one.
    pub(crate) async fn bind(section: &ApiSection) -> io::Result<Listener> {
        let socket = TcpListener::bind(section.address).await?;
        let address = socket.local_addr()?;
        Ok(Listener { socket, address, token: section.token.clone() })
    }

    /// Where it listens.
    pub(crate) fn address(&self) -> SocketAddr {
        self.address
    }

    /// Serves clients until it is dropped. `drives` are in the order of the rig file.
    pub(crate) async fn serve(
        self,
        world: Arc<World>,
        control: Control,
        drives: Vec<ServedDrive>,
        notify: Notify,
    ) {
        let router = router(Arc::new(Api::new(world, control, drives, self.token.as_deref())));
        let mut connections = JoinSet::new();
        let mut told: Option<Instant> = None;
        loop {
            match self.socket.accept().await {
                Ok((stream, _)) => admit(&mut connections, &router, stream),
                Err(error) => {
                    if told.is_none_or(|told| told.elapsed() >= NOTICE_REST) {
                        told = Some(Instant::now());
                        notify(Notice {
                            drive: "the control API".to_owned(),
                            what: What::CannotAccept(error),
                        });
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
        .serve_connection(TokioIo::new(Patient { stream, unread: None }), service);
    // However it ends, there is nobody left to tell.
    let _ = connection.await;
}

/// A connection that fails when its client does not read for [`UNREAD`].
struct Patient {
    stream: TcpStream,
    /// Runs while the client does not take what it is sent.
    unread: Option<Pin<Box<Sleep>>>,
}

impl Patient {
    /// Passes on how writing went, or that the client takes too long.
    fn wait<T>(&mut self, cx: &mut Context<'_>, written: Poll<io::Result<T>>) -> Poll<io::Result<T>> {
        if written.is_ready() {
            self.unread = None;
            return written;
        }
        let unread = self.unread.get_or_insert_with(|| Box::pin(sleep(UNREAD)));
        ready!(unread.as_mut().poll(cx));
        Poll::Ready(Err(io::ErrorKind::TimedOut.into()))
    }
}

impl AsyncRead for Patient {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_read(cx, buffer)
    }
}

impl AsyncWrite for Patient {
    fn poll_write(mut self: Pin<&mut Self>, cx: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        let written = Pin::new(&mut self.stream).poll_write(cx, bytes);
        self.wait(cx, written)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        parts: &[IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let written = Pin::new(&mut self.stream).poll_write_vectored(cx, parts);
        self.wait(cx, written)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(cx)
    }
}
