//! The panel: axes seen and driven from a browser.
//!
//! [`Panel`] is given opened axes, real or virtual, and makes of them a page and the HTTP API behind it
//! (`api/openapi.json`). It knows no server and no rig: every axis is reached through its driver of `stepdrive_host`.
//!
//! | module | |
//! |---|---|
//! | `member` | one axis of the panel, and what is under way on it |
//! | `hub` | looks at the axes, while somebody watches |
//! | `events` | tells those who watch what has changed |
//! | `jog` | a motion that lasts for as long as somebody says so: the dead man's timer |
//! | `motion` | moves, homing, zero, faults |
//! | `quantity` | positions, distances and speeds as they are sent |
//! | `stopping` | stops, told until they get through |
//! | `settings` | settings from the tables, checked, applied and read back |
//! | `programs` | programs checked, simulated, stored, started |
//! | `assets` | the page |
//!
//! Nothing here moves an axis but what a client asks for, and nothing is asked of a controller while nobody watches.

mod api;
mod assets;
mod bake;
mod events;
mod flags;
mod hub;
mod jog;
mod look;
mod member;
mod motion;
mod notices;
mod programs;
mod quantity;
mod settings;
mod stopping;

use axum::Router;
use hub::Hub;
use member::Member;
use notices::Notices;
use std::fmt;
use std::sync::Arc;
use std::time::Duration;
use stepdrive_host::axis::{Axis, DriveAxis, Smd3Motor, SmsdMotor};
use stepdrive_host::trust::TrustState;
use stepdrive_rig::file::DriveSection;
use tokio::time::{Instant, timeout};

/// How long [`Panel::close`] waits for stops to be sent.
const CLOSING: Duration = Duration::from_secs(2);

/// What turns an axis.
#[derive(Clone, Debug)]
pub enum Controller {
    /// An SMSD, over whatever line.
    Smsd(Arc<DriveAxis<SmsdMotor>>),
    /// An SMD3.
    Smd3(Arc<DriveAxis<Smd3Motor>>),
}

impl Controller {
    /// What both families can do.
    pub fn axis(&self) -> &dyn Axis {
        match self {
            Controller::Smsd(axis) => axis.as_ref(),
            Controller::Smd3(axis) => axis.as_ref(),
        }
    }
}

/// Why the trust in a position is to be remembered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kept {
    /// The axis was looked at: it may be believed less than before, and never more.
    Looked,
    /// Something is done with it from here.
    Acted,
    /// Its zero was set: nothing that was known before counts.
    Zeroed,
}

/// What remembers how far the position of an axis can be believed, as from one run of a program to the next.
pub trait Keeper: Send + Sync {
    /// This is the trust in its position now. Called after every look; what has not changed need not be kept again.
    fn keep(&self, trust: TrustState, why: Kept);

    /// What another program has remembered since this was last asked, if one has.
    fn news(&self) -> Option<TrustState>;
}

/// An axis of a panel.
pub struct PanelAxis {
    /// What it is called, unlike all others.
    pub name: String,
    /// Whether it is simulated. It is shown; nothing else depends on it.
    pub is_virtual: bool,
    /// Where its controller is, for people: `smsd+tcp://192.168.1.2:502?unit=1`.
    pub target: String,
    /// What turns it.
    pub controller: Controller,
    /// What remembers the trust in its position; `None` when nothing does.
    pub keeper: Option<Box<dyn Keeper>>,
    /// How its controller, motor and mechanics are simulated where a program is tried out for it; as in the demo rig when
    /// `None`.
    pub simulated_as: Option<DriveSection>,
}

impl fmt::Debug for PanelAxis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("PanelAxis")
            .field("name", &self.name)
            .field("target", &self.target)
            .finish_non_exhaustive()
    }
}

/// What the parts of a panel share.
struct Shared {
    began: Instant,
    members: Vec<Arc<Member>>,
    hub: Arc<Hub>,
    notices: Notices,
    viewers: events::Viewers,
}

impl Shared {
    /// The axis of a name; case matters only where two differ in nothing else.
    fn find(&self, name: &str) -> Option<&Arc<Member>> {
        let mut alike = self.members.iter().filter(|member| member.name().eq_ignore_ascii_case(name));
        let exact = self.members.iter().find(|member| member.name() == name);
        exact.or_else(|| alike.next().filter(|_| alike.next().is_none()))
    }

    /// Milliseconds since the panel began.
    fn millis(&self, at: Instant) -> u64 {
        u64::try_from(at.saturating_duration_since(self.began).as_millis()).unwrap_or(u64::MAX)
    }
}

/// A panel over axes. It is cheap to clone; clones are the same panel.
#[derive(Clone)]
pub struct Panel(Arc<Shared>);

impl Panel {
    /// A panel over these axes, in this order. Nothing is opened or asked yet.
    ///
    /// To be called, and its router to be used, in a runtime of tokio with its timer.
    pub fn new(axes: Vec<PanelAxis>) -> Panel {
        let began = Instant::now();
        let notices = Notices::new();
        let members =
            axes.into_iter().enumerate().map(|(index, axis)| Member::new(index, axis, notices.clone()));
        let members: Vec<Arc<Member>> = members.map(Arc::new).collect();
        let hub = Arc::new(Hub::new(began, members.clone()));
        Panel(Arc::new(Shared { began, members, hub, notices, viewers: events::Viewers::default() }))
    }

    /// The page and its API. Who may ask is for whoever serves it to see to: `stepdrive_web` has a guard for that.
    pub fn router(&self) -> Router {
        assets::router().merge(self.api())
    }

    /// The API alone, for whoever has another page.
    pub fn api(&self) -> Router {
        api::router(&self.0)
    }

    /// Ends all jogs, and waits until all stops have been sent, or 2 s. To be called before the program ends.
    pub async fn close(&self) {
        let stopped = async {
            for member in &self.0.members {
                jog::release(member);
            }
            for member in &self.0.members {
                jog::finished(member).await;
                stopping::finished(member).await;
            }
        };
        // Who does not answer within the time cannot be stopped from here.
        let _ = timeout(CLOSING, stopped).await;
    }
}

impl fmt::Debug for Panel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names: Vec<&str> = self.0.members.iter().map(|member| member.name()).collect();
        f.debug_struct("Panel").field("axes", &names).finish_non_exhaustive()
    }
}
