//! What becomes of requests and replies on a line with faults.
//!
//! A [`Link`] stands between a connection and its drive: each request asks it whether it may pass, each reply goes
//! through it on its way out. What is wrong is a setting of the drive, [`LineFaults`]; what happens to which request is
//! drawn from the seed.

mod outgoing;

pub(crate) use outgoing::Outgoing;

use rand_core::Rng as _;
use rand_pcg::Pcg64Dxsm;
use std::time::Duration;
use stepdrive_rig::line::{Chance, Connection, Delay, LineFaults, Pieces};
use stepdrive_spec::modbus::Exception;

/// The most bits of a reply that are damaged.
const MOST_DAMAGE: usize = 3;

/// Which sequence of the generator is used: the default one of PCG. Links differ by where in it they start.
const SEQUENCE: u128 = 0x0a02_bdbf_7bb3_c0a7_ac28_fa16_a64a_bf96;

/// What is spoken on a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Protocol {
    /// Modbus TCP.
    Modbus,
    /// The lines of an SMD3.
    Lines,
    /// The packets of an SMSD's standard protocol.
    Packets,
}

/// What becomes of a request before the drive sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Fate {
    /// The drive gets it.
    Deliver,
    /// It is not carried out and not answered.
    Swallow,
    /// It is not carried out, and answered with this exception. The answer is a reply like any other and goes through
    /// [`Link::reply`].
    Refuse(Exception),
    /// The connection is closed; it is neither carried out nor answered.
    Cut,
}

/// The faults of one connection.
///
/// What is drawn depends on the seed, the number of the connection, the settings, and the requests and replies, and on
/// nothing else: not on time, and not on how the bytes were cut into packets. So replay draws the same. A fault whose
/// chance is never or always draws nothing for it.
#[derive(Clone, Debug)]
pub(crate) struct Link {
    protocol: Protocol,
    dice: Dice,
}

impl Link {
    /// The link of the connection with this number. The same seed and number give the same faults.
    pub(crate) fn new(protocol: Protocol, seed: u64, connection: u64) -> Link {
        Link { protocol, dice: Dice::new(seed, connection) }
    }

    /// What becomes of a request.
    pub(crate) fn request(&mut self, faults: &LineFaults) -> Fate {
        match (faults.connection, faults.exception) {
            (Connection::Good, None) => Fate::Deliver,
            (Connection::Cut, _) => Fate::Cut,
            (Connection::Silent, _) => Fate::Swallow,
            (Connection::Good, Some((exception, chance))) => {
                let refuse = self.protocol == Protocol::Modbus && self.dice.happens(chance);
                if refuse { Fate::Refuse(exception) } else { Fate::Deliver }
            }
        }
    }

    /// What the identification of a reply is changed by before it is put into a packet, whose checksum is then right; 0
    /// leaves it as it is.
    pub(crate) fn change_of_id(&mut self, faults: &LineFaults) -> u8 {
        if faults.connection != Connection::Good || !self.dice.happens(faults.wrong_id) {
            return 0;
        }
        // Other than zero, so that it changes.
        u8::try_from(1 + self.dice.below(0xFF)).unwrap_or(1)
    }

    /// What becomes of one whole reply: puts what leaves behind what is in `out`.
    ///
    /// The faults act in this order: drop, transaction identifier, damage, duplicate, delay, pieces. So damage may hit
    /// the identifier, and what comes twice is as it was damaged. Each reply is delayed by itself: of pipelined requests
    /// the second is answered after two delays, as by a controller that is slow, not one that is far away.
    pub(crate) fn reply(&mut self, faults: &LineFaults, reply: &[u8], out: &mut Outgoing) {
        if is_passed_on(faults) {
            out.push(reply);
        } else if !reply.is_empty() {
            self.spoil(faults, reply, out);
        }
    }

    #[cold]
    fn spoil(&mut self, faults: &LineFaults, reply: &[u8], out: &mut Outgoing) {
        if faults.connection != Connection::Good || self.dice.happens(faults.drop) {
            return;
        }
        let mut reply = reply.to_vec();
        if self.protocol == Protocol::Modbus && self.dice.happens(faults.wrong_id) {
            self.change_id(&mut reply);
        }
        if self.dice.happens(faults.damage) {
            self.damage(&mut reply);
        }
        if self.dice.happens(faults.duplicate) {
            self.duplicate(&mut reply);
        }
        if let Some(delay) = faults.delay {
            out.pause(self.delay(delay));
        }
        match faults.pieces {
            Some(pieces) => self.cut(pieces, &reply, out),
            None => out.push(&reply),
        }
    }

    /// Gives a Modbus reply another transaction identifier.
    fn change_id(&mut self, reply: &mut [u8]) {
        // Other than zero, so that it changes.
        let change = u16::try_from(1 + self.dice.below(0xFFFF)).unwrap_or(1);
        for (byte, change) in reply.iter_mut().zip(change.to_be_bytes()) {
            *byte ^= change;
        }
    }

    /// Turns over one to three bits.
    fn damage(&mut self, reply: &mut [u8]) {
        let count = 1 + self.dice.place(MOST_DAMAGE);
        let bits = [(); MOST_DAMAGE].map(|()| self.dice.place(reply.len() * 8));
        for (index, bit) in bits.iter().enumerate().take(count) {
            // A bit that is drawn twice is turned over once.
            let again = bits.iter().take(index).any(|other| other == bit);
            if let Some(byte) = reply.get_mut(bit / 8).filter(|_| !again) {
                *byte ^= 1 << (bit % 8);
            }
        }
    }

    /// Repeats a run of bytes right after itself, as a flaky serial adapter does.
    fn duplicate(&mut self, reply: &mut Vec<u8>) {
        let start = self.dice.place(reply.len());
        let count = 1 + self.dice.place(reply.len() - start);
        let run: Vec<u8> = reply.iter().skip(start).take(count).copied().collect();
        let end = start + run.len();
        reply.splice(end..end, run);
    }

    /// A delay within its jitter, at least none.
    fn delay(&mut self, Delay { delay, jitter }: Delay) -> Duration {
        if jitter.is_zero() {
            return delay;
        }
        let span = u64::try_from(jitter.as_nanos()).unwrap_or(u64::MAX).saturating_mul(2);
        let above = Duration::from_nanos(self.dice.below(span.saturating_add(1)));
        (delay + above).saturating_sub(jitter)
    }

    /// Sends a reply in pieces, cut at places of which each is as likely as any other.
    fn cut(&mut self, pieces: Pieces, reply: &[u8], out: &mut Outgoing) {
        let mut cuts = usize::from(pieces.count.saturating_sub(1)).min(reply.len().saturating_sub(1));
        for (place, byte) in reply.iter().enumerate() {
            // Before each byte but the first: `cuts` of the places left are to be taken.
            if place > 0 && self.dice.place(reply.len() - place) < cuts {
                cuts -= 1;
                out.pause(pieces.gap);
            }
            out.push(&[*byte]);
        }
    }
}

/// Whether a reply leaves as it is.
fn is_passed_on(faults: &LineFaults) -> bool {
    let LineFaults { connection, delay, drop, pieces, duplicate, damage, wrong_id, exception: _ } = faults;
    // One comparison for the four; a chance is in a million, so that no bit of it gets lost.
    let chances = [drop, duplicate, damage, wrong_id].map(|chance| chance.parts_per_million());
    let any = chances.into_iter().fold(0, |any, chance| any | chance);
    any == 0 && delay.is_none() && pieces.is_none() && *connection == Connection::Good
}

/// Draws.
#[derive(Clone, Debug)]
struct Dice(Pcg64Dxsm);

impl Dice {
    fn new(seed: u64, connection: u64) -> Dice {
        Dice(Pcg64Dxsm::new(u128::from(connection) << 64 | u128::from(seed), SEQUENCE))
    }

    /// A whole number below `end`, each as likely as any other to within 2^-64 · `end`; zero when there is none.
    fn below(&mut self, end: u64) -> u64 {
        let product = u128::from(self.0.next_u64()) * u128::from(end);
        u64::try_from(product >> 64).unwrap_or(0)
    }

    /// A place below `end`.
    fn place(&mut self, end: usize) -> usize {
        let end = u64::try_from(end).unwrap_or(u64::MAX);
        usize::try_from(self.below(end)).unwrap_or(0)
    }

    fn happens(&mut self, chance: Chance) -> bool {
        match chance {
            Chance::NEVER => false,
            Chance::ALWAYS => true,
            chance => {
                let parts = u64::from(chance.parts_per_million());
                self.below(u64::from(Chance::ALWAYS.parts_per_million())) < parts
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::outgoing::Part;
    use super::*;
    use proptest::prelude::*;

    /// The reply to a read of one register.
    const REPLY: &[u8] = &[0x12, 0x34, 0x00, 0x00, 0x00, 0x05, 0x01, 0x03, 0x02, 0xAB, 0xCD];

    const GOOD: LineFaults = LineFaults {
        connection: Connection::Good,
        delay: None,
        drop: Chance::NEVER,
        pieces: None,
        duplicate: Chance::NEVER,
        damage: Chance::NEVER,
        wrong_id: Chance::NEVER,
        exception: None,
    };

    fn link(seed: u64) -> Link {
        Link::new(Protocol::Modbus, seed, 1)
    }

    /// What leaves of a reply, as milliseconds of pause and bytes.
    fn sent(link: &mut Link, faults: &LineFaults, reply: &[u8]) -> Vec<(u128, Vec<u8>)> {
        let mut out = Outgoing::new();
        link.reply(faults, reply, &mut out);
        out.parts().map(|part| (part.pause.as_millis(), part.bytes.to_vec())).collect()
    }

    /// What leaves of a reply on a line that does not delay or cut it.
    fn bytes(link: &mut Link, faults: &LineFaults, reply: &[u8]) -> Vec<u8> {
        let mut parts = sent(link, faults, reply);
        assert!(parts.len() < 2 && parts.iter().all(|(pause, _)| *pause == 0));
        parts.pop().map_or(Vec::new(), |(_, bytes)| bytes)
    }

    fn changed_bits(reply: &[u8], sent: &[u8]) -> u32 {
        assert_eq!(reply.len(), sent.len());
        reply.iter().zip(sent).map(|(before, after)| (before ^ after).count_ones()).sum()
    }

    fn millis(millis: u64) -> Duration {
        Duration::from_millis(millis)
    }

    #[test]
    fn replies_of_a_good_line_are_gathered_as_they_are_and_draw_and_allocate_nothing() {
        let mut link = link(1);
        let mut out = Outgoing::new();
        assert!(out.is_empty() && out.parts().next().is_none());
        link.reply(&GOOD, REPLY, &mut out);
        link.reply(&GOOD, b"OK\r\n", &mut out);
        let expected = [REPLY, b"OK\r\n"].concat();
        assert_eq!(out.len(), expected.len());
        assert_eq!(out.parts().collect::<Vec<_>>(), [Part { pause: Duration::ZERO, bytes: &expected }]);
        let room = out.bytes.capacity();
        for _ in 0..1_000 {
            out.clear();
            link.reply(&GOOD, REPLY, &mut out);
            assert_eq!(link.request(&GOOD), Fate::Deliver);
        }
        assert_eq!((out.bytes.capacity(), out.pauses.capacity()), (room, 0));
        assert_eq!(link.dice.0, super::tests::link(1).dice.0);
    }

    #[test]
    fn a_dropped_reply_does_not_leave_though_its_request_was_delivered() {
        let faults = LineFaults { drop: Chance::ALWAYS, ..GOOD };
        assert_eq!(link(1).request(&faults), Fate::Deliver);
        assert!(sent(&mut link(1), &faults, REPLY).is_empty());
    }

    #[test]
    fn a_wrong_transaction_identifier_changes_nothing_else() {
        let faults = LineFaults { wrong_id: Chance::ALWAYS, ..GOOD };
        let sent = bytes(&mut link(1), &faults, REPLY);
        assert_eq!(sent, [0x43, 0x43, 0x00, 0x00, 0x00, 0x05, 0x01, 0x03, 0x02, 0xAB, 0xCD]);
    }

    #[test]
    fn damage_turns_over_up_to_three_bits() {
        let faults = LineFaults { damage: Chance::ALWAYS, ..GOOD };
        let sent = bytes(&mut link(1), &faults, REPLY);
        assert_eq!(sent, [0x12, 0x34, 0x00, 0x00, 0x00, 0x05, 0x01, 0x03, 0x02, 0xEB, 0xCD]);
        let mut link = link(2);
        let mut seen = [0; MOST_DAMAGE + 1];
        for _ in 0..1_000 {
            seen[changed_bits(REPLY, &bytes(&mut link, &faults, REPLY)) as usize] += 1;
        }
        assert_eq!(seen[0], 0);
        assert!(seen[1..].iter().all(|count| *count > 250), "{seen:?}");
    }

    #[test]
    fn a_run_of_bytes_comes_twice_in_a_row() {
        let faults = LineFaults { duplicate: Chance::ALWAYS, ..GOOD };
        let sent = bytes(&mut link(1), &faults, b"1200,0,5\r\n");
        assert_eq!(sent, b"1200,0,5\r\n0,0,5\r\n");
        assert_eq!(bytes(&mut link(1), &faults, b"x"), b"xx");
    }

    #[test]
    fn a_reply_comes_in_pieces_with_gaps_between() {
        let faults = LineFaults { pieces: Some(Pieces { count: 3, gap: millis(10) }), ..GOOD };
        let sent = sent(&mut link(1), &faults, b"1200,0,5\r\n");
        assert_eq!(sent, [(0, b"120".to_vec()), (10, b"0,0".to_vec()), (10, b",5\r\n".to_vec())]);
    }

    #[test]
    fn pieces_without_a_gap_are_still_written_one_by_one() {
        let faults = LineFaults { pieces: Some(Pieces { count: 64, gap: Duration::ZERO }), ..GOOD };
        let sent = sent(&mut link(1), &faults, b"abc");
        assert_eq!(sent, [(0, b"a".to_vec()), (0, b"b".to_vec()), (0, b"c".to_vec())]);
    }

    #[test]
    fn each_reply_is_delayed_within_the_jitter_and_never_less_than_nothing() {
        let delay = |delay, jitter| Some(Delay { delay: millis(delay), jitter: millis(jitter) });
        let exact = LineFaults { delay: delay(20, 0), ..GOOD };
        assert_eq!(sent(&mut link(1), &exact, REPLY), [(20, REPLY.to_vec())]);
        let pauses = |faults: &LineFaults| {
            let mut link = link(1);
            let mut out = Outgoing::new();
            (0..1_000).for_each(|_| link.reply(faults, REPLY, &mut out));
            out.parts().map(|part| part.pause.as_secs_f64() * 1e3).collect::<Vec<f64>>()
        };
        let jittered = pauses(&LineFaults { delay: delay(20, 5), ..GOOD });
        assert_eq!(jittered.len(), 1_000);
        assert!(jittered.iter().all(|pause| (15.0..=25.0).contains(pause)));
        assert!(jittered.iter().any(|pause| *pause < 15.5) && jittered.iter().any(|pause| *pause > 24.5));
        let mean = jittered.iter().sum::<f64>() / 1e3;
        assert!((mean - 20.0).abs() < 0.5, "{mean}");
        let clipped = pauses(&LineFaults { delay: delay(1, 5), ..GOOD });
        let zeros = clipped.iter().filter(|pause| **pause == 0.0).count();
        assert!((350..450).contains(&zeros), "{zeros}");
        assert!(clipped.iter().all(|pause| *pause <= 6.0));
    }

    #[test]
    fn what_comes_after_the_last_fault_is_sent_with_the_part_before() {
        let mut link = link(1);
        let mut out = Outgoing::new();
        link.reply(&GOOD, b"a", &mut out);
        link.reply(
            &LineFaults { delay: Some(Delay { delay: millis(7), jitter: Duration::ZERO }), ..GOOD },
            b"b",
            &mut out,
        );
        link.reply(&GOOD, b"c", &mut out);
        let parts: Vec<_> = out.parts().map(|part| (part.pause, part.bytes)).collect();
        assert_eq!(parts, [(Duration::ZERO, &b"a"[..]), (millis(7), b"bc")]);
        out.clear();
        assert!(out.is_empty() && out.parts().next().is_none());
    }

    #[test]
    fn a_line_that_is_cut_or_silent_carries_neither_requests_nor_replies() {
        let exception = Some((Exception::ServerDeviceBusy, Chance::ALWAYS));
        for (connection, fate) in [(Connection::Cut, Fate::Cut), (Connection::Silent, Fate::Swallow)] {
            let faults = LineFaults { connection, exception, ..GOOD };
            assert_eq!(link(1).request(&faults), fate);
            assert!(sent(&mut link(1), &faults, REPLY).is_empty());
        }
    }

    #[test]
    fn requests_are_refused_with_the_exception_as_often_as_it_is_set() {
        let busy = |chance| LineFaults { exception: Some((Exception::ServerDeviceBusy, chance)), ..GOOD };
        let refused = Fate::Refuse(Exception::ServerDeviceBusy);
        assert_eq!(link(1).request(&busy(Chance::ALWAYS)), refused);
        let mut link = link(1);
        let count = (0..10_000).filter(|_| link.request(&busy(Chance::percent(30))) == refused).count();
        assert!((2_800..=3_200).contains(&count), "{count}");
    }

    #[test]
    fn lines_of_text_have_no_exceptions_and_no_transaction_identifiers() {
        let exception = Some((Exception::ServerDeviceBusy, Chance::ALWAYS));
        let faults = LineFaults { exception, wrong_id: Chance::ALWAYS, ..GOOD };
        let mut link = Link::new(Protocol::Lines, 1, 1);
        assert_eq!(link.request(&faults), Fate::Deliver);
        assert_eq!(bytes(&mut link, &faults, b"0,1\r\n"), b"0,1\r\n");
    }

    #[test]
    fn packets_have_no_exceptions_and_get_another_identification_before_they_are_made() {
        let exception = Some((Exception::ServerDeviceBusy, Chance::ALWAYS));
        let faults = LineFaults { exception, wrong_id: Chance::ALWAYS, ..GOOD };
        let mut link = Link::new(Protocol::Packets, 1, 1);
        assert_eq!(link.request(&faults), Fate::Deliver);
        assert_eq!(bytes(&mut link, &faults, REPLY), REPLY);
        assert!((0..1_000).all(|_| link.change_of_id(&faults) != 0));
        let before = link.dice.0.clone();
        assert_eq!(link.change_of_id(&GOOD), 0);
        assert_eq!(link.dice.0, before, "a good line draws nothing");
    }

    #[test]
    fn a_chance_is_kept_over_many_replies() {
        for percent in [1, 30, 99] {
            let faults = LineFaults { drop: Chance::percent(percent), ..GOOD };
            let mut link = link(u64::from(percent));
            let dropped = (0..10_000).filter(|_| bytes(&mut link, &faults, REPLY).is_empty()).count();
            assert!(dropped.abs_diff(100 * percent as usize) <= 200, "{percent} %: {dropped}");
        }
    }

    #[test]
    fn connections_and_seeds_have_faults_of_their_own() {
        let faults = LineFaults { drop: Chance::percent(50), ..GOOD };
        let pattern = |seed, connection| {
            let mut link = Link::new(Protocol::Modbus, seed, connection);
            (0..64).fold(0_u64, |bits, _| bits << 1 | u64::from(bytes(&mut link, &faults, REPLY).is_empty()))
        };
        let mut patterns: Vec<u64> =
            (0..30).flat_map(|a| (0..30).map(move |b| (a, b))).map(|(a, b)| pattern(a, b)).collect();
        // Those of neighbours differ in about half of their 64 places.
        for pair in patterns.windows(2) {
            assert!((12..=52).contains(&(pair[0] ^ pair[1]).count_ones()), "{pair:x?}");
        }
        patterns.sort_unstable();
        patterns.dedup();
        assert_eq!(patterns.len(), 900);
    }

    #[test]
    fn the_generator_is_the_same_in_every_version() {
        // A recording that is played again depends on it. Reckoned from the definition of PCG64DXSM.
        let mut dice = Dice::new(0x0123_4567_89AB_CDEF, 42);
        assert_eq!(
            [(); 3].map(|()| dice.0.next_u64()),
            [0x6F93_51C2_37F0_5292, 0x4DEC_AE89_718D_4520, 0x4966_63B8_A50A_5B51]
        );
    }

    prop_compose! {
        /// Faults that leave a reply's length and bytes as they are.
        fn timing()(
            delay in prop::option::of((0..50_u64, 0..50_u64)),
            pieces in prop::option::of((2..=64_u8, 0..50_u64)),
        ) -> LineFaults {
            LineFaults {
                delay: delay.map(|(delay, jitter)| Delay { delay: millis(delay), jitter: millis(jitter) }),
                pieces: pieces.map(|(count, gap)| Pieces { count, gap: millis(gap) }),
                ..GOOD
            }
        }
    }

    fn chance() -> impl Strategy<Value = Chance> {
        prop_oneof![Just(Chance::NEVER), Just(Chance::ALWAYS), (0..=100_u32).prop_map(Chance::percent)]
    }

    prop_compose! {
        fn any_faults()(
            timing in timing(),
            (drop, duplicate, damage, wrong_id) in (chance(), chance(), chance(), chance()),
        ) -> LineFaults {
            LineFaults { drop, duplicate, damage, wrong_id, ..timing }
        }
    }

    fn replies() -> impl Strategy<Value = Vec<Vec<u8>>> {
        prop::collection::vec(prop::collection::vec(any::<u8>(), 0..262), 0..6)
    }

    proptest! {
        #[test]
        fn the_same_seed_and_connection_give_the_same(
            faults in any_faults(), seed: u64, connection: u64, replies in replies(),
        ) {
            let run = || {
                let mut link = Link::new(Protocol::Modbus, seed, connection);
                replies.iter().map(|reply| sent(&mut link, &faults, reply)).collect::<Vec<_>>()
            };
            prop_assert_eq!(run(), run());
        }

        #[test]
        fn timing_keeps_all_bytes_in_order(faults in timing(), seed: u64, replies in replies()) {
            let mut link = link(seed);
            let mut out = Outgoing::new();
            for reply in &replies {
                link.reply(&faults, reply, &mut out);
            }
            let sent: Vec<u8> = out.parts().flat_map(|part| part.bytes.to_vec()).collect();
            prop_assert_eq!(sent, replies.concat());
        }

        #[test]
        fn there_are_as_many_pieces_as_set_or_as_there_are_bytes(
            count in 2..=64_u8, seed: u64, reply in prop::collection::vec(any::<u8>(), 1..262),
        ) {
            let faults = LineFaults { pieces: Some(Pieces { count, gap: millis(3) }), ..GOOD };
            let parts = sent(&mut link(seed), &faults, &reply);
            prop_assert_eq!(parts.len(), usize::from(count).min(reply.len()));
            prop_assert!(parts.iter().skip(1).all(|(pause, _)| *pause == 3) && parts[0].0 == 0);
        }

        #[test]
        fn damage_turns_over_one_to_three_bits(seed: u64, reply in prop::collection::vec(any::<u8>(), 1..262)) {
            let faults = LineFaults { damage: Chance::ALWAYS, ..GOOD };
            prop_assert!((1..=3).contains(&changed_bits(&reply, &bytes(&mut link(seed), &faults, &reply))));
        }

        #[test]
        fn a_wrong_identifier_is_never_the_right_one(seed: u64, reply in prop::collection::vec(any::<u8>(), 2..262)) {
            let faults = LineFaults { wrong_id: Chance::ALWAYS, ..GOOD };
            let sent = bytes(&mut link(seed), &faults, &reply);
            prop_assert_ne!(&sent[..2], &reply[..2]);
            prop_assert_eq!(&sent[2..], &reply[2..]);
        }

        #[test]
        fn a_repeated_run_stands_right_behind_itself(seed: u64, reply in prop::collection::vec(any::<u8>(), 1..64)) {
            let faults = LineFaults { duplicate: Chance::ALWAYS, ..GOOD };
            let sent = bytes(&mut link(seed), &faults, &reply);
            let run = sent.len() - reply.len();
            let repeats = |start: usize| {
                let (before, rest) = sent.split_at(start + run);
                rest.starts_with(&before[start..]) && [before, &rest[run..]].concat() == reply
            };
            prop_assert!((1..=reply.len()).contains(&run));
            prop_assert!((0..=reply.len() - run).any(repeats));
        }
    }
}
