//! `stepdrive bake`.

use super::attend::Interrupts;
use super::progress::Progress;
use super::{AxisArgs, Client, Opened, act_on, some_time};
use crate::Failure;
use crate::terminal::{print, print_json};
use serde_json::json;
use std::time::Duration;
use stepdrive_host::Error;
use stepdrive_host::smd3::Smd3Client;
use stepdrive_spec::smd3::commands::Command;
use stepdrive_spec::smd3::flags::{ERROR_FLAGS, StatusFlag};
use tokio::time::Instant;

/// How often the temperature is read.
const LOOK: Duration = Duration::from_millis(250);

/// Baking a motor.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  stepdrive bake -a uhv 150
  stepdrive bake -a uhv 150°C --for 8h
  stepdrive bake -a uhv off

  $ stepdrive bake -a uhv 150 --for 8h
  uhv was baked for 8h and is at 149.8 °C

An SMD3 warms its motor through the phases. With --for the time counts from when bake begins; when it is over, and on Ctrl-C,
bake ends and the drive is back in mode Remote. Without --for the command returns at once, and `bake off` ends it.")]
pub(crate) struct BakeArgs {
    #[command(flatten)]
    axis: AxisArgs,
    /// The temperature to keep, °C; or off.
    #[arg(value_name = "TEMP|off", value_parser = temperature)]
    setpoint: Setpoint,
    /// How long.
    #[arg(long = "for", value_name = "DURATION", value_parser = some_time)]
    duration: Option<Duration>,
}

/// What is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Setpoint {
    Off,
    Celsius(u16),
}

fn temperature(text: &str) -> Result<Setpoint, String> {
    if text.eq_ignore_ascii_case("off") {
        return Ok(Setpoint::Off);
    }
    let number = text.trim_end_matches('C').trim_end_matches('°').trim_end();
    let celsius = number.parse().map(Setpoint::Celsius);
    celsius.map_err(|_| "a temperature is a whole number of °C, as in 150".to_owned())
}

/// Bakes a motor.
pub(crate) fn bake(args: &BakeArgs) -> Result<(), Failure> {
    act_on(&args.axis, async |opened| {
        let Client::Smd3(client) = opened.client() else {
            return Err(Failure::Host(Error::Usage(format!(
                "{} is an SMSD, which cannot bake its motor; an SMD3 can; nothing was sent",
                opened.name()
            ))));
        };
        match (args.setpoint, args.duration) {
            (Setpoint::Off, None) => {
                client.end_bake().await?;
                told(opened, client, "was told to end bake", false, args).await
            }
            (Setpoint::Off, Some(_)) => Err(Failure::Usage(
                "--for says how long to bake, and `off` ends it; leave one of the two out".to_owned(),
            )),
            (Setpoint::Celsius(celsius), None) => {
                client.start_bake(celsius).await?;
                told(opened, client, &format!("bakes towards {celsius} °C"), true, args).await
            }
            (Setpoint::Celsius(celsius), Some(duration)) => {
                bake_for(opened, client, celsius, duration).await?;
                let shown = stepdrive_rig::duration::display(duration);
                told(opened, client, &format!("was baked for {shown}"), false, args).await
            }
        }
    })
}

/// Bakes for a while.
async fn bake_for(
    opened: &Opened,
    client: &Smd3Client,
    celsius: u16,
    duration: Duration,
) -> Result<(), Failure> {
    let mut interrupts = Interrupts::catch()?;
    client.start_bake(celsius).await?;
    let began = Instant::now();
    let kept = tokio::select! {
        kept = keep(opened, client, began, duration) => Some(kept),
        () = interrupts.next() => None,
    };
    let ended = client.end_bake().await;
    let Some(kept) = kept else {
        ended?;
        return Err(Failure::Failed(format!(
            "bake of {} was ended on Ctrl-C, after {} s",
            opened.name(),
            began.elapsed().as_secs()
        )));
    };
    kept?;
    Ok(ended?)
}

/// Watches that bake goes on.
async fn keep(opened: &Opened, client: &Smd3Client, began: Instant, duration: Duration) -> Result<(), Error> {
    let mut progress = Progress::new(format!("baking {}", opened.name()));
    loop {
        let gone = began.elapsed();
        if gone >= duration {
            return Ok(());
        }
        let flags = client.flags().await?;
        if !StatusFlag::Bake.is_in(flags.status) {
            let why = ERROR_FLAGS.iter().filter(|flag| flag.is_in(flags.error)).map(|flag| flag.name);
            let why = why.collect::<Vec<&str>>().join(", ");
            return Err(ended_early(opened, gone, &why));
        }
        progress.show(thousandths(gone, duration), 1000);
        tokio::time::sleep(LOOK.min(duration.saturating_sub(gone))).await;
    }
}

fn ended_early(opened: &Opened, gone: Duration, faults: &str) -> Error {
    let head = format!("bake of {} ended after {} s", opened.name(), gone.as_secs());
    if faults.is_empty() {
        return Error::Refused(format!("{head}: somebody or something stopped it"));
    }
    Error::Fault(format!("{head}: {faults}; remove the cause and clear it with `stepdrive clear`"))
}

fn thousandths(part: Duration, whole: Duration) -> usize {
    let share = 1000 * part.as_millis() / whole.as_millis().max(1);
    usize::try_from(share).unwrap_or(1000)
}

/// Says how it stands.
async fn told(
    opened: &Opened,
    client: &Smd3Client,
    what: &str,
    baking: bool,
    args: &BakeArgs,
) -> Result<(), Failure> {
    let (setpoint, now) = (client.get_number(Command::Baket).await?, client.get_number(Command::Tmot).await?);
    if args.axis.reach.json {
        return print_json(&json!({
            "axis": opened.name(), "baking": baking, "setpoint_c": setpoint, "temperature_c": now,
        }));
    }
    print(&format!("{} {what} and is at {now} °C\n", opened.name()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_temperature_is_whole_degrees_with_or_without_their_sign() {
        for text in ["150", "150C", "150°C", "150 °C"] {
            assert_eq!(temperature(text), Ok(Setpoint::Celsius(150)), "{text}");
        }
        assert_eq!(temperature("off"), Ok(Setpoint::Off));
        for text in ["", "hot", "-5", "150.5", "150F", "70000"] {
            assert!(temperature(text).is_err(), "{text}");
        }
    }
}
