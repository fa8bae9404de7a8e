//! Ways to reach a controller: TCP, or whatever opens a stream of bytes. [`Serial`](crate::Serial) has a module of its own.

use std::fmt;
use std::future::Future;
use std::io;
use std::pin::Pin;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpStream;

/// A future in a box.
pub type BoxFuture<'a, T> = Pin<Box<dyn Future<Output = T> + Send + 'a>>;

/// A stream of bytes to a controller and back. What is written goes out at once: nobody flushes it.
pub trait Stream: AsyncRead + AsyncWrite + Send + Unpin {}

impl<T: AsyncRead + AsyncWrite + Send + Unpin> Stream for T {}

/// Opens streams to one controller, as often as the line is lost.
pub trait Connect: Send + Sync {
    /// Opens a stream. Dropping the future gives up.
    ///
    /// # Errors
    /// Those of the operating system.
    fn connect(&self) -> BoxFuture<'_, io::Result<Box<dyn Stream>>>;

    /// What errors call the other end, as in `192.168.1.2:502`.
    fn name(&self) -> &str;
}

impl fmt::Debug for dyn Connect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Connect").field(&self.name()).finish()
    }
}

impl Connect for Box<dyn Connect> {
    fn connect(&self) -> BoxFuture<'_, io::Result<Box<dyn Stream>>> {
        (**self).connect()
    }

    fn name(&self) -> &str {
        (**self).name()
    }
}

/// A controller on the network.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tcp {
    host: String,
    port: u16,
    name: String,
}

impl Tcp {
    /// A host by name or address (an IPv6 address with or without its brackets), and its port.
    pub fn new(host: &str, port: u16) -> Tcp {
        let host = host.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')).unwrap_or(host);
        let name = if host.contains(':') { format!("[{host}]:{port}") } else { format!("{host}:{port}") };
        Tcp { host: host.to_owned(), port, name }
    }
}

impl Connect for Tcp {
    fn connect(&self) -> BoxFuture<'_, io::Result<Box<dyn Stream>>> {
        Box::pin(async move {
            let stream = TcpStream::connect((self.host.as_str(), self.port)).await?;
            // Requests are short and wait for their replies: without this each may wait for an acknowledgement too.
            stream.set_nodelay(true)?;
            Ok(Box::new(stream) as Box<dyn Stream>)
        })
    }

    fn name(&self) -> &str {
        &self.name
    }
}

/// Whatever a function opens, under the name that errors are to give it.
pub fn from_fn<F, S, R>(name: &str, open: F) -> impl Connect + use<F, S, R>
where
    F: Fn() -> R + Send + Sync,
    R: Future<Output = io::Result<S>> + Send,
    S: Stream + 'static,
{
    FromFn { name: name.to_owned(), open }
}

struct FromFn<F> {
    name: String,
    open: F,
}

impl<F, S, R> Connect for FromFn<F>
where
    F: Fn() -> R + Send + Sync,
    R: Future<Output = io::Result<S>> + Send,
    S: Stream + 'static,
{
    fn connect(&self) -> BoxFuture<'_, io::Result<Box<dyn Stream>>> {
        Box::pin(async move { Ok(Box::new((self.open)().await?) as Box<dyn Stream>) })
    }

    fn name(&self) -> &str {
        &self.name
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_host_is_named_with_its_port_and_an_ipv6_address_in_brackets() {
        assert_eq!(Tcp::new("192.168.1.2", 502).name(), "192.168.1.2:502");
        assert_eq!(Tcp::new("axis-1.lab", 5020).name(), "axis-1.lab:5020");
        assert_eq!(Tcp::new("::1", 502).name(), "[::1]:502");
        assert_eq!(Tcp::new("[::1]", 502), Tcp::new("::1", 502));
    }
}
