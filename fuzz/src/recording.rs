//! Recordings of rigs.

use stepdrive_server::replay::{ReplayError, replay_within};

/// The most that may happen in a rig: a line of a recording may be centuries later than the one before.
const MOST: u64 = 20_000;

/// A recording: it is refused in one line that says where, or it is judged, and judged alike a second time.
///
/// # Panics
/// When that does not hold.
pub fn recording(data: &[u8]) {
    match replay_within(data, MOST) {
        Ok(replayed) => {
            assert_eq!(replayed.identical, replayed.differences == 0 && !replayed.altered);
            assert_eq!(replayed.first_difference.is_some(), replayed.differences > 0);
            assert!(replayed.requests <= replayed.entries && !replayed.to_string().is_empty());
            let again = replay_within(data, MOST).ok();
            assert_eq!(again, Some(replayed));
        }
        Err(error) => check(&error),
    }
}

fn check(error: &ReplayError) {
    let told = error.to_string();
    assert!(told.starts_with("line ") && !told.contains('\n'), "{told}");
}
