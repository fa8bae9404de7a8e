//! A pseudo-terminal that stands for a USB virtual COM port, under a name that stays the same.
//!
//! The drive holds the master; a client opens the name, which is a symbolic link to the slave, as it would open
//! `/dev/ttyACM0`. Like a COM port it can be opened, closed and opened again; what a client has not read is dropped when
//! it closes. The kernel tells of that by inotify, so a port that nobody uses costs nothing.

use rustix::fs::inotify::{self, CreateFlags, ReadFlags, WatchFlags};
use rustix::fs::{Mode, OFlags};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, QueueSelector, tcflush, tcgetattr, tcsetattr};
use std::io;
use std::mem::MaybeUninit;
use std::os::fd::OwnedFd;
use std::os::unix::ffi::OsStringExt;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::pin::Pin;
use std::task::{Context, Poll, ready};
use tokio::io::unix::AsyncFd;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};

/// The drive's end of the port.
pub(crate) struct Pty {
    master: AsyncFd<OwnedFd>,
}

/// The name of the port, for as long as it is held.
pub(crate) struct PortName {
    link: PathBuf,
    slave: PathBuf,
}

/// Tells when clients open and close the port, and drops what they leave behind.
pub(crate) struct Clients {
    events: AsyncFd<OwnedFd>,
    /// Held open, so that the drive's end never hangs up.
    slave: OwnedFd,
    /// How many times clients have it open.
    open: usize,
}

/// Makes a port under a name. A link that is there already is replaced; anything else stays, and is an error.
pub(crate) fn open(link: &Path) -> io::Result<(Pty, Clients, PortName)> {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
    rustix::io::ioctl_fionbio(&master, true)?;
    grantpt(&master)?;
    unlockpt(&master)?;
    let slave_path = PathBuf::from(std::ffi::OsString::from_vec(ptsname(&master, Vec::new())?.into_bytes()));
    let slave =
        rustix::fs::open(&slave_path, OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC, Mode::empty())?;
    // A COM port passes bytes as they are.
    let mut settings = tcgetattr(&slave)?;
    settings.make_raw();
    tcsetattr(&slave, OptionalActions::Now, &settings)?;
    let events = inotify::init(CreateFlags::CLOEXEC | CreateFlags::NONBLOCK)?;
    inotify::add_watch(
        &events,
        &slave_path,
        WatchFlags::OPEN | WatchFlags::CLOSE_WRITE | WatchFlags::CLOSE_NOWRITE,
    )?;
    let name = PortName::claim(link, slave_path)?;
    Ok((Pty { master: watched(master)? }, Clients { events: watched(events)?, slave, open: 0 }, name))
}

/// Lets tokio tell when a descriptor is ready.
#[allow(
    deprecated,
    reason = "its unsafe successor wants a promise that an `OwnedFd` keeps: it stays open and the same"
)]
fn watched(descriptor: OwnedFd) -> io::Result<AsyncFd<OwnedFd>> {
    AsyncFd::new(descriptor)
}

impl PortName {
    fn claim(link: &Path, slave: PathBuf) -> io::Result<PortName> {
        if link.is_symlink() {
            std::fs::remove_file(link)?;
        }
        symlink(&slave, link)?;
        Ok(PortName { link: link.to_owned(), slave })
    }

    /// What a client opens.
    pub(crate) fn path(&self) -> &Path {
        &self.link
    }
}

impl Drop for PortName {
    fn drop(&mut self) {
        // Another one may have taken the name over; and a name that cannot be removed is replaced at the next start.
        if std::fs::read_link(&self.link).is_ok_and(|target| target == self.slave) {
            let _ = std::fs::remove_file(&self.link);
        }
    }
}

impl Clients {
    /// Waits until the last client has closed the port.
    pub(crate) async fn all_gone(&mut self) -> io::Result<()> {
        loop {
            let mut ready = self.events.readable().await?;
            let Ok(gone) = ready.try_io(|events| count(events.get_ref(), &mut self.open)) else { continue };
            if gone? {
                return Ok(());
            }
        }
    }

    /// Drops what nobody has read.
    pub(crate) fn drop_unread(&self) -> io::Result<()> {
        Ok(tcflush(&self.slave, QueueSelector::IFlush)?)
    }
}

/// Takes the events that are there into account. `true` when the last client has closed since.
fn count(events: &OwnedFd, open: &mut usize) -> io::Result<bool> {
    let mut space = [MaybeUninit::uninit(); 1024];
    let mut reader = inotify::Reader::new(events, &mut space);
    let mut gone = false;
    loop {
        let event = match reader.next() {
            Ok(event) => event.events(),
            Err(rustix::io::Errno::WOULDBLOCK) if gone => return Ok(true),
            Err(error) => return Err(error.into()),
        };
        if event.contains(ReadFlags::OPEN) {
            *open += 1;
            gone = false;
        } else if event.intersects(ReadFlags::CLOSE_WRITE | ReadFlags::CLOSE_NOWRITE) {
            *open = open.saturating_sub(1);
            gone = *open == 0;
        }
        if reader.is_buffer_empty() && gone {
            return Ok(true);
        }
    }
}

impl Pty {
    /// Reads what is there without waiting for more; `None` when there is nothing.
    pub(crate) fn read_now(&self, space: &mut [u8]) -> io::Result<Option<usize>> {
        match rustix::io::read(self.master.get_ref(), space) {
            Ok(0) | Err(rustix::io::Errno::WOULDBLOCK) => Ok(None),
            Ok(count) => Ok(Some(count)),
            Err(error) => Err(error.into()),
        }
    }
}

impl AsyncRead for Pty {
    fn poll_read(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        loop {
            let mut guard = ready!(self.master.poll_read_ready(context))?;
            let space = buffer.initialize_unfilled();
            match guard.try_io(|master| Ok(rustix::io::read(master.get_ref(), space)?)) {
                Ok(Ok(count)) => {
                    buffer.advance(count);
                    return Poll::Ready(Ok(()));
                }
                Ok(Err(error)) => return Poll::Ready(Err(error)),
                Err(_would_block) => {}
            }
        }
    }
}

impl AsyncWrite for Pty {
    fn poll_write(self: Pin<&mut Self>, context: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        loop {
            let mut guard = ready!(self.master.poll_write_ready(context))?;
            match guard.try_io(|master| Ok(rustix::io::write(master.get_ref(), bytes)?)) {
                Ok(written) => return Poll::Ready(written),
                Err(_would_block) => {}
            }
        }
    }

    fn poll_flush(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }

    fn poll_shutdown(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }
}
