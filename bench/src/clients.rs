//! Clients in processes of their own, so that what they use can be told from what the server uses.
//!
//! A client says `ready` on its standard output, and then takes orders on its standard input: a number of milliseconds is
//! for how long to work, and what it answers on one line are figures, first how many requests were made. It ends with its
//! input. [`obey`] is that for a benchmark that started itself as a client; any other program may do the same.

use crate::load::{Contestant, Round};
use crate::process;
use std::io::{self, BufRead, BufReader, Write};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::time::Duration;
use tokio::time::Instant;

/// The argument that makes a benchmark a client.
const CLIENT: &str = "client";
/// What a client says first.
const READY: &str = "ready";

/// A client that runs in another process. Dropping it ends it.
#[derive(Debug)]
pub struct ClientProcess {
    name: String,
    child: Child,
    output: BufReader<ChildStdout>,
}

impl ClientProcess {
    /// Starts this program again as a client, and waits until it is ready.
    ///
    /// # Errors
    /// When that fails.
    pub fn start(name: &str, arguments: &[String]) -> io::Result<ClientProcess> {
        let mut command = Command::new(std::env::current_exe()?);
        command.arg(CLIENT).args(arguments);
        ClientProcess::spawn(name, command)
    }

    /// Starts any program that takes orders, and waits until it is ready.
    ///
    /// # Errors
    /// When that fails.
    pub fn spawn(name: &str, mut command: Command) -> io::Result<ClientProcess> {
        let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn()?;
        let output = child.stdout.take().ok_or(io::ErrorKind::BrokenPipe)?;
        let mut client = ClientProcess { name: name.to_owned(), child, output: BufReader::new(output) };
        if client.line()? == READY {
            return Ok(client);
        }
        Err(io::Error::other(format!("the client {name} did not become ready")))
    }

    /// What it is called.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Lets it work for so long; gives its figures.
    ///
    /// # Errors
    /// When it has ended, or answers no figures.
    pub fn order(&mut self, time: Duration) -> io::Result<Vec<u64>> {
        let input = self.child.stdin.as_mut().ok_or(io::ErrorKind::BrokenPipe)?;
        writeln!(input, "{}", time.as_millis())?;
        let figures: Result<Vec<u64>, _> = self.line()?.split_whitespace().map(str::parse).collect();
        match figures {
            Ok(figures) if !figures.is_empty() => Ok(figures),
            Ok(_) | Err(_) => Err(io::Error::other(format!("the client {} gave up", self.name))),
        }
    }

    /// The processor time it has used.
    ///
    /// # Errors
    /// When it has ended.
    pub fn cpu_time(&self) -> io::Result<Duration> {
        process::cpu_time(self.child.id())
    }

    /// The memory it has in RAM, in bytes.
    ///
    /// # Errors
    /// When it has ended.
    pub fn resident(&self) -> io::Result<u64> {
        process::resident(self.child.id())
    }

    fn line(&mut self) -> io::Result<String> {
        let mut line = String::new();
        self.output.read_line(&mut line)?;
        Ok(line.trim().to_owned())
    }
}

impl Contestant for ClientProcess {
    /// Its requests, and what they cost the client.
    async fn round(&mut self, time: Duration) -> io::Result<Round> {
        let (start, used) = (Instant::now(), self.cpu_time()?);
        let requests = self.order(time)?.first().map_or(0.0, |count| *count as f64);
        let (time, used) = (start.elapsed(), self.cpu_time()?.saturating_sub(used));
        Ok(Round { rate: requests / time.as_secs_f64(), cost: used.as_secs_f64() * 1e6 / requests })
    }
}

impl Drop for ClientProcess {
    fn drop(&mut self) {
        // It ends with its input; when it has ended already that is as good.
        drop(self.child.stdin.take());
        let _ = self.child.wait();
    }
}

/// The arguments of this process when it was started as a client.
pub fn arguments() -> Option<Vec<String>> {
    let mut arguments = std::env::args().skip(1);
    (arguments.next()? == CLIENT).then(|| arguments.collect())
}

/// Carries out orders until there are no more: `work` is given a time and gives figures.
///
/// # Errors
/// Those of `work`, and when an order is no number.
pub fn obey(mut work: impl FnMut(Duration) -> io::Result<Vec<u64>>) -> io::Result<()> {
    println!("{READY}");
    for order in io::stdin().lines() {
        let time = Duration::from_millis(order?.trim().parse().map_err(io::Error::other)?);
        let figures: Vec<String> = work(time)?.iter().map(u64::to_string).collect();
        println!("{}", figures.join(" "));
    }
    Ok(())
}
