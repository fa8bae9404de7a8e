//! The motor chip: motion commands, status flags, counters (powerSTEP01 data sheet; `powerstep01` in the spec crate).

use crate::controller::ROTOR_UNITS;
use core::time::Duration;
use stepdrive_motion::{Axis, Direction, Limits, Phase, STEEPEST};
use stepdrive_spec::smsd::powerstep01 as scale;
use stepdrive_spec::smsd::registers::Reg;
use stepdrive_spec::smsd::ring;
use stepdrive_spec::time::Instant;

/// Units of `EL_POS` to the full step.
const EL_UNITS: i64 = 128;

/// ASSUMED: a microstep of the step input is made within one tick of the chip, so in 250 ns; steps that come faster follow
/// each other at that pace.
const STEP_CLOCK_MICROSTEPS_PER_SECOND: f64 = 4e6;

/// The speed and acceleration registers, in whole full steps as the controller's registers hold them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Parameters {
    pub(super) min_speed: u16,
    pub(super) max_speed: u16,
    pub(super) acc: u16,
    pub(super) dec: u16,
    pub(super) fs_speed: u16,
}

impl Parameters {
    fn power_up() -> Parameters {
        let default = |reg: Reg| u16::try_from(reg.info().default).unwrap_or(u16::MAX);
        Parameters {
            min_speed: default(Reg::MinSpeed),
            max_speed: default(Reg::MaxSpeed),
            acc: default(Reg::Acc),
            dec: default(Reg::Dec),
            fs_speed: default(Reg::FsSpeed),
        }
    }
}

/// What keeps `READY` low.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Busy {
    /// Nothing.
    No,
    /// `RUN`, until the speed is reached.
    UntilConstant,
    /// Everything else, until the motor stands.
    UntilStanding,
}

/// Steps by the step input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct StepClock {
    /// The count that the steps so far lead to.
    target: i64,
}

/// What is wrong outside of the chip.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Trouble {
    /// The motor is short-circuited, which shows while a current flows.
    shorted: bool,
    /// The chip is too hot.
    overheated: bool,
}

/// The chip.
#[derive(Clone, Debug)]
#[allow(clippy::struct_excessive_bools, reason = "the flags of a chip are what they are")]
pub(super) struct PowerStep01 {
    parameters: Parameters,
    axis: Axis,
    energised: bool,
    /// How often the phases were energised since power-up.
    starts: u32,
    /// De-energise as soon as the motor stands.
    release_at_standstill: bool,
    busy: Busy,
    command_error: bool,
    switch_event: bool,
    mark: i32,
    /// The axis' count at position 0.
    zero: i64,
    microsteps_per_step: u16,
    /// A place of the rotor, and the axis' count there: where the present microstep mode began.
    rotor_origin: (i64, i64),
    /// The rotor's place at which `EL_POS` is 0.
    el_origin: i64,
    /// Whether the motor was driven in full steps when the present leg of the motion began.
    full_steps_before: bool,
    /// The step input moves the motor.
    step_clock: Option<StepClock>,
    trouble: Trouble,
    /// The bridges are shut down: the motor is in HiZ, and stays so.
    shut_down: bool,
}

impl PowerStep01 {
    pub(super) fn power_up(microsteps_per_step: u16) -> PowerStep01 {
        PowerStep01 {
            parameters: Parameters::power_up(),
            axis: Axis::new(0),
            energised: false,
            starts: 0,
            release_at_standstill: false,
            busy: Busy::No,
            command_error: false,
            switch_event: false,
            mark: 0,
            zero: 0,
            microsteps_per_step,
            rotor_origin: (0, 0),
            el_origin: 0,
            full_steps_before: false,
            step_clock: None,
            trouble: Trouble::default(),
            shut_down: false,
        }
    }

    /// The chip after another power-up: what is wrong outside of it stays.
    pub(super) fn powered_up(&self, microsteps_per_step: u16) -> PowerStep01 {
        PowerStep01 {
            trouble: self.trouble,
            shut_down: self.trouble.overheated,
            ..PowerStep01::power_up(microsteps_per_step)
        }
    }

    // ---- time

    pub(super) fn next_wake(&self) -> Option<Instant> {
        self.axis.next_wake()
    }

    pub(super) fn handle_wake(&mut self, now: Instant) {
        self.steer(now, |axis, _| axis.handle_wake(now));
    }

    // ---- commands

    /// Turns at `speed` full steps per second, or the nearest that `MIN_SPEED` and `MAX_SPEED` allow.
    pub(super) fn run(&mut self, now: Instant, direction: Direction, speed: f64) {
        let counts = scale::SPEED.round(speed) * f64::from(self.microsteps_per_step);
        self.begin(now, Busy::UntilConstant);
        self.energise();
        self.steer(now, |axis, limits| axis.run(now, direction, counts, limits));
    }

    /// Goes `displacement` microsteps from where it is, and stops there.
    pub(super) fn move_by(&mut self, now: Instant, displacement: i64) {
        self.begin(now, Busy::UntilStanding);
        self.energise();
        let target = self.axis.count(now).saturating_add(displacement);
        self.steer(now, |axis, limits| axis.move_to(now, target, limits));
    }

    pub(super) fn soft_stop(&mut self, now: Instant) {
        self.begin(now, Busy::UntilStanding);
        self.energise();
        self.steer(now, |axis, limits| axis.brake(now, limits));
    }

    pub(super) fn hard_stop(&mut self, now: Instant) {
        self.begin(now, Busy::UntilStanding);
        self.energise();
        self.steer(now, |axis, _| axis.halt(now));
    }

    pub(super) fn soft_hi_z(&mut self, now: Instant) {
        self.begin(now, Busy::UntilStanding);
        self.release_at_standstill = true;
        self.steer(now, |axis, limits| axis.brake(now, limits));
    }

    pub(super) fn hard_hi_z(&mut self, now: Instant) {
        self.begin(now, Busy::UntilStanding);
        self.release_at_standstill = true;
        self.steer(now, |axis, _| axis.halt(now));
    }

    /// `RESET_POS`: the present position is zero from now on.
    pub(super) fn reset_position(&mut self, now: Instant) {
        self.zero = self.axis.count(now);
    }

    /// Remembers the present position as the mark.
    pub(super) fn set_mark(&mut self, now: Instant) {
        self.mark = self.position(now);
    }

    /// Back to the state at power-up; the rotor stays where it is.
    pub(super) fn reset(&mut self, now: Instant) {
        self.axis.halt(now);
        let rotor = self.rotor(now);
        let zero = self.axis.count(now);
        let axis = Axis::new(zero);
        *self = PowerStep01 {
            axis,
            zero,
            rotor_origin: (rotor, zero),
            el_origin: rotor,
            starts: self.starts,
            ..self.powered_up(self.microsteps_per_step)
        };
    }

    // ---- the step clock

    /// `STEP_CLOCK`: the step input moves the standing motor, while `enabled`. `READY` stays as it is, and the motor
    /// counts as standing.
    pub(super) fn begin_step_clock(&mut self, now: Instant, enabled: bool) {
        self.axis.halt(now);
        self.step_clock = Some(StepClock { target: self.axis.count(now) });
        if enabled {
            self.energise();
        } else {
            self.energised = false;
        }
        self.release_at_standstill = false;
        self.protect(now);
    }

    /// The enable input of the step clock. ASSUMED: without it the motor is de-energised and steps do nothing.
    pub(super) fn enable_steps(&mut self, now: Instant, enabled: bool) {
        if self.step_clock.is_some() && self.energised != enabled {
            self.begin_step_clock(now, enabled);
        }
    }

    /// A step of the step input.
    pub(super) fn step(&mut self, now: Instant, direction: Direction) {
        let Some(StepClock { target }) = self.step_clock.filter(|_| self.energised) else { return };
        let target = direction.step(target, 1);
        self.step_clock = Some(StepClock { target });
        self.steer(now, |axis, limits| axis.move_to(now, target, limits));
    }

    // ---- what goes wrong

    /// The motor is short-circuited, or not any more. While a current flows that shuts the bridges down.
    pub(super) fn short_motor(&mut self, now: Instant, shorted: bool) {
        self.trouble.shorted = shorted;
        self.protect(now);
    }

    /// The chip is too hot, or not any more. That shuts the bridges down.
    pub(super) fn overheat(&mut self, now: Instant, overheated: bool) {
        self.trouble.overheated = overheated;
        self.protect(now);
    }

    /// Whether the chip is too hot.
    pub(super) fn is_overheated(&self) -> bool {
        self.trouble.overheated
    }

    /// Whether the bridges are shut down.
    pub(super) fn is_shut_down(&self) -> bool {
        self.shut_down
    }

    /// Shuts the bridges down if something is wrong. ASSUMED: the controller takes motion commands all the same, and each
    /// is over at once; the flags that say why are not in the part of the status that it shows.
    fn protect(&mut self, now: Instant) {
        let Trouble { shorted, overheated } = self.trouble;
        self.shut_down |= overheated || (shorted && self.energised);
        if self.shut_down && self.energised {
            self.axis.halt(now);
            self.energised = false;
            self.release_at_standstill = false;
            self.busy = Busy::No;
            self.step_clock = None;
        }
    }

    // ---- settings

    pub(super) fn parameters(&self) -> &Parameters {
        &self.parameters
    }

    /// Changes parameters. Only `MAX_SPEED` and `FS_SPEED` may change while the motor turns; the motion in progress
    /// keeps to the new `MAX_SPEED`.
    pub(super) fn set_parameters(&mut self, now: Instant, change: impl FnOnce(&mut Parameters)) {
        self.full_steps_before = self.full_steps(now);
        change(&mut self.parameters);
        self.steer(now, |axis, limits| axis.set_limits(now, limits));
    }

    /// Changes the microstep mode of a de-energised motor. The position keeps its number; the electrical position
    /// starts again at 0.
    pub(super) fn set_microsteps(&mut self, now: Instant, microsteps_per_step: u16) {
        if microsteps_per_step == self.microsteps_per_step {
            return;
        }
        let rotor = self.rotor(now);
        self.rotor_origin = (rotor, self.axis.count(now));
        self.el_origin = rotor;
        self.microsteps_per_step = microsteps_per_step;
    }

    // ---- flags

    /// Sets `CMD_ERROR`. `true` when it was clear before.
    pub(super) fn raise_command_error(&mut self) -> bool {
        !core::mem::replace(&mut self.command_error, true)
    }

    pub(super) fn latch_switch_event(&mut self) {
        self.switch_event = true;
    }

    /// `CLR`: clears the latched flags. Bridges that were shut down can be used again, unless the chip is still too hot;
    /// ASSUMED, as `CLR` is what reads and clears the chip's status.
    pub(super) fn clear_flags(&mut self) {
        self.command_error = false;
        self.switch_event = false;
        self.shut_down = self.trouble.overheated;
    }

    pub(super) fn command_error(&self) -> bool {
        self.command_error
    }

    pub(super) fn switch_event(&self) -> bool {
        self.switch_event
    }

    pub(super) fn energised(&self) -> bool {
        self.energised
    }

    /// How often the phases were energised since power-up.
    pub(super) fn starts(&self) -> u32 {
        self.starts
    }

    pub(super) fn ready(&self) -> bool {
        self.busy == Busy::No
    }

    // ---- motion as it is

    pub(super) fn phase(&self, now: Instant) -> Phase {
        if self.step_clock.is_some() { Phase::Stopped } else { self.axis.phase(now) }
    }

    pub(super) fn standing(&self, now: Instant) -> bool {
        self.phase(now) == Phase::Stopped
    }

    pub(super) fn direction(&self) -> Direction {
        self.axis.direction()
    }

    /// `ABS_POS`, in microsteps.
    pub(super) fn position(&self, now: Instant) -> i32 {
        ring::wrap(self.axis.count(now).saturating_sub(self.zero))
    }

    pub(super) fn mark(&self) -> i32 {
        self.mark
    }

    /// The speed in full steps per second, without sign.
    pub(super) fn speed(&self, now: Instant) -> f64 {
        self.axis.speed(now) / f64::from(self.microsteps_per_step)
    }

    /// `SPEED`: the speed as a whole number; 0 while the step input moves the motor.
    pub(super) fn whole_speed(&self, now: Instant) -> u16 {
        if self.step_clock.is_some() {
            return 0;
        }
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "`as` saturates, and never sees a sign"
        )]
        let speed = (self.speed(now) + 0.5) as u16;
        speed
    }

    /// `EL_POS`: bits 8:7 the full step in the electrical cycle, 6:0 the microstep in 1/128. Driven in full steps, the
    /// motor has no microsteps.
    pub(super) fn el_pos(&self, now: Instant) -> u16 {
        let full_steps_mask = if self.full_steps(now) { !(EL_UNITS - 1) } else { !0 };
        let place = self.electrical(now).rem_euclid(4 * EL_UNITS) & full_steps_mask;
        u16::try_from(place).unwrap_or(0)
    }

    /// The rotor's place at `now`, in [`ROTOR_UNITS`] to the full step.
    pub(super) fn rotor(&self, now: Instant) -> i64 {
        let (rotor, count) = self.rotor_origin;
        let counts = self.axis.count(now).saturating_sub(count);
        rotor.saturating_add(counts.saturating_mul(self.units_per_count()))
    }

    /// When the motion as it is planned first brings the rotor to `place` or past it.
    pub(super) fn when_rotor_reaches(&self, place: i64) -> Option<Instant> {
        let (rotor, count) = self.rotor_origin;
        let units = place.saturating_sub(rotor);
        let per_count = self.units_per_count();
        let whole = units.div_euclid(per_count);
        let exact = units.rem_euclid(per_count) == 0;
        let counts = match self.direction() {
            Direction::Forward if !exact => whole.saturating_add(1),
            Direction::Forward | Direction::Reverse => whole,
        };
        self.axis.when_reaches(count.saturating_add(counts))
    }

    /// Where the rotor will be when the motion in progress ends as it is planned; `None` when there is none, and of a run.
    pub(super) fn destination(&self) -> Option<i64> {
        let (rotor, count) = self.rotor_origin;
        let counts = self.axis.destination()?.saturating_sub(count);
        Some(rotor.saturating_add(counts.saturating_mul(self.units_per_count())))
    }

    // ---- inside

    fn units_per_count(&self) -> i64 {
        (ROTOR_UNITS / i64::from(self.microsteps_per_step)).max(1)
    }

    /// Energises the phases. Bridges that are shut down do not follow; see [`PowerStep01::protect`].
    fn energise(&mut self) {
        if !self.energised && !self.shut_down {
            self.starts = self.starts.saturating_add(1);
        }
        self.energised = true;
    }

    /// A motion command begins: it ends the step clock and supersedes what was to happen at standstill.
    fn begin(&mut self, now: Instant, busy: Busy) {
        if self.step_clock.take().is_some() {
            self.axis.halt(now);
        }
        self.release_at_standstill = false;
        self.busy = busy;
    }

    /// Lets `act` change the motion, with the limits in force, and settles what follows from it.
    fn steer(&mut self, now: Instant, act: impl FnOnce(&mut Axis, &Limits)) {
        let limits = self.limits();
        // A motion may start at the very instant at which the one before it ended.
        let (leg_before, stood) = (self.axis.leg_start(), self.standing(now));
        let full_steps = self.full_steps(now);
        act(&mut self.axis, &limits);
        if stood || self.axis.leg_start() != leg_before {
            self.full_steps_before = full_steps;
        }
        let phase = self.axis.phase(now);
        match self.busy {
            Busy::UntilConstant if phase == Phase::Constant => self.busy = Busy::No,
            Busy::UntilStanding if phase == Phase::Stopped => self.busy = Busy::No,
            Busy::No | Busy::UntilConstant | Busy::UntilStanding => {}
        }
        if phase == Phase::Stopped && self.release_at_standstill {
            self.release_at_standstill = false;
            self.energised = false;
        }
        self.protect(now);
    }

    /// The limits in microsteps, as the chip rounds them (decision 37); none but the pace of the steps while the step
    /// input moves the motor.
    fn limits(&self) -> Limits {
        if self.step_clock.is_some() {
            return step_clock_limits();
        }
        let per_step = f64::from(self.microsteps_per_step);
        let rounded = |scale: scale::Scale, value: u16| scale.round(f64::from(value)) * per_step;
        let min_speed = rounded(scale::MIN_SPEED, self.parameters.min_speed);
        Limits {
            start: min_speed,
            stop: min_speed,
            max: rounded(scale::MAX_SPEED, self.parameters.max_speed),
            acc: rounded(scale::ACCELERATION, self.parameters.acc),
            dec: rounded(scale::ACCELERATION, self.parameters.dec),
            zero_wait: Duration::ZERO,
        }
    }

    /// The electrical position in 1/128 steps, unwrapped.
    fn electrical(&self, at: Instant) -> i64 {
        self.rotor(at).saturating_sub(self.el_origin) / (ROTOR_UNITS / EL_UNITS)
    }

    /// Whether the motor is driven in full steps at `now`. It changes over at the first whole step after the speed has
    /// passed `FS_SPEED`.
    fn full_steps(&self, now: Instant) -> bool {
        if self.standing(now) {
            return false;
        }
        let threshold =
            scale::FS_SPEED.round(f64::from(self.parameters.fs_speed)) * f64::from(self.microsteps_per_step);
        let crossing = self.axis.crossing(now, threshold);
        let (since, before) = match crossing.since {
            Some(at) => (at, !crossing.above),
            None => (self.axis.leg_start(), self.full_steps_before),
        };
        let step = |at: Instant| self.electrical(at).div_euclid(EL_UNITS);
        if crossing.above != before && step(since) == step(now) { before } else { crossing.above }
    }
}

fn step_clock_limits() -> Limits {
    let pace = STEP_CLOCK_MICROSTEPS_PER_SECOND;
    Limits { start: pace, stop: pace, max: pace, acc: STEEPEST, dec: STEEPEST, zero_wait: Duration::ZERO }
}
