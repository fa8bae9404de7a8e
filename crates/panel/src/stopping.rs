//! Stops, of one axis and of all at once. A stop that does not get through is told again until it does.
//!
//! An axis that is told to stop has one task that tells it, however often that is asked for: the task outlives the requests,
//! which wait for it for a second and then say why the axis does not know yet.

use crate::api::{Nothing, ThePanel, find};
use crate::member::Member;
use crate::notices::Level;
use crate::{Controller, Shared, jog};
use axum::extract::State;
use axum::http::StatusCode;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::time::Duration;
use stepdrive_host::Error;
use stepdrive_host::axis::Stop;
use stepdrive_web::{Asked, Named, Problem, Reply};
use tokio::sync::watch;
use tokio::time::{Instant, timeout, timeout_at};

/// How long a request waits for its stop to be told.
pub(crate) const PATIENCE: Duration = Duration::from_secs(1);
/// How long after a stop that did not get through it is told again.
const AGAIN: Duration = Duration::from_millis(250);
/// The same where we are not let in: each attempt with a wrong password locks a controller for others for a second.
const NOT_LET_IN: Duration = Duration::from_secs(10);
/// How old a reading may be that shows a motor without current.
const FRESH: Duration = Duration::from_secs(1);

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct HowToStop {
    #[serde(default)]
    how: How,
}

#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
enum How {
    #[default]
    Soft,
    Hard,
    Free,
}

impl From<How> for Stop {
    fn from(how: How) -> Stop {
        match how {
            How::Soft => Stop::Soft,
            How::Hard => Stop::Hard,
            How::Free => Stop::Free,
        }
    }
}

/// What has become of a stop of all.
#[derive(Debug, Serialize)]
pub(crate) struct Stopped {
    /// How many were told.
    stopped: usize,
    not_yet: Vec<NotYet>,
}

/// An axis that does not know yet that it is to stop.
#[derive(Debug, Serialize)]
pub(crate) struct NotYet {
    axis: String,
    error: String,
}

// ---- requests

pub(crate) async fn stop(
    State(panel): ThePanel,
    Named(name): Named<String>,
    Asked(HowToStop { how }): Asked<HowToStop>,
) -> Result<Reply<Nothing>, Problem> {
    let member = find(&panel, &name)?;
    let told = begin(&panel, &member, how.into()).by(Instant::now() + PATIENCE).await;
    told.map(|()| Reply(Nothing {})).map_err(|why| not_yet(&panel, &member, why))
}

pub(crate) async fn stop_all(
    State(panel): ThePanel,
    Asked(HowToStop { how }): Asked<HowToStop>,
) -> Reply<Stopped> {
    let latest = Instant::now() + PATIENCE;
    // All are told before any is waited for.
    let telling: Vec<Telling> =
        panel.members.iter().map(|member| begin(&panel, member, how.into())).collect();
    let mut stopped = Stopped { stopped: 0, not_yet: Vec::new() };
    for (member, telling) in panel.members.iter().zip(telling) {
        match telling.by(latest).await {
            Ok(()) => stopped.stopped += 1,
            Err(why) => stopped.not_yet.push(NotYet {
                axis: member.name().to_owned(),
                error: not_yet(&panel, member, why).error().to_owned(),
            }),
        }
    }
    Reply(stopped)
}

/// Has an axis told to stop, for which its jog is given up.
fn begin(panel: &Shared, member: &Arc<Member>, how: Stop) -> Telling {
    jog::give_up(member);
    tell(member, if how == Stop::Soft && is_at_rest(panel, member) { Stop::Free } else { how })
}

/// Whether it is an SMSD that was just seen standing without current. A soft stop would energise it.
fn is_at_rest(panel: &Shared, member: &Member) -> bool {
    matches!(member.controller(), Controller::Smsd(_))
        && panel
            .hub
            .seen_at_rest(member)
            .is_some_and(|at| at.elapsed() <= FRESH && member.has_not_departed_since(at))
}

/// Says that an axis could not be told to stop so far.
pub(crate) fn not_yet(panel: &Shared, member: &Member, why: Option<Error>) -> Problem {
    let name = member.name();
    let why = why.map(|error| error.to_string()).or_else(|| panel.hub.why_lost(member));
    let why = why.unwrap_or_else(|| format!("it did not answer within {PATIENCE:?}"));
    Problem::new(StatusCode::BAD_GATEWAY, told_again(name, &why))
}

fn told_again(name: &str, why: &str) -> String {
    format!("{name} could not be told to stop yet: {why}; it is told again until it can be")
}

// ---- telling

/// An axis that is being told to stop.
pub(crate) struct Stopping {
    asked: watch::Sender<Ask>,
    told: watch::Receiver<Told>,
}

/// What is asked for.
#[derive(Clone, Copy, Debug)]
struct Ask {
    how: Stop,
    /// How often a stop was asked for.
    times: u64,
    /// The axis was reached otherwise.
    is_over: bool,
}

/// How far it has come.
#[derive(Clone, Debug, Default)]
struct Told {
    /// The last that got through.
    times: u64,
    /// Why the last attempt failed.
    why: Option<Error>,
}

/// One who has asked for a stop.
pub(crate) struct Telling {
    times: u64,
    told: watch::Receiver<Told>,
}

impl Telling {
    /// Waits until the axis was told. Fails with the reason, where there is one so far, when that takes too long.
    pub(crate) async fn by(mut self, latest: Instant) -> Result<(), Option<Error>> {
        if timeout_at(latest, self.come_through()).await.is_ok() {
            return Ok(());
        }
        Err(self.told.borrow().why.clone())
    }

    /// Waits until the axis was told, however long that takes.
    pub(crate) async fn at_last(mut self) {
        self.come_through().await;
    }

    async fn come_through(&mut self) {
        let times = self.times;
        // The task ends without it where the axis was reached otherwise.
        let _ = self.told.wait_for(|told| told.times >= times).await;
    }
}

/// Has an axis told to stop until it was, or until a motion is begun on it from here, which shows that it was reached. A
/// stop of another kind takes the place of one that has not got through.
pub(crate) fn tell(member: &Arc<Member>, how: Stop) -> Telling {
    member.note_stop();
    let mut doing = member.doing();
    if let Some(stopping) = doing.stopping.as_ref().filter(|stopping| !stopping.asked.is_closed()) {
        let times = stopping.asked.borrow().times + 1;
        stopping.asked.send_replace(Ask { how, times, is_over: false });
        return Telling { times, told: stopping.told.clone() };
    }
    let (asked, to_be_told) = watch::channel(Ask { how, times: 1, is_over: false });
    let (tell, told) = watch::channel(Told::default());
    doing.stopping = Some(Stopping { asked, told: told.clone() });
    tokio::spawn(go(Arc::clone(member), to_be_told, tell));
    Telling { times: 1, told }
}

impl Stopping {
    /// It was reached otherwise: there is nothing more to tell.
    pub(crate) fn end(&self) {
        self.asked.send_modify(|ask| ask.is_over = true);
    }
}

/// Waits until an axis that is being told to stop was told.
pub(crate) async fn finished(member: &Member) {
    let telling = member
        .doing()
        .stopping
        .as_ref()
        .map(|stopping| Telling { times: stopping.asked.borrow().times, told: stopping.told.clone() });
    if let Some(telling) = telling {
        telling.at_last().await;
    }
}

/// Tells an axis to stop until it was told.
async fn go(member: Arc<Member>, mut asked: watch::Receiver<Ask>, tell: watch::Sender<Told>) {
    let (mut done, mut is_known) = (0, false);
    loop {
        let ask = *asked.borrow_and_update();
        if has_left(&member, done) {
            return;
        }
        let mut otherwise = asked.clone();
        let outcome = tokio::select! {
            biased;
            _ = otherwise.wait_for(|next| next.is_over || next.how != ask.how) => continue,
            outcome = attempt(&member, ask, &tell) => outcome,
        };
        let Err(error) = outcome else {
            done = ask.times;
            continue;
        };
        let rest = if matches!(error, Error::NotAuthorised(_)) { NOT_LET_IN } else { AGAIN };
        if !std::mem::replace(&mut is_known, true) {
            member.tell(Level::Error, told_again(member.name(), &error.to_string()));
        }
        tell.send_modify(|told| told.why = Some(error));
        // Whoever asks meanwhile does not wait for that.
        let _ = timeout(rest, asked.changed()).await;
    }
}

/// Leaves an axis of which all is done that was asked for.
fn has_left(member: &Member, done: u64) -> bool {
    let mut doing = member.doing();
    let is_done = |stopping: &Stopping| {
        let ask = stopping.asked.borrow();
        ask.is_over || ask.times <= done
    };
    let has = doing.stopping.as_ref().is_none_or(is_done);
    if has {
        doing.stopping = None;
    }
    has
}

/// Tells it once.
async fn attempt(member: &Member, ask: Ask, tell: &watch::Sender<Told>) -> Result<(), Error> {
    let through = || tell.send_modify(|told| told.times = ask.times);
    if ask.how == Stop::Free && matches!(member.controller(), Controller::Smd3(_)) {
        // It is disabled once it stands. Whoever asks does not wait for that.
        member.stop(Stop::Soft).await?;
        through();
    }
    member.stop(ask.how).await?;
    through();
    Ok(())
}
