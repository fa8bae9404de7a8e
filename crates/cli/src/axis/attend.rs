//! A motion while somebody waits for it: how far it is, and Ctrl-C.

use super::Opened;
use super::progress::Progress;
use super::status::position;
use crate::Failure;
use crate::terminal::tell;
use std::io::{self, IsTerminal};
use std::time::Duration;
use stepdrive_host::Error;
use stepdrive_host::axis::{Axis, AxisState, Stop};
use stepdrive_host::units::Amount;

/// How often is looked for a standstill, and for progress.
const LOOK: Duration = Duration::from_millis(50);

/// Lets a motion go on until it ends, and shows meanwhile how far it is; answers how it ended. Ctrl-C stops it softly, a
/// second one hard, and a third leaves it to itself; that is a failure.
pub(super) async fn attend<T>(
    opened: &Opened,
    motion: impl Future<Output = Result<T, Error>>,
    progress: impl Future<Output = ()>,
) -> Result<Result<T, Error>, Failure> {
    let mut interrupts = Interrupts::catch()?;
    let shown = async {
        progress.await;
        std::future::pending::<()>().await;
    };
    tokio::select! {
        done = motion => return Ok(done),
        () = interrupts.next() => {}
        () = shown => {}
    }
    Err(stop(opened, &mut interrupts).await)
}

/// Stops the motion that was broken off.
async fn stop(opened: &Opened, interrupts: &mut Interrupts) -> Failure {
    let (axis, name) = (opened.axis(), opened.name());
    tell(&format!("stepdrive: stopping {name}; Ctrl-C again stops it at once"));
    let state = tokio::select! {
        state = stopped(axis, Stop::Soft) => state,
        () = interrupts.next() => tokio::select! {
            state = stopped(axis, Stop::Hard) => state,
            () = interrupts.next() => return Failure::Failed(format!("whether {name} has stopped was not waited for")),
        },
    };
    match state {
        Ok(state) => Failure::Failed(format!("{name} was stopped on Ctrl-C, at {}", position(&state))),
        Err(cause) => {
            let done = format!("whether {name} has stopped is not known");
            Failure::Host(Error::Partly { done, cause: Box::new(cause) })
        }
    }
}

/// Stops an axis, and waits until it stands.
pub(super) async fn stopped(axis: &dyn Axis, how: Stop) -> Result<AxisState, Error> {
    axis.stop(how).await?;
    loop {
        let state = axis.state().await?;
        if !state.moving {
            return Ok(state);
        }
        tokio::time::sleep(LOOK).await;
    }
}

/// Shows how far a move is, at a terminal.
pub(super) async fn show_move(axis: &dyn Axis, from: Amount, to: Amount) {
    if !io::stderr().is_terminal() {
        return;
    }
    let mut progress = Progress::new(format!("moving to {to}"));
    loop {
        // What is wrong the move itself will say.
        if let Ok(state) = axis.state().await {
            progress.show(thousandths(from, state.position, to), 1000);
        }
        tokio::time::sleep(LOOK).await;
    }
}

/// How much of the way is behind.
fn thousandths(from: Amount, at: Amount, to: Amount) -> usize {
    let [from, at, to] = [from, at, to].map(|place| i128::from(place.value.billionths()));
    let share = (1000 * (at - from)).checked_div(to - from).unwrap_or(1000);
    usize::try_from(share.clamp(0, 1000)).unwrap_or(0)
}

/// What asks a command to end: Ctrl-C, and SIGTERM where there is such a thing.
pub(super) struct Interrupts {
    #[cfg(unix)]
    signals: [tokio::signal::unix::Signal; 2],
}

impl Interrupts {
    /// Catches them from now on.
    #[cfg(unix)]
    pub(super) fn catch() -> Result<Interrupts, Failure> {
        use tokio::signal::unix::{SignalKind, signal};
        let both =
            signal(SignalKind::interrupt()).and_then(|int| Ok([int, signal(SignalKind::terminate())?]));
        let signals =
            both.map_err(|error| Failure::Failed(format!("cannot catch Ctrl-C: {error}; nothing was sent")))?;
        Ok(Interrupts { signals })
    }

    /// Catches them from now on.
    #[cfg(not(unix))]
    #[allow(clippy::unnecessary_wraps, reason = "elsewhere it may fail")]
    pub(super) fn catch() -> Result<Interrupts, Failure> {
        Ok(Interrupts {})
    }

    /// Waits for the next one.
    pub(super) async fn next(&mut self) {
        #[cfg(unix)]
        {
            let [interrupt, terminate] = &mut self.signals;
            tokio::select! {
                _ = interrupt.recv() => {}
                _ = terminate.recv() => {}
            }
        }
        #[cfg(not(unix))]
        // When it cannot be caught, the default of dying at once is as good.
        let _ = tokio::signal::ctrl_c().await;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_behind_is_a_share_in_either_direction() {
        let mm = |text| Amount::parse(text).expect("an amount");
        let behind = |from, at, to| thousandths(mm(from), mm(at), mm(to));
        assert_eq!((behind("0mm", "3mm", "12mm"), behind("5mm", "-1mm", "-7mm")), (250, 500));
        assert_eq!((behind("0mm", "-3mm", "12mm"), behind("0mm", "13mm", "12mm")), (0, 1000));
        assert_eq!(behind("5mm", "5mm", "5mm"), 1000);
    }
}
