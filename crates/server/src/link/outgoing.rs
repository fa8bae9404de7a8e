//! Replies on their way out.

use std::iter::once;
use std::time::Duration;

/// Bytes to be sent, with pauses between them.
///
/// The pauses are of the time of the client's world, not of the rig's. A client's timeouts are real: a reply that is to be
/// 20 ms late is so whatever the rig's clock does, and comes at all while it is paused.
#[derive(Debug, Default)]
pub(crate) struct Outgoing {
    pub(super) bytes: Vec<u8>,
    /// The pauses, by how many of the bytes come before them.
    pub(super) pauses: Vec<(usize, Duration)>,
}

/// Bytes to be sent at once, after a pause.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Part<'a> {
    /// How long to wait before they are sent.
    pub(crate) pause: Duration,
    /// At least one.
    pub(crate) bytes: &'a [u8],
}

impl Outgoing {
    /// Nothing to be sent; allocates nothing.
    pub(crate) const fn new() -> Outgoing {
        Outgoing { bytes: Vec::new(), pauses: Vec::new() }
    }

    /// Puts bytes behind the others, without a pause before them.
    pub(crate) fn push(&mut self, bytes: &[u8]) {
        self.bytes.extend_from_slice(bytes);
    }

    /// Lets what is pushed next be sent by itself, after a pause, which may be zero.
    pub(super) fn pause(&mut self, pause: Duration) {
        self.pauses.push((self.bytes.len(), pause));
    }

    /// Puts all of `other` behind the others, and leaves it empty.
    pub(crate) fn append(&mut self, other: &mut Outgoing) {
        let before = self.bytes.len();
        self.bytes.extend_from_slice(&other.bytes);
        self.pauses.extend(other.pauses.iter().map(|(at, pause)| (before + at, *pause)));
        other.clear();
    }

    /// All bytes, without the pauses.
    pub(crate) fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// How many bytes there are to send.
    pub(crate) fn len(&self) -> usize {
        self.bytes.len()
    }

    /// Whether there is nothing to send.
    pub(crate) fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    /// Forgets what there was and keeps the room that it took.
    pub(crate) fn clear(&mut self) {
        self.bytes.clear();
        self.pauses.clear();
    }

    /// What to send, in order. Each part is to be written by itself.
    pub(crate) fn parts(&self) -> impl Iterator<Item = Part<'_>> {
        let starts = once((0, Duration::ZERO)).chain(self.pauses.iter().copied());
        let ends = self.pauses.iter().map(|(at, _)| *at).chain(once(self.bytes.len()));
        let parts = starts
            .zip(ends)
            .map(|((start, pause), end)| Part { pause, bytes: self.bytes.get(start..end).unwrap_or(&[]) });
        parts.filter(|part| !part.bytes.is_empty())
    }
}
