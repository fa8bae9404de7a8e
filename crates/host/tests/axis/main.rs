//! One behaviour of an axis, held to over both families against the virtual controllers, on virtual time.

// The benches of the drivers' own tests; not all that they can do is needed here.
#[allow(dead_code, reason = "a bench of other tests")]
#[path = "../smsd/bench.rs"]
mod bench;
#[allow(dead_code, reason = "a bench of other tests")]
#[path = "../smsd/link.rs"]
mod link;
#[allow(dead_code, reason = "a bench of other tests")]
#[path = "../smd3/station.rs"]
mod station;

mod families;
mod only_smd3;
mod only_smsd;
mod stage;
mod suite;

suite::hold!(smd3 to crate::families::Smd3Stage);
suite::hold!(smsd to crate::families::SmsdStage);
