//! Moves, endless motion, homing, zero and faults, as clients ask for them.
//!
//! What was begun goes on when its client hangs up half-way: it runs in a task of its own, and the client only waits for it.

use crate::Kept;
use crate::api::{Nothing, ThePanel, find, problem};
use crate::member::{Aim, Member, Way};
use crate::notices::Level;
use crate::quantity::Quantity;
use axum::extract::State;
use axum::http::StatusCode;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use stepdrive_host::Error;
use stepdrive_host::axis::{MoveOptions, Plan};
use stepdrive_host::units::Goal;
use stepdrive_web::{Asked, Named, Problem, Reply};
use tokio::time::Instant;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Move {
    to: Option<Quantity>,
    by: Option<Quantity>,
    speed: Option<Quantity>,
    #[serde(default)]
    override_trust: bool,
    #[serde(default)]
    dry_run: bool,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Run {
    direction: Way,
    speed: Option<Quantity>,
    #[serde(default)]
    override_trust: bool,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Home {
    direction: Way,
    speed: Option<Quantity>,
}

/// A move as it was begun, or would be.
#[derive(Debug, Serialize)]
pub(crate) struct Planned {
    from: f64,
    to: f64,
    distance: f64,
    seconds: f64,
    sent: Vec<String>,
}

impl From<Plan> for Planned {
    fn from(plan: Plan) -> Planned {
        Planned {
            from: plan.from.value.as_f64(),
            to: plan.to.value.as_f64(),
            distance: plan.distance.value.as_f64(),
            seconds: plan.duration.as_secs_f64(),
            sent: plan.sent,
        }
    }
}

/// Does something with an axis to its end, whatever becomes of who asked for it.
pub(crate) async fn to_the_end<T: Send + 'static>(
    work: impl Future<Output = Result<T, Error>> + Send + 'static,
) -> Result<T, Problem> {
    match tokio::spawn(work).await {
        Ok(done) => done.map_err(problem),
        Err(error) => Err(Problem::new(StatusCode::INTERNAL_SERVER_ERROR, error.to_string())),
    }
}

pub(crate) async fn r#move(
    State(panel): ThePanel,
    Named(name): Named<String>,
    Asked(asked): Asked<Move>,
) -> Result<Reply<Planned>, Problem> {
    let member = find(&panel, &name)?;
    let goal = match (&asked.to, &asked.by) {
        (Some(to), None) => Goal::To(to.amount(&member).map_err(problem)?),
        (None, Some(by)) => Goal::By(by.amount(&member).map_err(problem)?),
        (Some(_), Some(_)) | (None, None) => {
            return Err(Problem::impossible(
                "a move has either `to` a position or `by` a distance, as in {\"by\": \"5mm\"}",
            ));
        }
    };
    let speed = asked.speed.as_ref().map(|speed| speed.speed(&member)).transpose().map_err(problem)?;
    let options = MoveOptions { speed, no_wait: true, override_trust: asked.override_trust, timeout: None };
    if asked.dry_run {
        let plan = member.work(member.axis().plan(goal, options)).await.map_err(problem)?;
        return Ok(Reply(plan.into()));
    }
    let stops = member.stops();
    to_the_end(go(member, goal, options, stops)).await.map(|plan| Reply(plan.into()))
}

/// Begins a move, and remembers where it goes.
async fn go(member: Arc<Member>, goal: Goal, options: MoveOptions, stops: u32) -> Result<Plan, Error> {
    member.check_idle()?;
    let plan = member.work(member.depart(stops, member.axis().go(goal, options))).await?;
    let step = member.axis().scale().from_steps(1.0).abs();
    let aim = Aim { to: plan.to.value.as_f64(), within: step, since: Instant::now(), stops };
    member.doing().aim = Some(aim);
    member.keep_trust(Kept::Acted);
    // A speed that is given is a setting.
    member.revise();
    Ok(plan)
}

pub(crate) async fn run(
    State(panel): ThePanel,
    Named(name): Named<String>,
    Asked(asked): Asked<Run>,
) -> Result<Reply<Nothing>, Problem> {
    let member = find(&panel, &name)?;
    let speed = asked.speed.as_ref().map(|speed| speed.speed(&member)).transpose().map_err(problem)?;
    let options = MoveOptions { speed, no_wait: true, override_trust: asked.override_trust, timeout: None };
    let stops = member.stops();
    to_the_end(async move {
        member.check_idle()?;
        let direction = asked.direction.into();
        member.doing().aim = None;
        member.work(member.depart(stops, member.axis().run(direction, options))).await?;
        member.keep_trust(Kept::Acted);
        member.revise();
        Ok(Reply(Nothing {}))
    })
    .await
}

pub(crate) async fn home(
    State(panel): ThePanel,
    Named(name): Named<String>,
    Asked(asked): Asked<Home>,
) -> Result<(StatusCode, Reply<Nothing>), Problem> {
    let member = find(&panel, &name)?;
    let speed = asked.speed.as_ref().map(|speed| speed.speed(&member)).transpose().map_err(problem)?;
    let stops = member.stops();
    begin_homing(&member).map_err(problem)?;
    let options = MoveOptions { speed, ..MoveOptions::default() };
    tokio::spawn(look_for_home(member, asked.direction, options, stops));
    Ok((StatusCode::ACCEPTED, Reply(Nothing {})))
}

/// Takes the axis for homing.
fn begin_homing(member: &Member) -> Result<(), Error> {
    let mut doing = member.doing();
    doing.check_idle(member.name())?;
    doing.homing = true;
    doing.aim = None;
    Ok(())
}

/// Homes to the end, and tells when that is not as it should be.
async fn look_for_home(member: Arc<Member>, way: Way, options: MoveOptions, stops: u32) {
    member.nudge.notify_one();
    let homed = member.work(member.depart(stops, member.axis().home(way.into(), options))).await;
    member.doing().homing = false;
    member.keep_trust(if homed.is_ok() { Kept::Zeroed } else { Kept::Acted });
    member.revise();
    let name = member.name();
    match homed {
        Ok(()) => {}
        Err(_) if member.stops() != stops => {
            member.tell(Level::Info, format!("{name} was stopped before it was home"));
        }
        Err(error) => member.tell(Level::Error, format!("{name} is not home: {error}")),
    }
}

pub(crate) async fn zero(
    State(panel): ThePanel,
    Named(name): Named<String>,
) -> Result<Reply<Nothing>, Problem> {
    let member = find(&panel, &name)?;
    to_the_end(async move {
        member.check_idle()?;
        member.work(member.axis().zero()).await?;
        member.keep_trust(Kept::Zeroed);
        member.nudge.notify_one();
        Ok(Reply(Nothing {}))
    })
    .await
}

pub(crate) async fn clear(
    State(panel): ThePanel,
    Named(name): Named<String>,
) -> Result<Reply<Nothing>, Problem> {
    let member = find(&panel, &name)?;
    to_the_end(async move {
        let left = member.work(member.axis().clear_faults()).await?;
        member.keep_trust(Kept::Acted);
        member.revise();
        if left.is_empty() {
            return Ok(Reply(Nothing {}));
        }
        let told = left.iter().map(|fault| format!("{} ({})", fault.name, fault.about.trim_end_matches('.')));
        let told = told.collect::<Vec<String>>().join(", ");
        let name = member.name();
        Err(Error::Fault(format!(
            "{name} is not clear: {told}; the cause is still there, remove it and clear again"
        )))
    })
    .await
}
