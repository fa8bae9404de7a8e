//! The passwords that a controller may have, while a change to one has not been answered.

use std::time::Duration;
use tokio::time::Instant;

/// For how long a refused password is not tried again.
const REFUSAL_STANDS: Duration = Duration::from_secs(10);

/// Most passwords remembered to which a change was not answered.
const MOST_DOUBTS: usize = 4;

/// The passwords, and whether they were refused.
pub(super) struct Passwords {
    current: u64,
    /// Others that may be the right one, the latest first: a change to them was not answered.
    others: Vec<u64>,
    /// They were refused; until then they are not tried again.
    refused_until: Option<Instant>,
}

impl Passwords {
    pub(super) fn new(password: u64) -> Passwords {
        Passwords { current: password, others: Vec::new(), refused_until: None }
    }

    /// The password in force, as far as is known.
    pub(super) fn current(&self) -> u64 {
        self.current
    }

    /// This password may come into force, now or later; also when it is thought to be in force, since it may turn out that
    /// another one is.
    pub(super) fn may_change_to(&mut self, password: u64) {
        if !self.others.contains(&password) {
            self.others.truncate(MOST_DOUBTS - 1);
            self.others.insert(0, password);
        }
    }

    /// This password is in force.
    pub(super) fn has_changed_to(&mut self, password: u64) {
        self.others.retain(|other| *other != password);
        self.current = password;
    }

    /// What to try, in turn.
    pub(super) fn in_turn(&self) -> Vec<u64> {
        let others = self.others.iter().copied().filter(|other| *other != self.current);
        [self.current].into_iter().chain(others).collect()
    }

    /// All of them have been refused.
    pub(super) fn refuse(&mut self) {
        self.refused_until = Some(Instant::now() + REFUSAL_STANDS);
    }

    /// Whether they were refused not long ago.
    pub(super) fn are_refused(&self) -> bool {
        self.refused_until.is_some_and(|until| Instant::now() < until)
    }
}
