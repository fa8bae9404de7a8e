//! Serial ports, each for one program at a time.
//!
//! A controller's replies do not say whom they are for, and an SMD3's not even what they answer. Two programs on one port
//! would each take replies that the other waits for; so whoever opens a port holds a lock on it, the same that pyserial's
//! `exclusive=True` takes. Windows opens a port for one program in any case.

use crate::connect::{BoxFuture, Connect, Stream};
use serial2_tokio::SerialPort;
use std::io;
use std::path::{Path, PathBuf};
use std::pin::Pin;
use std::task::{Context, Poll};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};

/// The bit rate that serial ports are opened at. A USB port of a controller takes any and ignores it.
const BAUD: u32 = 115_200;

/// A controller at a serial port, which an SMD3's USB is, and an SMSD's.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Serial {
    path: PathBuf,
    name: String,
}

impl Serial {
    /// The port with this path, as `/dev/ttyACM0`, or name, as `COM3`.
    pub fn new(path: impl Into<PathBuf>) -> Serial {
        let path = path.into();
        let name = path.display().to_string();
        Serial { path, name }
    }
}

impl Connect for Serial {
    /// Opens the port. While another program holds it that is waited for, 0.6 s at most.
    fn connect(&self) -> BoxFuture<'_, io::Result<Box<dyn Stream>>> {
        Box::pin(async move {
            let hold = lock::Hold::take(&self.path).await?;
            let port = SerialPort::open(&self.path, BAUD)?;
            Ok(Box::new(Held { port, _hold: hold }) as Box<dyn Stream>)
        })
    }

    fn name(&self) -> &str {
        &self.name
    }
}

/// An open port. It is closed before it is let go.
struct Held {
    port: SerialPort,
    _hold: lock::Hold,
}

impl AsyncRead for Held {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        Pin::new(&mut self.port).poll_read(context, buffer)
    }
}

impl AsyncWrite for Held {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.port).poll_write(context, bytes)
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.port).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.port).poll_shutdown(context)
    }
}

#[cfg(unix)]
mod lock {
    use super::{Path, io};
    use rustix::fs::{Mode, OFlags};
    use std::fs::{File, TryLockError};
    use std::time::Duration;
    use tokio::time::{Instant, sleep};

    /// How long another program is waited for: longer than a command that asks for something and goes takes. Who makes a request
    /// tries to open the port several times.
    const PATIENCE: Duration = Duration::from_millis(600);

    /// Time between two looks whether it has gone.
    const REST: Duration = Duration::from_millis(20);

    /// A port that nobody else holds.
    pub(super) struct Hold(#[expect(dead_code, reason = "the lock lasts as long as it is open")] File);

    impl Hold {
        pub(super) async fn take(path: &Path) -> io::Result<Hold> {
            let latest = Instant::now() + PATIENCE;
            loop {
                // Opened anew each time: a port that stays open seems to be in use still to who is at its other end.
                let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
                let port = File::from(rustix::fs::open(path, flags, Mode::empty())?);
                match port.try_lock() {
                    Ok(()) => return Ok(Hold(port)),
                    Err(TryLockError::Error(error)) => return Err(error),
                    Err(TryLockError::WouldBlock) if Instant::now() >= latest => {
                        let what = "another program has it open, as a panel does once it was looked at; close that, or use it by turns";
                        return Err(io::Error::new(io::ErrorKind::ResourceBusy, what));
                    }
                    Err(TryLockError::WouldBlock) => drop(port),
                }
                sleep(REST).await;
            }
        }
    }
}

#[cfg(not(unix))]
mod lock {
    use super::{Path, io};

    /// The system sees to it.
    pub(super) struct Hold;

    impl Hold {
        pub(super) async fn take(_path: &Path) -> io::Result<Hold> {
            Ok(Hold)
        }
    }
}

/// The serial ports of this computer, sorted.
///
/// # Errors
/// When the system does not tell.
pub fn serial_ports() -> io::Result<Vec<PathBuf>> {
    let mut ports = SerialPort::available_ports()?;
    ports.sort();
    ports.dedup();
    Ok(ports)
}
