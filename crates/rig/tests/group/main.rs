//! Groups: drives joined by wires, and the world around them under control.

#![allow(clippy::float_cmp, reason = "flags are 0 and 1, and places whole microsteps, exactly")]

mod actions;
mod bench;
mod courses;
mod faults;
mod in_step;
mod properties;
mod wires;
