//! The client, and how a request is made until it has its reply.

use super::primitives::model_in;
use super::session::{Session, Trouble};
use super::table;
use crate::Error;
use crate::connect::Connect;
use crate::smsd::client::Manner;
use crate::smsd::options::SmsdOptions;
use crate::smsd::session::Lost;
use std::collections::BTreeMap;
use std::sync::{Mutex as StdMutex, MutexGuard as StdMutexGuard, OnceLock, PoisonError};
use stepdrive_proto::smsd::Framing;
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::standard::{Code, Reply, Request, Versions};
use tokio::sync::{Mutex, MutexGuard};

/// A controller's host over the standard binary protocol: at its USB port, or over TCP if it has the standard firmware.
///
/// It offers what [`Smsd`](crate::smsd::Smsd) says, under the names and in the units of the register map, although this
/// protocol has no registers. What the protocol cannot do is [`Error::Usage`] with a sentence that says so, and nothing is
/// sent.
///
/// Any number of tasks may use one: requests go one after another, and what takes several of them lets others' requests
/// in between.
///
/// # What is different from Modbus
///
/// * A [`Snapshot`](crate::smsd::Snapshot) takes four requests, so its parts are read one after another. Status and position
///   are of one moment: they come in one reply, the first.
/// * `SPEED` is what the controller answers. The maker says that it is wrong at low speed and at standstill unless
///   `MIN_SPEED` is 0 (sheet §7).
/// * Whether a program runs is not told, and `ACC`, `DEC` and `FS_SPEED` can be set but not read.
/// * `TARGET_SPEED`, `TARGET_POS` and `TARGET_INPUT` are kept here, and go out with the next command written to `CMD`.
/// * LAN parameters are in effect at once, also when one is written by itself.
/// * A setting that the motor does not take sets `CMD_ERROR`.
/// * The controller looks at one login a second: a connection that follows another within that time has to wait.
///
/// # What is repeated and what is not
///
/// What reads is repeated when its reply is lost, and so is what leaves the same behind however often it is carried out:
/// settings, the relay, programs. What else acts never is. A controller that answers that a packet arrived damaged has not
/// carried it out; then anything may be sent again, unless that answer may belong to a packet before.
///
/// ```no_run
/// use stepdrive_host::Serial;
/// use stepdrive_host::smsd::{Framing, Smsd, SmsdOptions, SmsdUsbClient, Way};
///
/// # async fn example() -> Result<(), stepdrive_host::Error> {
/// let stage = SmsdUsbClient::new(Serial::new("/dev/ttyACM0"), Framing::Stuffed, SmsdOptions::default());
/// stage.move_to(3200, Way::Shortest).await?;
/// println!("{}", stage.snapshot().await?);
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct SmsdUsbClient {
    tries: u32,
    pub(super) session: Mutex<Session>,
    /// What was written last to registers that cannot be read.
    written: StdMutex<BTreeMap<Reg, i64>>,
    /// The versions, once they were answered, or that the controller does not tell them: that never changes.
    pub(super) versions: OnceLock<Option<Versions>>,
    /// Held while it is found out whether a command was carried out.
    pub(super) command: Mutex<()>,
    /// Held while something is read, changed and written as a whole, and while a password changes.
    pub(super) whole: Mutex<()>,
}

impl SmsdUsbClient {
    /// A client of the controller that `connect` reaches: with [`Framing::Stuffed`] at its USB port, with [`Framing::Raw`]
    /// over TCP, if it has the standard firmware. Nothing is sent before something is asked. Of the options, `unit`,
    /// `word_order` and `memory_timeout` mean nothing to this protocol.
    pub fn new(connect: impl Connect + 'static, framing: Framing, options: SmsdOptions) -> SmsdUsbClient {
        SmsdUsbClient {
            tries: options.tries,
            session: Mutex::new(Session::new(Box::new(connect), framing, &options)),
            written: StdMutex::default(),
            versions: OnceLock::new(),
            command: Mutex::new(()),
            whole: Mutex::new(()),
        }
    }

    /// What errors call the controller.
    pub(super) async fn called(&self) -> String {
        self.session.lock().await.name()
    }

    /// Connects and logs in, unless that is done already.
    pub(super) async fn enter(&self) -> Result<(), Error> {
        let mut tries = self.tries;
        loop {
            tries = tries.saturating_sub(1);
            match self.session.lock().await.prepare(true).await {
                Ok(()) => return Ok(()),
                Err(Trouble::NotSent(_)) if tries > 0 => {}
                Err(trouble) => return Err(not_entered(trouble)),
            }
        }
    }

    /// Makes a request until there is a reply, or no hope of one. Others may have their turn between two tries.
    pub(super) async fn ask(&self, request: &Request, manner: Manner) -> Result<Reply, Trouble> {
        let mut tries = self.tries;
        let mut admitted_again = false;
        let mut sent_on = None;
        loop {
            tries = tries.saturating_sub(1);
            let mut session = self.turn().await;
            let trouble = match attempt(&mut session, request, manner).await {
                Ok(reply) => return Ok(reply),
                Err(trouble) => trouble,
            };
            let again = match &trouble {
                Trouble::NotSent(_) | Trouble::Damaged(_) => tries > 0,
                Trouble::Unanswered(lost) => {
                    sent_on = Some(lost.connection);
                    tries > 0 && manner.repeat
                }
                // Whoever is not logged in has changed nothing, so this may be repeated whatever it is.
                Trouble::Refused(answer) if answer.code == Code::ErrorAccess && manner.logged_in => {
                    session.login.inside = false;
                    !std::mem::replace(&mut admitted_again, true)
                }
                Trouble::Refused(_) | Trouble::Told(_) => false,
            };
            if !again {
                return Err(after_all(trouble, sent_on));
            }
        }
    }

    /// Waits for its turn.
    async fn turn(&self) -> MutexGuard<'_, Session> {
        // Mostly nobody else is at it.
        match self.session.try_lock() {
            Ok(session) => session,
            Err(_) => self.session.lock().await,
        }
    }

    /// What has to be said of a state that was read after a reply was lost: a controller answers in order on each
    /// connection, but not across two.
    pub(super) async fn but(&self, connection: u64) -> &'static str {
        if self.session.lock().await.wire.openings() == connection {
            ""
        } else {
            "; this was read on another connection, so what was sent may still arrive"
        }
    }

    // ---- what is remembered here

    /// Remembers what was written to a register, if it cannot be read.
    pub(super) fn remember(&self, reg: Reg, value: i64) {
        if table::source(reg).is_err() {
            self.remembered().insert(reg, value);
        }
    }

    /// What was written to a register that cannot be read, or else what it holds at power-up.
    pub(super) fn last_written(&self, reg: Reg) -> i64 {
        self.remembered().get(&reg).copied().unwrap_or(reg.info().default)
    }

    /// The motor chip is reset: its settings are those of power-up.
    pub(super) fn forget_settings(&self) {
        self.remembered().retain(|reg, _| table::is_operand(*reg));
    }

    fn remembered(&self) -> StdMutexGuard<'_, BTreeMap<Reg, i64>> {
        // It is whole whenever it can be seen.
        self.written.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The model, if it is known already.
    pub(super) fn known_model(&self) -> Option<Model> {
        self.versions.get().copied().flatten().and_then(model_in)
    }
}

/// The last trouble with a request, which may have arrived at an earlier try on this connection.
fn after_all(trouble: Trouble, sent_on: Option<u64>) -> Trouble {
    match (trouble, sent_on) {
        (Trouble::NotSent(cause) | Trouble::Damaged(cause), Some(connection)) => {
            Trouble::Unanswered(Lost { cause, connection })
        }
        (trouble, _) => trouble,
    }
}

async fn attempt(session: &mut Session, request: &Request, manner: Manner) -> Result<Reply, Trouble> {
    session.prepare(manner.logged_in).await?;
    session.exchange(request).await
}

/// Why nobody could log in.
fn not_entered(trouble: Trouble) -> Error {
    match trouble {
        Trouble::NotSent(cause) | Trouble::Damaged(cause) | Trouble::Unanswered(Lost { cause, .. }) => {
            Error::Line(cause)
        }
        Trouble::Refused(answer) => Error::Device(answer.code.to_string()),
        Trouble::Told(error) => error,
    }
}
