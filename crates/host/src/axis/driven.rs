//! An axis over a motor of either family.

use super::checks::{check_range, check_room, differs, to, told};
use super::limits::SoftLimits;
use super::motor::{Fault, Look, Motion, Motor, Order, Setup};
use super::plan::{self, Plan};
use super::stops::{Leave, Stops};
use super::wait::Pace;
use super::{Axis, AxisState, MoveOptions, Stop};
use crate::connect::BoxFuture;
use crate::direction::Direction;
use crate::error::Error;
use crate::trust::{Doubt, Trust, TrustState};
use crate::units::{Amount, Goal, Scale};
use std::fmt;
use std::sync::{Mutex as StdMutex, MutexGuard, PoisonError};
use std::time::Duration;

/// What is done until a motor moves.
const SENT_OFF: &str = "it was being sent off";

/// An axis over a motor.
pub struct DriveAxis<M> {
    motor: M,
    scale: Scale,
    limits: SoftLimits,
    watched: StdMutex<Watched>,
    stops: Stops,
    /// Held while a motion is prepared and started.
    turn: tokio::sync::Mutex<()>,
}

/// What is known from looking.
#[derive(Clone, Copy, Debug)]
struct Watched {
    trust: TrustState,
    /// [`Motor::upsets`] when it was last looked at.
    upsets: Option<u64>,
    /// How many motions are being started: where the motor is seen standing then says nothing.
    starting: u32,
    /// How many have been started.
    started: u64,
}

impl Watched {
    const fn new(trust: TrustState) -> Watched {
        Watched { trust, upsets: None, starting: 0, started: 0 }
    }

    /// Whether no motion was started since `before`, and none is being.
    const fn is_undisturbed_since(&self, before: &Watched) -> bool {
        before.starting == 0 && self.starting == 0 && self.started == before.started
    }
}

/// A motion that is being started.
struct Starting<'a>(&'a StdMutex<Watched>);

impl Starting<'_> {
    fn new(watched: &StdMutex<Watched>) -> Starting<'_> {
        lock(watched).starting += 1;
        Starting(watched)
    }
}

impl Drop for Starting<'_> {
    fn drop(&mut self) {
        let mut watched = lock(self.0);
        watched.starting -= 1;
        watched.started += 1;
        watched.trust.saw(None);
    }
}

fn lock(watched: &StdMutex<Watched>) -> MutexGuard<'_, Watched> {
    // It holds plain values, so whoever panicked left nothing half done.
    watched.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A move that has been checked.
struct Checked {
    plan: Plan,
    order: Order,
    /// Where it ends, in full steps.
    end: f64,
    /// How far off that may be.
    slack: f64,
}

impl<M: Motor> DriveAxis<M> {
    /// An axis measured in full steps, without soft limits, of which no position is known.
    pub fn new(motor: M) -> DriveAxis<M> {
        DriveAxis {
            motor,
            scale: Scale::STEPS,
            limits: SoftLimits::OFF,
            watched: StdMutex::new(Watched::new(TrustState::new())),
            stops: Stops::default(),
            turn: tokio::sync::Mutex::new(()),
        }
    }

    /// The same measured by a scale.
    #[must_use]
    pub fn with_scale(self, scale: Scale) -> DriveAxis<M> {
        DriveAxis { scale, ..self }
    }

    /// The same with soft limits, in the unit of its scale.
    #[must_use]
    pub fn with_limits(self, limits: SoftLimits) -> DriveAxis<M> {
        DriveAxis { limits, ..self }
    }

    /// The same with what was known of its position before the program ended. Whether that still holds is found out when it
    /// is first looked at.
    #[must_use]
    pub fn with_trust(self, trust: TrustState) -> DriveAxis<M> {
        DriveAxis { watched: StdMutex::new(Watched::new(trust)), ..self }
    }

    /// The motor.
    pub fn motor(&self) -> &M {
        &self.motor
    }

    // ---- looking

    fn watched(&self) -> MutexGuard<'_, Watched> {
        lock(&self.watched)
    }

    /// Looks at the motor, and judges by that how far its position can be believed.
    async fn look(&self) -> Result<Look, Error> {
        let before = *self.watched();
        let look = self.motor.look().await?;
        let upsets = Some(self.motor.upsets().await);
        let undisturbed = self.watched().is_undisturbed_since(&before);
        let moved = before.trust.place().is_some_and(|place| look.moving || differs(place, &look));
        if before.trust.trust() != Trust::Unknown && (before.upsets != upsets || undisturbed && moved) {
            let place = before.trust.place().filter(|_| undisturbed);
            let continuity = self.motor.continuity(place, &look).await?;
            self.watched().trust.found(continuity);
        }
        let mut watched = self.watched();
        watched.upsets = upsets;
        if look.faults.iter().any(|fault| fault.disables) {
            watched.trust.raise(Doubt::Disabled);
        } else if !look.energised {
            watched.trust.raise(Doubt::Freed);
        }
        let still = !look.moving && watched.is_undisturbed_since(&before);
        watched.trust.saw(still.then_some(look.position));
        drop(watched);
        Ok(look)
    }

    fn state_of(&self, look: Look) -> AxisState {
        let position = self.scale.amount(look.position);
        let trust = self.watched().trust;
        let (negative, positive) = (look.limit_negative, look.limit_positive);
        let turned = self.scale.is_reversed();
        AxisState {
            position,
            full_steps: look.position,
            speed: self.scale.from_steps(look.speed),
            moving: look.moving,
            energised: look.energised,
            faults: look.faults,
            limit_negative: if turned { positive } else { negative },
            limit_positive: if turned { negative } else { positive },
            within_soft_limits: self.limits.allow(position.value),
            trust: trust.trust(),
            doubt: trust.doubt(),
        }
    }

    /// A direction of the axis as one of the motor, or the other way round.
    fn turned(&self, direction: Direction) -> Direction {
        if self.scale.is_reversed() { direction.opposite() } else { direction }
    }

    // ---- checking

    /// What stands against any motion.
    fn check_ready(&self, look: &Look) -> Result<(), Error> {
        if !look.faults.is_empty() {
            return Err(Error::Fault(format!(
                "{}: {}; clear the fault first; nothing was sent",
                self.motor.name(),
                told(&look.faults)
            )));
        }
        if look.moving {
            return Err(Error::Refused(format!(
                "{} moves already, at {} full steps/s; wait for it or stop it; nothing was sent",
                self.motor.name(),
                look.speed.abs()
            )));
        }
        Ok(())
    }

    fn check_trust(&self, override_trust: bool) -> Result<(), Error> {
        let trust = self.watched().trust;
        match trust.doubt() {
            Some(doubt) if !override_trust => Err(Error::Refused(format!(
                "the position of {} is {}: {doubt}; home it, take a place as zero, or override this; nothing was sent",
                self.motor.name(),
                trust.trust()
            ))),
            _ => Ok(()),
        }
    }

    fn check_limits(&self, goal: &dyn fmt::Display, end: Amount) -> Result<(), Error> {
        match self.limits.range() {
            Some((low, high)) if !self.limits.allow(end.value) => Err(Error::Refused(format!(
                "{goal} ends at {end}, beyond the soft limits [{low}, {high}] {}; nothing was sent",
                end.unit
            ))),
            _ => Ok(()),
        }
    }

    /// The speed that is asked for, in full steps a second; one that the controller takes.
    fn speed(&self, options: &MoveOptions) -> Result<Option<f64>, Error> {
        let speed = options.speed.map(|speed| self.scale.steps_per_s(speed)).transpose()?;
        speed.map_or(Ok(()), |speed| self.motor.check_speed(speed))?;
        Ok(speed)
    }

    /// Checks a move and works it out.
    async fn check(&self, goal: Goal, options: &MoveOptions) -> Result<Checked, Error> {
        let speed = self.speed(options)?;
        let asked = self.scale.full_steps(goal.amount())?;
        let look = self.look().await?;
        self.check_ready(&look)?;
        let setup = self.motor.setup().await?;
        let counts = self.scale.counts(goal.amount(), setup.parts)?;
        let parts = f64::from(setup.parts);
        let (motion, from) = match goal {
            Goal::To(_) => (to(counts.count, &look, &setup), 0.0),
            Goal::By(_) => (Motion::By(counts.count), look.position),
        };
        let end = from + counts.count as f64 / parts;
        check_range(goal, end, counts.count, &look, &setup)?;
        self.check_limits(&goal, self.scale.amount(from + asked))?;
        self.check_limits(&goal, self.scale.amount(end))?;
        if matches!(goal, Goal::To(_)) {
            self.check_trust(options.override_trust)?;
        }
        let order = Order { motion, speed };
        let plan = self.planned(goal, order, &look, &setup, end, !counts.exact).await?;
        Ok(Checked { plan, order, end, slack: look.within + 1.0 / parts })
    }

    async fn planned(
        &self,
        goal: Goal,
        order: Order,
        look: &Look,
        setup: &Setup,
        end: f64,
        rounded: bool,
    ) -> Result<Plan, Error> {
        let mut profile = setup.profile;
        profile.max = order.speed.unwrap_or(profile.max);
        let full_steps = end - look.position;
        Ok(Plan {
            goal,
            from: self.scale.amount(look.position),
            to: self.scale.amount(end),
            distance: self.scale.amount(full_steps),
            full_steps,
            rounded,
            duration: plan::duration(full_steps, &profile),
            supposed: setup.supposed.clone(),
            sent: self.motor.sent_for(order).await?,
            trust: self.watched().trust.trust(),
        })
    }

    // ---- moving

    /// Starts an order. A stop that comes meanwhile wins.
    async fn begin(&self, order: Order, leave: Leave<'_>) -> Result<(), Error> {
        self.motor.prepare(order).await?;
        let start = async {
            let _starting = Starting::new(&self.watched);
            self.motor.start(order).await
        };
        leave.act(&self.motor, start).await
    }

    /// Leave to move from now on.
    fn leave(&self, doing: &'static str) -> Leave<'_> {
        self.stops.leave(self.motor.name(), doing)
    }

    /// Waits until the motor stands.
    async fn stand(&self, timeout: Option<Duration>, expected: Option<Duration>) -> Result<Look, Error> {
        let mut pace = Pace::new(timeout, expected);
        loop {
            let look = self.look().await?;
            if !look.moving {
                return Ok(look);
            }
            if !pace.pause().await {
                return Err(Error::Device(format!(
                    "{} still moves after {:?}, at {}; it was not stopped",
                    self.motor.name(),
                    timeout.unwrap_or_default(),
                    self.scale.amount(look.position)
                )));
            }
        }
    }

    /// Waits for the end of a move, and says why if it is not there.
    async fn arrive(&self, checked: &Checked, timeout: Option<Duration>) -> Result<(), Error> {
        let look = self.stand(timeout, Some(checked.plan.duration)).await?;
        let short = format!(
            "{} stands at {} instead of {}",
            self.motor.name(),
            self.scale.amount(look.position),
            checked.plan.to
        );
        if !look.faults.is_empty() {
            return Err(Error::Fault(format!("{short}: {}", told(&look.faults))));
        }
        if (look.position - checked.end).abs() <= checked.slack + look.within {
            return Ok(());
        }
        let ahead = if checked.plan.full_steps > 0.0 { look.limit_positive } else { look.limit_negative };
        if ahead {
            self.watched().trust.raise(Doubt::LimitMet);
            return Err(Error::Refused(format!(
                "{short}: the limit switch there stopped it; move it away from it"
            )));
        }
        Err(Error::Refused(format!(
            "{short}: somebody or something stopped it on the way; look at the drive, and move again"
        )))
    }

    async fn move_there(&self, goal: Goal, options: MoveOptions, leave: Leave<'_>) -> Result<Plan, Error> {
        let checked = {
            let _turn = self.turn.lock().await;
            let checked = self.check(goal, &options).await?;
            self.begin(checked.order, leave).await?;
            checked
        };
        if !options.no_wait {
            self.arrive(&checked, options.timeout).await.map_err(|error| self.begun("motion", error))?;
        }
        Ok(checked.plan)
    }

    /// An error behind the start of a motion. When nothing more was heard, what has become of it is part of what there is to say.
    fn begun(&self, motion: &str, error: Error) -> Error {
        if !matches!(error, Error::Line(_)) {
            return error;
        }
        let done =
            format!("the {motion} of {} was begun, and whether it has ended is not known", self.motor.name());
        Error::Partly { done, cause: Box::new(error) }
    }

    async fn run_off(
        &self,
        direction: Direction,
        options: MoveOptions,
        leave: Leave<'_>,
    ) -> Result<(), Error> {
        let _turn = self.turn.lock().await;
        let order = match self.limits.range() {
            None => {
                let speed = self.speed(&options)?;
                self.check_ready(&self.look().await?)?;
                Order { motion: Motion::Run(self.turned(direction)), speed }
            }
            Some((low, high)) => {
                let end = if direction == Direction::Positive { high } else { low };
                let checked = self.check(Goal::To(Amount::new(end, self.scale.unit())), &options).await?;
                check_room(direction, &checked.plan)?;
                checked.order
            }
        };
        self.begin(order, leave).await
    }

    async fn look_for_home(
        &self,
        direction: Direction,
        options: MoveOptions,
        leave: Leave<'_>,
    ) -> Result<(), Error> {
        let speed = options.speed.map(|speed| self.scale.steps_per_s(speed)).transpose()?;
        speed.map_or(Ok(()), |speed| self.motor.check_home_speed(speed))?;
        let _turn = self.turn.lock().await;
        self.check_ready(&self.look().await?)?;
        leave.check()?;
        // Until it is found, and also when nobody waits for that any more.
        self.watched().trust.raise(Doubt::HomingFailed);
        let starting = Starting::new(&self.watched);
        let homed = self.motor.home(self.turned(direction), speed, options.timeout, leave).await;
        drop(starting);
        homed.map_err(|error| self.begun("search for home", error))?;
        let upsets = self.marked().await?;
        leave.check()?;
        self.believe_zero(upsets);
        Ok(())
    }

    async fn zero_here(&self) -> Result<(), Error> {
        let _turn = self.turn.lock().await;
        let look = self.look().await?;
        self.check_ready(&look)?;
        if !look.energised {
            return Err(Error::Refused(format!(
                "the motor of {} is de-energised, so its rotor is not held; energise it, as a move does and `stepdrive stop`, \
                 and then take the place as zero",
                self.motor.name()
            )));
        }
        self.motor.zero().await?;
        let upsets = self.marked().await?;
        self.believe_zero(upsets);
        Ok(())
    }

    /// Marks that zero was set in the controller. Answers [`Motor::upsets`] up to there.
    async fn marked(&self) -> Result<u64, Error> {
        self.motor.mark().await?;
        Ok(self.motor.upsets().await)
    }

    /// Zero has been set in the controller.
    fn believe_zero(&self, upsets: u64) {
        let mut watched = self.watched();
        watched.trust.confirm(0.0);
        watched.upsets = Some(upsets);
    }

    /// Stops; this is the `number`th stop that was asked for.
    async fn stop_now(&self, how: Stop, number: u64) -> Result<(), Error> {
        let doubt = match how {
            Stop::Soft => None,
            Stop::Hard => self.watched().trust.place().is_none().then_some(Doubt::StoppedDead),
            Stop::Free => Some(Doubt::Freed),
        };
        if let Some(doubt) = doubt {
            self.watched().trust.raise(doubt);
        }
        self.motor.stop(how).await?;
        if self.stops.settled(number).await {
            // What was being sent may have come to the controller behind the stop.
            self.motor.stop(how).await?;
        }
        Ok(())
    }
}

impl<M: Motor> Axis for DriveAxis<M> {
    fn name(&self) -> &str {
        self.motor.name()
    }

    fn scale(&self) -> &Scale {
        &self.scale
    }

    fn soft_limits(&self) -> SoftLimits {
        self.limits
    }

    fn trust(&self) -> TrustState {
        self.watched().trust
    }

    fn distrust(&self, doubt: Doubt) {
        self.watched().trust.raise(doubt);
    }

    fn believe(&self, trust: TrustState) {
        let mut watched = self.watched();
        watched.trust = trust;
        watched.upsets = None;
    }

    fn state(&self) -> BoxFuture<'_, Result<AxisState, Error>> {
        Box::pin(async { Ok(self.state_of(self.look().await?)) })
    }

    fn plan(&self, goal: Goal, options: MoveOptions) -> BoxFuture<'_, Result<Plan, Error>> {
        Box::pin(async move { Ok(self.check(goal, &options).await?.plan) })
    }

    fn go(&self, goal: Goal, options: MoveOptions) -> BoxFuture<'_, Result<Plan, Error>> {
        Box::pin(self.move_there(goal, options, self.leave(SENT_OFF)))
    }

    fn run(&self, direction: Direction, options: MoveOptions) -> BoxFuture<'_, Result<(), Error>> {
        Box::pin(self.run_off(direction, options, self.leave(SENT_OFF)))
    }

    fn stop(&self, how: Stop) -> BoxFuture<'_, Result<(), Error>> {
        Box::pin(self.stop_now(how, self.stops.ask(how)))
    }

    fn home(&self, direction: Direction, options: MoveOptions) -> BoxFuture<'_, Result<(), Error>> {
        Box::pin(self.look_for_home(direction, options, self.leave("it looked for home; home it again")))
    }

    fn zero(&self) -> BoxFuture<'_, Result<(), Error>> {
        Box::pin(self.zero_here())
    }

    fn wait_done(&self, timeout: Option<Duration>) -> BoxFuture<'_, Result<AxisState, Error>> {
        Box::pin(async move {
            let look = self.stand(timeout, None).await?;
            if look.faults.is_empty() {
                return Ok(self.state_of(look));
            }
            Err(Error::Fault(format!("{} stands: {}", self.motor.name(), told(&look.faults))))
        })
    }

    fn clear_faults(&self) -> BoxFuture<'_, Result<Vec<Fault>, Error>> {
        Box::pin(async {
            self.look().await?;
            self.motor.clear_faults().await?;
            Ok(self.look().await?.faults)
        })
    }
}

impl<M: Motor> fmt::Debug for DriveAxis<M> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("DriveAxis")
            .field("motor", &self.motor)
            .field("scale", &self.scale)
            .field("limits", &self.limits)
            .field("trust", &self.watched().trust)
            .finish_non_exhaustive()
    }
}
