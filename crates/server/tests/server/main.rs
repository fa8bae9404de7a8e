//! The server from outside: real sockets, real files.
//!
//! [`bench`] holds what the tests are written with. The rest is sorted by what goes wrong.

mod awkward;
mod bench;
mod connections;
mod damage;
mod hostile;
mod many;
mod memory;
mod network;
