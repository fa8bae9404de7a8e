//! Stops, which win over whatever was asked for before them.

use super::Stop;
use super::motor::Motor;
use crate::error::Error;
use tokio::sync::watch;

/// The stops that an axis was asked for.
#[derive(Debug, Default)]
pub(super) struct Stops(watch::Sender<Asked>);

#[derive(Clone, Copy, Debug, Default)]
struct Asked {
    /// How often.
    count: u64,
    /// How the last time.
    how: Option<Stop>,
    /// Something acts on the motor at this moment that was asked for after so many stops. There is one at a time.
    acting: Option<u64>,
}

impl Stops {
    /// Notes that somebody asks for a stop. Answers how many there have been.
    pub(super) fn ask(&self, how: Stop) -> u64 {
        self.0.send_modify(|asked| {
            asked.count += 1;
            asked.how = Some(how);
        });
        self.0.borrow().count
    }

    /// Leave from now on. `doing` says what for, as in `it was being sent off`.
    pub(super) fn leave<'a>(&'a self, name: &'a str, doing: &'static str) -> Leave<'a> {
        Leave { stops: self, before: self.0.borrow().count, name, doing }
    }

    /// Waits until nothing acts on the motor any more that was asked for before this stop. Answers whether anything did.
    pub(super) async fn settled(&self, stop: u64) -> bool {
        let acts = |asked: &Asked| asked.acting.is_some_and(|before| before < stop);
        let acted = acts(&self.0.borrow());
        // The sender lives as long as this.
        let _ = self.0.subscribe().wait_for(|asked| !acts(asked)).await;
        acted
    }
}

/// Leave to move a motor. It ends with the next stop that somebody asks for.
#[derive(Clone, Copy, Debug)]
pub struct Leave<'a> {
    stops: &'a Stops,
    /// How many stops there had been.
    before: u64,
    name: &'a str,
    doing: &'static str,
}

impl Leave<'_> {
    /// How the motor was told to stop last, if that was since.
    pub fn ended(&self) -> Option<Stop> {
        let asked = self.stops.0.borrow();
        asked.how.filter(|_| asked.count != self.before)
    }

    /// Fails when the leave has ended.
    ///
    /// # Errors
    /// [`Error::Refused`], which says that somebody asked for a stop.
    pub fn check(&self) -> Result<(), Error> {
        let Leave { name, doing, .. } = self;
        match self.ended() {
            None => Ok(()),
            Some(_) => Err(Error::Refused(format!("{name} was told to stop while {doing}"))),
        }
    }

    /// Does something that acts on the motor, unless the leave has ended. When it ends meanwhile, the motor is stopped again
    /// in the same way, as the stop may have come to the controller first.
    ///
    /// # Errors
    /// Those of what is done and of the stop, and [`Error::Refused`] when the leave has ended.
    pub async fn act<T>(
        &self,
        motor: &impl Motor,
        what: impl Future<Output = Result<T, Error>>,
    ) -> Result<T, Error> {
        // Whoever stops from here on waits until this is over.
        let _acting = Acting::begin(*self);
        self.check()?;
        let done = what.await;
        if let Some(how) = self.ended() {
            motor.stop(how).await?;
        }
        self.check()?;
        done
    }
}

/// Something acts on the motor.
struct Acting<'a>(&'a Stops);

impl<'a> Acting<'a> {
    fn begin(leave: Leave<'a>) -> Acting<'a> {
        leave.stops.0.send_modify(|asked| asked.acting = Some(leave.before));
        Acting(leave.stops)
    }
}

impl Drop for Acting<'_> {
    fn drop(&mut self) {
        self.0.0.send_modify(|asked| asked.acting = None);
    }
}
