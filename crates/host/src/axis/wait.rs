//! Waiting for a motion to end by looking again and again, often at first and near the end.

use std::time::Duration;
use tokio::time::Instant;

/// The shortest pause between two looks.
const FASTEST: Duration = Duration::from_millis(5);
/// The longest.
const SLOWEST: Duration = Duration::from_millis(100);

/// When to look next, and when to give up.
#[derive(Debug)]
pub(super) struct Pace {
    began: Instant,
    timeout: Option<Duration>,
    /// When it should be over.
    expected: Option<Duration>,
    pause: Duration,
}

impl Pace {
    /// A wait that begins now.
    pub(super) fn new(timeout: Option<Duration>, expected: Option<Duration>) -> Pace {
        Pace { began: Instant::now(), timeout, expected, pause: FASTEST }
    }

    /// Pauses until the next look. `false` when the time is over.
    pub(super) async fn pause(&mut self) -> bool {
        let waited = self.began.elapsed();
        let Some(left) = self.timeout.map_or(Some(Duration::MAX), |timeout| timeout.checked_sub(waited))
        else {
            return false;
        };
        tokio::time::sleep(self.next(waited).min(left)).await;
        // The look after the last pause counts.
        left > Duration::ZERO
    }

    /// How long to pause: twice as long each time, but a quarter of what is left where that is known.
    fn next(&mut self, waited: Duration) -> Duration {
        let ahead = self.expected.and_then(|expected| expected.checked_sub(waited));
        let pause = self.pause;
        self.pause = SLOWEST.min(pause * 2);
        match ahead {
            Some(ahead) => (ahead / 4).clamp(FASTEST, pause),
            None => pause,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The pauses of a wait of so many looks, in ms.
    async fn pauses(mut pace: Pace, count: usize) -> Vec<u128> {
        let mut pauses = Vec::new();
        for _ in 0..count {
            let before = Instant::now();
            if !pace.pause().await {
                break;
            }
            pauses.push(before.elapsed().as_millis());
        }
        pauses
    }

    #[tokio::test(start_paused = true)]
    async fn looks_come_less_and_less_often() {
        assert_eq!(pauses(Pace::new(None, None), 7).await, [5, 10, 20, 40, 80, 100, 100]);
    }

    #[tokio::test(start_paused = true)]
    async fn near_the_expected_end_looks_come_often() {
        let pauses = pauses(Pace::new(None, Some(Duration::from_secs(1))), 40).await;
        assert_eq!(pauses[..5], [5, 10, 20, 40, 80]);
        assert!(pauses.contains(&5) && pauses.iter().skip(10).any(|pause| *pause <= 6), "{pauses:?}");
    }

    #[tokio::test(start_paused = true)]
    async fn a_wait_ends_at_its_timeout_with_a_last_look() {
        let began = Instant::now();
        let pauses = pauses(Pace::new(Some(Duration::from_millis(50)), None), 100).await;
        assert_eq!((began.elapsed().as_millis(), pauses.iter().sum::<u128>()), (50, 50));
    }
}
