//! HTTP as the rig's control API and the panel both serve it: JSON, server-sent events, and who may ask at all.
//!
//! * [`Route`] is a row of a table of what there is; [`Site`] puts routes behind a [`Guard`], and answers for all that is
//!   not there.
//! * [`Listener`] serves a site, and bears with clients that do not behave.
//! * [`Asked`], [`Named`] and [`Query`] are what clients send; [`Reply`] and [`Problem`] what they are answered.
//! * [`stream`] answers with [`event`]s, to as many as [`Places`] has room for.
//!
//! No controller is known here.

mod ask;
mod events;
mod guard;
mod listener;
mod patient;
mod problem;
mod query;
mod reply;
mod site;

pub use ask::{Asked, Named};
pub use events::{Place, Places, QUIET, STILL_HERE, event, stream};
pub use guard::Guard;
pub use listener::Listener;
pub use problem::Problem;
pub use query::Query;
pub use reply::{JSON, Reply};
pub use site::{Route, Site, described, route, router};
