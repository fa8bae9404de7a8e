//! The behaviour of the controllers: state machines, registers, inputs, memory, faults.
//!
//! A controller here is an object without I/O and without a clock. Requests, input signals and the time go in; replies
//! and the positions of the rotor come out; and it can say when it next wants to be woken. It knows neither bytes nor
//! connections: `stepdrive-proto` speaks for it, and a [`smsd::Session`] stands for whoever asks.
//!
//! `no_std`, allocates nothing.
#![no_std]

pub mod controller;
pub mod smd3;
pub mod smsd;
