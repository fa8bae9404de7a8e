//! `stepdrive up` and `stepdrive example-rig`, as a person, a script or a power cut uses them.
#![cfg(unix)]

mod bench;
mod disk;
mod failures;
mod kill;
mod plain;
mod running;
mod usb;
