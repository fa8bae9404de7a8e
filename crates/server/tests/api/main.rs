//! Controlling a running rig over HTTP.

mod bench;
mod bodies;
mod change;
mod clock;
mod connector;
mod events;
mod guard;
mod hostile;
mod look;
mod mechanism;
mod modbus;
mod play;
mod traffic;
