//! The contacts of switches, which may stick or bounce.

use alloc::vec::Vec;
use core::time::Duration;
use rand_core::Rng as _;
use rand_pcg::Pcg32;
use stepdrive_spec::time::Instant;

/// How badly the switches of an input work.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SwitchFault {
    /// They work.
    #[default]
    None,
    /// They never close.
    StuckOpen,
    /// They never open.
    StuckClosed,
    /// When they close or open, they do so several times.
    Bouncing,
}

/// The most times that a bouncing contact comes back.
const MOST_BOUNCES: u32 = 4;

/// How long a bouncing contact stays as it is, at least and at most, in nanoseconds: a microswitch's bounces.
const BOUNCE_NANOS: [u32; 2] = [50_000, 500_000];

/// Which sequence of the generator is used.
const SEQUENCE: u64 = 0x0a02_bdbf_7bb3_c0a7;

/// The contacts of all inputs.
#[derive(Clone, Debug)]
pub(crate) struct Contacts {
    /// Which are closed as the switches stand, a bit each.
    closed: u16,
    stuck_open: u16,
    stuck_closed: u16,
    bouncing: u16,
    /// Which of the bouncing ones have come off for the moment.
    off: u16,
    /// The next changes of bouncing contacts: when, and which.
    bounces: Vec<(Instant, u16)>,
    random: Pcg32,
}

impl Contacts {
    /// Contacts that work, with these closed.
    pub(crate) fn new(seed: u64, closed: u16) -> Contacts {
        Contacts {
            closed,
            stuck_open: 0,
            stuck_closed: 0,
            bouncing: 0,
            off: 0,
            bounces: Vec::new(),
            random: random(seed),
        }
    }

    /// Chooses the bounces to come.
    pub(crate) fn set_seed(&mut self, seed: u64) {
        self.random = random(seed);
    }

    /// Lets the contacts of an input work like this.
    pub(crate) fn set_fault(&mut self, bit: u16, fault: SwitchFault) {
        let set = |bits: u16, on: bool| if on { bits | bit } else { bits & !bit };
        self.stuck_open = set(self.stuck_open, fault == SwitchFault::StuckOpen);
        self.stuck_closed = set(self.stuck_closed, fault == SwitchFault::StuckClosed);
        self.bouncing = set(self.bouncing, fault == SwitchFault::Bouncing);
        self.settle(bit);
    }

    /// When a bouncing contact next changes.
    pub(crate) fn next_wake(&self) -> Option<Instant> {
        self.bounces.iter().map(|(at, _)| *at).min()
    }

    /// What the inputs see at `now` with these switches closed, a bit each.
    pub(crate) fn advance(&mut self, now: Instant, closed: u16) -> u16 {
        while let Some(number) = self.bounces.iter().position(|(at, _)| *at <= now) {
            let (_, bit) = self.bounces.remove(number);
            self.off ^= bit;
        }
        let mut changed = core::mem::replace(&mut self.closed, closed) ^ closed;
        changed &= self.bouncing;
        while changed != 0 {
            let bit = changed & changed.wrapping_neg();
            self.bounce(now, bit);
            changed &= !bit;
        }
        ((closed ^ self.off) | self.stuck_closed) & !self.stuck_open
    }

    /// A contact has just changed: it comes back some times before it stays.
    fn bounce(&mut self, now: Instant, bit: u16) {
        self.settle(bit);
        let mut at = now;
        for _ in 0..2 * (1 + self.random.next_u32() % MOST_BOUNCES) {
            let [least, most] = BOUNCE_NANOS;
            let nanos = least + self.random.next_u32() % (most - least);
            at = at + Duration::from_nanos(nanos.into());
            self.bounces.push((at, bit));
        }
    }

    /// A contact stays as its switch stands.
    fn settle(&mut self, bit: u16) {
        self.bounces.retain(|(_, other)| *other != bit);
        self.off &= !bit;
    }
}

/// What bounces are drawn from; PCG's own definition says what a seed gives.
fn random(seed: u64) -> Pcg32 {
    Pcg32::new(seed, SEQUENCE)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a contact shows from the moment on at which its switch closes.
    fn closing(contacts: &mut Contacts) -> Vec<(Instant, u16)> {
        let mut shown = alloc::vec![(Instant::ZERO, contacts.advance(Instant::ZERO, 1))];
        while let Some(at) = contacts.next_wake() {
            shown.push((at, contacts.advance(at, 1)));
        }
        shown
    }

    #[test]
    fn a_bouncing_contact_comes_back_some_times_and_then_stays() {
        for seed in 0..50 {
            let mut contacts = Contacts::new(seed, 0);
            contacts.set_fault(1, SwitchFault::Bouncing);
            let shown = closing(&mut contacts);
            assert!((3..=9).contains(&shown.len()), "{shown:?}");
            assert!(
                shown.iter().enumerate().all(|(number, (_, level))| *level == u16::from(number % 2 == 0))
            );
            assert!(shown.windows(2).all(|pair| {
                let gap = pair[1].0.since(pair[0].0);
                gap >= Duration::from_micros(50) && gap < Duration::from_micros(500)
            }));
        }
    }

    #[test]
    fn the_same_seed_bounces_alike_and_another_one_otherwise() {
        let bounced = |seed| {
            let mut contacts = Contacts::new(seed, 0);
            contacts.set_fault(1, SwitchFault::Bouncing);
            closing(&mut contacts)
        };
        assert_eq!(bounced(7), bounced(7));
        assert_ne!(bounced(7), bounced(8));
    }

    #[test]
    fn a_contact_that_is_stuck_shows_that_and_after_it_what_the_switch_says() {
        let mut contacts = Contacts::new(1, 0);
        contacts.set_fault(1, SwitchFault::StuckClosed);
        assert_eq!(contacts.advance(Instant::ZERO, 0), 1);
        contacts.set_fault(1, SwitchFault::StuckOpen);
        assert_eq!(contacts.advance(Instant::ZERO, 1), 0);
        contacts.set_fault(1, SwitchFault::None);
        assert_eq!(contacts.advance(Instant::ZERO, 1), 1);
    }

    #[test]
    fn a_contact_that_works_changes_once() {
        assert_eq!(closing(&mut Contacts::new(1, 0)), [(Instant::ZERO, 1)]);
    }
}
