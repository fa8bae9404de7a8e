//! Authorisation by Modbus (ch. 3, decisions 4 and 5) and by the standard protocol.

use super::Smsd;
use super::memory::{Record, factory_password};
use stepdrive_spec::smsd::standard::{AUTHORISATION_REST, Code};
use stepdrive_spec::smsd::timing::AUTHORISATION_LOCKOUT;
use stepdrive_spec::time::Instant;

/// What the controller knows of one connection: whether it is authorised, and the password it has entered so far.
///
/// The entered password belongs to the connection so that two clients that log in at once do not mix theirs.
#[derive(Clone, Copy, Debug, Default)]
pub struct Session {
    authorised: bool,
    entered: u64,
}

impl Session {
    /// An authorised one.
    pub(super) const AUTHORISED: Session = Session { authorised: true, entered: 0 };

    /// A new connection, not authorised.
    pub const fn new() -> Session {
        Session { authorised: false, entered: 0 }
    }

    /// `Access` (0x2200).
    pub const fn is_authorised(&self) -> bool {
        self.authorised
    }

    /// Enters 16 bits of the password at `shift`.
    pub(super) fn enter(&mut self, shift: u32, word: u16) {
        self.entered = self.entered & !(0xFFFF << shift) | u64::from(word) << shift;
    }
}

/// What the controller knows of one line on which the standard protocol is spoken: whether somebody has logged in there,
/// and whether `STOP_USB` has silenced it. Power-off of the controller ends both; that shows with the next request.
#[derive(Clone, Copy, Debug)]
pub struct StandardSession {
    usb: bool,
    /// The power-up in which somebody logged in.
    login: Option<u64>,
    stopped: bool,
}

impl StandardSession {
    /// A USB port that has just been opened.
    pub const fn usb() -> StandardSession {
        StandardSession::new(true)
    }

    /// A new connection over LAN, to the standard firmware.
    pub const fn lan() -> StandardSession {
        StandardSession::new(false)
    }

    const fn new(usb: bool) -> StandardSession {
        StandardSession { usb, login: None, stopped: false }
    }

    /// Whether somebody has logged in.
    pub const fn is_authorised(&self) -> bool {
        self.login.is_some()
    }

    /// Whether `STOP_USB` has silenced it: nothing is answered any more.
    pub const fn is_stopped(&self) -> bool {
        self.stopped
    }

    /// `STOP_USB`. ASSUMED: it silences the USB port until that is opened anew, and over LAN it changes nothing.
    pub(super) fn stop(&mut self) {
        self.stopped = self.usb;
    }
}

/// When the controller was last asked for access.
#[derive(Clone, Copy, Debug)]
pub(super) struct Logins {
    /// The number of this power-up, from 1.
    power_up: u64,
    /// When the supply came, or the standard protocol last looked at an attempt.
    looked: Instant,
    /// The last attempt, by either protocol, if it failed.
    failed: Option<Instant>,
}

impl Logins {
    pub(super) fn power_up(now: Instant) -> Logins {
        Logins { power_up: 0, looked: now, failed: None }
    }

    /// The supply came at `now`.
    pub(super) fn start_over(&mut self, now: Instant) {
        *self = Logins { power_up: self.power_up.saturating_add(1), ..Logins::power_up(now) };
    }

    fn locked_out(&self, now: Instant) -> bool {
        self.failed.is_some_and(|failed| now.since(failed) < AUTHORISATION_LOCKOUT)
    }
}

impl Smsd {
    /// `Password_CMD` 0: compares the entered password. An attempt within the lock-out after the last failed one, from
    /// whatever connection, is not evaluated and changes nothing.
    pub(super) fn authorise(&mut self, now: Instant, session: &mut Session) {
        if self.logins.locked_out(now) {
            return;
        }
        session.authorised = session.entered == self.memory.password;
        self.logins.failed = (!session.authorised).then_some(now);
    }

    /// `Password_CMD` 1: the entered password is the password from now on. Connections stay authorised.
    pub(super) fn change_password(&mut self, session: &Session) {
        self.set_password(session.entered);
    }

    /// Stores the password. Whoever has access keeps it.
    pub(super) fn set_password(&mut self, password: u64) {
        self.memory.password = password;
        self.unsaved.mark(Record::Password);
    }

    /// `REQUEST`: asks for access by the standard protocol. An attempt too early is not looked at and changes nothing.
    pub(super) fn log_in(&mut self, now: Instant, session: &mut StandardSession, password: u64) -> Code {
        if now.since(self.logins.looked) < AUTHORISATION_REST || self.logins.locked_out(now) {
            return Code::ErrorAccessTimeout;
        }
        let accepted = self.accepts(password);
        session.login = accepted.then_some(self.logins.power_up);
        self.logins.looked = now;
        self.logins.failed = (!accepted).then_some(now);
        if accepted { Code::OkAccess } else { Code::ErrorAccess }
    }

    /// Whether the standard protocol takes this for the password. ASSUMED: as long as it is the factory's it does so with
    /// the bytes in ascending order too, as the maker prints them.
    fn accepts(&self, password: u64) -> bool {
        let stored = self.memory.password;
        let ascending = stored == factory_password() && password == stored.swap_bytes();
        password == stored || ascending
    }

    /// Begins a session anew in which somebody logged in before the last power-off.
    pub(super) fn refresh(&self, session: &mut StandardSession) {
        if session.login.is_some_and(|power_up| power_up != self.logins.power_up) {
            *session = StandardSession::new(session.usb);
        }
    }
}
