//! The panel over virtual controllers, on virtual time: its API, and what reaches the controllers.

// The benches of the drivers' own tests; not all that they can do is needed here.
#[allow(dead_code, reason = "a bench of other tests")]
#[path = "../../../host/tests/smsd/bench.rs"]
mod bench;
#[allow(dead_code, reason = "a bench of other tests")]
#[path = "../../../host/tests/smsd/link.rs"]
mod link;
#[allow(dead_code, reason = "a bench of other tests")]
#[path = "../../../host/tests/smd3/station.rs"]
mod station;

mod jog;
mod motion;
mod page;
mod programs;
mod settings;
mod stage;
mod stopping;
mod told;
mod watching;
