//! An axis in a program without `async`: go there and back, and let the motor go.
//!
//! `stepdrive up` in one terminal, and in another:
//! `cargo run -p stepdrive-host --example blocking -- 127.0.0.1:5020`

use stepdrive_host::Error;
use stepdrive_host::axis::{DriveAxis, MoveOptions, SmsdMotor, Stop};
use stepdrive_host::blocking::Blocking;
use stepdrive_host::smsd::{SmsdClient, SmsdOptions};
use stepdrive_host::units::{Amount, Scale};
use stepdrive_host::uri::Target;
use stepdrive_spec::smsd::registers::Reg;

fn main() -> Result<(), Error> {
    let target = std::env::args().nth(1).unwrap_or_else(|| "127.0.0.1:5020".to_owned());
    run(&target)
}

/// Moves an axis there and back.
pub(crate) fn run(target: &str) -> Result<(), Error> {
    let target = Target::parse(target)?;
    // The factory's password; another is `SmsdOptions { password: 0x0123_4567_89AB_CDEF, .. }`.
    let client = SmsdClient::new(target.connect(), SmsdOptions::default());
    let axis = Blocking::new(DriveAxis::new(SmsdMotor::new("axis", client)).with_scale(Scale::turns(200)?))?;

    // Anything that only the asynchronous driver has is run.
    let speed = axis.run(|axis| axis.motor().client().read(Reg::MaxSpeed))?;
    println!("MAX_SPEED is {speed} full steps/s");

    // Where nobody has set zero, a move by a distance is all that makes sense.
    for distance in ["1 turn", "-1 turn"] {
        let plan = axis.move_by(Amount::parse(distance)?, MoveOptions::default())?;
        println!("{distance}: from {} to {}", plan.from, plan.to);
    }
    axis.stop(Stop::Free)?;
    println!("at {}, {}", axis.position()?, axis.state()?.trust);
    Ok(())
}
