//! Jogging: a motion that lasts for as long as a client says so again and again.
//!
//! Each jog is a task of its own, and its timer is the dead man's: it runs out [`HOLD`] after the last time that the client
//! was heard of, and then the axis is stopped, whatever else has become of the client, its request, or the start of the
//! motion. A stop that does not get through is sent again until it does.

use crate::api::{Nothing, ThePanel, find, problem};
use crate::member::{Client, Member, Way};
use crate::notices::Level;
use crate::quantity::{counted, shortly};
use crate::stopping;
use crate::stopping::PATIENCE;
use axum::extract::State;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;
use stepdrive_host::axis::MoveOptions;
use stepdrive_host::units::{Decimal, Speed};
use stepdrive_host::{Direction, Error};
use stepdrive_spec::smd3::commands::Command;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_web::{Asked, Named, Problem, Reply};
use tokio::sync::watch;
use tokio::time::{Instant, sleep, sleep_until, timeout};

/// How long a jog goes on without being heard of.
const HOLD: Duration = Duration::from_millis(500);
/// How often it is looked whether a motor that was told to stop stands.
const LOOK: Duration = Duration::from_millis(20);
/// How long after its end a jog is not begun again by a request that does not say which press it is of.
const LATE: Duration = Duration::from_millis(200);
/// Within this time a motor that brakes has become slower.
const BRAKING: Duration = Duration::from_millis(500);
/// How long a motor that was stopped is waited for.
const STOPPING: Duration = Duration::from_secs(30);
/// Of so many clients it is known which of their presses have ended.
const MOST_ENDED: usize = 64;
/// The longest name of a client.
const LONGEST_ID: usize = 64;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Begin {
    direction: Way,
    /// In the axis' unit a second.
    speed: f64,
    id: String,
    /// Grows with each press of a key or button: what has ended is not begun again by a request that comes late.
    #[serde(default)]
    press: u64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct End {
    id: String,
    /// The press that ends; whichever is under way by default.
    press: Option<u64>,
}

#[derive(Debug, Serialize)]
pub(crate) struct Holds {
    ends_in_ms: u64,
}

/// A jog, as those see it who ask for it.
#[derive(Debug)]
pub(crate) struct Jog {
    /// Whose it is.
    id: String,
    wanted: watch::Sender<Wanted>,
    stage: watch::Receiver<Stage>,
}

/// The jogs that have ended, the last of each client: the newest [`MOST_ENDED`], the oldest first.
#[derive(Debug, Default)]
pub(crate) struct EndedJogs(VecDeque<EndedJog>);

#[derive(Debug)]
struct EndedJog {
    id: String,
    press: u64,
    ended: Instant,
}

impl EndedJogs {
    /// A jog ends now.
    fn add(&mut self, id: &str, press: u64) {
        let before = self.of(id).map_or(0, |jog| jog.press);
        self.0.retain(|jog| jog.id != id);
        if self.0.len() == MOST_ENDED {
            self.0.pop_front();
        }
        self.0.push_back(EndedJog { id: id.to_owned(), press: press.max(before), ended: Instant::now() });
    }

    fn of(&self, id: &str) -> Option<&EndedJog> {
        self.0.iter().find(|jog| jog.id == id)
    }

    /// Whether what comes now is of a press that has ended, and late.
    fn has(&self, id: &str, press: u64) -> bool {
        self.of(id).is_some_and(|jog| press <= jog.press && (press > 0 || jog.ended.elapsed() < LATE))
    }
}

/// What its client wants.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Wanted {
    press: u64,
    direction: Direction,
    speed: Speed,
    /// When that ends unless the client is heard of again.
    until: Instant,
    end: Option<Why>,
}

/// Why a jog ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Why {
    /// Its client said so.
    Released,
    /// The axis was stopped otherwise.
    Taken,
    /// Its client was not heard of.
    Silent,
}

/// How far it has come.
#[derive(Clone, Debug, PartialEq)]
enum Stage {
    Starting,
    Running,
    Stopping,
    Over(Option<Error>),
}

impl Wanted {
    /// Why it has ended, if it has.
    fn ended(&self) -> Option<Why> {
        self.end.or_else(|| (Instant::now() >= self.until).then_some(Why::Silent))
    }
}

// ---- requests

pub(crate) async fn jog(
    State(panel): ThePanel,
    Named(name): Named<String>,
    Asked(begin): Asked<Begin>,
) -> Result<Reply<Holds>, Problem> {
    let until = Instant::now() + HOLD;
    let member = find(&panel, &name)?;
    let wanted = begin.wanted(&member, until)?;
    let stage = hold(&member, &begin.id, wanted).map_err(problem)?;
    started(stage).await.map_err(problem)?;
    Ok(Reply(Holds { ends_in_ms: u64::try_from(HOLD.as_millis()).unwrap_or(0) }))
}

pub(crate) async fn end(
    State(panel): ThePanel,
    Named(name): Named<String>,
    Asked(End { id, press }): Asked<End>,
) -> Result<Reply<Nothing>, Problem> {
    let member = find(&panel, &name)?;
    let jog = member.doing().jog.clone();
    let Some(jog) = jog else { return Ok(Reply(Nothing {})) };
    if jog.id != id {
        return Err(problem(taken(&member)));
    }
    if press.is_some_and(|press| press < jog.wanted.borrow().press) {
        // It comes late, and another is under way.
        return Ok(Reply(Nothing {}));
    }
    jog.finish(Why::Released);
    if timeout(PATIENCE, jog.stopped()).await.is_ok() {
        return Ok(Reply(Nothing {}));
    }
    Err(stopping::not_yet(&panel, &member, stopping::trouble(&member)))
}

impl Begin {
    fn wanted(&self, member: &Member, until: Instant) -> Result<Wanted, Problem> {
        if self.id.is_empty() || self.id.len() > LONGEST_ID {
            return Err(Problem::impossible(format!("`id` is 1 to {LONGEST_ID} bytes that say who jogs")));
        }
        let unit = member.axis().scale().unit();
        let value = counted(self.speed, unit).map_err(problem)?;
        if value <= Decimal::ZERO {
            return Err(Problem::impossible(format!(
                "a speed is above 0 {unit}/s, not {}; the direction is said by itself",
                shortly(self.speed)
            )));
        }
        Ok(Wanted {
            press: self.press,
            direction: self.direction.into(),
            speed: Speed::new(value, unit),
            until,
            end: None,
        })
    }
}

/// Begins a jog, or says of the one that is under way that it is still wanted.
fn hold(member: &Arc<Member>, id: &str, wanted: Wanted) -> Result<watch::Receiver<Stage>, Error> {
    let mut doing = member.doing();
    if doing.homing {
        return Err(Error::Refused(format!(
            "{} is looking for its home switch; stop it first; nothing was sent",
            member.name()
        )));
    }
    if let Some(jog) = &doing.jog {
        if jog.id != id {
            return Err(taken(member));
        }
        let before = *jog.wanted.borrow();
        if before.ended().is_some() && wanted.press <= before.press {
            return Err(has_ended(member));
        }
        jog.wanted.send_replace(wanted);
        return Ok(jog.stage.clone());
    }
    doing.check_stopped(member.name())?;
    if doing.ended_jogs.has(id, wanted.press) {
        return Err(has_ended(member));
    }
    let (tell, stage) = watch::channel(Stage::Starting);
    let (want, heard) = watch::channel(wanted);
    doing.aim = None;
    doing.jog = Some(Arc::new(Jog { id: id.to_owned(), wanted: want, stage: stage.clone() }));
    drop(doing);
    let jogging = Jogging { member: Arc::clone(member), heard, tell, before: None, stops: member.stops() };
    tokio::spawn(jogging.go());
    Ok(stage)
}

fn taken(member: &Member) -> Error {
    Error::Refused(format!("{} is being jogged by somebody else; nothing was sent", member.name()))
}

fn has_ended(member: &Member) -> Error {
    let name = member.name();
    Error::Refused(format!("this jog of {name} has ended; let go and press again; nothing was sent"))
}

/// Waits until a jog goes, and says why if it does not.
async fn started(mut stage: watch::Receiver<Stage>) -> Result<(), Error> {
    let is_known = |stage: &Stage| *stage != Stage::Starting;
    match stage.wait_for(is_known).await.as_deref() {
        Ok(Stage::Over(Some(error))) => Err(error.clone()),
        Ok(Stage::Starting | Stage::Running | Stage::Stopping | Stage::Over(None)) | Err(_) => Ok(()),
    }
}

/// Ends the jog of an axis, if there is one.
pub(crate) fn release(member: &Member) {
    if let Some(jog) = &member.doing().jog {
        jog.finish(Why::Released);
    }
}

/// Waits until the stop of a jog that ends was sent.
pub(crate) async fn finished(member: &Member) {
    let jog = member.doing().jog.clone();
    if let Some(jog) = jog {
        jog.stopped().await;
    }
}

/// Ends the jog of an axis, if there is one, which somebody else stops.
pub(crate) fn give_up(member: &Member) {
    if let Some(jog) = &member.doing().jog {
        jog.finish(Why::Taken);
    }
}

impl Jog {
    fn finish(&self, why: Why) {
        self.wanted.send_modify(|wanted| wanted.end = Some(wanted.end.unwrap_or(why)));
    }

    /// Waits until its stop was sent.
    async fn stopped(&self) {
        let is_sent = |stage: &Stage| matches!(stage, Stage::Stopping | Stage::Over(_));
        // The task that has the sender ends by saying so.
        let _ = self.stage.clone().wait_for(is_sent).await;
    }
}

// ---- the task

/// A jog as its task sees it.
struct Jogging {
    member: Arc<Member>,
    heard: watch::Receiver<Wanted>,
    tell: watch::Sender<Stage>,
    /// The highest speed as it was before, as the controller has it.
    before: Option<f64>,
    /// [`Member::stops`] when it last set off.
    stops: u32,
}

impl Jogging {
    /// Goes as is wanted, until nothing is wanted any more.
    async fn go(mut self) {
        self.member.nudge.notify_one();
        loop {
            let mut failed = None;
            while let (Some(wanted), None) = (self.wanted(), &failed) {
                failed = self.once(wanted).await.err();
            }
            if failed.is_none() {
                self.stand().await;
            }
            self.restore().await;
            if self.has_left(failed) {
                return;
            }
        }
    }

    /// Goes once, and stops.
    async fn once(&mut self, wanted: Wanted) -> Result<(), Error> {
        self.stops = self.member.stops();
        self.tell.send_replace(Stage::Starting);
        let why = self.leg(wanted).await?;
        if why == Why::Silent {
            self.say_why();
        }
        if why != Why::Taken {
            self.stop().await;
        }
        self.tell.send_replace(Stage::Stopping);
        self.stand().await;
        Ok(())
    }

    /// What is wanted, if it still is.
    fn wanted(&mut self) -> Option<Wanted> {
        let wanted = *self.heard.borrow_and_update();
        wanted.ended().is_none().then_some(wanted)
    }

    /// Leaves the axis to others, unless its client has pressed again meanwhile.
    fn has_left(&self, failed: Option<Error>) -> bool {
        let mut doing = self.member.doing();
        let wanted = *self.heard.borrow();
        if failed.is_none() && wanted.ended().is_none() {
            return false;
        }
        // Without a number the next request may be of another press, and is to hear why this one failed.
        let is_told_apart = failed.is_none() || wanted.press > 0;
        if let Some(jog) = doing.jog.take().filter(|_| is_told_apart) {
            doing.ended_jogs.add(&jog.id, wanted.press);
        }
        self.tell.send_replace(Stage::Over(failed));
        drop(doing);
        self.member.nudge.notify_one();
        true
    }

    /// Starts in a direction, and goes until it ends or another direction is wanted.
    async fn leg(&mut self, mut wanted: Wanted) -> Result<Why, Error> {
        let member = Arc::clone(&self.member);
        let mut heard = self.heard.clone();
        let sent = {
            let mut start = pin!(member.work(self.start(wanted)));
            tokio::select! {
                biased;
                why = over(&mut heard) => {
                    if why == Why::Taken {
                        // It sees by itself that a stop has come, and that the stop wins.
                        let _ = start.await;
                    }
                    return Ok(why);
                }
                started = &mut start => started,
            }
        };
        match sent {
            Ok(()) => {}
            // Whatever moves there, this has not begun it.
            Err(
                error @ (Error::Usage(_) | Error::Refused(_) | Error::Fault(_) | Error::NotAuthorised(_)),
            ) => return Err(error),
            Err(error) => {
                self.stop().await;
                return Err(error);
            }
        }
        self.tell.send_replace(Stage::Running);
        loop {
            if let Some(why) = otherwise(&mut self.heard, &wanted).await {
                return Ok(why);
            }
            wanted = *self.heard.borrow_and_update();
            let mut heard = self.heard.clone();
            let changed = tokio::select! {
                biased;
                why = over(&mut heard) => return Ok(why),
                changed = member.work(change_speed(&member, wanted)) => changed,
            };
            if let Err(error) = changed {
                let name = member.name();
                member.tell(Level::Error, format!("{name} goes on as before: {error}"));
            }
        }
    }

    async fn start(&mut self, wanted: Wanted) -> Result<(), Error> {
        let member = Arc::clone(&self.member);
        if self.before.is_none() {
            self.before = Some(highest_speed(&member).await?);
        }
        let options = MoveOptions {
            speed: Some(wanted.speed),
            no_wait: true,
            // Where it is not known where the axis is, it is jogged to find out. The limits hold by what it shows.
            override_trust: true,
            timeout: None,
        };
        let stops = member.stops();
        member.depart(stops, member.axis().run(wanted.direction, options)).await
    }

    /// Stops, however often that has to be tried.
    async fn stop(&self) {
        stopping::repeat(&self.member, self.stops).at_last().await;
    }

    fn say_why(&self) {
        let name = self.member.name();
        let held = HOLD.as_millis();
        self.member.tell(
            Level::Info,
            format!("{name} was stopped: whoever jogged it was not heard of for {held} ms"),
        );
    }

    /// Waits until the motor stands, or cannot be asked. One that does not brake is told again.
    async fn stand(&self) {
        let began = Instant::now();
        let (mut looked, mut fastest) = (began, f64::INFINITY);
        while began.elapsed() < STOPPING {
            let Ok(state) = self.member.work(self.member.axis().state()).await else { return };
            if !state.moving {
                return;
            }
            if looked.elapsed() >= BRAKING {
                if state.speed.abs() >= fastest {
                    // When it fails again, the next look says so.
                    let again = stopping::repeat(&self.member, self.stops);
                    let _ = again.by(Instant::now() + BRAKING).await;
                }
                (looked, fastest) = (Instant::now(), state.speed.abs());
            }
            sleep(LOOK).await;
        }
    }

    /// Sets the highest speed as it was before: that of a jog is for that alone.
    async fn restore(&mut self) {
        let Some(before) = self.before.take() else { return };
        if let Err(error) = self.member.work(set_highest_speed(&self.member, before)).await {
            let name = self.member.name();
            self.member.tell(
                Level::Error,
                format!("the highest speed of {name} was left as its jog had it: {error}"),
            );
        }
    }
}

/// Waits until a jog is over.
async fn over(heard: &mut watch::Receiver<Wanted>) -> Why {
    loop {
        let wanted = *heard.borrow_and_update();
        if let Some(why) = wanted.ended() {
            return why;
        }
        tokio::select! {
            () = sleep_until(wanted.until) => {}
            // The jog is kept until its task ends, and the sender with it.
            _ = heard.changed() => {}
        }
    }
}

/// Waits until a jog is over, or another direction or speed is wanted: `None` for another speed alone.
async fn otherwise(heard: &mut watch::Receiver<Wanted>, now: &Wanted) -> Option<Why> {
    loop {
        let wanted = *heard.borrow_and_update();
        if let Some(why) = wanted.ended() {
            return Some(why);
        } else if wanted.direction != now.direction {
            return Some(Why::Released);
        } else if wanted.speed != now.speed {
            return None;
        }
        tokio::select! {
            () = sleep_until(wanted.until) => {}
            _ = heard.changed() => {}
        }
    }
}

// ---- the highest speed, which a jog sets and leaves as it was

async fn highest_speed(member: &Member) -> Result<f64, Error> {
    match member.client() {
        Client::Smsd(client) if client.check_readable(Reg::MaxSpeed).is_err() => {
            Ok(client.supposed(Reg::MaxSpeed) as f64)
        }
        Client::Smsd(client) => Ok(client.read(Reg::MaxSpeed).await? as f64),
        Client::Smd3(client) => client.get_number(Command::Vmax).await,
    }
}

async fn set_highest_speed(member: &Member, speed: f64) -> Result<(), Error> {
    match member.client() {
        Client::Smsd(client) => client.write(Reg::MaxSpeed, whole(speed)).await,
        Client::Smd3(client) => client.set_number(Command::Vmax, speed).await.map(drop),
    }
}

/// Gives a motor that turns another speed.
async fn change_speed(member: &Member, wanted: Wanted) -> Result<(), Error> {
    let speed = member.axis().scale().steps_per_s(wanted.speed)?;
    set_highest_speed(member, speed).await?;
    let Client::Smsd(client) = member.client() else { return Ok(()) };
    if member.axis().soft_limits().range().is_some() {
        // A motion to the limit takes the highest speed as it is.
        return Ok(());
    }
    let turned = member.axis().scale().is_reversed();
    let direction = if turned { wanted.direction.opposite() } else { wanted.direction };
    client.run(direction, whole(speed)).await
}

/// A speed as a register holds it.
fn whole(speed: f64) -> i64 {
    #[allow(clippy::cast_possible_truncation, reason = "`as` saturates, and what is too much is refused")]
    let whole = speed.round() as i64;
    whole
}
