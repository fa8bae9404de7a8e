//! Drivers for programs that are not asynchronous.

use crate::axis::{Axis, AxisState, Fault, MoveOptions, Plan, Stop};
use crate::direction::Direction;
use crate::error::Error;
use crate::units::{Amount, Goal};
use std::fmt;
use std::time::Duration;
use tokio::runtime::{Builder, Handle, Runtime};

/// A client or an axis with a runtime of its own, on the thread that calls.
///
/// ```no_run
/// use stepdrive_host::blocking::Blocking;
/// use stepdrive_host::smd3::Smd3Client;
/// use stepdrive_host::{Serial, Timeouts};
/// use stepdrive_spec::smd3::commands::Command;
///
/// let drive = Blocking::new(Smd3Client::new(Serial::new("/dev/ttyACM0"), Timeouts::default()))?;
/// let warm = drive.run(|drive| drive.get_number(Command::Tmot))?;
/// println!("{warm} °C");
/// # Ok::<(), stepdrive_host::Error>(())
/// ```
pub struct Blocking<T> {
    inner: T,
    /// Always there until it is dropped.
    runtime: Option<Runtime>,
}

impl<T> Blocking<T> {
    /// Wraps a client or an axis. What it holds open lives in the new runtime, so it is to be used through this alone.
    ///
    /// # Errors
    /// [`Error::Device`] when the operating system gives no runtime.
    pub fn new(inner: T) -> Result<Blocking<T>, Error> {
        let runtime = Builder::new_current_thread().enable_all().build();
        let runtime = runtime
            .map_err(|error| Error::Device(format!("no runtime for blocking calls can be had: {error}")))?;
        Ok(Blocking { inner, runtime: Some(runtime) })
    }

    /// Calls something asynchronous and waits until it is done.
    ///
    /// # Errors
    /// Its own, and [`Error::Usage`] inside an asynchronous task, which must not block.
    pub fn run<'a, F, R>(&'a self, call: impl FnOnce(&'a T) -> F) -> Result<R, Error>
    where
        F: Future<Output = Result<R, Error>>,
    {
        match &self.runtime {
            Some(runtime) if Handle::try_current().is_err() => runtime.block_on(call(&self.inner)),
            _ => Err(Error::Usage(
                "a blocking call inside an asynchronous task; use the asynchronous driver there".to_owned(),
            )),
        }
    }

    /// What is wrapped, for what does not wait.
    pub fn get(&self) -> &T {
        &self.inner
    }
}

impl<T> Drop for Blocking<T> {
    fn drop(&mut self) {
        if let Some(runtime) = self.runtime.take() {
            // It may be dropped where waiting is not allowed; nothing runs in it that would be waited for.
            runtime.shutdown_background();
        }
    }
}

impl<T: fmt::Debug> fmt::Debug for Blocking<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Blocking").field(&self.inner).finish()
    }
}

/// An axis whose calls wait: [`Axis`] as it is, but for that.
impl<A: Axis> Blocking<A> {
    /// See [`Axis::state`].
    ///
    /// # Errors
    /// Those of [`Axis::state`], as of each call its own, and those of [`Blocking::run`].
    pub fn state(&self) -> Result<AxisState, Error> {
        self.run(Axis::state)
    }

    /// See [`Axis::position`].
    ///
    /// # Errors
    /// Those of [`Axis::position`].
    pub fn position(&self) -> Result<Amount, Error> {
        self.run(Axis::position)
    }

    /// See [`Axis::plan`].
    ///
    /// # Errors
    /// Those of [`Axis::plan`].
    pub fn plan(&self, goal: Goal, options: MoveOptions) -> Result<Plan, Error> {
        self.run(|axis| axis.plan(goal, options))
    }

    /// See [`Axis::go`].
    ///
    /// # Errors
    /// Those of [`Axis::go`].
    pub fn go(&self, goal: Goal, options: MoveOptions) -> Result<Plan, Error> {
        self.run(|axis| axis.go(goal, options))
    }

    /// See [`Axis::move_to`].
    ///
    /// # Errors
    /// Those of [`Axis::go`].
    pub fn move_to(&self, position: Amount, options: MoveOptions) -> Result<Plan, Error> {
        self.go(Goal::To(position), options)
    }

    /// See [`Axis::move_by`].
    ///
    /// # Errors
    /// Those of [`Axis::go`].
    pub fn move_by(&self, distance: Amount, options: MoveOptions) -> Result<Plan, Error> {
        self.go(Goal::By(distance), options)
    }

    /// See [`Axis::run`].
    ///
    /// # Errors
    /// Those of [`Axis::run`].
    pub fn run_off(&self, direction: Direction, options: MoveOptions) -> Result<(), Error> {
        self.run(|axis| axis.run(direction, options))
    }

    /// See [`Axis::stop`].
    ///
    /// # Errors
    /// Those of [`Axis::stop`].
    pub fn stop(&self, how: Stop) -> Result<(), Error> {
        self.run(|axis| axis.stop(how))
    }

    /// See [`Axis::home`].
    ///
    /// # Errors
    /// Those of [`Axis::home`].
    pub fn home(&self, direction: Direction, options: MoveOptions) -> Result<(), Error> {
        self.run(|axis| axis.home(direction, options))
    }

    /// See [`Axis::zero`].
    ///
    /// # Errors
    /// Those of [`Axis::zero`].
    pub fn zero(&self) -> Result<(), Error> {
        self.run(Axis::zero)
    }

    /// See [`Axis::wait_done`].
    ///
    /// # Errors
    /// Those of [`Axis::wait_done`].
    pub fn wait_done(&self, timeout: Option<Duration>) -> Result<AxisState, Error> {
        self.run(|axis| axis.wait_done(timeout))
    }

    /// See [`Axis::clear_faults`].
    ///
    /// # Errors
    /// Those of [`Axis::clear_faults`].
    pub fn clear_faults(&self) -> Result<Vec<Fault>, Error> {
        self.run(Axis::clear_faults)
    }
}
