//! The bench of the standard protocol by itself, for the tests of what stands on the driver.

#[path = "../smsd/common/mod.rs"]
pub(crate) mod common;
#[path = "standard_bench.rs"]
mod standard_bench;

pub(crate) use standard_bench::{Act, Bench};
