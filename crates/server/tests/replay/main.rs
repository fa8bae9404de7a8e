//! What a served rig records, replayed: real sockets, real files.
//!
//! [`bench`] holds what the tests are written with, [`session`] the session that most of them replay.

mod bench;
mod broken;
mod endings;
mod identical;
mod session;
mod usb;
