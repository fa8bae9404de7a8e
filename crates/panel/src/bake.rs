//! Bake: an SMD3 warms its motor through the phases.

use crate::api::{Nothing, ThePanel, find, problem};
use crate::motion::to_the_end;
use axum::extract::State;
use serde::Deserialize;
use stepdrive_web::{Asked, Named, Problem, Reply};

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Bake {
    /// The temperature to keep, °C.
    setpoint: u16,
}

pub(crate) async fn begin(
    State(panel): ThePanel,
    Named(name): Named<String>,
    Asked(Bake { setpoint }): Asked<Bake>,
) -> Result<Reply<Nothing>, Problem> {
    let member = find(&panel, &name)?;
    member.smd3().map_err(problem)?;
    to_the_end(async move {
        member.check_idle()?;
        member.work(member.smd3()?.start_bake(setpoint)).await?;
        member.nudge.notify_one();
        Ok(Reply(Nothing {}))
    })
    .await
}

pub(crate) async fn end(
    State(panel): ThePanel,
    Named(name): Named<String>,
) -> Result<Reply<Nothing>, Problem> {
    let member = find(&panel, &name)?;
    member.smd3().map_err(problem)?;
    to_the_end(async move {
        member.work(member.smd3()?.end_bake()).await?;
        member.nudge.notify_one();
        Ok(Reply(Nothing {}))
    })
    .await
}
