//! What is remembered of the trust in a position from one command to the next: a small file for each controller in the
//! platform's state folder.

use crate::disk::replace;
use crate::rigs::{fnv1a, state_folder};
use crate::terminal::tell;
use std::cell::RefCell;
use std::fs;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};
use stepdrive_host::trust::TrustState;
use stepdrive_host::uri::Target;
use stepdrive_panel::{Keeper, Kept};

/// What is remembered of one controller.
#[derive(Debug)]
pub(crate) struct Record {
    /// Where; `None` when there is no place for it.
    file: Option<PathBuf>,
    /// Which controller.
    target: String,
    /// What the file held when it was last read or written here.
    known: RefCell<Option<String>>,
}

/// What is to be remembered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Keep {
    /// Zero was set: nothing that was known before counts.
    Zero,
    /// Whatever has become of the trust, unless another command has raised a worse doubt since.
    Acts,
    /// That it is less than it was, unless another command has written since.
    Doubts,
}

impl Record {
    /// The record of a controller, which may hold nothing yet.
    pub(crate) fn of(target: &Target) -> Record {
        let target = named(target);
        let name = format!("{:08x}", fnv1a(target.as_bytes()));
        let file = state_folder().ok().map(|folder| folder.join("trust").join(name));
        let record = Record { file, target, known: RefCell::new(None) };
        record.known.replace(record.read());
        record
    }

    /// What was remembered. A record that cannot be read is none.
    pub(crate) fn state(&self) -> TrustState {
        self.known.borrow().as_deref().and_then(|text| self.parse(text)).unwrap_or_default()
    }

    /// What another command has remembered since, if one has.
    pub(crate) fn news(&self) -> Option<TrustState> {
        let now = self.read();
        if now == *self.known.borrow() {
            return None;
        }
        self.known.replace(now);
        Some(self.state())
    }

    /// Remembers what has become of the trust.
    pub(crate) fn keep(&self, state: TrustState, keep: Keep) {
        let before = self.state();
        let alone = self.read() == *self.known.borrow();
        let wanted = match keep {
            Keep::Zero => true,
            Keep::Acts if alone => state != before,
            Keep::Acts => {
                self.read().and_then(|text| self.parse(&text)).is_none_or(|now| state.trust() >= now.trust())
            }
            Keep::Doubts => alone && state.trust() > before.trust(),
        };
        let Some(file) = self.file.as_ref().filter(|_| wanted) else { return };
        let text = format!("{}\n{state}\n", self.target);
        let written = fs::create_dir_all(file.parent().unwrap_or(file)).map_err(|error| error.to_string());
        let written =
            written.and_then(|()| replace(file, text.as_bytes()).map_err(|failure| failure.to_string()));
        match written {
            Ok(()) => drop(self.known.replace(Some(text))),
            Err(why) => tell(&format!(
                "stepdrive: the trust in the position ({}) could not be noted, so the next command will not know it: {why}",
                state.trust()
            )),
        }
    }

    fn read(&self) -> Option<String> {
        fs::read_to_string(self.file.as_ref()?).ok()
    }

    fn parse(&self, text: &str) -> Option<TrustState> {
        let (target, state) = text.split_once('\n')?;
        (target == self.target).then(|| TrustState::parse(state).ok()).flatten()
    }
}

/// What a controller is remembered by: how its values are read is none of its own.
fn named(target: &Target) -> String {
    match target {
        Target::Smsd { host, port, unit, .. } => {
            Target::Smsd { host: host.clone(), port: *port, unit: *unit, word_order: None }.to_string()
        }
        Target::SmsdUsb { .. }
        | Target::SmsdUsbTcp { .. }
        | Target::SmsdStandard { .. }
        | Target::Smd3Serial { .. }
        | Target::Smd3Tcp { .. } => target.to_string(),
    }
}

/// A record for a program that lasts, in which several tasks look at an axis and act on it.
pub(crate) struct Remembered {
    record: Mutex<Record>,
    /// What was kept last.
    last: Mutex<Option<TrustState>>,
}

impl Remembered {
    /// Remembers in a record.
    pub(crate) fn new(record: Record) -> Remembered {
        Remembered { record: Mutex::new(record), last: Mutex::new(None) }
    }
}

impl Keeper for Remembered {
    fn keep(&self, trust: TrustState, why: Kept) {
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        if *last == Some(trust) && why != Kept::Zeroed {
            return;
        }
        *last = Some(trust);
        let keep = match why {
            Kept::Looked => Keep::Doubts,
            Kept::Acted => Keep::Acts,
            Kept::Zeroed => Keep::Zero,
        };
        self.record.lock().unwrap_or_else(PoisonError::into_inner).keep(trust, keep);
    }

    fn news(&self) -> Option<TrustState> {
        self.record.lock().unwrap_or_else(PoisonError::into_inner).news()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tempfile::TempDir;

    fn record(folder: &TempDir) -> Record {
        let record = Record {
            file: Some(folder.path().join("trust/one")),
            target: "smd3+tcp://h:1".to_owned(),
            known: RefCell::new(None),
        };
        record.known.replace(record.read());
        record
    }

    fn state(text: &str) -> TrustState {
        TrustState::parse(text).expect("a state")
    }

    #[test]
    fn the_next_command_knows_what_became_of_the_last() {
        let folder = TempDir::new().expect("a folder");
        assert_eq!(record(&folder).state(), TrustState::new());
        record(&folder).keep(state("trusted 12.5"), Keep::Acts);
        assert_eq!(record(&folder).state(), state("trusted 12.5"));
    }

    #[test]
    fn who_only_looks_remembers_doubts_unless_somebody_has_acted_meanwhile() {
        let folder = TempDir::new().expect("a folder");
        record(&folder).keep(state("trusted 0"), Keep::Acts);
        let (looks, acts) = (record(&folder), record(&folder));
        looks.keep(state("trusted 5"), Keep::Doubts);
        assert_eq!(record(&folder).state(), state("trusted 0"));
        acts.keep(state("trusted 7"), Keep::Acts);
        looks.keep(state("freed 7"), Keep::Doubts);
        assert_eq!(record(&folder).state(), state("trusted 7"));
        assert_eq!((looks.news(), looks.news()), (Some(state("trusted 7")), None));
        looks.keep(state("freed 7"), Keep::Doubts);
        assert_eq!(record(&folder).state(), state("freed 7"));
    }

    #[test]
    fn a_doubt_that_another_command_has_raised_stands_until_zero_is_set() {
        let folder = TempDir::new().expect("a folder");
        let (moves, stops) = (record(&folder), record(&folder));
        moves.keep(state("trusted"), Keep::Acts);
        stops.keep(state("stopped-dead 3"), Keep::Acts);
        moves.keep(state("trusted 3"), Keep::Acts);
        assert_eq!(record(&folder).state(), state("stopped-dead 3"));
        moves.keep(state("trusted 0"), Keep::Zero);
        assert_eq!(record(&folder).state(), state("trusted 0"));
    }

    #[test]
    fn a_record_that_is_damaged_or_of_another_controller_is_none() {
        let folder = TempDir::new().expect("a folder");
        record(&folder).keep(state("trusted 0"), Keep::Acts);
        let file = folder.path().join("trust/one");
        for text in ["", "smd3+tcp://h:1\nsure\n", "smd3+tcp://other:1\ntrusted 0\n"] {
            fs::write(&file, text).expect("written");
            assert_eq!(record(&folder).state(), TrustState::new(), "{text}");
        }
    }
}
