//! Arbitrary commands at arbitrary times.
#![allow(clippy::float_cmp, reason = "these figures are exact")]

mod common;

use common::{SECOND, config, limits};
use core::time::Duration;
use proptest::prelude::*;
use stepdrive_motion::check::{End, check};
use stepdrive_motion::{Axis, Direction, Goal, Limits, Phase};
use stepdrive_spec::time::Instant;

#[derive(Clone, Copy, Debug)]
enum Command {
    Run(Direction, f64),
    MoveTo(i64),
    Brake,
    Halt,
    SetLimits(Limits),
    Again,
}

fn command() -> impl Strategy<Value = Command> {
    let direction = prop_oneof![Just(Direction::Forward), Just(Direction::Reverse)];
    let target = prop_oneof![-100..100_i64, -2_000_000..2_000_000_i64];
    prop_oneof![
        3 => (direction, 0.0..2e6).prop_map(|(direction, speed)| Command::Run(direction, speed)),
        4 => target.prop_map(Command::MoveTo),
        1 => Just(Command::Brake),
        1 => Just(Command::Halt),
        2 => limits().prop_map(Command::SetLimits),
        1 => Just(Command::Again),
    ]
}

/// Commands, each with the nanoseconds to let pass before it.
fn script() -> impl Strategy<Value = Vec<(u64, Command)>> {
    let pause = prop_oneof![0..3_u64, 0..SECOND / 1000, 0..SECOND, 0..20 * SECOND];
    prop::collection::vec((pause, command()), 1..12)
}

/// An axis with its limits, watched: every step in time is held against what its speed allows.
struct Watched {
    axis: Axis,
    limits: Limits,
    /// The highest speed since the watch began that the present limits need not cover.
    top: f64,
    now: Instant,
}

impl Watched {
    fn new(limits: Limits) -> Watched {
        Watched { axis: Axis::new(0), limits, top: limits.max, now: Instant::ZERO }
    }

    fn command(&mut self, command: Command) {
        let (count, speed) = (self.axis.count(self.now), self.axis.speed(self.now));
        match command {
            Command::Run(direction, speed) => self.axis.run(self.now, direction, speed, &self.limits),
            Command::MoveTo(target) => self.axis.move_to(self.now, target, &self.limits),
            Command::Brake => self.axis.brake(self.now, &self.limits),
            Command::Halt => self.axis.halt(self.now),
            Command::SetLimits(limits) => {
                self.limits = limits;
                self.axis.set_limits(self.now, &limits);
            }
            Command::Again => self.axis.set_limits(self.now, &self.limits),
        }
        assert_eq!(self.axis.count(self.now), count, "the command moved the rotor");
        self.top = self.limits.max.max(speed);
        self.judge(speed);
    }

    /// Has the checker look at the present leg, which was planned at the speed `v0`.
    fn judge(&self, v0: f64) {
        let Some(profile) = self.axis.profile().filter(|_| self.axis.leg_start() == self.now) else { return };
        let end = match self.axis.goal() {
            Goal::Run { .. } if profile.duration_s().is_none() => End::Endless,
            Goal::MoveTo(target) => {
                let n = self.axis.count(self.now).abs_diff(target);
                if profile.end_position() == n as f64 { End::At(n) } else { End::Anywhere }
            }
            Goal::Run { .. } | Goal::Stand => End::Anywhere,
        };
        // Up to the stop speed it may have stood in between.
        let judged = check(profile, &self.limits, v0, end);
        if judged.is_err() && v0 <= self.limits.stop {
            assert_eq!(check(profile, &self.limits, 0.0, end), Ok(()));
        } else {
            assert_eq!(judged, Ok(()));
        }
    }

    /// Lets time pass, waking the axis in time and looking at it in between.
    fn pass(&mut self, nanos: u64) {
        let end = self.now + Duration::from_nanos(nanos);
        let mut wakes = 0;
        while let Some(wake) = self.axis.next_wake().filter(|&wake| wake <= end) {
            assert!(wake > self.now || wakes == 0, "a wake in the past");
            self.step(wake);
            assert!(self.axis.next_wake().is_none_or(|next| next > wake), "stuck at {wake}");
            wakes += 1;
            assert!(wakes <= 12, "wakes without end");
        }
        self.step(end);
    }

    fn step(&mut self, to: Instant) {
        let from = self.now;
        let span = to.since(from);
        let mut last = self.axis.count(from);
        for part in [1, 2, 3] {
            let at = from + span * part / 3;
            let count = self.axis.count(at);
            let ahead = match self.axis.direction() {
                Direction::Forward => count - last,
                Direction::Reverse => last - count,
            };
            let most = self.top * span.as_secs_f64() / 3.0 * (1.0 + 1e-9) + 1.01;
            assert!(ahead >= 0 && ahead as f64 <= most, "{ahead} counts where {most} are possible");
            assert!(self.axis.speed(at) <= self.top);
            last = count;
        }
        self.axis.handle_wake(to);
        self.now = to;
        assert_eq!(self.axis.count(to), last, "handling a wake moved the rotor");
        if self.axis.phase(to) == Phase::Constant {
            assert!(self.axis.speed(to) <= self.limits.max, "settled above the limit");
            self.top = self.limits.max;
        }
        if to > from {
            self.judge(0.0);
        }
    }

    /// Lets all the time pass that the present goal needs.
    fn settle(&mut self) {
        let mut wakes = 0;
        while let Some(wake) = self.axis.next_wake() {
            self.step(wake);
            wakes += 1;
            assert!(wakes <= 12, "wakes without end");
        }
    }
}

fn play(limits: Limits, script: &[(u64, Command)]) -> Watched {
    let mut watched = Watched::new(limits);
    for &(pause, command) in script {
        watched.pass(pause);
        watched.command(command);
    }
    watched
}

proptest! {
    #![proptest_config(config(512))]

    #[test]
    fn after_any_commands_a_move_ends_exactly_at_its_target(
        limits in limits(), script in script(), target in -2_000_000..2_000_000_i64
    ) {
        let mut watched = play(limits, &script);
        watched.command(Command::MoveTo(target));
        watched.settle();
        prop_assert_eq!(watched.axis.count(watched.now), target);
        prop_assert!(watched.axis.is_standing() && watched.axis.is_settled(watched.now));
    }

    #[test]
    fn after_any_commands_a_brake_ends_at_a_standstill(limits in limits(), script in script()) {
        let mut watched = play(limits, &script);
        let (speed, from) = (watched.axis.speed(watched.now), watched.now);
        watched.command(Command::Brake);
        watched.settle();
        prop_assert!(watched.axis.is_standing());
        prop_assert_eq!(watched.axis.speed(watched.now), 0.0);
        let took = watched.now.since(from).as_secs_f64();
        let expected = f64::max((speed - watched.limits.stop) / watched.limits.dec, 0.0);
        prop_assert!((took - expected).abs() <= 2e-9 + 1e-9 * expected, "{took} s instead of {expected} s");
    }

    #[test]
    fn after_any_commands_a_run_settles_at_its_speed(
        limits in limits(), script in script(), speed in 1.0..2e6, zero_wait in 0..SECOND
    ) {
        let mut watched = play(limits, &script);
        let limits = Limits { zero_wait: Duration::from_nanos(zero_wait), ..watched.limits };
        watched.command(Command::SetLimits(limits));
        watched.command(Command::Run(Direction::Reverse, speed));
        watched.settle();
        prop_assert!(watched.axis.is_settled(watched.now));
        prop_assert_eq!(watched.axis.speed(watched.now), watched.limits.run_speed(speed));
        prop_assert_eq!(watched.axis.direction(), Direction::Reverse);
    }

    #[test]
    fn the_same_commands_give_the_same_axis_and_looking_changes_nothing(limits in limits(), script in script()) {
        let watched = play(limits, &script);
        let mut blind = Watched::new(limits);
        for &(pause, command) in &script {
            blind.now = blind.now + Duration::from_nanos(pause);
            blind.axis.handle_wake(blind.now);
            blind.command(command);
        }
        prop_assert_eq!(watched.axis, blind.axis);
    }

    #[test]
    fn an_axis_emits_a_count_at_the_instant_it_foretold(
        limits in limits(), script in script(), ahead in 1..100_000_i64
    ) {
        let watched = play(limits, &script);
        let axis = &watched.axis;
        let count = axis.direction().step(axis.count(watched.now), ahead);
        if let Some(at) = axis.when_reaches(count) {
            let before = Instant::from_nanos(at.as_nanos() - 1);
            prop_assert_eq!(axis.direction().step(axis.count(before), 1), count);
            prop_assert_eq!(axis.count(at), count);
        }
    }

    #[test]
    fn no_limits_make_an_axis_panic_or_wake_without_end(
        numbers in prop::collection::vec(any::<f64>(), 6), script in script(), target in any::<i64>()
    ) {
        let [start, stop, max, acc, dec, speed] = numbers[..] else { unreachable!() };
        let limits = Limits { start, stop, max, acc, dec, zero_wait: Duration::from_secs(1) };
        let mut axis = Axis::new(target);
        let mut now = Instant::ZERO;
        for (pause, _) in script {
            now = now + Duration::from_nanos(pause);
            axis.run(now, Direction::Forward, speed, &limits);
            axis.move_to(now + Duration::from_nanos(pause), target, &limits);
            now = axis.next_wake().unwrap_or(now).max(now);
            axis.brake(now, &limits);
            axis.set_limits(now, &Limits { max: speed, ..limits });
        }
        axis.move_to(now, 0, &limits);
        let mut wakes = 0;
        while let Some(wake) = axis.next_wake() {
            prop_assert!(wakes < 12);
            axis.handle_wake(wake);
            prop_assert!(axis.next_wake().is_none_or(|next| next > wake));
            wakes += 1;
        }
    }
}
