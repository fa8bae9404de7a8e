//! The motor of an SMD3.

use super::Stop;
use super::motor::{Fault, Look, Motion, Motor, Order, Profile, Setup};
use super::speed;
use super::stops::Leave;
use super::wait::Pace;
use crate::connect::BoxFuture;
use crate::direction::Direction;
use crate::error::Error;
use crate::smd3::{Smd3Client, Smd3Status};
use crate::trust::Continuity;
use std::time::Duration;
use stepdrive_spec::smd3::commands::{Command, FARTHEST, Mode, Request, Value};
use stepdrive_spec::smd3::flags::{ERROR_FLAGS, FlagBits, StatusFlag};

/// What `PREL` is ahead of `PACT` from the moment zero was set, in full steps. At power-up, and when another host homes, both
/// are 0: so whether the drive has counted since can be seen in it.
const MARK: f64 = 100_000.0;

/// A position that one command can be sent to, in full steps either way.
#[allow(clippy::cast_possible_truncation, reason = "2^23 - 1")]
const REACH: i64 = FARTHEST as i64;

/// How long the motor is waited for after it was told to stop.
const STOPPING: Duration = Duration::from_mins(1);

/// The motor of an SMD3.
///
/// Motion wants mode Remote. Where the drive is in mode Home, in which homing leaves it when it is given up half-way, a
/// motion brings it back; where somebody has chosen another mode, motion is refused.
///
/// Homing and taking a place as zero set `PREL` 100 000 full steps ahead of `PACT`, so that it is seen when the drive has
/// started over; see [`Smd3Motor::keeping_prel`].
#[derive(Debug)]
pub struct Smd3Motor {
    client: Smd3Client,
    keep_prel: bool,
}

impl Smd3Motor {
    /// The motor of a drive.
    pub fn new(client: Smd3Client) -> Smd3Motor {
        Smd3Motor { client, keep_prel: false }
    }

    /// The same, which leaves `PREL` alone. That the drive has started over is then seen by `PACT` alone; after a loss of the
    /// line at position 0 it cannot be told, and the position is suspect.
    #[must_use]
    pub fn keeping_prel(self) -> Smd3Motor {
        Smd3Motor { keep_prel: true, ..self }
    }

    /// The drive.
    pub fn client(&self) -> &Smd3Client {
        &self.client
    }

    async fn set_up(&self) -> Result<Setup, Error> {
        let profile = Profile {
            start: self.client.get_number(Command::Vstart).await?,
            stop: self.client.get_number(Command::Vstop).await?,
            max: self.client.get_number(Command::Vmax).await?,
            acceleration: self.client.get_number(Command::Amax).await?,
            deceleration: self.client.get_number(Command::Dmax).await?,
        };
        Ok(Setup { profile, parts: 1, range: (-REACH, REACH), reach: REACH, supposed: None })
    }

    /// The requests for an order, the last of them the one that starts it.
    async fn requests(&self, order: Order) -> Result<Vec<Request>, Error> {
        let mode = self.client.mode().await?;
        let speed = order.speed.map(|speed| set(Command::Vmax, Value::Float(speed)));
        let back = match mode {
            Mode::Remote => None,
            Mode::Home => Some(set(Command::Mode, Value::Uint(Mode::Remote.number().into()))),
            Mode::StepDirection | Mode::TriggeredVelocity | Mode::Joystick | Mode::Bake => {
                return Err(Error::Refused(format!(
                    "{} is in mode {} ({}), in which commands do not move the motor; set MODE {} first; nothing was sent",
                    self.client.name(),
                    mode.number(),
                    mode.name(),
                    Mode::Remote.number()
                )));
            }
        };
        Ok(back.into_iter().chain(speed).chain([starting(order.motion)]).collect())
    }

    async fn get_ready(&self, order: Order) -> Result<(), Error> {
        let requests = self.requests(order).await?;
        let Some((_, before)) = requests.split_last() else { return Ok(()) };
        for Request { command, argument } in before {
            if let Some(value) = argument {
                self.client.set(*command, *value).await?;
            }
        }
        Ok(())
    }

    async fn stop_as(&self, how: Stop) -> Result<(), Error> {
        match how {
            Stop::Soft => self.client.stop().await,
            Stop::Hard => self.client.estop().await,
            Stop::Free => {
                self.client.stop().await?;
                self.until_standby(Some(STOPPING)).await?;
                self.client.estop().await
            }
        }
    }

    /// Waits for standby. `None` when it does not come in time.
    async fn until_standby(&self, timeout: Option<Duration>) -> Result<Option<Smd3Status>, Error> {
        let mut pace = Pace::new(timeout, None);
        loop {
            let status = self.client.status().await?;
            if status.standby() {
                return Ok(Some(status));
            }
            if !pace.pause().await {
                return Ok(None);
            }
        }
    }

    async fn find_home(
        &self,
        direction: Direction,
        speed: Option<f64>,
        timeout: Option<Duration>,
        leave: Leave<'_>,
    ) -> Result<(), Error> {
        // The mode that others have chosen is theirs.
        let order = Order { motion: Motion::Run(direction), speed };
        self.get_ready(order).await?;
        self.client.set_mode(Mode::Home).await?;
        let found = self.seek(direction, timeout, leave).await;
        // Whatever became of it, the next motion is to find the drive as it was. What the search failed of counts more.
        let back = self.go_remote().await;
        found.and(back)
    }

    /// Goes back to mode Remote, which wants a motor that stands.
    async fn go_remote(&self) -> Result<(), Error> {
        self.until_standby(Some(STOPPING)).await?;
        self.client.set_mode(Mode::Remote).await
    }

    async fn seek(
        &self,
        direction: Direction,
        timeout: Option<Duration>,
        leave: Leave<'_>,
    ) -> Result<(), Error> {
        leave.act(self, self.client.runh(direction)).await?;
        let status = self.until_standby(timeout).await?;
        leave.check()?;
        let Some(status) = status else {
            leave.act(self, self.client.stop()).await?;
            self.until_standby(Some(STOPPING)).await?;
            return Err(Error::Device(format!(
                "{} did not find {} within {:?}; the motor was stopped",
                self.client.name(),
                limit_name(direction),
                timeout.unwrap_or_default()
            )));
        };
        if status.flags.error != 0 {
            let names: Vec<_> = faults(status.flags.error).map(|fault| fault.name).collect();
            return Err(Error::Fault(format!(
                "{} was disabled while it homed: {}",
                self.client.name(),
                names.join(", ")
            )));
        }
        if !limit(direction).is_in(status.flags.status) {
            return Err(Error::Refused(format!(
                "{} stopped at PACT {} without having found {}; home again, or look at the switch and its polarity",
                self.client.name(),
                status.position,
                limit_name(direction)
            )));
        }
        // The drive has done so by itself (decision 31); it is not known of every firmware.
        self.client.set(Command::Pact, Value::Float(0.0)).await.map(|_| ())
    }

    async fn kept(&self, place: Option<f64>, look: &Look) -> Result<Continuity, Error> {
        if self.keep_prel {
            return Ok(match place {
                Some(place) if (place - look.position).abs() > 2.0 * look.within => Continuity::Unclear,
                Some(0.0) => Continuity::Unclear,
                Some(_) | None => Continuity::Kept,
            });
        }
        let relative = self.client.get_number(Command::Prel).await?;
        // Between the two readings it may have gone some way, and both counters turn over.
        let ahead = (relative - look.position).rem_euclid(2.0 * (FARTHEST + 1.0));
        Ok(if (ahead - MARK).abs() < MARK / 2.0 { Continuity::Kept } else { Continuity::Broken })
    }
}

impl Motor for Smd3Motor {
    fn name(&self) -> &str {
        self.client.name()
    }

    fn upsets(&self) -> BoxFuture<'_, u64> {
        Box::pin(async { self.client.upsets() })
    }

    fn look(&self) -> BoxFuture<'_, Result<Look, Error>> {
        Box::pin(async {
            let status = self.client.status().await?;
            Ok(Look {
                position: status.position,
                speed: status.velocity,
                moving: !status.standby(),
                energised: status.flags.error == 0,
                faults: faults(status.flags.error).collect(),
                limit_negative: StatusFlag::LimitNegative.is_in(status.flags.status),
                limit_positive: StatusFlag::LimitPositive.is_in(status.flags.status),
                within: shown_within(status.position),
            })
        })
    }

    fn setup(&self) -> BoxFuture<'_, Result<Setup, Error>> {
        Box::pin(self.set_up())
    }

    fn check_speed(&self, speed: f64) -> Result<(), Error> {
        let row = Command::Vmax.info();
        if (row.min..=row.max).contains(&speed) {
            return Ok(());
        }
        Err(speed::refused(row.mnemonic, speed, row.min, row.max, row.unit))
    }

    fn sent_for(&self, order: Order) -> BoxFuture<'_, Result<Vec<String>, Error>> {
        Box::pin(async move { self.requests(order).await?.iter().map(Smd3Client::line_of).collect() })
    }

    fn prepare(&self, order: Order) -> BoxFuture<'_, Result<(), Error>> {
        Box::pin(self.get_ready(order))
    }

    fn start(&self, order: Order) -> BoxFuture<'_, Result<(), Error>> {
        Box::pin(async move { self.client.request(starting(order.motion)).await.map(|_| ()) })
    }

    fn stop(&self, how: Stop) -> BoxFuture<'_, Result<(), Error>> {
        Box::pin(self.stop_as(how))
    }

    fn home<'a>(
        &'a self,
        direction: Direction,
        speed: Option<f64>,
        timeout: Option<Duration>,
        leave: Leave<'a>,
    ) -> BoxFuture<'a, Result<(), Error>> {
        Box::pin(self.find_home(direction, speed, timeout, leave))
    }

    fn zero(&self) -> BoxFuture<'_, Result<(), Error>> {
        Box::pin(async { self.client.set(Command::Pact, Value::Float(0.0)).await.map(|_| ()) })
    }

    fn mark(&self) -> BoxFuture<'_, Result<(), Error>> {
        Box::pin(async {
            if self.keep_prel {
                return Ok(());
            }
            self.client.set(Command::Prel, Value::Float(MARK)).await.map(|_| ())
        })
    }

    fn continuity<'a>(
        &'a self,
        place: Option<f64>,
        look: &'a Look,
    ) -> BoxFuture<'a, Result<Continuity, Error>> {
        Box::pin(self.kept(place, look))
    }

    fn clear_faults(&self) -> BoxFuture<'_, Result<(), Error>> {
        Box::pin(async { self.client.clr().await.map(|_| ()) })
    }
}

fn set(command: Command, value: Value) -> Request {
    Request { command, argument: Some(value) }
}

/// The request that starts a motion.
fn starting(motion: Motion) -> Request {
    match motion {
        Motion::To { target, .. } => set(Command::Runa, Value::Int(target)),
        Motion::By(steps) => set(Command::Runr, Value::Int(steps)),
        Motion::Run(direction) => set(Command::Runv, Value::Sign(direction == Direction::Positive)),
    }
}

/// The error flags in a set as faults.
fn faults(bits: FlagBits) -> impl Iterator<Item = Fault> {
    let flags = ERROR_FLAGS.iter().filter(move |flag| flag.is_in(bits));
    flags.map(|flag| Fault { name: flag.name, about: flag.about, disables: true })
}

fn limit(direction: Direction) -> StatusFlag {
    match direction {
        Direction::Positive => StatusFlag::LimitPositive,
        Direction::Negative => StatusFlag::LimitNegative,
    }
}

fn limit_name(direction: Direction) -> &'static str {
    match direction {
        Direction::Positive => "LIMIT POSITIVE",
        Direction::Negative => "LIMIT NEGATIVE",
    }
}

/// How far off a position may be that is printed with six digits, in full steps: a half of the last, and at least the
/// drive's own part.
fn shown_within(position: f64) -> f64 {
    let last_digit = 10_f64.powf(position.abs().max(1.0).log10().floor() - 5.0);
    (last_digit / 2.0).max(1.0 / 256.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_are_shown_with_six_digits() {
        assert!((shown_within(0.0) - 1.0 / 256.0).abs() < 1e-9);
        assert!((shown_within(-500.0) - 1.0 / 256.0).abs() < 1e-9);
        assert!((shown_within(123_456.0) - 0.5).abs() < 1e-9);
        assert!((shown_within(-8_388_607.0) - 5.0).abs() < 1e-9);
    }
}
