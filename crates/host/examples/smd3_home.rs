//! A vacuum drive on an SMD3: set its limits up, home it, move it, and store the settings.
//!
//! `stepdrive up` in one terminal, which tells the serial port, and in another:
//! `cargo run -p stepdrive-host --example smd3_home -- smd3+serial:///dev/ttyACM0`

use stepdrive_host::axis::{Axis, DriveAxis, MoveOptions, Smd3Motor};
use stepdrive_host::smd3::Smd3Client;
use stepdrive_host::units::{Amount, Scale, Speed};
use stepdrive_host::uri::Target;
use stepdrive_host::{Direction, Error, Timeouts};
use stepdrive_spec::smd3::commands::{Command, Value};

#[tokio::main(flavor = "current_thread")]
async fn main() -> Result<(), Error> {
    let target = std::env::args().nth(1).unwrap_or_else(|| "/dev/ttyACM0".to_owned());
    run(&target).await
}

/// Sets the drive up, homes it and moves it.
pub(crate) async fn run(target: &str) -> Result<(), Error> {
    let client = Smd3Client::new(Target::parse(target)?.connect(), Timeouts::default());
    println!("SMD3 {}, firmware {}", client.serial_number().await?, client.firmware().await?);

    // Both limit inputs are in use; meeting one stops the motor at once.
    for (command, value) in [(Command::L, true), (Command::LMinus, true), (Command::LPlus, true)] {
        client.set(command, Value::Bool(value)).await?;
    }
    // The drive answers with the nearest that it can.
    let speed = client.set(Command::Vmax, Value::Float(1000.0)).await?;
    println!("VMAX is {speed:?}");
    client.store().await?;

    let axis = DriveAxis::new(Smd3Motor::new(client)).with_scale(Scale::turns(200)?);
    axis.home(Direction::Negative, MoveOptions::default()).await?;
    println!("home");
    let gently = MoveOptions { speed: Some(Speed::parse("2 turns/s")?), ..MoveOptions::default() };
    axis.move_to(Amount::parse("3 turns")?, gently).await?;

    let state = axis.state().await?;
    println!("{} is at {}, {}", axis.name(), state.position, state.trust);
    // The client is still there for what is the SMD3's own.
    println!("its motor is at {} °C", axis.motor().client().get_number(Command::Tmot).await?);
    Ok(())
}
