//! Controlling a running rig over HTTP.

mod bench;
mod bodies;
mod change;
mod clock;
mod events;
mod guard;
mod hostile;
mod look;
mod play;
