//! What a step does.

use super::send::Sending;
use stepdrive_rig::action::Action;
use stepdrive_rig::file::{ClockMode, RigFile};

/// Something that a step does.
#[derive(Clone, Debug)]
pub(super) struct Act {
    /// As it was written.
    text: String,
    what: Deed,
}

/// What it is.
#[derive(Clone, Debug)]
pub(super) enum Deed {
    /// Done to the rig.
    Rig(Action),
    /// Done to its clock.
    Clock(ClockMode),
    /// Sent to a drive.
    Send(Sending),
}

impl Act {
    /// Reads one for a rig; the error says what is wrong and what there is.
    pub(super) fn parse(text: &str, rig: &RigFile) -> Result<Act, String> {
        let text = text.trim();
        let (word, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
        let rest = rest.trim();
        let what = match word {
            "clock" => ClockMode::parse(rest).map(Deed::Clock).map_err(|error| error.to_string())?,
            "line" => Deed::Send(Sending::line(rest, rig)?),
            "write" => Deed::Send(Sending::write(rest, rig)?),
            "command" => Deed::Send(Sending::command(rest, rig)?),
            _ => Deed::Rig(Action::parse(text, rig).map_err(|error| explained(word, &error.to_string()))?),
        };
        Ok(Act { text: text.to_owned(), what })
    }

    /// As it was written.
    pub(super) fn text(&self) -> &str {
        &self.text
    }

    /// What it is.
    pub(super) fn what(&self) -> &Deed {
        &self.what
    }
}

/// The message about an action; of one that does not exist, with what scenarios have besides.
fn explained(word: &str, message: &str) -> String {
    match word {
        "input" | "fault" | "power" | "panel" | "wire" | "" => message.to_owned(),
        _ => format!("{message}, and in scenarios clock, line, write, command"),
    }
}
