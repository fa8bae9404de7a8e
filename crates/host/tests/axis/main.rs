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
mod programs;
mod stage;
mod stopping;
mod suite;

suite::hold!(smd3 to crate::families::Smd3Stage);
suite::hold!(smsd to crate::families::SmsdStage);
stopping::hold!(smd3_stopping to crate::families::Smd3Stage);
stopping::hold!(smsd_stopping to crate::families::SmsdStage);
programs::hold!(smsd_programs to crate::families::SmsdStage);
