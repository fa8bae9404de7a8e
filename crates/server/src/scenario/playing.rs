//! Scenarios on a running rig.

use super::player::Player;
use super::{Mistake, Report, Scenario, StepEvent};
use crate::world::{Play, World};
use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use stepdrive_rig::group::Group;
use stepdrive_spec::time::Instant;
use tokio::sync::{Notify, mpsc};

/// How often a quantity that flows is looked at, in wall time. When it came is found out exactly all the same.
const LOOK: Duration = Duration::from_millis(5);

/// Why a scenario is not played.
#[derive(Debug, thiserror::Error)]
pub enum PlayError {
    /// There is a mistake in it.
    #[error("{0}")]
    Mistake(Mistake),
    /// Another one is being played.
    #[error("the scenario `{0}` is being played; wait until it has ended, or end it")]
    Busy(String),
}

/// Something about a scenario that is being played.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Played {
    /// Something happened to a step.
    Step(StepEvent),
    /// It is over. Nothing comes after this.
    Over(Report),
}

/// A scenario that is being played on a running rig. Dropping this ends it where it is.
#[derive(Debug)]
pub struct Playing {
    name: String,
    began: Instant,
    news: mpsc::UnboundedReceiver<Played>,
}

impl Playing {
    /// The scenario's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The rig time at which it began.
    pub fn began(&self) -> Instant {
        self.began
    }

    /// The next thing that happens to it; `None` after [`Played::Over`].
    ///
    /// May be dropped before it is done; nothing is lost then.
    pub async fn next(&mut self) -> Option<Played> {
        self.news.recv().await
    }
}

/// Begins to play.
pub(crate) fn begin(world: &Arc<World>, text: &str) -> Result<Playing, PlayError> {
    let scenario = Scenario::parse(text, world.rig()).map_err(PlayError::Mistake)?;
    let name = scenario.name.clone();
    let began = world.clock().now();
    let shared =
        Arc::new(Shared { player: Mutex::new(Player::live(scenario, began)), changed: Notify::new() });
    if !world.begin_play(Box::new(Part(Arc::clone(&shared)))) {
        return Err(PlayError::Busy(world.playing().unwrap_or_default()));
    }
    let (teller, news) = mpsc::unbounded_channel();
    tokio::spawn(keep_playing(Stage(Arc::clone(world)), shared, teller));
    Ok(Playing { name, began, news })
}

/// The player, shared by the world, which brings its groups forward with it, and the task that tells what happens.
struct Shared {
    player: Mutex<Player>,
    /// Rung when something has happened to a step.
    changed: Notify,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Player> {
        self.player.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// What the world has of it.
struct Part(Arc<Shared>);

impl Play for Part {
    fn advance(&mut self, world: &World, groups: &mut [&mut Group], to: Instant, budget: &mut u32) {
        let mut player = self.0.lock();
        player.go_on(world, groups, to, budget);
        if player.has_news() {
            self.0.changed.notify_one();
        }
        if player.is_over() {
            for group in groups.iter_mut() {
                group.advance(to, budget);
            }
        }
    }

    fn name(&self) -> String {
        self.0.lock().scenario().name().to_owned()
    }
}

/// The world while something is being played in it.
struct Stage(Arc<World>);

impl Drop for Stage {
    fn drop(&mut self) {
        self.0.end_play();
    }
}

/// Sees to it that a scenario goes on though nobody looks, and tells what happens.
async fn keep_playing(stage: Stage, shared: Arc<Shared>, teller: mpsc::UnboundedSender<Played>) {
    while !teller.is_closed() {
        stage.0.visit_all(|_| ());
        let (news, report, due, watches) = {
            let mut player = shared.lock();
            let report = player.is_over().then(|| player.report());
            (player.take_events(), report, player.next_due(), player.watches())
        };
        for event in news {
            // Whether anybody listens is seen above.
            let _ = teller.send(Played::Step(event));
        }
        if let Some(report) = report {
            // Who hears that it is over may begin another.
            drop(stage);
            let _ = teller.send(Played::Over(report));
            return;
        }
        tokio::select! {
            () = teller.closed() => {}
            () = shared.changed.notified() => {}
            () = stage.0.clock().sleep_until(due) => {}
            () = look_again(&stage.0, watches) => {}
        }
    }
}

/// Waits until it is time to look again; while rig time stands there is nothing to see.
async fn look_again(world: &World, watches: bool) {
    if !watches {
        return std::future::pending().await;
    }
    let now = world.clock().now();
    tokio::time::sleep(LOOK).await;
    world.clock().sleep_until(Some(now + Duration::from_nanos(1))).await;
}

impl fmt::Debug for Shared {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Shared").finish_non_exhaustive()
    }
}
