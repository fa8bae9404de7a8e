//! The motor of an SMSD.

use super::Stop;
use super::motor::{Fault, Look, Motion, Motor, Order, Profile, Setup};
use super::speed;
use super::stops::Leave;
use super::wait::Pace;
use crate::connect::BoxFuture;
use crate::direction::Direction;
use crate::error::Error;
use crate::smsd::{Answer, Smsd, Snapshot, Step, Way};
use crate::trust::Continuity;
use std::time::Duration;
use stepdrive_spec::smsd::inputs::Input;
use stepdrive_spec::smsd::instructions::Opcode;
use stepdrive_spec::smsd::mode::MotorConfiguration;
use stepdrive_spec::smsd::models::Model;
use stepdrive_spec::smsd::powerstep01;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::ring;
use stepdrive_spec::smsd::status::MotStatus;

/// How often a stop is sent whose reply is lost: sent twice it is the same.
const TRIES: u32 = 3;

/// How long the motor is waited for after it was told to stop.
const STOPPING: Duration = Duration::from_mins(1);

/// The highest code of `MICROSTEPPING`: 1/128.
const FINEST: u16 = 7;

/// The motor of an SMSD.
///
/// A move goes to its position forward or backward (`GO_TO_F`, `GO_TO_R`), wherever it lies, and never over the end of the
/// counter. Homing looks for the signal `SET_ZERO` (`SCAN_ZERO_F`, `SCAN_ZERO_R`), at `TARGET_SPEED` where no other speed is
/// given; where the signal is there already it first goes back until it is not. There are no limit switches.
///
/// What a line does not tell ([`Smsd::check_readable`]) is supposed to be as [`Smsd::supposed`] says: over USB `ACC`, `DEC`
/// and `TARGET_SPEED`.
#[derive(Debug)]
pub struct SmsdMotor {
    client: Box<dyn Smsd>,
    name: String,
}

impl SmsdMotor {
    /// The motor of a controller, under the name that errors are to give it.
    pub fn new(name: &str, client: impl Into<Box<dyn Smsd>>) -> SmsdMotor {
        SmsdMotor { client: client.into(), name: name.to_owned() }
    }

    /// The controller.
    pub fn client(&self) -> &dyn Smsd {
        &*self.client
    }

    fn is_told(&self, reg: Reg) -> bool {
        self.client.check_readable(reg).is_ok()
    }

    /// What registers hold, as far as that can be read; otherwise what they are supposed to.
    async fn values(&self, regs: &[Reg]) -> Result<Vec<i64>, Error> {
        let told: Vec<Reg> = regs.iter().copied().filter(|reg| self.is_told(*reg)).collect();
        let mut read = self.client.read_many(&told).await?.into_iter();
        let value = |reg: &Reg| {
            if self.is_told(*reg) { read.next().unwrap_or(0) } else { self.client.supposed(*reg) }
        };
        Ok(regs.iter().map(value).collect())
    }

    /// What a ramp is worked out from without being known.
    fn supposed(&self) -> Option<String> {
        let untold = [Reg::Acc, Reg::Dec].into_iter().filter(|reg| !self.is_told(*reg));
        let names: Vec<String> =
            untold.map(|reg| format!("{} {}", reg.info().name, self.client.supposed(reg))).collect();
        (!names.is_empty())
            .then(|| format!("{} are supposed: this line does not tell them", names.join(", ")))
    }

    /// Microsteps to the full step, at present.
    async fn parts(&self) -> Result<u16, Error> {
        self.parts_of(self.client.read(Reg::Microstepping).await?)
    }

    /// Microsteps to the full step under a code of `MICROSTEPPING`.
    fn parts_of(&self, code: i64) -> Result<u16, Error> {
        match u16::try_from(code) {
            Ok(microstepping @ 0..=FINEST) => {
                let motor = MotorConfiguration { microstepping, ..MotorConfiguration::FACTORY };
                Ok(motor.microsteps_per_step())
            }
            _ => Err(Error::Device(format!(
                "{} of {} reads {code}, and it can be 0 to {FINEST} (full step to 1/128); without it positions cannot be \
                 told; write another value to it",
                Reg::Microstepping.info().name,
                self.name
            ))),
        }
    }

    async fn look_at(&self) -> Result<Look, Error> {
        let parts = self.parts().await?;
        Ok(seen(&self.client.snapshot().await?, parts))
    }

    async fn set_up(&self) -> Result<Setup, Error> {
        let regs = [Reg::MinSpeed, Reg::MaxSpeed, Reg::Acc, Reg::Dec, Reg::Microstepping];
        let values = self.values(&regs).await?;
        let value = |place: usize| values.get(place).copied().unwrap_or(0);
        let rounded = |scale: powerstep01::Scale, place| scale.round(value(place) as f64);
        let start = rounded(powerstep01::MIN_SPEED, 0);
        let profile = Profile {
            start,
            stop: start,
            max: rounded(powerstep01::MAX_SPEED, 1),
            acceleration: rounded(powerstep01::ACCELERATION, 2),
            deceleration: rounded(powerstep01::ACCELERATION, 3),
        };
        let range = (ring::MIN.into(), ring::MAX.into());
        let (parts, supposed) = (self.parts_of(value(4))?, self.supposed());
        Ok(Setup { profile, parts, range, reach: ring::SIZE - 1, supposed })
    }

    // ---- orders

    /// The steps of an order; the last is the command.
    async fn steps(&self, order: Order) -> Result<Vec<Step>, Error> {
        let max = order.speed.map(|speed| Step::Write(Reg::MaxSpeed, whole(speed)));
        let (opcode, operand) = match order.motion {
            Motion::To { target, direction: Direction::Positive } => (Opcode::GoToF, target),
            Motion::To { target, direction: Direction::Negative } => (Opcode::GoToR, target),
            Motion::By(distance) => (Opcode::MoveF, distance),
            Motion::Run(direction) => {
                let opcode = if direction == Direction::Positive { Opcode::RunF } else { Opcode::RunR };
                (opcode, self.run_speed(order).await?)
            }
        };
        Ok(max.into_iter().chain([Step::Command(opcode, Some(operand))]).collect())
    }

    /// What would be sent for an order.
    async fn requests_for(&self, order: Order) -> Result<Vec<String>, Error> {
        let mut requests = Vec::new();
        for step in self.steps(order).await? {
            requests.extend(self.client.sent_for(step).await?);
        }
        Ok(requests)
    }

    /// The speed of an endless motion: the highest, as nothing else is said.
    async fn run_speed(&self, order: Order) -> Result<i64, Error> {
        match order.speed {
            Some(speed) => Ok(whole(speed)),
            None => self.client.read(Reg::MaxSpeed).await,
        }
    }

    async fn get_ready(&self, order: Order) -> Result<(), Error> {
        self.check_program().await?;
        match order.speed {
            Some(speed) => self.client.write(Reg::MaxSpeed, whole(speed)).await,
            None => Ok(()),
        }
    }

    /// A program that is seen running would go on beside what is asked for.
    async fn check_program(&self) -> Result<(), Error> {
        let program = self.client.program().await?;
        if program.running != Some(true) {
            return Ok(());
        }
        Err(Error::Refused(format!(
            "a user program runs in {} (mem{}:{}) and moves the motor as it likes; stop it first",
            self.name, program.area, program.line,
        )))
    }

    async fn start_motion(&self, order: Order) -> Result<(), Error> {
        match order.motion {
            Motion::To { target, direction: Direction::Positive } => {
                self.client.move_to(target, Way::Forward).await
            }
            Motion::To { target, direction: Direction::Negative } => {
                self.client.move_to(target, Way::Reverse).await
            }
            Motion::By(distance) => self.client.move_by(distance).await,
            Motion::Run(direction) => self.client.run(direction, self.run_speed(order).await?).await,
        }
    }

    async fn stop_as(&self, how: Stop) -> Result<(), Error> {
        let coil = match how {
            Stop::Soft => Reg::SoftStop,
            Stop::Hard => Reg::HardStop,
            Stop::Free => Reg::SoftHiZ,
        };
        self.trigger(coil).await?;
        self.end_program(coil).await.map_err(|cause| Error::Partly {
            done: format!(
                "the motor of {} was stopped, but a user program may run there and move it again",
                self.name
            ),
            cause: Box::new(cause),
        })
    }

    /// Ends the user program that may run, and lets the coil that stopped the motor act again: the program may have moved it
    /// meanwhile.
    async fn end_program(&self, coil: Reg) -> Result<(), Error> {
        if self.is_left_alone().await? {
            return Ok(());
        }
        insist(|| self.client.stop_program()).await?;
        self.trigger(coil).await
    }

    /// Whether it is seen that no user program runs that moves the motor, and that none has moved it just before its end.
    async fn is_left_alone(&self) -> Result<bool, Error> {
        if !self.is_told(Reg::ProgramRun) || self.client.read(Reg::ProgramRun).await? != 0 {
            return Ok(false);
        }
        let motion = self.client.snapshot().await?.status.motion;
        Ok(matches!(motion, MotStatus::Stopped | MotStatus::Decelerating))
    }

    /// Lets a coil act that does the same when it acts twice.
    async fn trigger(&self, coil: Reg) -> Result<(), Error> {
        insist(|| self.client.trigger(coil)).await
    }

    // ---- homing

    async fn find_home(
        &self,
        direction: Direction,
        speed: Option<f64>,
        timeout: Option<Duration>,
        leave: Leave<'_>,
    ) -> Result<(), Error> {
        self.check_program().await?;
        if self.client.read(Reg::Mask).await? & i64::from(Input::SetZero.bit()) == 0 {
            return Err(Error::Refused(format!(
                "the input {} of {} is masked, so it would never be found; set its bit in Mask; nothing was sent",
                Input::SetZero,
                self.name
            )));
        }
        let speed = match speed {
            Some(speed) => whole(speed),
            None => self.values(&[Reg::TargetSpeed]).await?.first().copied().unwrap_or(0),
        };
        let mut pace = Pace::new(timeout, None);
        let found = self.seek(direction, speed, &mut pace, leave).await;
        if matches!(found, Err(Error::Device(_))) {
            leave.act(self, self.trigger(Reg::SoftStop)).await?;
            self.until(&mut Pace::new(Some(STOPPING), None), |snapshot| !is_moving(snapshot)).await?;
        }
        found
    }

    async fn seek(
        &self,
        direction: Direction,
        speed: i64,
        pace: &mut Pace,
        leave: Leave<'_>,
    ) -> Result<(), Error> {
        if self.client.snapshot().await?.input(Input::SetZero) {
            self.back_off(direction.opposite(), speed, pace, leave).await?;
        }
        leave.act(self, self.client.scan_zero(direction, speed)).await?;
        let snapshot = self.until(pace, |snapshot| !is_moving(snapshot)).await?;
        leave.check()?;
        if snapshot.position == 0 && snapshot.input(Input::SetZero) {
            return Ok(());
        }
        Err(Error::Refused(format!(
            "{} stopped at {} microsteps without having found {}: somebody or something stopped it; home it again",
            self.name,
            snapshot.position,
            Input::SetZero
        )))
    }

    /// Goes off the switch. A stop by another program is seen as long as the motor is not braking by itself: it slows down, or
    /// is freed.
    async fn back_off(
        &self,
        direction: Direction,
        speed: i64,
        pace: &mut Pace,
        leave: Leave<'_>,
    ) -> Result<(), Error> {
        leave.act(self, self.client.run(direction, speed)).await?;
        let goes = |snapshot: &Snapshot| {
            matches!(snapshot.status.motion, MotStatus::Accelerating | MotStatus::ConstantSpeed)
        };
        let off = self.until(pace, |snapshot| !snapshot.input(Input::SetZero) || !goes(snapshot)).await?;
        leave.check()?;
        if !goes(&off) {
            return Err(self.interrupted(&off));
        }
        leave.act(self, self.trigger(Reg::SoftStop)).await?;
        let standing = self.until(pace, |snapshot| !is_moving(snapshot)).await?;
        leave.check()?;
        if standing.input(Input::SetZero) || standing.status.hi_z {
            return Err(self.interrupted(&standing));
        }
        Ok(())
    }

    fn interrupted(&self, seen: &Snapshot) -> Error {
        Error::Refused(format!(
            "{} stopped at {} microsteps on its way off {}: somebody or something stopped it; home it again",
            self.name,
            seen.position,
            Input::SetZero
        ))
    }

    /// Looks until something is so.
    async fn until(&self, pace: &mut Pace, done: impl Fn(&Snapshot) -> bool) -> Result<Snapshot, Error> {
        loop {
            let snapshot = self.client.snapshot().await?;
            if done(&snapshot) {
                return Ok(snapshot);
            }
            if !pace.pause().await {
                return Err(Error::Device(format!(
                    "{} did not find {} in the time given; the motor was stopped ({snapshot} before that)",
                    self.name,
                    Input::SetZero
                )));
            }
        }
    }
}

impl Motor for SmsdMotor {
    fn name(&self) -> &str {
        &self.name
    }

    fn upsets(&self) -> BoxFuture<'_, u64> {
        self.client.connections()
    }

    fn look(&self) -> BoxFuture<'_, Result<Look, Error>> {
        Box::pin(self.look_at())
    }

    fn setup(&self) -> BoxFuture<'_, Result<Setup, Error>> {
        Box::pin(self.set_up())
    }

    fn check_speed(&self, speed: f64) -> Result<(), Error> {
        takes(Reg::MaxSpeed, speed)
    }

    fn check_home_speed(&self, speed: f64) -> Result<(), Error> {
        takes(Reg::TargetSpeed, speed)
    }

    fn sent_for(&self, order: Order) -> BoxFuture<'_, Result<Vec<String>, Error>> {
        Box::pin(self.requests_for(order))
    }

    fn prepare(&self, order: Order) -> BoxFuture<'_, Result<(), Error>> {
        Box::pin(self.get_ready(order))
    }

    fn start(&self, order: Order) -> BoxFuture<'_, Result<(), Error>> {
        Box::pin(self.start_motion(order))
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
        Box::pin(self.trigger(Reg::ResetPos))
    }

    fn mark(&self) -> BoxFuture<'_, Result<(), Error>> {
        // That a controller has started over shows in HiZ, with which it begins.
        Box::pin(async { Ok(()) })
    }

    fn continuity<'a>(
        &'a self,
        place: Option<f64>,
        look: &'a Look,
    ) -> BoxFuture<'a, Result<Continuity, Error>> {
        let moved =
            place.is_some_and(|place| look.moving || (place - look.position).abs() > 2.0 * look.within);
        Box::pin(async move {
            Ok(match (look.energised, moved) {
                (false, _) => Continuity::Broken,
                (true, true) => Continuity::Unclear,
                (true, false) => Continuity::Kept,
            })
        })
    }

    fn clear_faults(&self) -> BoxFuture<'_, Result<(), Error>> {
        self.client.clear_flags()
    }
}

fn is_moving(snapshot: &Snapshot) -> bool {
    snapshot.is_moving() || !snapshot.status.ready
}

fn seen(snapshot: &Snapshot, parts: u16) -> Look {
    let error = Reg::CmdError.info();
    let fault = Fault { name: error.name, about: error.about, disables: false };
    let speed = f64::from(snapshot.speed);
    Look {
        position: f64::from(snapshot.position) / f64::from(parts),
        speed: if snapshot.status.forward || snapshot.speed == 0 { speed } else { -speed },
        moving: is_moving(snapshot),
        energised: !snapshot.status.hi_z,
        faults: snapshot.status.cmd_error.then_some(fault).into_iter().collect(),
        limit_negative: false,
        limit_positive: false,
        within: 0.5 / f64::from(parts),
    }
}

/// Does something that does the same when it is done twice, again while its reply is lost.
async fn insist<'a>(act: impl Fn() -> Answer<'a, ()>) -> Result<(), Error> {
    let mut outcome = act().await;
    for _ in 1..TRIES {
        if !matches!(outcome, Err(Error::Uncertain { .. })) {
            break;
        }
        outcome = act().await;
    }
    outcome
}

/// Fails for a speed that a register does not take, whichever the model.
fn takes(reg: Reg, speed: f64) -> Result<(), Error> {
    let row = reg.info();
    let (min, max) = row.range(Model::Smsd42);
    if (min..=max).contains(&whole(speed)) {
        return Ok(());
    }
    Err(speed::refused(row.name, speed, min, max, row.unit))
}

/// A speed as a register holds it; the client says which it takes.
fn whole(speed: f64) -> i64 {
    #[allow(clippy::cast_possible_truncation, reason = "`as` saturates, and what is too much is refused")]
    let whole = speed.round() as i64;
    whole
}
