//! A session replays to the same replies and the same state, always.

use crate::bench::replay_it;
use crate::session::recorded;
use std::collections::BTreeSet;

fn entries(what: &str) -> usize {
    recorded().lines().filter(|line| line.contains(what)).count()
}

#[test]
fn a_session_of_both_families_with_faults_replays_identically() {
    let replayed = replay_it(recorded());
    assert!(replayed.identical, "{replayed}");
    assert!(!replayed.cut_short && !replayed.altered && replayed.end.is_some());
    assert_eq!((replayed.differences, &replayed.first_difference), (0, &None));
    assert_eq!(replayed.entries, recorded().lines().count() - 1);
    assert_eq!(replayed.requests, entries("\"heard\""));
    // It would prove little if little had happened.
    assert!(replayed.requests > 500, "{replayed}");
    for (what, least) in [("\"do\"", 27), ("\"clock\"", 10), ("\"open\"", 15), ("\"shut\"", 15)] {
        assert!(entries(what) >= least, "{what}: {}", entries(what));
    }
    let unanswered =
        recorded().lines().filter(|line| line.contains("heard") && !line.contains("\"tx\"")).count();
    assert!(unanswered > 20, "{unanswered}");
}

#[test]
fn a_session_replayed_a_hundred_times_gives_one_digest() {
    let digests: BTreeSet<String> = (0..100).map(|_| replay_it(recorded()).digest).collect();
    assert_eq!(digests.len(), 1);
}
