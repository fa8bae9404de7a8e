//! Bake: an SMD3 warms its motor through the phases.

use crate::api::{Nothing, ThePanel, find, problem};
use crate::motion::to_the_end;
use axum::extract::State;
use serde::Deserialize;
use stepdrive_host::Error;
use stepdrive_host::smd3::Smd3Client;
use stepdrive_spec::smd3::commands::Mode;
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
        member.work(start(member.smd3()?, setpoint)).await?;
        member.nudge.notify_one();
        Ok(Reply(Nothing {}))
    })
    .await
}

async fn start(client: &Smd3Client, celsius: u16) -> Result<(), Error> {
    let begun = client.start_bake(celsius).await;
    if begun.is_err() && matches!(client.mode().await, Ok(Mode::Bake)) {
        // The mode was set before the drive refused; why it did counts more than whether this succeeds.
        let _ = client.set_mode(Mode::Remote).await;
    }
    begun
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
