//! A pseudo-terminal that stands for a USB virtual COM port, under a name that stays the same.
//!
//! The drive holds the master; a client opens the name, which is a symbolic link to the slave, as it would open
//! `/dev/ttyACM0`. Like a COM port it can be opened, closed and opened again.
//!
//! Whether a client is there the kernel alone knows for certain: while the slave is open nowhere, reading the master
//! fails with `EIO`, behind all that clients have sent. So nobody here holds the slave open. That a client comes is told
//! by inotify, so a port that nobody uses costs nothing; and that one has left, however soon another one comes.

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::inotify::{self, CreateFlags, ReadFlags, WatchFlags};
use rustix::fs::{Mode, OFlags};
use rustix::io::Errno;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, QueueSelector, tcflush, tcgetattr, tcsetattr};
use std::io;
use std::mem::MaybeUninit;
use std::os::fd::OwnedFd;
use std::os::unix::ffi::OsStringExt;
use std::os::unix::fs::{FileTypeExt, symlink};
use std::path::{Path, PathBuf};
use std::pin::Pin;
use std::task::{Context, Poll, ready};
use std::time::Duration;
use tokio::io::unix::AsyncFd;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::time::timeout;

/// So long after somebody has opened the slave that is told at the latest.
const LATE: Duration = Duration::from_millis(20);

/// The drive's end of the port. Reading gives its end when the last client has closed the port and all that was sent is
/// read; what is written while nobody is there is lost.
#[allow(clippy::struct_excessive_bools, reason = "each is a thing of its own to know")]
pub(crate) struct Pty {
    /// `None` only when registering it with tokio has failed.
    master: Option<AsyncFd<OwnedFd>>,
    /// Tells when the slave is opened and closed.
    changes: AsyncFd<OwnedFd>,
    /// How many have it open, as far as that was told.
    holders: u32,
    /// Somebody has opened it since that was last asked.
    came: bool,
    /// As far as that was told nobody has it open any more, since somebody came.
    empty: bool,
    /// Then somebody has opened it: another client than before.
    changed: bool,
    /// Nobody was there when the master was last registered: that it was hung up says nothing of the client since.
    vacant: bool,
    /// What was read too late to be sure that the client whose turn it is has sent it: it is the next one's.
    kept: Vec<u8>,
    slave: PathBuf,
    /// Something was written since it was last dropped.
    written: bool,
}

/// The name of the port, for as long as it is held.
pub(crate) struct PortName {
    link: PathBuf,
    slave: PathBuf,
}

/// Makes a port under a name. A link to a port or to nothing is replaced; anything else stays, and is an error.
pub(crate) fn open(link: &Path) -> io::Result<(Pty, PortName)> {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
    rustix::io::ioctl_fionbio(&master, true)?;
    grantpt(&master)?;
    unlockpt(&master)?;
    let slave = PathBuf::from(std::ffi::OsString::from_vec(ptsname(&master, Vec::new())?.into_bytes()));
    // Before the first client has closed it, the master does not know that nobody is there.
    drop(open_slave(&slave)?);
    let changes = inotify::init(CreateFlags::CLOEXEC | CreateFlags::NONBLOCK)?;
    inotify::add_watch(&changes, &slave, WatchFlags::OPEN | WatchFlags::CLOSE)?;
    let name = PortName::claim(link, slave.clone())?;
    let port = Pty {
        master: Some(watched(master)?),
        changes: watched(changes)?,
        holders: 0,
        came: false,
        empty: false,
        changed: false,
        vacant: false,
        kept: Vec::new(),
        slave,
        written: false,
    };
    port.pass_bytes_as_they_are()?;
    Ok((port, name))
}

fn open_slave(path: &Path) -> io::Result<OwnedFd> {
    Ok(rustix::fs::open(path, OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC, Mode::empty())?)
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
        if link.is_symlink() && std::fs::metadata(link).map_or(true, |to| to.file_type().is_char_device()) {
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

impl Pty {
    /// Waits until a client may have opened the port. It may have closed it again since.
    pub(crate) async fn opened(&mut self) -> io::Result<()> {
        self.look_around()?;
        while !self.came && self.kept.is_empty() {
            self.changes.readable().await?.clear_ready();
            self.look_around()?;
        }
        self.came = false;
        self.empty = false;
        self.changed = false;
        self.vacant = self.is_left()?;
        self.register_anew()
    }

    /// Takes notice of who has opened and closed the slave. The kernel tells two openings in a row as one, unless they are
    /// asked for in between.
    fn look_around(&mut self) -> io::Result<()> {
        let mut space = [MaybeUninit::uninit(); 1024];
        let mut events = inotify::Reader::new(self.changes.get_ref(), &mut space);
        loop {
            let event = match events.next() {
                Ok(event) => event.events(),
                Err(Errno::AGAIN) => return Ok(()),
                Err(error) => return Err(error.into()),
            };
            if event.contains(ReadFlags::OPEN) {
                self.holders = self.holders.saturating_add(1);
                self.came = true;
                self.changed |= self.empty;
            } else if event.intersects(ReadFlags::CLOSE_WRITE | ReadFlags::CLOSE_NOWRITE) {
                self.holders = self.holders.saturating_sub(1);
                self.empty |= self.holders == 0;
            }
        }
    }

    /// Whether the client whose turn it is has left and another one has come since.
    fn has_changed_hands(&mut self) -> io::Result<bool> {
        self.look_around()?;
        Ok(self.changed)
    }

    /// Makes the port as it was before its last client: drops what was not read, and takes back what the client did to
    /// the line discipline, as with echo on the drive would answer its own replies.
    pub(crate) async fn reset(&mut self) -> io::Result<()> {
        if std::mem::take(&mut self.written) {
            self.look_around()?;
            tcflush(open_slave(&self.slave)?, QueueSelector::IFlush)?;
            self.look_around()?;
        }
        self.count_anew().await?;
        self.pass_bytes_as_they_are()
    }

    /// Puts right how many have the slave open. What was done here is told as if a client had done it, and as one with what a
    /// client did in the same moment.
    async fn count_anew(&mut self) -> io::Result<()> {
        if self.is_left()? {
            self.holders = 0;
            return Ok(());
        }
        while self.holders == 0 && !self.is_left()? {
            // Somebody whose opening was told as one with ours, or is yet to be told; counted twice, it would never be seen to leave.
            match timeout(LATE, self.changes.readable()).await {
                Ok(guard) => guard?.clear_ready(),
                Err(_) => self.holders = 1,
            }
            self.look_around()?;
        }
        Ok(())
    }

    fn pass_bytes_as_they_are(&self) -> io::Result<()> {
        // On the master these are the settings of the slave.
        let settings = tcgetattr(self.master()?.get_ref())?;
        let mut raw = settings.clone();
        raw.make_raw();
        let modes = |of: &rustix::termios::Termios| (of.input_modes, of.output_modes, of.local_modes);
        if modes(&raw) != modes(&settings) {
            tcsetattr(self.master()?.get_ref(), OptionalActions::Now, &raw)?;
        }
        Ok(())
    }

    /// Whether the slave is open nowhere at present.
    fn is_left(&self) -> io::Result<bool> {
        let mut asked = [PollFd::new(self.master()?.get_ref(), PollFlags::empty())];
        poll(&mut asked, Some(&Timespec::default()))?;
        Ok(asked.iter().any(|about| about.revents().contains(PollFlags::HUP)))
    }

    fn master(&self) -> io::Result<&AsyncFd<OwnedFd>> {
        self.master.as_ref().ok_or_else(|| io::ErrorKind::NotConnected.into())
    }

    /// Registers the master with tokio once more, which never forgets that a descriptor was hung up.
    fn register_anew(&mut self) -> io::Result<()> {
        let descriptor = self.master.take().map(AsyncFd::into_inner);
        self.master = descriptor.map(watched).transpose()?;
        Ok(())
    }
}

impl AsyncRead for Pty {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        if !self.kept.is_empty() {
            let count = self.kept.len().min(buffer.remaining());
            buffer.put_slice(self.kept.get(..count).unwrap_or(&[]));
            self.kept.drain(..count);
            return Poll::Ready(Ok(()));
        }
        loop {
            if self.has_changed_hands()? {
                return Poll::Ready(Ok(()));
            }
            let mut guard = ready!(self.master()?.poll_read_ready(context))?;
            let hung_up = guard.ready().is_read_closed();
            match guard.try_io(|master| Ok(rustix::io::read(master.get_ref(), buffer.initialize_unfilled())?))
            {
                Ok(Ok(count)) => {
                    buffer.advance(count);
                    if self.has_changed_hands()? {
                        self.kept.extend_from_slice(buffer.filled());
                        buffer.clear();
                    }
                    return Poll::Ready(Ok(()));
                }
                Ok(Err(error)) if is_left(&error) => return Poll::Ready(Ok(())),
                Ok(Err(error)) => return Poll::Ready(Err(error)),
                Err(_would_block) if hung_up && self.vacant => {
                    self.vacant = false;
                    self.register_anew()?;
                }
                // One client has left, and another has come since.
                Err(_would_block) if hung_up => return Poll::Ready(Ok(())),
                Err(_would_block) => {}
            }
        }
    }
}

impl AsyncWrite for Pty {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        self.written = true;
        loop {
            let mut guard = ready!(self.master()?.poll_write_ready(context))?;
            let hung_up = guard.ready().is_write_closed();
            match guard.try_io(|master| Ok(rustix::io::write(master.get_ref(), bytes)?)) {
                Ok(Err(error)) if is_left(&error) => return Poll::Ready(Ok(bytes.len())),
                Ok(written) => return Poll::Ready(written),
                // Full of what the last client has not read, and nobody will.
                Err(_would_block) if hung_up && self.is_left()? => return Poll::Ready(Ok(bytes.len())),
                Err(_would_block) if hung_up => self.register_anew()?,
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

/// What the master says while the slave is open nowhere.
fn is_left(error: &io::Error) -> bool {
    Errno::from_io_error(error) == Some(Errno::IO)
}
