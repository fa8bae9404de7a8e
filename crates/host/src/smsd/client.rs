//! The client, and how a request is made until it has its reply.

use super::options::{SmsdOptions, WordOrder};
use super::session::{Lost, Session, Trouble};
use crate::Error;
use crate::connect::Connect;
use std::sync::OnceLock;
use stepdrive_spec::modbus::{Exception, Reply, Request};
use tokio::sync::{Mutex, MutexGuard};

/// A controller's host; see [the module](super).
///
/// Any number of tasks may use one: requests go one after another, and what takes several of them lets others' requests
/// in between, so that a stop never waits for a program to be stored.
#[derive(Debug)]
pub struct SmsdClient {
    pub(super) options: SmsdOptions,
    pub(super) session: Mutex<Session>,
    /// The word order, once it is known: it never changes.
    order: OnceLock<WordOrder>,
    /// Held from an operand to its command.
    pub(super) command: Mutex<()>,
    /// Held for what the registers and the buffer of `MEM_CMD` are needed for, and likewise the password.
    pub(super) memory: Mutex<()>,
}

/// How a request may be made.
#[derive(Clone, Copy, Debug)]
pub(super) struct Manner {
    /// It needs authorisation.
    pub(super) logged_in: bool,
    /// It does no harm when it is carried out twice.
    pub(super) repeat: bool,
}

impl Manner {
    /// A read, or a write that leaves the same behind however often it is carried out.
    pub(super) const REPEATED: Manner = Manner { logged_in: true, repeat: true };
    /// A read that is open to everybody.
    pub(super) const OPEN: Manner = Manner { logged_in: false, repeat: true };
    /// Something that acts.
    pub(super) const ONCE: Manner = Manner { logged_in: true, repeat: false };
}

impl SmsdClient {
    /// A client of the controller that `connect` reaches. Nothing is sent before something is asked.
    pub fn new(connect: impl Connect + 'static, options: SmsdOptions) -> SmsdClient {
        SmsdClient {
            options,
            session: Mutex::new(Session::new(Box::new(connect), &options)),
            order: OnceLock::new(),
            command: Mutex::new(()),
            memory: Mutex::new(()),
        }
    }

    /// What errors call the controller: where it is and its unit.
    pub async fn name(&self) -> String {
        self.session.lock().await.name()
    }

    /// How often it has connected. Another number than before: much may have happened to the controller meanwhile.
    pub async fn connections(&self) -> u64 {
        self.session.lock().await.wire.openings()
    }

    /// Connects and logs in, unless that is done already. Nothing moves by it.
    ///
    /// # Errors
    /// [`Error::Line`] and [`Error::NotAuthorised`]; [`Error::Usage`] when the word order cannot be found out from this
    /// password.
    pub async fn log_in(&self) -> Result<(), Error> {
        let mut tries = self.options.tries;
        loop {
            tries = tries.saturating_sub(1);
            match self.session.lock().await.prepare(true).await {
                Ok(()) => return Ok(()),
                Err(Trouble::NotSent(_) | Trouble::Unanswered(_)) if tries > 0 => {}
                Err(Trouble::NotSent(cause) | Trouble::Unanswered(Lost { cause, .. })) => {
                    return Err(cause.into());
                }
                Err(Trouble::Told(error)) => return Err(error),
                Err(Trouble::Exception(exception)) => return Err(Error::Device(exception.to_string())),
            }
        }
    }

    /// The word order, given or found; logs in where it is not known.
    ///
    /// # Errors
    /// Those of [`SmsdClient::log_in`].
    pub async fn word_order(&self) -> Result<WordOrder, Error> {
        match self.order.get() {
            Some(order) => Ok(*order),
            // In a box: the future of every read has room for all that it may do.
            None => Box::pin(self.find_word_order()).await,
        }
    }

    async fn find_word_order(&self) -> Result<WordOrder, Error> {
        loop {
            if let Some(order) = self.session.lock().await.login.order() {
                return Ok(*self.order.get_or_init(|| order));
            }
            // Whoever is logged in knows it.
            self.log_in().await?;
        }
    }

    /// Closes the connection. The next request opens another.
    pub async fn close(&self) {
        self.session.lock().await.wire.close();
    }

    /// Waits for its turn.
    async fn turn(&self) -> MutexGuard<'_, Session> {
        // Mostly nobody else is at it.
        match self.session.try_lock() {
            Ok(session) => session,
            Err(_) => self.session.lock().await,
        }
    }

    /// Makes a request until there is a reply, or no hope of one. Others may have their turn between two tries.
    pub(super) async fn ask(&self, request: &Request, manner: Manner) -> Result<Reply, Trouble> {
        let mut tries = self.options.tries;
        let mut admitted_again = false;
        let mut sent_on = None;
        loop {
            tries = tries.saturating_sub(1);
            let mut session = self.turn().await;
            let trouble = match attempt(&mut session, request, manner).await {
                Ok(reply) => return Ok(reply.clone()),
                Err(trouble) => trouble,
            };
            let again = match &trouble {
                Trouble::NotSent(_) => tries > 0,
                Trouble::Unanswered(lost) => {
                    sent_on = Some(lost.connection);
                    tries > 0 && manner.repeat
                }
                // Nothing has changed there, so this may be repeated whatever it is.
                Trouble::Exception(Exception::IllegalDataAddress) if manner.logged_in && !admitted_again => {
                    admitted_again = true;
                    matches!(Box::pin(session.has_access()).await, Ok(false))
                }
                Trouble::Exception(_) | Trouble::Told(_) => false,
            };
            if !again {
                return Err(after_all(trouble, sent_on));
            }
        }
    }
}

/// The last trouble with a request, which may have arrived at an earlier try on this connection.
fn after_all(trouble: Trouble, sent_on: Option<u64>) -> Trouble {
    match (trouble, sent_on) {
        (Trouble::NotSent(cause), Some(connection)) => Trouble::Unanswered(Lost { cause, connection }),
        (trouble, _) => trouble,
    }
}

async fn attempt<'a>(
    session: &'a mut Session,
    request: &Request,
    manner: Manner,
) -> Result<&'a Reply, Trouble> {
    session.prepare(manner.logged_in).await?;
    session.exchange(request).await
}
