//! The bench of Modbus by itself, for the tests of what stands on the driver.

#[path = "common/mod.rs"]
pub(crate) mod common;
#[path = "modbus_bench.rs"]
mod modbus_bench;

pub(crate) use modbus_bench::Bench;
