//! The world around the controllers, still without I/O: motors, mechanics, switches.
//!
//! A [`machine::Machine`] is a controller with what hangs on it. It is driven like the controller itself, by requests
//! and by time, and makes the two meet: the rotor moves the mechanics, the mechanics close the switches, the switches
//! signal to the controller, each at the exact instant. A rig is a set of machines, described by a [`file::RigFile`].
//!
//! `no_std`; allocates when a rig is read and built, and not while it runs.
#![no_std]

extern crate alloc;

pub mod action;
pub mod any;
pub mod condition;
pub mod contacts;
pub mod course;
pub mod duration;
pub mod fault;
pub mod file;
pub mod group;
pub mod line;
pub mod machine;
pub mod mechanics;
pub mod names;
pub mod pulses;
pub mod simulation;
