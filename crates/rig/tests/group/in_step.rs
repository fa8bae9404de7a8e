//! Two controllers that keep each other in step by their relays.

use crate::bench::{Bench, MS, PAIR};
use std::time::Duration;
use stepdrive_spec::time::Instant;

/// Makes a move, meets the other, and so on. The pauses are long enough for either to see the other's relay.
const LEADER: &str = "
SET_MAX_SPEED 1000
again:
MOVE_F 320
SET_RELE
WAIT_CONTINUE
SET_WAIT 5ms
CLR_RELE
SET_WAIT 5ms
GOTO_PROGRAM again
";

const FOLLOWER: &str = "
SET_MAX_SPEED 500
again:
MOVE_F 160
SET_RELE
WAIT_CONTINUE
SET_WAIT 5ms
CLR_RELE
SET_WAIT 5ms
GOTO_PROGRAM again
";

/// When both relays are on, over so many cycles.
fn meetings(rig: &str, cycles: usize) -> Vec<Instant> {
    let mut bench = Bench::new(rig, &[("a", LEADER), ("b", FOLLOWER)]);
    let mut meetings = Vec::new();
    while meetings.len() < cycles {
        assert!(bench.until("a.RELAY && b.RELAY", Duration::from_mins(1)), "they meet");
        let cycle = f64::from(u32::try_from(meetings.len()).expect("few") + 1);
        // Position 22 bits, which wrap.
        let wrapped = |position: f64| (position + 2_097_152.0).rem_euclid(4_194_304.0) - 2_097_152.0;
        assert_eq!(bench.look("a.ABS_POS"), wrapped(cycle * 320.0));
        assert_eq!(bench.look("b.ABS_POS"), wrapped(cycle * 160.0));
        meetings.push(bench.now);
        assert!(bench.until("!a.RELAY && !b.RELAY", Duration::from_mins(1)), "they part");
    }
    meetings
}

#[test]
fn two_controllers_stay_in_step_over_a_thousand_cycles_exact_to_the_nanosecond() {
    let meetings = meetings(PAIR, 1000);
    let period = meetings[1].since(meetings[0]);
    assert!(period > 20 * MS, "{period:?}");
    for (number, meeting) in meetings.iter().enumerate() {
        let due = meetings[0] + period * u32::try_from(number).expect("few");
        assert_eq!(*meeting, due, "meeting {number}");
    }
}

#[test]
fn with_a_delay_on_the_wires_the_one_that_waits_goes_on_exactly_that_much_later() {
    let apart = |rig: &str| {
        // The follower has the longer way, so that the leader always waits.
        let follower = FOLLOWER.replace("MOVE_F 160", "MOVE_F 1600");
        let mut bench = Bench::new(rig, &[("a", LEADER), ("b", &follower)]);
        let mut apart = Vec::new();
        for _ in 0..100 {
            assert!(bench.until("b.RELAY", Duration::from_mins(1)));
            assert!(bench.until("!b.RELAY", Duration::from_mins(1)));
            let follower = bench.now;
            assert!(bench.until("!a.RELAY", Duration::from_mins(1)));
            apart.push(bench.now.since(follower));
        }
        apart
    };
    let delayed = |delay: &str| apart(&PAIR.replace("to = \"", &format!("delay = \"{delay}\"\nto = \"")));
    let (short, long) = (delayed("3ms"), delayed("4.000001ms"));
    assert!(short.iter().all(|apart| *apart == short[0] && *apart > Duration::ZERO), "{short:?}");
    assert_eq!(long, [short[0] + Duration::from_nanos(1_000_001); 100]);
}
