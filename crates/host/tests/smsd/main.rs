//! The drivers of the SMSD against the virtual controller, over a link in memory that can be made to fail, on virtual time:
//! what they all promise, held to over every line, and what is of one line only.

mod common;
mod line;
mod modbus_bench;
mod only_modbus;
#[path = "../smsd_usb/only_usb/mod.rs"]
mod only_usb;
#[path = "../smsd_usb/standard_bench.rs"]
mod standard_bench;
mod suite;

suite::hold!(modbus to crate::only_modbus::line::ModbusTcp);
suite::hold!(usb to crate::only_usb::line::Usb);
suite::hold!(lan to crate::only_usb::line::Lan);
