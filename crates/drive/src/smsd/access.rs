//! Authorisation (ch. 3, decisions 4 and 5).

use super::Smsd;
use super::memory::Record;
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

impl Smsd {
    /// `Password_CMD` 0: compares the entered password. An attempt within the lock-out after the last failed one, from
    /// whatever connection, is not evaluated and changes nothing.
    pub(super) fn authorise(&mut self, now: Instant, session: &mut Session) {
        let locked = |failed: Instant| now.since(failed) < AUTHORISATION_LOCKOUT;
        if self.last_failed_login.is_some_and(locked) {
            return;
        }
        session.authorised = session.entered == self.memory.password;
        self.last_failed_login = (!session.authorised).then_some(now);
    }

    /// `Password_CMD` 1: the entered password is the password from now on. Connections stay authorised.
    pub(super) fn change_password(&mut self, session: &Session) {
        self.memory.password = session.entered;
        self.unsaved.mark(Record::Password);
    }
}
