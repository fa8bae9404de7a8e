//! The behaviour that all axes share, of an SMSD over its USB port.

// The bench of the driver's own tests; not all that it can do is needed here.
#[allow(dead_code, reason = "a bench of other tests")]
#[path = "../smsd_usb/bench.rs"]
mod bench;
#[allow(dead_code, reason = "a bench of other tests")]
#[path = "../smsd_usb/link.rs"]
mod link;
#[path = "../axis/programs.rs"]
mod programs;
#[path = "../axis/stage.rs"]
mod stage;
#[path = "../axis/stopping.rs"]
mod stopping;
#[path = "../axis/suite.rs"]
mod suite;

mod only_usb;
mod usb;

suite::hold!(smsd_usb to crate::usb::UsbStage);
stopping::hold!(smsd_usb_stopping to crate::usb::UsbStage);
programs::hold!(smsd_usb_programs to crate::usb::UsbStage);
