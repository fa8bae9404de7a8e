//! Authorisation (sheet §5, decision 25).
//!
//! The controller looks at one attempt a second and says of any other that it came too early; then it is tried again. So a
//! password that is refused is the wrong one, and the client does not try it again for a while.

use super::session::{Session, Trouble};
use crate::Error;
use crate::smsd::passwords::Passwords;
use std::fmt;
use std::time::Duration;
use stepdrive_spec::smsd::standard::{AUTHORISATION_REST, Code, Reply, Request};
use tokio::time::{Instant, sleep, sleep_until};

/// The time between two attempts, and what the way there and back may differ by.
const REST: Duration = AUTHORISATION_REST.saturating_add(Duration::from_millis(50));
/// How long is waited after each attempt that came too early: in parts of that time first, and then, should an attempt that
/// comes too early start it anew, all of it.
const RESTS: [Duration; 6] =
    [Duration::from_millis(350), Duration::from_millis(350), Duration::from_millis(350), REST, REST, REST];

/// What is needed to log in.
pub(super) struct Login {
    /// The connection is logged in.
    pub(super) inside: bool,
    pub(super) passwords: Passwords,
    /// No attempt before.
    not_before: Option<Instant>,
}

impl fmt::Debug for Login {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Login").field("inside", &self.inside).finish_non_exhaustive()
    }
}

impl Login {
    pub(super) fn new(password: u64) -> Login {
        Login { inside: false, passwords: Passwords::new(password), not_before: None }
    }
}

impl Session {
    /// Logs in. The connection is open. What was asked for besides has not been sent when this fails.
    pub(super) async fn log_in(&mut self) -> Result<(), Trouble> {
        match self.try_to_log_in().await {
            Ok(true) => Ok(()),
            Ok(false) => {
                self.login.passwords.refuse();
                Err(Trouble::Told(Error::NotAuthorised(format!(
                    "{} does not accept the password; nothing else was sent",
                    self.name()
                ))))
            }
            Err(Trouble::Unanswered(lost)) => Err(Trouble::NotSent(lost.cause)),
            Err(Trouble::Damaged(cause)) => Err(Trouble::NotSent(cause)),
            Err(Trouble::Refused(answer)) => Err(Trouble::Told(self.not_let_in(answer.code))),
            Err(trouble) => Err(trouble),
        }
    }

    async fn try_to_log_in(&mut self) -> Result<bool, Trouble> {
        if self.login.passwords.are_refused() {
            return Ok(false);
        }
        for password in self.login.passwords.in_turn() {
            if let Some(at) = self.login.not_before {
                sleep_until(at).await;
            }
            if self.attempt(password).await? {
                self.login.inside = true;
                self.login.passwords.has_changed_to(password);
                self.login.not_before = None;
                return Ok(true);
            }
            self.login.not_before = Some(Instant::now() + REST);
        }
        Ok(false)
    }

    /// Tries a password until it is looked at.
    async fn attempt(&mut self, password: u64) -> Result<bool, Trouble> {
        let mut rests = RESTS.into_iter();
        loop {
            let answer = match self.exchange(&Request::Authorise(password)).await {
                Ok(Reply::Response(answer) | Reply::Powerstep01(answer)) | Err(Trouble::Refused(answer)) => {
                    answer
                }
                Ok(_) => return Ok(false),
                Err(trouble) => return Err(trouble),
            };
            match (answer.code, rests.next()) {
                (Code::OkAccess, _) => return Ok(true),
                (Code::ErrorAccess, _) => return Ok(false),
                (Code::ErrorAccessTimeout, Some(rest)) => sleep(rest).await,
                _ => return Err(Trouble::Refused(answer)),
            }
        }
    }

    fn not_let_in(&self, code: Code) -> Error {
        let name = self.name();
        if code == Code::ErrorAccessTimeout {
            let waited: Duration = RESTS.iter().sum();
            return Error::NotAuthorised(format!(
                "{name} has not looked at the password within {waited:?} ({code}): somebody else logs in all the time, or \
                 its clock is slow; try again"
            ));
        }
        Error::Device(format!(
            "{name} answered the password with {code}; is it an SMSD-4.2LAN or SMSD-8.0LAN?"
        ))
    }
}
