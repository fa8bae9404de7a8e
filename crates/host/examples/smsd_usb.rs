//! What an SMSD at a USB port is, how it stands and what it has counted.
//!
//! `cargo run -p stepdrive-host --example smsd_usb -- /dev/ttyACM0`

use stepdrive_host::smsd::{Framing, Smsd, SmsdOptions, SmsdUsbClient};
use stepdrive_host::{Error, Serial};
use stepdrive_spec::smsd::standard::COUNTER_ROWS;

#[tokio::main(flavor = "current_thread")]
async fn main() -> Result<(), Error> {
    let port = std::env::args().nth(1).unwrap_or_else(|| "/dev/ttyACM0".to_owned());
    run(&port).await
}

/// Asks the controller at a port, and changes nothing.
pub(crate) async fn run(port: &str) -> Result<(), Error> {
    let stage = SmsdUsbClient::new(Serial::new(port), Framing::Stuffed, SmsdOptions::default());
    println!("{}", stage.identity().await?);
    println!("{}", stage.snapshot().await?);
    let counters = stage.error_counters().await?;
    for ((_, name, about), count) in COUNTER_ROWS.iter().zip(counters) {
        println!("{count:>10}  {name}: {}", about.trim_start());
    }
    Ok(())
}
