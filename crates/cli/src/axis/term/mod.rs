//! `stepdrive term`: a terminal that explains what it sees.

mod lines;
mod smd3;
mod smsd;

use super::{AxisArgs, Client, act_on};
use crate::Failure;
use crate::terminal::{print, print_json, tell};
use crate::up::end_requested;
use lines::Lines;
use serde_json::Value;
use std::io::{self, IsTerminal};
use stepdrive_host::Error;

#[derive(Debug, clap::Args)]
#[command(after_help = "An SMD3 is sent each line as it is typed. An SMSD understands
  NAME            reads a register: MAX_SPEED, ABS_POS, IP 2, 0x1101
  NAME=VALUE      writes one: MAX_SPEED=800, Mask=0xFF, Relay=1
  COMMAND [N]     carries out a command: RUN_F 500, MOVE_F 1600, CLR, Soft STOP
Words of the terminal itself: help, help NAME, exit.

Examples:
  stepdrive term -a /dev/ttyACM0
  printf 'VMAX,500\\nRUNR,200\\n' | stepdrive term -a uhv
  echo 'MAX_SPEED=800' | stepdrive term -a stage --json

Commands typed here go straight to the controller: no soft limit and no trust holds them. Without a terminal the first line
that is refused sets the exit code; trouble on the line ends it.")]
pub(crate) struct TermArgs {
    #[command(flatten)]
    axis: AxisArgs,
}

/// What became of a line.
pub(super) struct Answer {
    /// For people.
    pub(super) text: String,
    /// For programs.
    pub(super) json: Value,
    /// Why it was not done.
    pub(super) refused: Option<Error>,
}

/// Talks with a controller until there is nothing more to say.
pub(crate) fn term(args: &TermArgs) -> Result<(), Failure> {
    let at_terminal = io::stdin().is_terminal();
    act_on(&args.axis, async |opened| {
        let end = end_requested().map_err(|error| cannot_begin(&error))?;
        let lines = Lines::start(at_terminal).map_err(|error| cannot_begin(&error))?;
        if at_terminal {
            let how = greeting(opened.client());
            tell(&format!("{}: {how}; `help` explains, `exit` or Ctrl-D ends", opened.name()));
        }
        let mut talk =
            Talk { client: opened.client(), json: args.axis.reach.json, at_terminal, first_refusal: None };
        tokio::select! {
            () = end => Ok(()),
            outcome = talk.all(lines) => outcome,
        }
    })
}

/// A talk with a controller.
struct Talk<'a> {
    client: Client<'a>,
    json: bool,
    at_terminal: bool,
    first_refusal: Option<Error>,
}

impl Talk<'_> {
    /// Answers all lines.
    async fn all(&mut self, mut lines: Lines) -> Result<(), Failure> {
        while let Some(line) = lines.next().await {
            let line = line.trim();
            if matches!(line.to_ascii_lowercase().as_str(), "exit" | "quit") {
                break;
            }
            self.one(line).await?;
        }
        // A person has seen it.
        let refusal = self.first_refusal.take().filter(|_| !self.at_terminal);
        refusal.map_or(Ok(()), |refusal| Err(refusal.into()))
    }

    /// Answers a line.
    async fn one(&mut self, line: &str) -> Result<(), Failure> {
        if line.is_empty() || line.starts_with('#') {
            return Ok(());
        }
        if let Some(name) = help_for(line) {
            return print(&help(self.client, name));
        }
        match answer(self.client, line).await {
            Ok(answer) => {
                self.first_refusal = self.first_refusal.take().or(answer.refused);
                if self.json { print_json(&answer.json) } else { print(&answer.text) }
            }
            Err(error) if self.at_terminal => {
                tell(&error.to_string());
                Ok(())
            }
            Err(error) => Err(error.into()),
        }
    }
}

/// Sends a line, and explains what came.
///
/// # Errors
/// The line is in trouble, or nobody may be let in.
async fn answer(client: Client<'_>, line: &str) -> Result<Answer, Error> {
    match client {
        Client::Smsd(client) => smsd::answer(client, line).await,
        Client::Smd3(client) => smd3::answer(client, line).await,
    }
}

/// Whether an error ends the talk instead of being an answer.
pub(super) fn is_trouble(error: &Error) -> bool {
    match error {
        Error::Line(_) | Error::NotAuthorised(_) | Error::Uncertain { .. } => true,
        Error::Partly { cause, .. } => is_trouble(cause),
        Error::Usage(_) | Error::Refused(_) | Error::Fault(_) | Error::Device(_) | Error::Differs(_) => false,
    }
}

fn greeting(client: Client<'_>) -> &'static str {
    match client {
        Client::Smsd(_) => "NAME reads, NAME=VALUE writes, COMMAND [operand] does",
        Client::Smd3(_) => "lines are sent as they are typed",
    }
}

fn help_for(line: &str) -> Option<&str> {
    let (word, name) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
    (word.eq_ignore_ascii_case("help") || word == "?").then(|| name.trim())
}

fn help(client: Client<'_>, name: &str) -> String {
    match client {
        Client::Smsd(_) => smsd::help(name),
        Client::Smd3(_) => smd3::help(name),
    }
}

fn cannot_begin(error: &io::Error) -> Failure {
    Failure::Failed(format!("cannot start to read lines: {error}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn help_is_asked_for_with_and_without_a_name() {
        assert_eq!(help_for("help"), Some(""));
        assert_eq!(help_for("HELP  MAX_SPEED "), Some("MAX_SPEED"));
        assert_eq!(help_for("? VMAX"), Some("VMAX"));
        assert_eq!(help_for("helpless"), None);
    }
}
