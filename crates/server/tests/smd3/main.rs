//! SMD3s as they are served: real ports, real sockets, real files.
//!
//! [`bench`] holds what the tests are written with. The rest is sorted by what it is about.
#![cfg(target_os = "linux")]

mod bench;
mod flash;
mod lines;
mod many;
mod port;
mod tcp;
