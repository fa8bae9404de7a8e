//! Stops, of one axis and of all at once. A stop that does not get through is told again until it does.
//!
//! An axis that is told to stop has one task that tells it, however often that is asked for: the task outlives the requests,
//! which wait for it for a second and then say why the axis does not know yet. Which stop it tells:
//!
//! * **Asked for.** What people ask for is what is told. What the panel sends by itself, at the end of a jog or behind a
//!   program that came late, is the stop that was asked for meanwhile, else a soft one.
//! * **Chosen** each time that it is told: a soft stop of an SMSD that stands without current is a free one, as the soft one
//!   would energise it. What was seen just now says whether it stands so; the axis is asked where nothing was, or after an
//!   attempt that failed. One that was seen moving within a second, or is moved from here, is told without that.
//! * **Replaced** while it is pending by a hard or a free one that is asked for later, never by a soft one.
//! * **Ended** when it got through, when a motion was begun from here, which shows that the axis was reached, or when it is
//!   given up: after two minutes, or where we are not let in. As long as it fails nothing else is begun from here.

use crate::api::{Nothing, ThePanel, find};
use crate::member::{Client, Doing, Member};
use crate::notices::Level;
use crate::{Controller, Shared, jog};
use axum::extract::State;
use axum::http::StatusCode;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::time::Duration;
use stepdrive_host::Error;
use stepdrive_host::axis::Stop;
use stepdrive_host::smsd::Smsd;
use stepdrive_web::{Asked, Named, Problem, Reply};
use tokio::sync::watch;
use tokio::time::{Instant, timeout, timeout_at};

/// How long a request waits for its stop to be told.
pub(crate) const PATIENCE: Duration = Duration::from_secs(1);
/// How long after a stop that did not get through it is told again.
const AGAIN: Duration = Duration::from_millis(250);
/// The same where we are not let in: each attempt with a wrong password locks a controller for others for a second.
const NOT_LET_IN: Duration = Duration::from_secs(10);
/// How often we may be refused before a stop is given up.
const MOST_REFUSALS: u32 = 3;
/// How long after it was last asked for a stop is given up.
const LONGEST: Duration = Duration::from_mins(2);
/// How old a reading may be that shows a motor without current.
const FRESH: Duration = Duration::from_millis(150);
/// How old one may be that shows it moving.
const RECENT: Duration = Duration::from_secs(1);

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
    let told = begin(&member, how.into()).by(Instant::now() + PATIENCE).await;
    told.map(|()| Reply(Nothing {})).map_err(|why| not_yet(&panel, &member, why))
}

pub(crate) async fn stop_all(
    State(panel): ThePanel,
    Asked(HowToStop { how }): Asked<HowToStop>,
) -> Reply<Stopped> {
    let latest = Instant::now() + PATIENCE;
    // All are told before any is waited for.
    let telling: Vec<Telling> = panel.members.iter().map(|member| begin(member, how.into())).collect();
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
fn begin(member: &Arc<Member>, how: Stop) -> Telling {
    jog::give_up(member);
    tell(member, how)
}

/// Says that an axis could not be told to stop so far.
pub(crate) fn not_yet(panel: &Shared, member: &Member, untold: Untold) -> Problem {
    let name = member.name();
    let why = untold.why.map(|error| error.to_string()).or_else(|| panel.hub.why_lost(member));
    let text = match why {
        Some(why) if untold.is_given_up => given_up(name, &why),
        Some(why) => told_again(name, &why),
        None => format!(
            "{name} has not confirmed within {PATIENCE:?} that it stops; it is told again until it does"
        ),
    };
    Problem::new(StatusCode::BAD_GATEWAY, text)
}

fn told_again(name: &str, why: &str) -> String {
    format!("{name} could not be told to stop yet: {why}; it is told again until it can be")
}

fn given_up(name: &str, why: &str) -> String {
    format!("{name} could not be told to stop: {why}; it is not told again: see to it, and stop it once more")
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
    is_given_up: bool,
}

/// One who has asked for a stop.
pub(crate) struct Telling {
    times: u64,
    told: watch::Receiver<Told>,
}

/// A stop that an axis was not told.
#[derive(Debug, Default)]
pub(crate) struct Untold {
    /// Why, where that is known so far.
    why: Option<Error>,
    is_given_up: bool,
}

impl Telling {
    /// Waits until the axis was told. Fails when that takes too long, or is given up.
    pub(crate) async fn by(mut self, latest: Instant) -> Result<(), Untold> {
        let is_over = timeout_at(latest, self.come_through()).await.is_ok();
        let told = self.told.borrow();
        if is_over && !told.is_given_up {
            return Ok(());
        }
        Err(Untold { why: told.why.clone(), is_given_up: told.is_given_up })
    }

    /// Waits until the axis was told, however long that takes, or that is given up.
    pub(crate) async fn at_last(mut self) {
        self.come_through().await;
    }

    async fn come_through(&mut self) {
        let times = self.times;
        // The task ends without it where the axis was reached otherwise.
        let _ = self.told.wait_for(|told| told.times >= times || told.is_given_up).await;
    }
}

/// Has an axis told to stop, as somebody asks for it.
fn tell(member: &Arc<Member>, how: Stop) -> Telling {
    ask(member, &mut member.doing(), how)
}

/// Has an axis told to stop by the panel itself: as it was since it had been told to so many times, or else softly.
pub(crate) fn repeat(member: &Arc<Member>, stops: u32) -> Telling {
    let mut doing = member.doing();
    let how = doing.stopped_since(stops).unwrap_or(Stop::Soft);
    ask(member, &mut doing, how)
}

fn ask(member: &Arc<Member>, doing: &mut Doing, how: Stop) -> Telling {
    if let Some(stopping) = doing.stopping.as_ref().filter(|stopping| !stopping.asked.is_closed()) {
        let pending = *stopping.asked.borrow();
        let telling = Telling { times: pending.times + 1, told: stopping.told.clone() };
        let how = if how == Stop::Soft { pending.how } else { how };
        stopping.asked.send_replace(Ask { how, times: telling.times, is_over: false });
        member.note_stop(doing, how);
        return telling;
    }
    member.note_stop(doing, how);
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

    /// Why it does not get through, if it does not.
    pub(crate) fn trouble(&self) -> Option<Error> {
        self.told.borrow().why.clone()
    }
}

/// What keeps an axis from being told to stop, as far as that is known.
pub(crate) fn trouble(member: &Member) -> Untold {
    Untold { why: member.doing().stopping.as_ref().and_then(Stopping::trouble), is_given_up: false }
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

// ---- the task

/// Tells an axis to stop until it was told, or that is given up.
async fn go(member: Arc<Member>, mut asked: watch::Receiver<Ask>, tell: watch::Sender<Told>) {
    let (mut done, mut trouble) = (0, Trouble::default());
    loop {
        let ask = *asked.borrow_and_update();
        if has_left(&member, done) {
            return;
        }
        trouble.latest(ask);
        let mut otherwise = asked.clone();
        let outcome = tokio::select! {
            biased;
            _ = otherwise.wait_for(|next| is_otherwise(ask, *next, &tell)) => continue,
            outcome = attempt(&member, ask, trouble.is_known, &tell) => outcome,
        };
        let Err(error) = outcome else {
            done = ask.times;
            continue;
        };
        let is_refused = matches!(error, Error::NotAuthorised(_));
        tell.send_modify(|told| told.why = Some(error.clone()));
        if trouble.is_enough(is_refused) && has_given_up(&member, ask, &tell) {
            member.tell(Level::Error, given_up(member.name(), &error.to_string()));
            return;
        }
        if !std::mem::replace(&mut trouble.is_known, true) {
            member.tell(Level::Error, told_again(member.name(), &error.to_string()));
        }
        // Whoever asks meanwhile does not wait for that.
        let _ = timeout(if is_refused { NOT_LET_IN } else { AGAIN }, asked.changed()).await;
    }
}

/// What goes wrong with a stop.
#[derive(Debug, Default)]
struct Trouble {
    /// An attempt has failed.
    is_known: bool,
    /// How often it was asked for, and until when it is told for that.
    until: Option<(u64, Instant)>,
    refusals: u32,
}

impl Trouble {
    /// Who asks anew has the whole time.
    fn latest(&mut self, ask: Ask) {
        if self.until.is_none_or(|(times, _)| times != ask.times) {
            self.until = Some((ask.times, Instant::now() + LONGEST));
            self.refusals = 0;
        }
    }

    /// Whether the stop is to be given up with the attempt that has just failed.
    fn is_enough(&mut self, is_refused: bool) -> bool {
        self.refusals += u32::from(is_refused);
        self.refusals >= MOST_REFUSALS || self.until.is_some_and(|(_, until)| Instant::now() >= until)
    }
}

/// Whether what is asked for next does not wait for the attempt that is under way.
fn is_otherwise(now: Ask, next: Ask, told: &watch::Sender<Told>) -> bool {
    // What has got through already is told once more to whoever asks once more.
    let is_once_more = next.times > now.times && told.borrow().times >= now.times;
    next.is_over || next.how != now.how || is_once_more
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

/// Leaves an axis that cannot be told, unless somebody has asked anew.
fn has_given_up(member: &Member, ask: Ask, tell: &watch::Sender<Told>) -> bool {
    let mut doing = member.doing();
    if doing.stopping.as_ref().is_some_and(|stopping| stopping.asked.borrow().times > ask.times) {
        return false;
    }
    doing.stopping = None;
    tell.send_modify(|told| told.is_given_up = true);
    true
}

/// Tells it once.
async fn attempt(
    member: &Member,
    ask: Ask,
    has_failed: bool,
    tell: &watch::Sender<Told>,
) -> Result<(), Error> {
    let through = || {
        tell.send_modify(|told| {
            told.times = ask.times;
            told.why = None;
        });
    };
    if ask.how == Stop::Free && matches!(member.controller(), Controller::Smd3(_)) {
        // It is disabled once it stands. Whoever asks does not wait for that.
        member.stop(ask.how, async { Ok(Stop::Soft) }).await?;
        through();
    }
    member.stop(ask.how, chosen(member, ask.how, has_failed)).await?;
    through();
    Ok(())
}

// ---- which stop

/// The stop to tell: a free one for an SMSD that a soft one would energise.
async fn chosen(member: &Member, how: Stop, has_failed: bool) -> Result<Stop, Error> {
    let Client::Smsd(client) = member.client() else { return Ok(how) };
    if how != Stop::Soft {
        return Ok(how);
    }
    let known = if has_failed { None } else { seen_at_rest(member) };
    let is_at_rest = match known {
        Some(is_at_rest) => is_at_rest,
        None => stands_without_current(client).await?,
    };
    Ok(if is_at_rest { Stop::Free } else { Stop::Soft })
}

/// Whether it was seen standing without current, if that can be told from what is known.
fn seen_at_rest(member: &Member) -> Option<bool> {
    let doing = member.doing();
    if doing.is_under_way() {
        return Some(false);
    }
    let seen = doing.seen?;
    let age = seen.at.elapsed();
    if seen.is_moving() && age <= RECENT {
        return Some(false);
    }
    (age <= FRESH).then(|| seen.is_at_rest() && doing.has_not_departed_since(seen.at))
}

/// Whether it stands without current, and no program is seen to run.
async fn stands_without_current(client: &dyn Smsd) -> Result<bool, Error> {
    let snapshot = client.snapshot().await?;
    let is_at_rest = snapshot.status.hi_z && !snapshot.is_moving();
    Ok(is_at_rest && client.program().await?.running != Some(true))
}
