//! The settings of a controller over its line.

use super::key::{Family, Key};
use super::plan::{Change, Setting};
use crate::error::Error;
use crate::smd3::Smd3Client;
use crate::smsd::{Smsd, Step};
use stepdrive_spec::smd3::commands::{Command, Kind, Request, Value};
use stepdrive_spec::smsd::registers::{Reg, Writable};

/// The driver of a controller, by family.
#[derive(Clone, Copy, Debug)]
pub enum Client<'a> {
    /// Of an SMSD.
    Smsd(&'a dyn Smsd),
    /// Of an SMD3.
    Smd3(&'a Smd3Client),
}

impl Client<'_> {
    /// The family of its controller.
    pub fn family(self) -> Family {
        match self {
            Client::Smsd(_) => Family::Smsd,
            Client::Smd3(_) => Family::Smd3,
        }
    }

    /// Whether its line tells a setting.
    pub fn tells(self, key: Key) -> bool {
        match (self, key) {
            (Client::Smsd(client), Key::Smsd(reg)) => client.check_readable(reg).is_ok(),
            (Client::Smsd(_) | Client::Smd3(_), _) => true,
        }
    }

    /// All settings as they are now, as far as this line tells them.
    ///
    /// # Errors
    /// Those of reading.
    pub async fn read_settings(self) -> Result<Vec<Setting>, Error> {
        let mut keys = Key::all(self.family());
        keys.retain(|key| self.tells(*key));
        match self {
            Client::Smsd(client) => {
                let regs: Vec<Reg> = keys.iter().filter_map(|key| reg(*key)).collect();
                let values = client.read_many(&regs).await?;
                Ok(keys.into_iter().zip(values).map(|(key, value)| (key, value as f64)).collect())
            }
            Client::Smd3(client) => {
                let mut settings = Vec::new();
                for key in keys {
                    if let Key::Smd3(command) = key {
                        settings.push((key, client.get_number(command).await?));
                    }
                }
                Ok(settings)
            }
        }
    }

    /// How the controller stands, as far as settings heed that.
    ///
    /// # Errors
    /// Those of reading.
    pub async fn standing(self) -> Result<Standing, Error> {
        Ok(match self {
            Client::Smsd(client) => {
                let snapshot = client.snapshot().await?;
                Standing { turns: snapshot.is_moving(), energised: !snapshot.status.hi_z, standby: true }
            }
            Client::Smd3(client) => {
                Standing { turns: false, energised: false, standby: client.status().await?.standby() }
            }
        })
    }

    /// Whether the controller, which errors call `name`, takes these changes as it stands now.
    ///
    /// # Errors
    /// [`Error::Refused`] when it does not: nothing is changed then. Those of reading.
    pub async fn check_state(self, name: &str, changes: &[Change]) -> Result<(), Error> {
        if !changes.iter().any(|change| Standing::WORST.forbids(change.key).is_some()) {
            return Ok(());
        }
        let standing = self.standing().await?;
        let Some(obstacle) = changes.iter().find_map(|change| standing.forbids(change.key)) else {
            return Ok(());
        };
        let names = changes.iter().filter(|change| standing.forbids(change.key) == Some(obstacle));
        let names = names.map(|change| change.key.name()).collect::<Vec<&str>>().join(", ");
        Err(Error::Refused(format!(
            "{name} was left as it is: {} first; nothing was changed",
            obstacle.in_the_way_of(&names)
        )))
    }

    /// Sends a change.
    ///
    /// # Errors
    /// Those of setting.
    pub async fn send(self, change: &Change) -> Result<(), Error> {
        match (self, change.key) {
            (Client::Smsd(client), Key::Smsd(reg)) => client.write(reg, whole(change.to)).await,
            (Client::Smd3(client), Key::Smd3(command)) => {
                client.set(command, value(command, change.to)).await.map(drop)
            }
            (Client::Smsd(_) | Client::Smd3(_), _) => Err(foreign(change)),
        }
    }

    /// What is sent for a change, for people.
    ///
    /// # Errors
    /// [`Error::Usage`] when there is no way to send it.
    pub async fn sent_for(self, change: &Change) -> Result<String, Error> {
        match (self, change.key) {
            (Client::Smsd(client), Key::Smsd(reg)) => {
                Ok(client.sent_for(Step::Write(reg, whole(change.to))).await?.join("; "))
            }
            (Client::Smd3(_), Key::Smd3(command)) => {
                Smd3Client::line_of(&Request { command, argument: Some(value(command, change.to)) })
            }
            (Client::Smsd(_) | Client::Smd3(_), _) => Err(foreign(change)),
        }
    }

    /// Sends changes one after another. `progress` is told how many are done.
    ///
    /// # Errors
    /// [`Error::Partly`], which says what was done before the one that failed, and what was not tried.
    pub async fn apply(self, changes: &[Change], mut progress: impl FnMut(usize)) -> Result<(), Error> {
        for (number, change) in changes.iter().enumerate() {
            progress(number);
            if let Err(cause) = self.send(change).await {
                return Err(halted(changes, number, cause));
            }
        }
        Ok(())
    }
}

/// How a controller stands, as far as settings heed that.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Standing {
    /// An SMSD: its motor turns.
    turns: bool,
    /// An SMSD: its motor is energised.
    energised: bool,
    /// An SMD3: its motor is in standby.
    standby: bool,
}

/// Why a setting cannot be set now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Obstacle {
    /// The motor turns.
    Turns,
    /// It is energised.
    Energised,
    /// It is not in standby.
    NoStandby,
}

impl Standing {
    /// In which every setting is forbidden that is so in any.
    const WORST: Standing = Standing { turns: true, energised: true, standby: false };

    /// What is in the way of setting something, if anything is.
    pub fn forbids(self, key: Key) -> Option<Obstacle> {
        match key {
            Key::Smsd(reg) => match reg.info().writable {
                Writable::Stopped | Writable::HiZ if self.turns => Some(Obstacle::Turns),
                Writable::HiZ if self.energised => Some(Obstacle::Energised),
                Writable::Always | Writable::Stopped | Writable::HiZ => None,
            },
            Key::Smd3(command) => (command.info().standby && !self.standby).then_some(Obstacle::NoStandby),
        }
    }
}

impl Obstacle {
    /// What the motor does, and how that comes to an end.
    const fn words(self) -> (&'static str, &'static str) {
        match self {
            Obstacle::Turns => ("turns", "stop it"),
            Obstacle::Energised => ("is energised", "de-energise it (stop and free it)"),
            Obstacle::NoStandby => ("is not in standby", "stop it"),
        }
    }

    /// Why settings of these names cannot be set.
    fn in_the_way_of(self, names: &str) -> String {
        let (is, how) = self.words();
        let only = match self {
            Obstacle::Turns => format!("and {names} can be set only while it stands"),
            Obstacle::Energised => format!("and {names} can be set only while it is not"),
            Obstacle::NoStandby => format!("which {names} can be set in only"),
        };
        format!("its motor {is}, {only}; {how}")
    }
}

impl std::fmt::Display for Obstacle {
    /// As in `its motor turns; stop it first`.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (is, how) = self.words();
        write!(f, "its motor {is}; {how} first")
    }
}

/// The error for a change that failed: what was done before it, and what was not.
fn halted(changes: &[Change], number: usize, cause: Error) -> Error {
    let names =
        |changes: &[Change]| changes.iter().map(|change| change.key.name()).collect::<Vec<&str>>().join(", ");
    let (before, rest) = changes.split_at_checked(number).unwrap_or((changes, &[]));
    let done = match before {
        [] => "no setting before it was changed".to_owned(),
        _ => format!("{} had been set", names(before)),
    };
    let left = rest.get(1..).filter(|left| !left.is_empty());
    let left = left.map_or_else(String::new, |left| format!("; {} not tried", names(left)));
    Error::Partly { done: format!("{done}{left}"), cause: Box::new(cause) }
}

/// The error for a setting of the other family.
fn foreign(change: &Change) -> Error {
    Error::Usage(format!("the controller has no {}; nothing was sent", change.key.name()))
}

fn reg(key: Key) -> Option<Reg> {
    match key {
        Key::Smsd(reg) => Some(reg),
        Key::Smd3(_) => None,
    }
}

/// A number as the value that a setting takes.
fn value(command: Command, number: f64) -> Value {
    match command.info().kind {
        Kind::Float => Value::Float(number),
        Kind::Bool => Value::Bool(whole(number) != 0),
        Kind::None | Kind::Int | Kind::Uint | Kind::Sign | Kind::Text => {
            Value::Uint(whole(number).unsigned_abs())
        }
    }
}

/// A value that was checked to be whole.
#[allow(clippy::cast_possible_truncation, reason = "whole, and within the range of its row")]
fn whole(number: f64) -> i64 {
    number as i64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_that_fails_says_what_was_done_and_what_was_not() {
        let change = |command| Change { key: Key::Smd3(command), now: Some(0.0), to: 1.0 };
        let changes = [Command::Vmax, Command::Ir, Command::Ih].map(change);
        let told = |number| halted(&changes, number, Error::Refused("IR refused".to_owned())).to_string();
        assert_eq!(told(0), "IR refused; no setting before it was changed; IR, IH not tried");
        assert_eq!(told(1), "IR refused; VMAX had been set; IH not tried");
        assert_eq!(told(2), "IR refused; VMAX, IR had been set");
    }

    #[test]
    fn settings_are_forbidden_as_the_tables_say() {
        let still = Standing { turns: false, energised: true, standby: true };
        let (mask, acc, current) = (Key::Smsd(Reg::Mask), Key::Smsd(Reg::Acc), Key::Smsd(Reg::WorkCurrent));
        assert_eq!((still.forbids(mask), still.forbids(acc)), (None, None));
        assert_eq!(still.forbids(current), Some(Obstacle::Energised));
        let turning = Standing { turns: true, ..still };
        assert_eq!(
            (turning.forbids(acc), turning.forbids(current)),
            (Some(Obstacle::Turns), Some(Obstacle::Turns))
        );
        let mode = Key::Smd3(Command::Mode);
        assert_eq!(still.forbids(mode), None);
        assert_eq!(Standing::WORST.forbids(mode), Some(Obstacle::NoStandby));
        assert_eq!(Obstacle::Turns.to_string(), "its motor turns; stop it first");
    }
}
