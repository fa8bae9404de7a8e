//! Where time comes from, and how fast it passes. Everything else takes it as an argument.

mod course;
mod published;

use course::{Course, Line};
use published::Published;
use std::future::pending;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use stepdrive_rig::file::ClockMode;
use stepdrive_spec::time::Instant;
use tokio::sync::Notify;

/// The longest that one timer is set for; a timer for centuries is more than every platform can do.
const LONGEST_SLEEP: Duration = Duration::from_hours(24);

/// The rig's clock, shared by all that is in the rig.
///
/// Rig time is a straight line over wall time, `tokio::time::Instant`, until it is given another speed or moved.
pub(crate) struct Clock {
    /// When the clock was started. Wall time is counted in nanoseconds from here.
    started: tokio::time::Instant,
    /// The truth, changed by one at a time.
    course: Mutex<Course>,
    /// A copy of the line that it is on, for [`Clock::now`].
    published: Published,
    /// Rung after the speed has changed or time was moved.
    changed: Notify,
}

/// Why rig time was not moved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum CannotJump {
    /// The clock is not paused.
    #[error("rig time can be moved only while the clock is paused; pause it first")]
    Running,
    /// It is later already.
    #[error("rig time cannot be moved back to {to}: it is {now} already; give a later time")]
    Back {
        /// The present rig time.
        now: Instant,
        /// The time that was asked for.
        to: Instant,
    },
}

/// What somebody who waits for an instant has to do.
enum Wait {
    Over,
    /// Rig time stands.
    ForChange,
    /// It comes at this wall time, if nothing changes.
    Until(tokio::time::Instant),
}

impl Clock {
    /// Starts the clock: it is [`Instant::ZERO`] now.
    pub(crate) fn start(mode: ClockMode) -> Clock {
        let course = Course::start(mode);
        Clock {
            started: tokio::time::Instant::now(),
            published: Published::new(course.line()),
            course: Mutex::new(course),
            changed: Notify::new(),
        }
    }

    /// The present rig time.
    ///
    /// Whoever asks twice never sees it go back, whatever is done to the clock meanwhile, except by
    /// [`Clock::hold_back`].
    pub(crate) fn now(&self) -> Instant {
        self.read(|line, wall| line.rig_at(wall))
    }

    /// How rig time passes.
    pub(crate) fn mode(&self) -> ClockMode {
        self.lock().mode()
    }

    /// Lets rig time pass as `mode` says, from the present rig time on, which is returned.
    pub(crate) fn set_mode(&self, mode: ClockMode) -> Instant {
        let now = self.change(|course, wall| course.set_mode(mode, wall));
        self.changed.notify_waiters();
        now
    }

    /// Moves rig time forward to `to`. Only while the clock is paused.
    pub(crate) fn jump_to(&self, to: Instant) -> Result<(), CannotJump> {
        self.change(|course, wall| course.jump_to(to, wall))?;
        self.changed.notify_waiters();
        Ok(())
    }

    /// Says that the machines have got only as far as `to` although it is later already: rig time goes back to `to` and
    /// on from there, so that a speed that is too high for this computer becomes slower instead of piling up.
    ///
    /// Rig time goes back, so a machine that was farther holds on to its own last time. It never goes back behind the
    /// last change by [`Clock::set_mode`] or [`Clock::jump_to`]: somebody was told when that was. Nothing happens when
    /// `to` is to come, or while the clock is paused, since then the machines catch up by themselves.
    pub(crate) fn hold_back(&self, to: Instant) {
        // Nobody is woken: a sleeper wakes too early now, sees that and goes on sleeping.
        if to < self.now() {
            self.change(|course, wall| course.hold_back(to, wall));
        }
    }

    /// How much of the speed that was asked for was reached in the last five to ten seconds of wall time, but not
    /// longer than since the last change: 1 is all of it, as when nothing was held back; 0 none.
    pub(crate) fn reached(&self) -> f64 {
        let course = self.lock();
        course.reached(self.wall())
    }

    /// Waits until it is `at` in rig time, whatever is done to the clock meanwhile; for ever when `at` is `None` or
    /// [`Instant::FAR_FUTURE`]. It never wakes early, and up to a few milliseconds of wall time late.
    pub(crate) async fn sleep_until(&self, at: Option<Instant>) {
        let Some(at) = at.filter(|at| *at != Instant::FAR_FUTURE) else { return pending().await };
        // Who finds `at` past again and again, at a high speed, must still let others run.
        tokio::task::coop::consume_budget().await;
        loop {
            // Listening comes before looking, so that no change falls between the two.
            let changed = self.changed.notified();
            match self.wait_for(at) {
                Wait::Over => return,
                Wait::ForChange => changed.await,
                Wait::Until(wall) => tokio::select! {
                    biased;
                    () = changed => {}
                    () = tokio::time::sleep_until(wall) => {}
                },
            }
        }
    }

    fn wait_for(&self, at: Instant) -> Wait {
        self.read(|line, wall| {
            if line.rig_at(wall) >= at {
                return Wait::Over;
            }
            let Some(due) = line.wall_at(at) else { return Wait::ForChange };
            let longest = Duration::from_nanos(wall) + LONGEST_SLEEP;
            Wait::Until(self.started + Duration::from_nanos(due).min(longest))
        })
    }

    /// Reads the line and the wall time of the same moment.
    fn read<R>(&self, read: impl Fn(Line, u64) -> R) -> R {
        self.published.read(|line| read(line, self.wall())).unwrap_or_else(|| {
            // It is being changed; that takes some tens of nanoseconds.
            let course = self.lock();
            read(course.line(), self.wall())
        })
    }

    /// Changes the course, with the wall time at which that is.
    fn change<R>(&self, change: impl FnOnce(&mut Course, u64) -> R) -> R {
        let mut course = self.lock();
        self.published.withdraw();
        let outcome = change(&mut course, self.wall());
        self.published.publish(course.line());
        outcome
    }

    /// Nanoseconds of wall time since the clock was started.
    fn wall(&self) -> u64 {
        u64::try_from(self.started.elapsed().as_nanos()).unwrap_or(u64::MAX)
    }

    fn lock(&self) -> MutexGuard<'_, Course> {
        // Every change of the course is whole, even if somebody panicked.
        self.course.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, Ordering};
    use tokio::task::JoinHandle;
    use tokio::time::{advance, sleep};

    const MODES: [ClockMode; 4] =
        [ClockMode::Real, ClockMode::Factor(1e6), ClockMode::Paused, ClockMode::Factor(0.01)];

    /// The grain of tokio's timers.
    const GRAIN: Duration = Duration::from_millis(1);

    /// In tests on a real clock this is long only when they fail.
    const TOO_LONG: Duration = Duration::from_secs(30);

    fn millis(millis: u64) -> Instant {
        Instant::ZERO + Duration::from_millis(millis)
    }

    fn secs(secs: u64) -> Instant {
        millis(secs * 1_000)
    }

    async fn wait_secs(secs: u64) {
        sleep(Duration::from_secs(secs)).await;
    }

    /// A task that sleeps; it returns the wall time since the start and the rig time at which it woke.
    fn sleeper(clock: &Arc<Clock>, at: Instant) -> JoinHandle<(Duration, Instant)> {
        let clock = Arc::clone(clock);
        tokio::spawn(async move {
            clock.sleep_until(Some(at)).await;
            (clock.started.elapsed(), clock.now())
        })
    }

    async fn woken(sleeper: JoinHandle<(Duration, Instant)>) -> (Duration, Instant) {
        tokio::time::timeout(TOO_LONG, sleeper).await.expect("nobody woke it").unwrap()
    }

    #[tokio::test(start_paused = true)]
    async fn rig_time_passes_as_the_mode_says() {
        for (mode, expected) in [
            (ClockMode::Real, 90_000_000_001),
            (ClockMode::Factor(100.0), 9_000_000_000_100),
            (ClockMode::Factor(2.5), 225_000_000_002),
            (ClockMode::Factor(0.01), 900_000_000),
            (ClockMode::Factor(1e6), 90_000_000_001_000_000),
            (ClockMode::Paused, 0),
        ] {
            let clock = Clock::start(mode);
            assert_eq!(clock.now(), Instant::ZERO);
            assert_eq!(clock.mode(), mode);
            advance(Duration::from_nanos(90_000_000_001)).await;
            assert_eq!(clock.now(), Instant::from_nanos(expected), "{mode:?}");
        }
    }

    #[tokio::test(start_paused = true)]
    async fn a_change_goes_on_from_the_present_rig_time() {
        let clock = Clock::start(ClockMode::Real);
        advance(Duration::from_secs(10)).await;
        for (mode, then) in [
            (ClockMode::Factor(100.0), secs(1_010)),
            (ClockMode::Paused, secs(1_010)),
            (ClockMode::Factor(0.01), millis(1_010_100)),
            (ClockMode::Factor(0.01), millis(1_010_200)),
            (ClockMode::Real, millis(1_020_200)),
        ] {
            let before = clock.now();
            assert_eq!(clock.set_mode(mode), before);
            assert_eq!(clock.now(), before);
            assert_eq!(clock.mode(), mode);
            advance(Duration::from_secs(10)).await;
            assert_eq!(clock.now(), then, "{mode:?}");
        }
    }

    #[tokio::test(start_paused = true)]
    async fn rig_time_is_moved_only_while_paused_and_only_forward() {
        let clock = Clock::start(ClockMode::Real);
        assert_eq!(clock.jump_to(secs(5)), Err(CannotJump::Running));
        advance(Duration::from_secs(2)).await;
        clock.set_mode(ClockMode::Paused);
        assert_eq!(clock.jump_to(secs(1)), Err(CannotJump::Back { now: secs(2), to: secs(1) }));
        assert_eq!(clock.now(), secs(2));
        assert_eq!(clock.jump_to(secs(2)), Ok(()));
        assert_eq!(clock.jump_to(secs(5)), Ok(()));
        assert_eq!(clock.now(), secs(5));
        clock.set_mode(ClockMode::Factor(3.0));
        advance(Duration::from_secs(2)).await;
        assert_eq!(clock.now(), secs(11));
    }

    #[test]
    fn a_refused_move_says_what_to_do() {
        assert_eq!(
            CannotJump::Running.to_string(),
            "rig time can be moved only while the clock is paused; pause it first"
        );
        assert_eq!(
            CannotJump::Back { now: secs(2), to: secs(1) }.to_string(),
            "rig time cannot be moved back to 1.000000000 s: it is 2.000000000 s already; give a later time"
        );
    }

    #[tokio::test(start_paused = true)]
    async fn a_sleeper_wakes_at_its_time_whatever_the_speed() {
        for (mode, wall) in [
            (ClockMode::Real, Duration::from_hours(1)),
            (ClockMode::Factor(1e6), Duration::from_micros(3_600)),
            (ClockMode::Factor(7.0), Duration::from_nanos(514_285_714_286)),
            (ClockMode::Factor(0.01), Duration::from_hours(100)),
        ] {
            let clock = Arc::new(Clock::start(mode));
            let (woken, now) = sleeper(&clock, secs(3_600)).await.unwrap();
            assert!(now >= secs(3_600), "{mode:?}: early, at {now}");
            assert!(woken >= wall && woken <= wall + GRAIN, "{mode:?}: {woken:?}");
        }
    }

    #[tokio::test(start_paused = true)]
    async fn a_sleeper_follows_every_change_of_speed() {
        let clock = Arc::new(Clock::start(ClockMode::Real));
        let sleeper = sleeper(&clock, secs(1_000));
        wait_secs(100).await;
        clock.set_mode(ClockMode::Factor(100.0));
        wait_secs(2).await;
        clock.set_mode(ClockMode::Paused);
        wait_secs(5_000).await;
        assert!(!sleeper.is_finished());
        assert_eq!(clock.set_mode(ClockMode::Real), secs(300));
        let (wall, now) = sleeper.await.unwrap();
        assert_eq!(wall, Duration::from_secs(5_802));
        assert_eq!(now, secs(1_000));
    }

    #[tokio::test(start_paused = true)]
    async fn a_sleeper_is_woken_by_a_move_of_rig_time_that_reaches_it() {
        let clock = Arc::new(Clock::start(ClockMode::Paused));
        let [first, second] = [10, 20].map(|at| sleeper(&clock, secs(at)));
        wait_secs(1).await;
        clock.jump_to(millis(9_999)).unwrap();
        wait_secs(1).await;
        assert!(!first.is_finished());
        clock.jump_to(secs(10)).unwrap();
        assert_eq!(woken(first).await, (Duration::from_secs(2), secs(10)));
        wait_secs(1).await;
        assert!(!second.is_finished());
        clock.jump_to(secs(50)).unwrap();
        assert_eq!(woken(second).await, (Duration::from_secs(3), secs(50)));
    }

    #[tokio::test(start_paused = true)]
    async fn nobody_waits_for_what_is_over_even_on_a_paused_clock() {
        let clock = Clock::start(ClockMode::Paused);
        clock.sleep_until(Some(Instant::ZERO)).await;
        assert_eq!(clock.started.elapsed(), Duration::ZERO);
    }

    #[tokio::test(start_paused = true)]
    async fn never_does_not_come_even_at_the_end_of_time() {
        let clock = Clock::start(ClockMode::Factor(1e6));
        advance(Duration::from_hours(24)).await;
        assert_eq!(clock.now(), Instant::FAR_FUTURE);
        for never in [None, Some(Instant::FAR_FUTURE)] {
            let waited = tokio::time::timeout(Duration::from_hours(1), clock.sleep_until(never)).await;
            assert!(waited.is_err(), "{never:?} came");
        }
    }

    #[tokio::test(start_paused = true)]
    async fn a_sleep_for_longer_than_a_timer_is_set_for_ends_in_time() {
        let clock = Arc::new(Clock::start(ClockMode::Factor(0.01)));
        let (wall, now) = sleeper(&clock, secs(10 * 24 * 3_600)).await.unwrap();
        assert_eq!(wall, Duration::from_hours(24_000));
        assert_eq!(now, secs(10 * 24 * 3_600));
    }

    #[tokio::test(start_paused = true)]
    async fn whoever_is_always_late_lets_others_run() {
        let clock = Clock::start(ClockMode::Factor(1e6));
        let late = tokio::spawn(async move {
            for _ in 0..100_000 {
                clock.sleep_until(Some(Instant::ZERO)).await;
            }
        });
        tokio::task::yield_now().await;
        assert!(!late.is_finished());
        late.await.unwrap();
    }

    #[tokio::test(start_paused = true)]
    async fn a_clock_that_is_held_back_slows_down_to_what_the_machines_reach() {
        let clock = Clock::start(ClockMode::Factor(100.0));
        assert_eq!(clock.reached().to_bits(), 1.0_f64.to_bits());
        let mut done = Instant::ZERO;
        for _ in 0..2_000 {
            advance(Duration::from_millis(10)).await;
            done = done + Duration::from_millis(250);
            clock.hold_back(done);
        }
        assert_eq!(clock.now(), secs(500));
        assert_eq!(clock.mode(), ClockMode::Factor(100.0));
        assert!((clock.reached() - 0.25).abs() < 0.01, "{}", clock.reached());

        advance(Duration::from_secs(10)).await;
        assert_eq!(clock.now(), secs(1_500));
        assert_eq!(clock.reached().to_bits(), 1.0_f64.to_bits());
    }

    #[tokio::test(start_paused = true)]
    async fn what_was_lost_before_a_change_is_not_held_against_the_new_speed() {
        let clock = Clock::start(ClockMode::Factor(100.0));
        advance(Duration::from_secs(1)).await;
        clock.hold_back(Instant::ZERO);
        assert_eq!(clock.reached().to_bits(), 0.0_f64.to_bits());
        clock.set_mode(ClockMode::Real);
        advance(Duration::from_secs(4)).await;
        clock.hold_back(secs(3));
        assert!((clock.reached() - 0.75).abs() < 1e-9, "{}", clock.reached());
    }

    #[tokio::test(start_paused = true)]
    async fn holding_back_never_goes_behind_the_last_change_nor_forward() {
        let clock = Clock::start(ClockMode::Real);
        advance(Duration::from_secs(10)).await;
        clock.hold_back(secs(11));
        assert_eq!(clock.now(), secs(10));

        clock.set_mode(ClockMode::Paused);
        clock.hold_back(secs(3));
        assert_eq!(clock.now(), secs(10));

        clock.jump_to(secs(20)).unwrap();
        clock.set_mode(ClockMode::Factor(2.0));
        advance(Duration::from_secs(1)).await;
        clock.hold_back(secs(3));
        assert_eq!(clock.now(), secs(20));
    }

    #[tokio::test(start_paused = true)]
    async fn a_sleeper_on_a_clock_that_was_held_back_does_not_wake_early() {
        let clock = Arc::new(Clock::start(ClockMode::Real));
        let sleeper = sleeper(&clock, secs(100));
        wait_secs(90).await;
        clock.hold_back(secs(50));
        let (wall, now) = sleeper.await.unwrap();
        assert_eq!(wall, Duration::from_secs(140));
        assert_eq!(now, secs(100));
    }

    #[test]
    fn rig_time_never_goes_back_for_anybody_while_others_change_the_clock() {
        let clock = Clock::start(ClockMode::Real);
        let ended = AtomicBool::new(false);
        let watch = || {
            let mut last = clock.now();
            while !ended.load(Ordering::Relaxed) {
                let now = clock.now();
                assert!(now >= last, "{last}, then {now}");
                last = now;
            }
        };
        let change = || {
            for round in 0..20_000_usize {
                let before = clock.now();
                let changed = clock.set_mode(MODES[round % MODES.len()]);
                assert!(changed >= before, "{before}, then changed at {changed}");
                let _ = clock.jump_to(changed + Duration::from_nanos(500));
                assert!(clock.now() >= changed);
            }
        };
        std::thread::scope(|scope| {
            let watchers = [scope.spawn(watch), scope.spawn(watch)];
            let changers = [scope.spawn(change), scope.spawn(change)];
            let changed = changers.map(|thread| thread.join().is_ok());
            ended.store(true, Ordering::Relaxed);
            let watched = watchers.map(|thread| thread.join().is_ok());
            assert_eq!((changed, watched), ([true; 2], [true; 2]));
        });
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn no_change_is_missed_that_comes_while_somebody_goes_to_sleep() {
        let clock = Arc::new(Clock::start(ClockMode::Paused));
        for round in 1..=5_000 {
            let sleeper = sleeper(&clock, millis(round));
            clock.jump_to(millis(round)).unwrap();
            assert_eq!(woken(sleeper).await.1, millis(round));
        }
    }
}
