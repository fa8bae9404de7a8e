//! Proof that the cores stand without `std`.
//!
//! This crate brings the panic handler that a program without `std` needs, and uses all the cores. `std` has a panic
//! handler of its own; where one of the cores, or anything they depend on, pulls it in, there are two, and the compiler
//! refuses: ``found duplicate lang item `panic_impl` ``.
#![no_std]

use core::panic::PanicInfo;
use stepdrive_drive as _;
use stepdrive_motion as _;
use stepdrive_proto as _;
use stepdrive_rig as _;
use stepdrive_spec as _;

/// Never runs: it is here to clash with that of `std`.
#[panic_handler]
fn stand_still(_: &PanicInfo<'_>) -> ! {
    loop {}
}
