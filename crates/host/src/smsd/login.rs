//! Authorisation (ch. 3, decisions 4 and 5), and the word order, which it shows.
//!
//! A password that is refused locks everybody out for a second, and within that second even the right one is refused. So
//! an attempt is repeated once, behind the lock-out, before it is believed; and when the password is wrong the client
//! does not try again for a while, so that others can get in.

use super::options::{SmsdOptions, WordOrder, halves};
use super::passwords::Passwords;
use super::session::{Session, Trouble};
use crate::Error;
use std::time::Duration;
use stepdrive_spec::modbus::{Exception, Reply, Request, Words};
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::timing::AUTHORISATION_LOCKOUT;
use tokio::time::{Instant, sleep_until};

/// The lock-out, and what the way there and back may differ by.
const LOCKOUT: Duration = AUTHORISATION_LOCKOUT.saturating_add(Duration::from_millis(50));
/// Value of `Password_CMD`: authorise.
const AUTHORISE: u16 = 0;

/// How a connection stands with its controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Standing {
    /// It has not been tried.
    Outside,
    /// This has been tried; `Access` says with what outcome.
    Asked(Attempt),
    /// It is authorised.
    Inside,
}

/// A password in a word order.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) struct Attempt {
    password: u64,
    order: WordOrder,
}

impl std::fmt::Debug for Attempt {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Attempt").field("order", &self.order).finish_non_exhaustive()
    }
}

/// What is needed to log in, and what has been learnt by it.
pub(super) struct Login {
    pub(super) standing: Standing,
    pub(super) passwords: Passwords,
    /// Given, or found.
    order: Option<WordOrder>,
    /// The password and the word order have been accepted once.
    accepted: bool,
    /// No attempt before.
    not_before: Option<Instant>,
}

impl std::fmt::Debug for Login {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Login")
            .field("standing", &self.standing)
            .field("order", &self.order)
            .field("accepted", &self.accepted)
            .finish_non_exhaustive()
    }
}

impl Login {
    pub(super) fn new(options: &SmsdOptions) -> Login {
        Login {
            standing: Standing::Outside,
            passwords: Passwords::new(options.password),
            order: options.word_order,
            accepted: false,
            not_before: None,
        }
    }

    /// The word order, once it is known.
    pub(super) fn order(&self) -> Option<WordOrder> {
        self.order
    }

    /// What to try, in turn. The word order is part of the question until it is known. All is tried at least twice, since
    /// an attempt within somebody else's lock-out is refused whatever it is.
    fn attempts(&self) -> Vec<Attempt> {
        let first = self.order.unwrap_or(WordOrder::LowFirst);
        let orders = if self.order.is_some() { vec![first] } else { vec![first, first.other()] };
        let round = || {
            let passwords = self.passwords.in_turn().into_iter();
            passwords.flat_map(|password| orders.iter().map(move |order| Attempt { password, order: *order }))
        };
        round().chain(round()).collect()
    }

    fn is_same_in_either_order(&self) -> bool {
        halves(self.passwords.current()).into_iter().all(|half| half.rotate_left(16) == half)
    }

    fn admit(&mut self, attempt: Attempt) {
        self.standing = Standing::Inside;
        self.order = Some(attempt.order);
        self.passwords.has_changed_to(attempt.password);
        self.accepted = true;
        self.not_before = None;
    }

    /// An attempt was refused, or may have been.
    fn lock_out(&mut self) {
        self.standing = Standing::Outside;
        self.not_before = Some(Instant::now() + LOCKOUT);
    }
}

impl Session {
    /// Logs in. The connection is open. What was asked for besides has not been sent when this fails.
    pub(super) async fn log_in(&mut self) -> Result<(), Trouble> {
        match self.try_to_log_in().await {
            Ok(true) => Ok(()),
            Ok(false) => {
                self.login.passwords.refuse();
                Err(Trouble::Told(self.refused()))
            }
            Err(Trouble::Unanswered(lost)) => Err(Trouble::NotSent(lost.cause)),
            Err(Trouble::Exception(exception)) => Err(Trouble::Told(self.not_entered(exception))),
            Err(trouble) => Err(trouble),
        }
    }

    async fn try_to_log_in(&mut self) -> Result<bool, Trouble> {
        if self.login.passwords.are_refused() {
            return Ok(false);
        }
        if self.login.order.is_none() && self.login.is_same_in_either_order() {
            let text = "the word order cannot be found out from a password that is the same in both; give it, as in word_order=low-first";
            return Err(Trouble::Told(Error::Usage(text.to_owned())));
        }
        if let Standing::Asked(attempt) = self.login.standing
            && self.has_been_admitted(attempt).await?
        {
            return Ok(true);
        }
        for attempt in self.login.attempts() {
            if let Some(at) = self.login.not_before {
                sleep_until(at).await;
            }
            if self.attempt(attempt).await? {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Tries a password as ch. 3 says.
    async fn attempt(&mut self, attempt: Attempt) -> Result<bool, Trouble> {
        self.exchange(&enter(attempt.password, attempt.order)).await?;
        self.login.standing = Standing::Asked(attempt);
        if !self.login.accepted {
            // Should the answer get lost, this may have been an attempt that failed.
            self.login.not_before = Some(Instant::now() + LOCKOUT);
        }
        let address = Reg::PasswordCmd.info().address;
        self.exchange(&Request::WriteRegister { address, value: AUTHORISE }).await?;
        self.has_been_admitted(attempt).await
    }

    /// Finds out what became of an attempt.
    async fn has_been_admitted(&mut self, attempt: Attempt) -> Result<bool, Trouble> {
        let inside = self.has_access().await?;
        if inside {
            self.login.admit(attempt);
        } else {
            self.login.lock_out();
        }
        Ok(inside)
    }

    /// Reads `Access`. A connection that is found to be without it logs in again before its next request.
    pub(super) async fn has_access(&mut self) -> Result<bool, Trouble> {
        let row = Reg::AccessFlag.info();
        let request = Request::ReadBits { table: row.table, address: row.address, count: 1 };
        let access = matches!(self.exchange(&request).await?, Reply::Bits(bits) if bits.get(0) == Some(true));
        if !access && self.login.standing == Standing::Inside {
            self.login.standing = Standing::Outside;
        }
        Ok(access)
    }

    fn not_entered(&self, exception: Exception) -> Error {
        let name = self.name();
        if exception == Exception::ServerDeviceBusy {
            return Error::Refused(format!(
                "{name} does not let a password be entered now ({exception}); try again"
            ));
        }
        Error::Device(format!(
            "{name} does not let a password be entered ({exception}); is it an SMSD-4.2LAN or SMSD-8.0LAN?"
        ))
    }

    fn refused(&self) -> Error {
        let order = match self.login.order {
            Some(order) => format!("with word order {order}"),
            None => "in either word order".to_owned(),
        };
        Error::NotAuthorised(format!(
            "{} does not accept the password, {order}; nothing else was sent",
            self.name()
        ))
    }
}

/// The request that enters a password.
pub(super) fn enter(password: u64, order: WordOrder) -> Request {
    let words: Words = halves(password).into_iter().flat_map(|half| order.split(half)).collect();
    Request::WriteRegisters { address: Reg::PasswordLow32.info().address, values: words }
}
