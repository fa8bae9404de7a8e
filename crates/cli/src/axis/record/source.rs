//! Axes that are read again and again. One that does not answer holds up the others for a moment only.

use super::quantity::Choice;
use crate::Failure;
use crate::axis::Opened;
use crate::table::Column;
use crate::terminal::tell;
use std::rc::Rc;
use std::time::Duration;
use stepdrive_host::Error;
use stepdrive_rig::duration;
use tokio::task::{JoinHandle, spawn_local};
use tokio::time::{Instant, timeout_at};

type Reading = Result<Vec<Option<f64>>, Error>;

/// An axis that is recorded.
pub(super) struct Source {
    pub(super) opened: Rc<Opened>,
    choice: Rc<Choice>,
    /// What was asked for and is not there yet.
    pending: Option<JoinHandle<Reading>>,
    /// Since when it does not answer.
    silent: Option<Instant>,
    /// How many rows have nothing of it.
    pub(super) missing: u64,
}

impl Source {
    pub(super) fn new(opened: Opened, choice: Choice) -> Source {
        let (opened, choice) = (Rc::new(opened), Rc::new(choice));
        Source { opened, choice, pending: None, silent: None, missing: 0 }
    }

    pub(super) fn columns(&self) -> Vec<Column> {
        self.choice.columns(&self.opened)
    }

    /// Reads it once, for as long as it takes.
    pub(super) async fn try_out(&self) -> Result<(), Failure> {
        let values = self.choice.read(&self.opened).await?;
        debug_assert_eq!(values.len(), self.choice.len());
        Ok(())
    }

    /// Asks for its values, unless it still owes those that were asked for before.
    pub(super) fn ask(&mut self) {
        if self.pending.is_none() {
            let (opened, choice) = (Rc::clone(&self.opened), Rc::clone(&self.choice));
            self.pending = Some(spawn_local(async move { choice.read(&opened).await }));
        }
    }

    /// Its values; none when they do not come in time. Who was silent before is not waited for, and what comes then is too
    /// old for the row, but shows that it answers again.
    pub(super) async fn answer(&mut self, deadline: Instant) -> Vec<Option<f64>> {
        let was_silent = self.silent.is_some();
        let deadline = if was_silent { Instant::now() } else { deadline };
        let reading = match &mut self.pending {
            Some(pending) => timeout_at(deadline, pending).await.ok(),
            None => None,
        };
        if reading.is_some() {
            self.pending = None;
        }
        match reading {
            Some(Ok(Ok(values))) => {
                self.answers();
                if !was_silent {
                    return values;
                }
            }
            Some(Ok(Err(error))) => self.falls_silent(&error.to_string()),
            Some(Err(_)) | None => self.falls_silent("it does not answer"),
        }
        self.missing += 1;
        vec![None; self.choice.len()]
    }

    fn answers(&mut self) {
        if let Some(since) = self.silent.take() {
            let lasted =
                Duration::from_millis(u64::try_from(since.elapsed().as_millis()).unwrap_or(u64::MAX));
            tell(&format!(
                "stepdrive: {} answers again after {}",
                self.opened.name(),
                duration::display(lasted)
            ));
        }
    }

    fn falls_silent(&mut self, why: &str) {
        if self.silent.is_none() {
            self.silent = Some(Instant::now());
            tell(&format!(
                "stepdrive: {}: {why}; its cells stay empty until it answers again",
                self.opened.name()
            ));
        }
    }
}
